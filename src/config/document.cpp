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

namespace ves {
namespace {

constexpr std::uintmax_t kMaxFileSize = 4 << 20;  // [B]
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
      if (value.tag != "found" && value.tag != "derived" && value.tag != "substitute")
        refuse(fmt::format("tag !{}, want !found, !derived or !substitute", value.tag));
    }
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
        for (const auto& entry : node) {
          if (!entry.first.IsScalar()) refuse("a key that is not a word");
          const std::string& key = entry.first.Scalar();
          if (value.find(key))
            throw InputError(
                fmt::format("{}:{}: {}: given twice", *file_, entry.first.Mark().line + 1, key));
          value.keys.push_back(key);
          value.children.push_back(convert(entry.second, depth + 1));
          // An empty value has no position of its own.
          if (value.children.back().kind == Value::Kind::kNull)
            value.children.back().line = entry.first.Mark().line + 1;
        }
        break;
    }
    return value;
  }

 private:
  std::shared_ptr<const std::string> file_;
  int count_ = 0;
};

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

/// Replaces `from` and `urdf` below by what they name.
void resolve(Value& value, const std::filesystem::path& directory, int depth) {
  for (Value& child : value.children) resolve(child, directory, depth);
  if (value.kind != Value::Kind::kMap) return;
  const auto named = [&](const Value& v, std::string_view key) {
    const std::string at = fmt::format("{}:{}: {}: ", *v.file, v.line, key);
    if (v.kind != Value::Kind::kScalar || v.text.empty()) throw InputError(at + "want a file name");
    if (depth >= kMaxDepth) throw InputError(at + "files name each other in a circle");
    return at;
  };
  if (Value* urdf = value.find("urdf")) {
    const std::string at = named(*urdf, "urdf");
    const std::filesystem::path path = directory / urdf->text;
    const auto i = static_cast<std::size_t>(urdf - value.children.data());
    urdf->text = readFile(path, at);
    urdf->file = std::make_shared<const std::string>(path.lexically_normal().string());
    urdf->line = 1;
    value.keys[i] = "urdf_text";
  }
  if (const Value* from = value.find("from")) {
    const std::string at = named(*from, "from");
    Value base = load(directory / from->text, at, depth + 1);
    const auto i = from - value.children.data();
    value.keys.erase(value.keys.begin() + i);
    value.children.erase(value.children.begin() + i);
    base.line = value.line;
    base.file = value.file;
    merge(base, std::move(value));
    value = std::move(base);
    value.whole = true;
  }
}

Value parse(const std::string& text, const std::string& name) {
  try {
    return Converter(name).convert(YAML::Load(text));
  } catch (const YAML::Exception& error) {
    throw InputError(fmt::format("{}:{}: not YAML: {}", name, error.mark.line + 1, error.msg));
  }
}

Value load(const std::filesystem::path& path, const std::string& asked_by, int depth) {
  Value value = parse(readFile(path, asked_by), path.lexically_normal().string());
  if (value.kind != Value::Kind::kMap)
    throw InputError(fmt::format("{}:1: want a map of keys", path.string()));
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

std::string_view kindName(const Value& value) {
  switch (value.kind) {
    case Value::Kind::kNull: return "nothing";
    case Value::Kind::kScalar: return "a single value";
    case Value::Kind::kList: return "a list";
    case Value::Kind::kMap: return "a map";
  }
  return "";
}

std::string interval(double lo, double hi) {
  if (lo == -HUGE_VAL && hi == HUGE_VAL) return "a finite number";
  if (hi == HUGE_VAL) return fmt::format("a number of at least {}", lo);
  return fmt::format("a number in [{}, {}]", lo, hi);
}

/// Edit distance, for "did you mean".
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1])});
      diagonal = above;
    }
  }
  return row.back();
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

Value loadDocument(const std::filesystem::path& path) { return load(path, "", 0); }

Value parseDocument(const std::string& text, const std::string& name) {
  Value value = parse(text, name);
  if (value.kind != Value::Kind::kMap) throw InputError(name + ":1: want a map of keys");
  return value;
}

void applyOverride(Value& document, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0)
    throw InputError(fmt::format("--set {}: want key.path=value", assignment));
  Value leaf = parse(assignment.substr(equals + 1), "--set " + assignment);
  leaf.whole = true;
  std::string path = assignment.substr(0, equals);
  for (;;) {
    const std::size_t dot = path.rfind('.');
    Value map;
    map.kind = Value::Kind::kMap;
    map.file = leaf.file;
    map.line = 1;
    map.keys = {dot == std::string::npos ? path : path.substr(dot + 1)};
    map.children = {std::move(leaf)};
    leaf = std::move(map);
    if (dot == std::string::npos) break;
    path.resize(dot);
  }
  merge(document, std::move(leaf));
}

std::string fingerprint(const std::string& text) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const unsigned char c : text) hash = (hash ^ c) * 0x100000001b3u;
  return fmt::format("{:016x}", hash);
}

std::string emit(const Value& document) {
  YAML::Emitter out;
  emit(out, document);
  return std::string(out.c_str()) + "\n";
}

Section::Section(const Value& value, std::string path) : value_(&value), path_(std::move(path)) {
  if (value.kind != Value::Kind::kMap)
    failAt(value, path_, fmt::format("is {}, want a map of keys", kindName(value)));
}

bool Section::has(std::string_view key) {
  used_.emplace(key);
  return value_->find(key) != nullptr;
}

const Value& Section::need(std::string_view key) {
  used_.emplace(key);
  const Value* value = value_->find(key);
  if (!value) fail(key, "missing");
  return *value;
}

double Section::toNumber(const Value& value, const std::string& path, double lo, double hi) const {
  double x = 0.0;
  const char* begin = value.text.data();
  const char* end = begin + value.text.size();
  if (begin != end && *begin == '+') ++begin;
  const auto [last, error] = std::from_chars(begin, end, x);
  if (value.kind != Value::Kind::kScalar)
    failAt(value, path, fmt::format("is {}, want {}", kindName(value), interval(lo, hi)));
  if (error != std::errc() || last != end || !(x >= lo && x <= hi) || !std::isfinite(x))
    failAt(value, path, fmt::format("'{}', want {}", value.text, interval(lo, hi)));
  return x;
}

double Section::number(std::string_view key, double lo, double hi) {
  return toNumber(need(key), fmt::format("{}{}", path_.empty() ? "" : path_ + ".", key), lo, hi);
}

std::int64_t Section::integer(std::string_view key, std::int64_t lo, std::int64_t hi) {
  const Value& value = need(key);
  std::int64_t x = 0;
  const char* end = value.text.data() + value.text.size();
  const auto [last, error] = std::from_chars(value.text.data(), end, x);
  if (value.kind != Value::Kind::kScalar || error != std::errc() || last != end || x < lo || x > hi)
    fail(key, fmt::format("'{}', want a whole number in [{}, {}]", value.text, lo, hi));
  return x;
}

bool Section::flag(std::string_view key) { return choice(key, {"true", "false"}) == "true"; }

std::string Section::text(std::string_view key) {
  const Value& value = need(key);
  if (value.kind != Value::Kind::kScalar)
    fail(key, fmt::format("is {}, want text", kindName(value)));
  return value.text;
}

std::vector<std::string> Section::texts(std::string_view key) {
  const Value& value = need(key);
  if (value.kind != Value::Kind::kList)
    fail(key, fmt::format("is {}, want a list", kindName(value)));
  std::vector<std::string> out;
  for (const Value& child : value.children) {
    if (child.kind != Value::Kind::kScalar)
      failAt(child, fmt::format("{}{}", path_.empty() ? "" : path_ + ".", key),
             fmt::format("holds {}, want texts", kindName(child)));
    out.push_back(child.text);
  }
  return out;
}

std::string Section::choice(std::string_view key, std::initializer_list<std::string_view> allowed) {
  const Value& value = need(key);
  if (value.kind != Value::Kind::kScalar ||
      std::find(allowed.begin(), allowed.end(), value.text) == allowed.end())
    fail(key, fmt::format("'{}', want one of {}", value.text, fmt::join(allowed, ", ")));
  return value.text;
}

Eigen::VectorXd Section::vector(std::string_view key, int size, double lo, double hi) {
  const Value& value = need(key);
  const auto n = static_cast<int>(value.children.size());
  const std::string want = size < 0 ? "at least one" : std::to_string(size);
  if (value.kind != Value::Kind::kList || n == 0 || (size >= 0 && n != size))
    fail(key, value.kind == Value::Kind::kList
                  ? fmt::format("has {} entries, want {} numbers", n, want)
                  : fmt::format("is {}, want a list of {} numbers", kindName(value), want));
  Eigen::VectorXd out(n);
  for (int i = 0; i < n; ++i)
    out(i) = toNumber(value.children[static_cast<std::size_t>(i)],
                      fmt::format("{}{}[{}]", path_.empty() ? "" : path_ + ".", key, i), lo, hi);
  return out;
}

Eigen::MatrixXd Section::matrix(std::string_view key, int rows, int cols, double lo, double hi) {
  const Value& value = need(key);
  if (rows < 0 && value.kind == Value::Kind::kList && !value.children.empty())
    rows = static_cast<int>(value.children.size());
  if (value.kind != Value::Kind::kList || static_cast<int>(value.children.size()) != rows)
    fail(key,
         fmt::format("want {} rows of {} numbers", rows < 0 ? "one or more" : std::to_string(rows),
                     cols < 0 ? "equally many" : std::to_string(cols)));
  if (cols < 0) cols = static_cast<int>(value.children[0].children.size());
  if (cols == 0) fail(key, "the first row is empty");
  Eigen::MatrixXd out(rows, cols);
  for (int i = 0; i < rows; ++i) {
    const Value& row = value.children[static_cast<std::size_t>(i)];
    const std::string path = fmt::format("{}{}[{}]", path_.empty() ? "" : path_ + ".", key, i);
    if (row.kind != Value::Kind::kList || static_cast<int>(row.children.size()) != cols)
      failAt(row, path, fmt::format("has {} entries, want {}", row.children.size(), cols));
    for (int j = 0; j < cols; ++j)
      out(i, j) = toNumber(row.children[static_cast<std::size_t>(j)],
                           fmt::format("{}[{}]", path, j), lo, hi);
  }
  return out;
}

Section Section::section(std::string_view key) {
  return {need(key), fmt::format("{}{}", path_.empty() ? "" : path_ + ".", key)};
}

std::vector<Section> Section::list(std::string_view key) {
  const Value& value = need(key);
  if (value.kind != Value::Kind::kList)
    fail(key, fmt::format("is {}, want a list", kindName(value)));
  std::vector<Section> out;
  for (std::size_t i = 0; i < value.children.size(); ++i)
    out.emplace_back(value.children[i],
                     fmt::format("{}{}[{}]", path_.empty() ? "" : path_ + ".", key, i));
  return out;
}

std::string Section::onlyKey(std::initializer_list<std::string_view> allowed,
                             std::initializer_list<std::string_view> besides) {
  std::string found;
  for (const std::string& key : value_->keys) {
    if (std::find(besides.begin(), besides.end(), key) != besides.end()) continue;
    if (std::find(allowed.begin(), allowed.end(), key) == allowed.end())
      fail(key, fmt::format("unknown, want one of {}", fmt::join(allowed, ", ")));
    if (!found.empty()) fail(key, fmt::format("beside {}, want only one of them", found));
    found = key;
  }
  if (found.empty())
    failAt(*value_, path_, fmt::format("want one of {}", fmt::join(allowed, ", ")));
  return found;
}

void Section::finish() const {
  for (const std::string& key : value_->keys) {
    if (used_.count(key)) continue;
    std::string hint;
    std::size_t best = 1 + key.size() / 3;
    for (const std::string& known : used_) {
      if (value_->find(known) || distance(key, known) > best) continue;
      best = distance(key, known);
      hint = fmt::format(", did you mean {}?", known);
    }
    if (hint.empty()) hint = fmt::format(", known here: {}", fmt::join(used_, ", "));
    fail(key, "unknown key" + hint);
  }
}

void Section::fail(std::string_view key, const std::string& what) const {
  const Value* value = value_->find(key);
  failAt(value ? *value : *value_, fmt::format("{}{}", path_.empty() ? "" : path_ + ".", key),
         what);
}

void Section::failAt(const Value& at, const std::string& path, const std::string& what) const {
  throw InputError(fmt::format("{}:{}: {}{}{}", at.file ? *at.file : "?", at.line, path,
                               path.empty() ? "" : ": ", what));
}

std::filesystem::path findFile(const std::string& kind, const std::string& name,
                               const std::filesystem::path& folder) {
  const std::filesystem::path given(name);
  if (given.extension() == ".yaml") return given;
  const std::filesystem::path named = folder / (name + ".yaml");
  std::error_code error;
  if (!name.empty() && std::filesystem::exists(named, error)) return named;
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error))
    if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  throw InputError(fmt::format("{} '{}': unknown, want one of {} or a path to a .yaml file", kind,
                               name, fmt::join(names, ", ")));
}

}  // namespace ves
