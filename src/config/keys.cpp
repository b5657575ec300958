// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/keys.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "ves/config/experiment.hpp"
#include "ves/core/spelling.hpp"

namespace ves {
namespace {

constexpr std::size_t kShort = 44;  // [-] letters of a value that is shown

/// One line of YAML; empty where it takes more.
std::string inShort(const Value& value) {
  if (value.kind == Value::Kind::kMap) return {};
  Value plain = value;
  plain.tag.clear();
  for (Value& child : plain.children) child.tag.clear();
  std::string text = emit(plain);
  text.pop_back();
  return text.size() <= kShort && text.find('\n') == std::string::npos ? text : std::string();
}

/// Sentences of a map: "." is that of the map itself; a name of several words stands for as many
/// keys.
class Meanings {
 public:
  KeyMeaning of(const Value* said, const AskedKey& asked, const std::string& path,
                const Value* standard) const {
    KeyMeaning out;
    out.path = path;
    out.asked = asked;
    out.asked.keys.clear();
    if (standard) out.standard = inShort(*standard);
    if (!said) {
      for (const auto& [key, below] : asked.keys)
        out.keys.push_back(of(nullptr, below, joined(path, key), below_(standard, key)));
      return out;
    }
    if (said->kind != Value::Kind::kMap) {
      out.sentence = said->text;
      return out;
    }
    std::vector<std::string> told;
    for (std::size_t i = 0; i < said->keys.size(); ++i) {
      const Value& child = said->children[i];
      if (said->keys[i] == ".") {
        out.sentence = child.text;
        continue;
      }
      std::istringstream words(said->keys[i]);
      for (std::string key; words >> key;) {
        told.push_back(key);
        out.keys.push_back(of(&child, askedFor(asked, key, *said), joined(path, key),
                              key == "[]" ? nullptr : below_(standard, key)));
      }
    }
    const bool any = said->find("*") != nullptr;
    for (const auto& [key, below] : asked.keys)
      if (!any && std::find(told.begin(), told.end(), key) == told.end())
        out.keys.push_back(of(nullptr, below, joined(path, key), below_(standard, key)));
    return out;
  }

 private:
  static std::string joined(const std::string& path, const std::string& key) {
    return key == "[]" ? path + key : path.empty() ? key : path + "." + key;
  }
  static const Value* below_(const Value* standard, const std::string& key) {
    return standard ? standard->find(key) : nullptr;
  }
  /// "*" is whatever is not named beside it.
  static AskedKey askedFor(const AskedKey& asked, const std::string& key, const Value& said) {
    AskedKey out;
    if (key != "*") {
      if (const auto at = asked.keys.find(key); at != asked.keys.end()) out = at->second;
      return out;
    }
    for (const auto& [name, below] : asked.keys)
      if (!said.find(name)) out.join(below);
    return out;
  }
};

Value readSentences(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw InputError(fmt::format("{}: cannot be read", file.string()));
  return parseDocument(text.str(), file.string());  // `urdf` and `from` are words here
}

}  // namespace

void AskedKey::take(unsigned kind, double least, double most) {
  kinds |= kind;
  lo.take(least);
  hi.take(most);
}

void AskedKey::need(const Value* value) {
  ++needed;
  if (value && example.empty()) example = inShort(*value);
}

void AskedKey::join(const AskedKey& other) {
  kinds |= other.kinds;
  const auto same = [](auto& mine, const auto& theirs) {
    if (theirs.first) mine.take(*theirs.first);
    mine.differs = mine.differs || theirs.differs;
  };
  same(lo, other.lo);
  same(hi, other.hi);
  same(rows, other.rows);
  same(cols, other.cols);
  if (choices.empty()) choices = other.choices;
  if (variants.empty()) variants = other.variants;
  if (example.empty()) example = other.example;
  visits += other.visits;
  needed += other.needed;
  for (const auto& [key, below] : other.keys) keys[key].join(below);
}

std::string unitOfKey(std::string_view key) {
  // The longest first, where one ends as another does.
  constexpr std::pair<std::string_view, std::string_view> kUnits[] = {
      {"in_per_s_per_ma", "in/s/mA"},
      {"rotation_braking_deg_per_s2", "deg/s²"},
      {"deg_per_s2", "deg/s²"},
      {"m_per_s2", "m/s²"},
      {"deg_per_s", "deg/s"},
      {"rad_per_s", "rad/s"},
      {"m_per_s", "m/s"},
      {"l_per_s", "l/s"},
      {"nm_per_rad", "N m/rad"},
      {"ns_per_m", "N s/m"},
      {"n_per_m", "N/m"},
      {"kg_m2", "kg m²"},
      {"n_m2", "N m²"},
      {"nms", "N m s"},
      {"n_or_nm", "N | N m"},
      {"n_and_nm", "N | N m"},
      {"deg_or_m", "deg | m"},
      {"rad_or_m", "rad | m"},
      {"m_deg", "m | deg"},
      {"uv_per_v", "µV/V per N | N m"},
      {"v_per_root_hz", "V/√Hz"},
      {"volts_per_count", "V/count"},
      {"counts_per_in", "count/in"},
      {"v_per_c", "V/°C"},
      {"per_second", "1/s"},
      {"per_s", "1/s"},
      {"per_m", "1/m"},
      {"cm2", "cm²"},
      {"hz", "Hz"},
      {"deg", "deg"},
      {"ticks", "ticks"},
      {"samples", "samples"},
      {"counts", "counts"},
      {"volts", "V"},
      {"kg", "kg"},
      {"nm", "N m"},
      {"ns", "ns"},
      {"m", "m"},
      {"s", "s"},
      {"n", "N"},
      {"v", "V"},
      {"c", "°C"},
      {"h", "h"},
      {"j", "J"},
  };
  for (const auto& [ending, unit] : kUnits)
    if (key == ending || (key.size() > ending.size() && key.ends_with(ending) &&
                          key[key.size() - ending.size() - 1] == '_'))
      return std::string(unit);
  return {};
}

std::string typeOfKey(const AskedKey& key) {
  const auto bound = [](const AskedKey::Same<double>& b) -> std::string {
    const std::optional<double> x = b.known();
    if (!x || std::isinf(*x)) return {};
    return *x != 0.0 && std::abs(*x) <= 1e-12 ? "above 0" : fmt::format("{:.10g}", *x);
  };
  const std::string lo = bound(key.lo), hi = bound(key.hi);
  const auto limited = [&](const std::string& what) {
    if (lo.empty() && hi.empty()) return what;
    if (lo.empty()) return fmt::format("{}, at most {}", what, hi);
    if (lo == "above 0")
      return hi.empty() ? what + ", above 0" : fmt::format("{}, above 0, at most {}", what, hi);
    return hi.empty() ? fmt::format("{}, at least {}", what, lo)
                      : fmt::format("{}, {} to {}", what, lo, hi);
  };
  const auto many = [](const AskedKey::Same<int>& n, const char* what) {
    const std::optional<int> known = n.known();
    return known && *known >= 0 ? fmt::format("{} {}", *known, what) : fmt::format("{}", what);
  };
  std::vector<std::string> types;
  if (key.kinds & AskedKey::kNumber) types.push_back(limited("number"));
  if (key.kinds & AskedKey::kInteger) types.push_back(limited("whole number"));
  if (key.kinds & AskedKey::kVector)
    types.push_back(limited("list of " + many(key.cols, "numbers")));
  if (key.kinds & AskedKey::kMatrix)
    types.push_back(
        limited(fmt::format("{} of {}", many(key.rows, "rows"), many(key.cols, "numbers"))));
  if (key.kinds & AskedKey::kFlag) types.push_back("true or false");
  if (key.kinds & AskedKey::kChoice)
    types.push_back(key.choices.size() == 1
                        ? key.choices[0]
                        : fmt::format("one of {}", fmt::join(key.choices, ", ")));
  if (key.kinds & AskedKey::kTexts) types.push_back("list of names");
  if (key.kinds & AskedKey::kText) types.push_back("text");
  if (key.kinds & AskedKey::kDerived) types.push_back("`derived`");
  if (key.kinds & AskedKey::kList) types.push_back("list");
  if (key.kinds & AskedKey::kMap)
    types.push_back(key.variants.empty() ? "keys"
                                         : fmt::format("one of {}", fmt::join(key.variants, ", ")));
  return fmt::format("{}", fmt::join(types, "; or "));
}

KeyMeaning keyMeanings(const std::filesystem::path& config) {
  AskedKey asked;
  const std::filesystem::path scenarios = config / "scenarios";
  for (const std::string& name : namesIn(scenarios))
    askKeys(loadDocument(scenarios / (name + ".yaml")), asked);
  const Value file = readSentences(config / "keys.yaml");
  Section root(file, "");
  for (Section example : root.list("examples")) {
    Value document = loadDocument(scenarios / (example.text("scenario") + ".yaml"));
    for (const std::string& assignment : example.texts("set")) applyOverride(document, assignment);
    example.finish();
    askKeys(document, asked);
  }
  // A file itself stands in the document, where the key named it.
  const auto named = [](auto& keys, const char* text_key, const char* key) {
    auto text = keys.extract(text_key);
    if (text.empty()) return;
    text.key() = key;
    text.mapped().example.clear();
    keys.insert(std::move(text));
  };
  named(asked.keys["robot"].keys, "urdf_text", "urdf");
  named(asked.keys["base"].keys["ground"].keys, "recording_text", "recording");
  const Value standard = loadDocument(config / "ves.yaml");
  const Value* const said = file.find("keys");
  if (!said) root.fail("keys", "missing");
  return Meanings().of(said, asked, "", &standard);
}

void walkKeys(const KeyMeaning& root, const std::function<void(const KeyMeaning&)>& visit) {
  for (const KeyMeaning& key : root.keys) {
    visit(key);
    walkKeys(key, visit);
  }
}

const KeyMeaning& keyAt(const KeyMeaning& root, const std::string& path) {
  const auto plain = [](std::string text) {
    for (std::size_t at = 0; (at = text.find("[]")) != std::string::npos;) text.erase(at, 2);
    return text;
  };
  const KeyMeaning* found = nullptr;
  std::vector<std::string> all;
  walkKeys(root, [&](const KeyMeaning& key) {
    if (!found && plain(key.path) == plain(path)) found = &key;
    all.push_back(plain(key.path));
  });
  if (found) return *found;
  const std::string meant = nearest(path, all);
  throw InputError(meant.empty()
                       ? fmt::format("key '{}': there is none, `ves keys` lists the sections", path)
                       : fmt::format("key '{}': there is none, did you mean {}?", path, meant));
}

}  // namespace ves
