// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "ves/core/spelling.hpp"
#include "ves/config/document.hpp"
#include "ves/config/keys.hpp"

namespace ves {
namespace {

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

}  // namespace

Section::Section(const Value& value, std::string path, AskedKey* asked)
    : value_(&value), path_(std::move(path)), asked_(asked) {
  if (value.kind != Value::Kind::kMap)
    failAt(value, path_, fmt::format("is {}, want a map of keys", kindName(value)));
  if (asked_) ++asked_->visits;
}

/// Nobody, where nobody wants to know.
AskedKey* Section::asked(std::string_view key) {
  return asked_ ? &asked_->keys[std::string(key)] : nullptr;
}

bool Section::has(std::string_view key) {
  used_.emplace(key);
  asked(key);
  return value_->find(key) != nullptr;
}

bool Section::isList(std::string_view key) {
  const Value* value = has(key) ? value_->find(key) : nullptr;
  return value && value->kind == Value::Kind::kList;
}

const Value& Section::need(std::string_view key) {
  used_.emplace(key);
  const Value* value = value_->find(key);
  if (AskedKey* const k = asked(key)) k->need(value);
  if (value) return *value;
  // A slip of the pen is told as such.
  for (const std::string& given : value_->keys)
    if (!used_.count(given) && editDistance(given, key) <= 1 + given.size() / 3)
      fail(given, fmt::format("unknown key, did you mean {}?", key));
  fail(key, "missing");
}

double Section::toNumber(const Value& value, const std::string& path, double lo, double hi) const {
  double x = 0.0;
  const char* begin = value.text.data();
  const char* end = begin + value.text.size();
  if (end - begin > 1 && begin[0] == '+' && begin[1] != '-') ++begin;
  const auto [last, error] = std::from_chars(begin, end, x);
  if (value.kind != Value::Kind::kScalar)
    failAt(value, path, fmt::format("is {}, want {}", kindName(value), interval(lo, hi)));
  if (error != std::errc() || last != end || !(x >= lo && x <= hi) || !std::isfinite(x))
    failAt(value, path, fmt::format("'{}', want {}", value.text, interval(lo, hi)));
  return x;
}

double Section::number(std::string_view key, double lo, double hi) {
  if (AskedKey* const k = asked(key)) k->take(AskedKey::kNumber, lo, hi);
  return toNumber(need(key), fmt::format("{}{}", path_.empty() ? "" : path_ + ".", key), lo, hi);
}

double Section::numberOr(std::string_view key, double lo, double hi, double derived) {
  if (AskedKey* const k = asked(key)) k->take(AskedKey::kNumber | AskedKey::kDerived, lo, hi);
  const Value& value = need(key);
  if (value.kind != Value::Kind::kScalar || value.text != "derived") return number(key, lo, hi);
  if (!(derived >= lo && derived <= hi))
    fail(key, fmt::format("the derived value is {:.4g}, want {}", derived, interval(lo, hi)));
  return derived;
}

std::int64_t Section::integer(std::string_view key, std::int64_t lo, std::int64_t hi) {
  if (AskedKey* const k = asked(key))
    k->take(AskedKey::kInteger, static_cast<double>(lo), static_cast<double>(hi));
  const Value& value = need(key);
  std::int64_t x = 0;
  const char* end = value.text.data() + value.text.size();
  const auto [last, error] = std::from_chars(value.text.data(), end, x);
  if (value.kind != Value::Kind::kScalar || error != std::errc() || last != end || x < lo || x > hi)
    fail(key, fmt::format("'{}', want a whole number in [{}, {}]", value.text, lo, hi));
  return x;
}

bool Section::flag(std::string_view key) {
  if (AskedKey* const k = asked(key)) k->kinds |= AskedKey::kFlag;
  return chosen(key, {"true", "false"}) == "true";
}

std::string Section::text(std::string_view key) {
  if (AskedKey* const k = asked(key)) k->kinds |= AskedKey::kText;
  const Value& value = need(key);
  if (value.kind != Value::Kind::kScalar)
    fail(key, fmt::format("is {}, want text", kindName(value)));
  return value.text;
}

std::string Section::fileOf(std::string_view key) { return *need(key).file; }

std::vector<std::string> Section::texts(std::string_view key) {
  if (AskedKey* const k = asked(key)) k->kinds |= AskedKey::kTexts;
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

std::string Section::choice(std::string_view key, const std::vector<std::string_view>& allowed) {
  if (AskedKey* const k = asked(key)) {
    k->kinds |= AskedKey::kChoice;
    k->choices.assign(allowed.begin(), allowed.end());
  }
  return chosen(key, allowed);
}

std::string Section::chosen(std::string_view key, const std::vector<std::string_view>& allowed) {
  const Value& value = need(key);
  if (value.kind != Value::Kind::kScalar)
    fail(key, fmt::format("is {}, want one of {}", kindName(value), fmt::join(allowed, ", ")));
  if (std::find(allowed.begin(), allowed.end(), value.text) == allowed.end())
    fail(key, fmt::format("'{}', want one of {}", value.text, fmt::join(allowed, ", ")));
  return value.text;
}

Eigen::VectorXd Section::vector(std::string_view key, int size, double lo, double hi) {
  if (AskedKey* const k = asked(key)) {
    k->take(AskedKey::kVector, lo, hi);
    k->cols.take(size);
  }
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
  if (AskedKey* const k = asked(key)) {
    k->take(AskedKey::kMatrix, lo, hi);
    k->rows.take(rows);
    k->cols.take(cols);
  }
  const Value& value = need(key);
  if (rows < 0 && value.kind == Value::Kind::kList && !value.children.empty())
    rows = static_cast<int>(value.children.size());
  if (value.kind != Value::Kind::kList || static_cast<int>(value.children.size()) != rows)
    fail(key,
         fmt::format("want {} rows of {} numbers", rows < 0 ? "one or more" : std::to_string(rows),
                     cols < 0 ? "equally many" : std::to_string(cols)));
  if (cols < 0) cols = static_cast<int>(value.children[0].children.size());
  if (cols == 0 && value.children[0].kind == Value::Kind::kList)
    fail(key, "the first row is empty");
  Eigen::MatrixXd out(rows, cols);
  for (int i = 0; i < rows; ++i) {
    const Value& row = value.children[static_cast<std::size_t>(i)];
    const std::string path = fmt::format("{}{}[{}]", path_.empty() ? "" : path_ + ".", key, i);
    if (row.kind != Value::Kind::kList)
      failAt(row, path, fmt::format("is {}, want a list of {}numbers", kindName(row),
                                      cols > 0 ? fmt::format("{} ", cols) : ""));
    if (static_cast<int>(row.children.size()) != cols)
      failAt(row, path, fmt::format("has {} entries, want {}", row.children.size(), cols));
    for (int j = 0; j < cols; ++j)
      out(i, j) = toNumber(row.children[static_cast<std::size_t>(j)],
                           fmt::format("{}[{}]", path, j), lo, hi);
  }
  return out;
}

Section Section::section(std::string_view key) {
  AskedKey* const below = asked(key);
  if (below) below->kinds |= AskedKey::kMap;
  return {need(key), fmt::format("{}{}", path_.empty() ? "" : path_ + ".", key), below};
}

std::vector<Section> Section::list(std::string_view key) {
  AskedKey* const below = asked(key);
  if (below) below->kinds |= AskedKey::kList;
  const Value& value = need(key);
  if (value.kind != Value::Kind::kList)
    fail(key, fmt::format("is {}, want a list", kindName(value)));
  AskedKey* const entry = below ? &below->keys["[]"] : nullptr;
  if (entry) entry->kinds |= AskedKey::kMap;
  std::vector<Section> out;
  for (std::size_t i = 0; i < value.children.size(); ++i)
    out.emplace_back(value.children[i],
                     fmt::format("{}{}[{}]", path_.empty() ? "" : path_ + ".", key, i), entry);
  return out;
}

std::string Section::onlyKey(const std::vector<std::string_view>& allowed,
                             const std::vector<std::string_view>& besides) {
  if (asked_) asked_->variants.assign(allowed.begin(), allowed.end());
  for (const std::string_view key : allowed) asked(key);
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
    std::vector<std::string> missing;
    std::copy_if(used_.begin(), used_.end(), std::back_inserter(missing),
                 [&](const std::string& known) { return !value_->find(known); });
    std::string meant = beginning(key, used_);
    if (meant.empty()) meant = nearest(key, missing);
    std::set<std::string_view> known;
    for (const std::string& one : used_) known.insert(asWritten(one));
    fail(key, meant.empty() ? fmt::format("unknown key, known here: {}", fmt::join(known, ", "))
                            : fmt::format("unknown key, did you mean {}?", meant));
  }
}

void Section::fail(std::string_view key, const std::string& what) const {
  const Value* value = value_->find(key);
  failAt(value ? *value : *value_, fmt::format("{}{}", path_.empty() ? "" : path_ + ".", key),
         what);
}

void Section::failOfMotion(std::string_view key, const std::string& what) const {
  try {
    fail(key, what);
  } catch (const InputError& error) {
    throw WouldStop(error.what());
  }
}

void Section::failAt(const Value& at, const std::string& path, const std::string& what) const {
  throw InputError(fmt::format("{}:{}: {}{}{}", at.file ? *at.file : "?", at.line, path,
                               path.empty() ? "" : ": ", what));
}

}  // namespace ves
