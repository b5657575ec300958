// SPDX-License-Identifier: BSD-3-Clause
//
// ves keys: what scenario files may say.
#include <fmt/format.h>
#include <cmath>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "options.hpp"
#include "ves/config/keys.hpp"

namespace ves::app {
namespace {

using Json = nlohmann::ordered_json;

std::string lastOf(const std::string& path) {
  const std::size_t dot = path.rfind('.');
  return dot == std::string::npos ? path : path.substr(dot + 1);
}

bool leaf(const KeyMeaning& key) { return key.keys.empty(); }

/// The value that a file without the key has, or one that a shipped file gives.
std::string valueOf(const KeyMeaning& key) {
  if (!key.standard.empty()) return key.standard;
  return key.asked.example.empty() ? "" : "e.g. " + key.asked.example;
}

/// `head`, and the words behind it, in lines of 80 letters; the second begins `indent` letters in.
std::string wrapped(std::string line, const std::string& text, std::size_t indent) {
  constexpr std::size_t kWidth = 80;
  std::istringstream words(text);
  std::string out;
  bool begun = false;
  for (std::string word; words >> word; begun = true) {
    if (begun && line.size() + 1 + word.size() > kWidth) {
      out += line + "\n";
      line.assign(indent, ' ');
      begun = false;
    }
    line += (begun ? " " : "") + word;
  }
  return out + line + "\n";
}

void printKey(const KeyMeaning& key) {
  const std::string unit = unitOfKey(lastOf(key.path)), value = valueOf(key);
  std::string head = key.path;
  if (!value.empty()) head += (key.standard.empty() ? "   " : " = ") + value;
  fmt::print("{}\n", head);
  std::string type = typeOfKey(key.asked);
  if (!unit.empty()) type += " [" + unit + "]";
  const std::string in(4, ' ');
  fmt::print("{}{}", wrapped(in, type, in.size()), wrapped(in, key.sentence, in.size()));
}

void printSections(const KeyMeaning& root) {
  for (const KeyMeaning& key : root.keys)
    fmt::print("{}", wrapped(fmt::format("  {:<18}", key.path), key.sentence, 20));
  fmt::print("\n`ves keys SECTION` lists a section's keys; any path below it does, too.\n");
}

std::string cell(std::string text) {
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2)
    text.insert(at, 1, '\\');
  return text;
}

void printMarkdown(const KeyMeaning& root) {
  for (const KeyMeaning& section : root.keys) {
    fmt::print("\n### {}\n\n{}\n", section.path, section.sentence);
    if (leaf(section)) {
      fmt::print("\n{}{}\n", typeOfKey(section.asked),
                 valueOf(section).empty() ? "" : ": `" + valueOf(section) + "`");
      continue;
    }
    fmt::print("\n| key | value | default or example | meaning |\n|---|---|---|---|\n");
    walkKeys(section, [&](const KeyMeaning& key) {
      const std::string unit = unitOfKey(lastOf(key.path)), value = valueOf(key);
      fmt::print("| `{}` | {}{} | {} | {} |\n", key.path.substr(section.path.size()),
                 cell(typeOfKey(key.asked)), unit.empty() ? "" : " [" + cell(unit) + "]",
                 value.empty() ? "" : fmt::format("`{}`", cell(value)), cell(key.sentence));
    });
  }
}

Json numberSchema(const AskedKey& key, bool whole) {
  Json out = {{"type", whole ? "integer" : "number"}};
  const auto lo = key.lo.known(), hi = key.hi.known();
  if (lo && std::isfinite(*lo)) out["minimum"] = *lo;
  if (hi && std::isfinite(*hi)) out["maximum"] = *hi;
  return out;
}

Json listSchema(Json items, const AskedKey::Same<int>& size) {
  Json out = {{"type", "array"}, {"items", std::move(items)}};
  const auto n = size.known();
  out["minItems"] = n && *n >= 0 ? *n : 1;
  if (n && *n >= 0) out["maxItems"] = *n;
  return out;
}

Json schemaOf(const KeyMeaning& key);

/// A map's. Any map may begin `from: FILE`, and then leaves out what that has.
Json mapSchema(const KeyMeaning& key) {
  Json properties = {{"from", {{"type", "string"}, {"description", "a file that this begins as"}}}};
  Json out = {{"type", "object"}}, required = Json::array();
  for (const KeyMeaning& below : key.keys) {
    const std::string name = lastOf(below.path);
    if (name == "*") {
      out["additionalProperties"] = schemaOf(below);
      continue;
    }
    properties[name] = schemaOf(below);
    if (key.asked.visits > 0 && below.asked.needed >= key.asked.visits &&
        key.path.find("[]") != std::string::npos)
      required.push_back(name);
  }
  out["properties"] = std::move(properties);
  if (!out.contains("additionalProperties")) out["additionalProperties"] = false;
  Json variants = Json::array();
  for (const std::string& one : key.asked.variants) variants.push_back({{"required", {one}}});
  Json whole = Json::object();
  if (!required.empty()) whole["required"] = required;
  if (!variants.empty()) whole["oneOf"] = variants;
  if (!whole.empty()) {
    out["if"] = {{"not", {{"required", {"from"}}}}};
    out["then"] = whole;
  }
  return out;
}

Json schemaOf(const KeyMeaning& key) {
  const AskedKey& a = key.asked;
  Json any = Json::array();
  if (a.kinds & AskedKey::kNumber) any.push_back(numberSchema(a, false));
  if (a.kinds & AskedKey::kInteger) any.push_back(numberSchema(a, true));
  if (a.kinds & AskedKey::kVector) any.push_back(listSchema(numberSchema(a, false), a.cols));
  if (a.kinds & AskedKey::kMatrix)
    any.push_back(listSchema(listSchema(numberSchema(a, false), a.cols), a.rows));
  if (a.kinds & AskedKey::kFlag) any.push_back({{"type", "boolean"}});
  if (a.kinds & AskedKey::kChoice) any.push_back({{"enum", a.choices}});
  if (a.kinds & AskedKey::kTexts)
    any.push_back({{"type", "array"}, {"items", {{"type", {"string", "number"}}}}});
  if (a.kinds & AskedKey::kText) any.push_back({{"type", {"string", "number"}}});
  if (a.kinds & AskedKey::kDerived) any.push_back({{"const", "derived"}});
  if (a.kinds & AskedKey::kList) {
    Json items = true;
    for (const KeyMeaning& below : key.keys)
      if (below.path.ends_with("[]")) items = mapSchema(below);
    any.push_back({{"type", "array"}, {"items", items}});
  }
  if (a.kinds & AskedKey::kMap) any.push_back(mapSchema(key));
  Json out = any.size() == 1 ? any[0] : any.empty() ? Json::object() : Json{{"anyOf", any}};
  if (!key.sentence.empty()) out["description"] = key.sentence;
  return out;
}

void printSchema(const KeyMeaning& root) {
  Json out = {{"$schema", "http://json-schema.org/draft-07/schema#"},
              {"title", "A scenario of the Vehicle Emulation System"}};
  out.update(mapSchema(root));
  fmt::print("{}\n", out.dump(1));
}

}  // namespace

int keysCommand(int argc, char** argv) {
  CLI::App cli(
      "What scenario files may say: each key with its unit, range, default and meaning.\n"
      "  ves keys                          the sections\n"
      "  ves keys controller.compensation  the keys of one\n"
      "  ves keys --schema > ves.json      for editors: a file begins\n"
      "                                    # yaml-language-server: $schema=ves.json",
      "ves keys");
  std::string path;
  bool schema = false, markdown = false;
  cli.add_option("section", path, "a section or a key, as controller or legs.K_P");
  auto* const as_schema = cli.add_flag("--schema", schema, "JSON Schema, draft 7");
  cli.add_flag("--markdown", markdown, "tables, as docs/scenario.md has them")->excludes(as_schema);
  return run(cli, argc, argv, [&] {
    if (schema || markdown)
      refuse(cli, {"section"}, "beside --schema and --markdown: they have all");
    const KeyMeaning root = keyMeanings(configFolder());
    if (schema) {
      printSchema(root);
    } else if (markdown) {
      printMarkdown(root);
    } else if (path.empty()) {
      printSections(root);
    } else {
      const KeyMeaning& key = keyAt(root, path);
      printKey(key);
      walkKeys(key, printKey);
    }
    return kDone;
  });
}

}  // namespace ves::app
