// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/document.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>

#include "ves/core/spelling.hpp"

namespace ves {
namespace {

constexpr std::uintmax_t kMaxFileSize = 2 << 20;  // [B]
constexpr std::size_t kMaxKeys = 1000;            // [-] of one map
constexpr int kMaxValues = 200'000;               // [-] in one document; aliases can multiply
constexpr int kMaxDepth = 16;                     // [-] of `from` and of nesting

std::string readFile(const std::filesystem::path& path, const std::string& asked_by) {
  std::error_code error;
  const std::string what = asked_by + path.string() + ": ";
  if (!std::filesystem::exists(path, error)) throw InputError(what + "no such file");
  if (!std::filesystem::is_regular_file(path, error)) throw InputError(what + "not a file");
  if (std::filesystem::file_size(path, error) > kMaxFileSize || error)
    throw InputError(what + fmt::format("too large, at most {} bytes", kMaxFileSize));
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw InputError(what + "cannot be read");
  return text.str();
}

/// UTF-8 without control characters: JSON, XML and YAML that are written later would fail on, or
/// lose, anything else.
void requireText(const std::string& text, const std::string& name) {
  int line = 1;
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = static_cast<unsigned char>(text[i]);
    if (byte == '\n') ++line;
    if (byte < 0x20 && byte != '\n' && byte != '\t' && byte != '\r')
      throw InputError(
          fmt::format("{}:{}: byte {:#04x} is a control character, want text", name, line, byte));
    const std::size_t length = byte < 0x80   ? 1
                               : byte < 0xc2 ? 0
                               : byte < 0xe0 ? 2
                               : byte < 0xf0 ? 3
                               : byte < 0xf5 ? 4
                                             : 0;
    bool good = length > 0 && i + length <= text.size();
    for (std::size_t k = 1; good && k < length; ++k)
      good = (static_cast<unsigned char>(text[i + k]) & 0xc0) == 0x80;
    if (good && length > 2) {  // neither overlong, nor a surrogate, nor past U+10FFFF
      const auto next = static_cast<unsigned char>(text[i + 1]);
      good = !(byte == 0xe0 && next < 0xa0) && !(byte == 0xed && next >= 0xa0) &&
             !(byte == 0xf0 && next < 0x90) && !(byte == 0xf4 && next >= 0x90);
    }
    if (!good)
      throw InputError(fmt::format("{}:{}: byte {:#04x} is no UTF-8 text, want the file in UTF-8",
                                   name, line, byte));
    i += length;
  }
}

/// YAML::Load would leave the others out.
void requireOneDocument(const std::string& text, const std::string& name) {
  std::istringstream in(text);
  bool content = false;
  int number = 1;
  for (std::string line; std::getline(in, line); ++number) {
    const bool marker = line.rfind("---", 0) == 0 &&
                        (line.size() == 3 || line[3] == ' ' || line[3] == '\t' || line[3] == '\r');
    if (marker && content)
      throw InputError(fmt::format("{}:{}: a second YAML document begins here, want one in a file",
                                   name, number));
    const std::size_t first = line.find_first_not_of(" \t\r");
    content =
        content || (!marker && first != std::string::npos && line[first] != '#' && line[0] != '%');
  }
}

class Converter {
 public:
  explicit Converter(std::string name)
      : file_(std::make_shared<const std::string>(std::move(name))) {}

  Value convert(const YAML::Node& node, int depth = 0) {
    Value value;
    value.file = file_;
    value.line = node.Mark().line + 1;
    const auto refuse = [&](const std::string& what) {
      throw InputError(fmt::format("{}:{}: {}", *file_, value.line, what));
    };
    if (++count_ > kMaxValues) refuse(fmt::format("more than {} values", kMaxValues));
    if (depth > kMaxDepth) refuse(fmt::format("nested deeper than {}", kMaxDepth));
    const std::string& tag = node.Tag();
    if (tag.size() > 1 && tag[0] == '!') {
      value.tag = tag.substr(1);
      if (value.tag == "replace") {
        value.whole = true;
        value.tag.clear();
      } else if (value.tag != "found" && value.tag != "derived" && value.tag != "substitute") {
        refuse(fmt::format("tag !{}, want !found, !derived, !substitute or !replace", value.tag));
      }
    }
    std::vector<Value> merged;  // of YAML's merge key, <<
    switch (node.Type()) {
      case YAML::NodeType::Undefined:
      case YAML::NodeType::Null: break;
      case YAML::NodeType::Scalar:
        value.kind = Value::Kind::kScalar;
        value.text = node.Scalar();
        break;
      case YAML::NodeType::Sequence:
        value.kind = Value::Kind::kList;
        for (const YAML::Node& child : node) value.children.push_back(convert(child, depth + 1));
        break;
      case YAML::NodeType::Map:
        value.kind = Value::Kind::kMap;
        if (node.size() > kMaxKeys) refuse(fmt::format("more than {} keys in one map", kMaxKeys));
        for (const auto& entry : node) {
          if (!entry.first.IsScalar()) refuse("a key that is not a word");
          const std::string& key = entry.first.Scalar();
          if (key == "<<") {
            merged.push_back(convert(entry.second, depth + 1));
            continue;
          }
          if (value.find(key))
            throw InputError(
                fmt::format("{}:{}: {}: given twice", *file_, entry.first.Mark().line + 1, key));
          value.keys.push_back(key);
          value.children.push_back(convert(entry.second, depth + 1));
          // An empty value has no position of its own.
          if (value.children.back().kind == Value::Kind::kNull)
            value.children.back().line = entry.first.Mark().line + 1;
        }
        for (const Value& one : merged)
          if (one.kind == Value::Kind::kList)
            for (const Value& each : one.children) mergeInto(value, each);
          else
            mergeInto(value, one);
        break;
    }
    return value;
  }

 private:
  /// Keys that `value` has stay as they are.
  void mergeInto(Value& value, const Value& from) const {
    if (from.kind != Value::Kind::kMap)
      throw InputError(fmt::format("{}:{}: <<: want a map, or a list of maps", *file_, from.line));
    for (std::size_t i = 0; i < from.keys.size(); ++i)
      if (!value.find(from.keys[i])) value.put(from.keys[i], from.children[i]);
  }

  std::shared_ptr<const std::string> file_;
  int count_ = 0;
};

/// "; a tab indents, want blanks" where a line up to that of the error begins so.
std::string tabBefore(const std::string& text, int line) {
  std::istringstream in(text);
  std::string one;
  for (int i = 0; i <= line && std::getline(in, one); ++i)
    if (const std::size_t first = one.find_first_not_of(' ');
        first != std::string::npos && one[first] == '\t')
      return fmt::format("; a tab indents line {}, want blanks", i + 1);
  return {};
}

/// `over` wins; maps merge key by key, everything else is replaced.
void merge(Value& base, Value over) {
  if (over.whole || base.kind != Value::Kind::kMap || over.kind != Value::Kind::kMap) {
    base = std::move(over);
    return;
  }
  if (!over.tag.empty()) base.tag = over.tag;
  for (std::size_t i = 0; i < over.keys.size(); ++i) {
    if (Value* old = base.find(over.keys[i])) {
      merge(*old, std::move(over.children[i]));
    } else {
      base.put(over.keys[i], std::move(over.children[i]));
    }
  }
}

Value load(const std::filesystem::path& path, const std::string& asked_by, int depth);

/// Files that are taken in as text, and the key that has it then.
struct Embedded {
  std::string_view key, text_key;
};
constexpr Embedded kEmbedded[] = {{"urdf", "urdf_text"}, {"recording", "recording_text"}};

}  // namespace

std::string_view asWritten(std::string_view key) {
  for (const Embedded& file : kEmbedded)
    if (file.text_key == key) return file.key;
  return key;
}

namespace {

/// Replaces `from` and those of kEmbedded below by what they name.
void resolve(Value& value, const std::filesystem::path& directory, int depth) {
  for (Value& child : value.children) resolve(child, directory, depth);
  if (value.kind != Value::Kind::kMap) return;
  const auto named = [&](const Value& v, std::string_view key) {
    const std::string at = fmt::format("{}:{}: {}: ", *v.file, v.line, key);
    if (v.kind != Value::Kind::kScalar || v.text.empty()) throw InputError(at + "want a file name");
    if (depth >= kMaxDepth) throw InputError(at + "files name each other in a circle");
    return at;
  };
  for (const auto& [key, text_key] : kEmbedded) {
    Value* embedded = value.find(key);
    if (!embedded) continue;
    const std::string at = named(*embedded, key);
    const std::filesystem::path path = directory / embedded->text;
    const auto i = static_cast<std::size_t>(embedded - value.children.data());
    embedded->text = readFile(path, at);
    requireText(embedded->text, path.lexically_normal().string());
    embedded->file = std::make_shared<const std::string>(path.lexically_normal().string());
    embedded->line = 1;
    value.keys[i] = text_key;
  }
  if (const Value* from = value.find("from")) {
    const std::string at = named(*from, "from");
    Value base = load(directory / from->text, at, depth + 1);
    const auto i = from - value.children.data();
    value.keys.erase(value.keys.begin() + i);
    value.children.erase(value.children.begin() + i);
    base.line = value.line;
    base.file = value.file;
    value.whole = false;  // over the file that it names, not over nothing
    merge(base, std::move(value));
    value = std::move(base);
    value.whole = true;
  }
}

Value parse(const std::string& text, const std::string& name) {
  requireText(text, name);
  // Before the parser needs seconds and a gigabyte for it.
  const auto marks = std::count_if(text.begin(), text.end(), [](char c) {
    return c == '\n' || c == ',' || c == '[' || c == '{';
  });
  if (marks > 2 * kMaxValues)
    throw InputError(fmt::format("{}: more than {} values", name, kMaxValues));
  try {
    requireOneDocument(text, name);
    return Converter(name).convert(YAML::Load(text));
  } catch (const YAML::Exception& error) {
    throw InputError(fmt::format("{}:{}: not YAML: {}{}", name, error.mark.line + 1, error.msg,
                                 tabBefore(text, error.mark.line)));
  }
}

Value load(const std::filesystem::path& path, const std::string& asked_by, int depth) {
  Value value = parse(readFile(path, asked_by), path.lexically_normal().string());
  if (value.kind != Value::Kind::kMap)
    throw InputError(fmt::format("{}:1: {}want a map of keys", path.string(),
                                 value.kind == Value::Kind::kNull ? "nothing is in it, " : ""));
  resolve(value, path.parent_path(), depth);
  return value;
}

void emit(YAML::Emitter& out, const Value& value) {
  if (!value.tag.empty()) out << YAML::LocalTag(value.tag);
  switch (value.kind) {
    case Value::Kind::kNull: out << YAML::Null; break;
    case Value::Kind::kScalar:
      if (value.text.find('\n') != std::string::npos)
        out << YAML::DoubleQuoted;  // keeps every byte of a URDF
      out << value.text;
      break;
    case Value::Kind::kList: {
      const bool flat = std::all_of(value.children.begin(), value.children.end(),
                                    [](const Value& v) { return v.kind == Value::Kind::kScalar; });
      if (flat) out << YAML::Flow;
      out << YAML::BeginSeq;
      for (const Value& child : value.children) emit(out, child);
      out << YAML::EndSeq;
      break;
    }
    case Value::Kind::kMap:
      out << YAML::BeginMap;
      for (std::size_t i = 0; i < value.keys.size(); ++i) {
        out << YAML::Key << value.keys[i] << YAML::Value;
        emit(out, value.children[i]);
      }
      out << YAML::EndMap;
      break;
  }
}

}  // namespace

const Value* Value::find(std::string_view key) const {
  const auto at = std::find(keys.begin(), keys.end(), key);
  return at == keys.end() ? nullptr : &children[static_cast<std::size_t>(at - keys.begin())];
}

Value* Value::find(std::string_view key) {
  return const_cast<Value*>(static_cast<const Value*>(this)->find(key));
}

void Value::put(std::string key, Value value) {
  if (Value* old = find(key)) {
    *old = std::move(value);
    return;
  }
  keys.push_back(std::move(key));
  children.push_back(std::move(value));
}

void Value::erase(std::string_view key) {
  const auto at = std::find(keys.begin(), keys.end(), key);
  if (at == keys.end()) return;
  children.erase(children.begin() + (at - keys.begin()));
  keys.erase(at);
}

Value loadDocument(const std::filesystem::path& path) { return load(path, "", 0); }

Value parseDocument(const std::string& text, const std::string& name) {
  Value value = parse(text, name);
  if (value.kind != Value::Kind::kMap) throw InputError(name + ":1: want a map of keys");
  return value;
}

/// What `from`, `urdf` and their like name is a path, whatever YAML would make of its letters.
static bool isFileOf(const std::string& key, const std::string& given) {
  std::error_code error;
  const bool names_one =
      key == "from" || std::any_of(std::begin(kEmbedded), std::end(kEmbedded),
                                   [&](const Embedded& one) { return key == one.key; });
  return names_one && std::filesystem::is_regular_file(given, error);
}

static Value scalar(const std::string& text, const std::string& name) {
  Value out;
  out.kind = Value::Kind::kScalar;
  out.text = text;
  out.file = std::make_shared<const std::string>(name);
  out.line = 1;
  return out;
}

void applyOverride(Value& document, const std::string& assignment, std::string_view option) {
  const std::string name = fmt::format("{} {}", option, assignment);
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0)
    throw InputError(fmt::format("{}: want key.path=value", name));
  std::string path = assignment.substr(0, equals);
  std::erase(path, ']');  // an entry of a list is key[2] or key.2
  std::replace(path.begin(), path.end(), '[', '.');
  std::vector<std::string> keys;
  for (std::size_t begin = 0, dot = 0; dot < path.size(); begin = dot + 1) {
    dot = std::min(path.find('.', begin), path.size());
    keys.push_back(path.substr(begin, dot - begin));
  }
  const std::string given = assignment.substr(equals + 1);
  Value leaf = isFileOf(keys.back(), given) ? scalar(given, name) : parse(given, name);
  leaf.whole = true;
  Value* at = &document;
  const auto entry = [&](const std::string& key) -> Value& {
    std::size_t index = 0;
    const auto [end, error] = std::from_chars(key.data(), key.data() + key.size(), index);
    if (error != std::errc() || end != key.data() + key.size() || index >= at->children.size())
      throw InputError(fmt::format("{}: '{}', want the number of an entry, 0 to {}", name, key,
                                   std::ssize(at->children) - 1));
    return at->children[index];
  };
  Value map;
  map.kind = Value::Kind::kMap;
  map.file = leaf.file;
  map.line = 1;
  for (std::size_t i = 0; i + 1 < keys.size(); ++i) {
    if (at->kind == Value::Kind::kList) {
      at = &entry(keys[i]);
      continue;
    }
    if (at->kind != Value::Kind::kMap) *at = map;
    if (!at->find(keys[i])) at->put(keys[i], map);
    at = at->find(keys[i]);
  }
  if (at->kind == Value::Kind::kList) {
    entry(keys.back()) = std::move(leaf);
    return;
  }
  if (at->kind != Value::Kind::kMap) *at = map;
  map.put(keys.back(), std::move(leaf));
  resolve(map, std::filesystem::current_path(), 0);  // from, urdf: beside where it was typed
  for (std::size_t i = 0; i < map.keys.size(); ++i)  // `from` brings many
    at->put(map.keys[i], std::move(map.children[i]));
}

std::string fingerprint(const std::string& text) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return fmt::format("{:016x}", hash);
}

std::string emit(const Value& document) {
  YAML::Emitter out;
  emit(out, document);
  return std::string(out.c_str()) + "\n";
}

std::vector<std::string> namesIn(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error))
    if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

std::filesystem::path findFile(const std::string& kind, const std::string& name,
                               const std::filesystem::path& folder) {
  const std::filesystem::path given(name);
  if (given.extension() == ".yaml" || given.extension() == ".yml") return given;
  const std::filesystem::path named = folder / (name + ".yaml");
  std::error_code error;
  if (!name.empty() && std::filesystem::exists(named, error)) return named;
  const std::vector<std::string> names = namesIn(folder);
  if (names.empty())
    throw InputError(
        fmt::format("{} '{}': there is no configuration in {}; want its folder in "
                    "VES_CONFIG_DIR, or a path to a .yaml file",
                    kind, name, folder.string()));
  const std::string meant = nearest(name, names);
  if (!meant.empty())
    throw InputError(fmt::format("{} '{}': unknown, did you mean '{}'?", kind, name, meant));
  throw InputError(fmt::format("{} '{}': unknown, want one of {} or a path to a .yaml file", kind,
                               name, fmt::join(names, ", ")));
}

}  // namespace ves
