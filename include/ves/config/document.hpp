// SPDX-License-Identifier: BSD-3-Clause
//
// YAML documents that remember where each value came from. yaml-cpp parses; this adds what a person
// needs when a file is wrong: one line, `file:line: key: what is wrong, what is allowed`.
//
// A map may start `from: other.yaml` and then names only what differs; it then stands for itself,
// and replaces a map of the same key in the file that `from` above it names. So does a map tagged
// !replace. Other tags say where a number was got: !found (a cited source), !derived (computed from
// one), !substitute (a stand-in); none: the report's own, or a choice of the experiment. A tag
// covers what stands below it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "ves/core/errors.hpp"

namespace ves {

/// One value of a document.
struct Value {
  enum class Kind { kNull, kScalar, kList, kMap };
  Kind kind = Kind::kNull;
  std::string text;               // of a scalar
  std::string tag;                // "substitute", ...; empty
  std::vector<std::string> keys;  // of a map, beside children
  std::vector<Value> children;    // of a list or map
  std::shared_ptr<const std::string> file;
  int line = 0;
  bool whole = false;  // stands for itself: replaces what it would be merged onto

  const Value* find(std::string_view key) const;
  Value* find(std::string_view key);
  /// Of a map: adds the key, or replaces what it had.
  void put(std::string key, Value value);
  /// Of a map: the key is gone, if it was there.
  void erase(std::string_view key);
};

/// Reads a file with everything it is made from, `from` and `urdf` replaced by what they name.
Value loadDocument(const std::filesystem::path& path);

/// A key as people write it: `urdf` for the key that has the file's text.
std::string_view asWritten(std::string_view key);

/// Parses text that stands for a file of this name; nothing else is read.
Value parseDocument(const std::string& text, const std::string& name);

/// Applies "a.b.c=value" as if it stood in the file. Throws InputError, which names the option.
void applyOverride(Value& document, const std::string& assignment,
                   std::string_view option = "--set");

/// Of the .yaml files in a folder, without the ending, sorted; none where it cannot be read.
std::vector<std::string> namesIn(const std::filesystem::path& folder);

/// The file of a `kind` given by path or by its name in `folder`. Throws InputError that says what
/// is meant, or there.
std::filesystem::path findFile(const std::string& kind, const std::string& name,
                               const std::filesystem::path& folder);

/// Tells texts apart, no more: FNV-1a, 64 bits, in hexadecimal.
std::string fingerprint(const std::string& text);

/// YAML that parseDocument() reads back to the same document.
std::string emit(const Value& document);

struct AskedKey;

/// A map on its way into a struct: knows its name, counts which keys were asked for.
class Section {
 public:
  /// `value` must outlive it, and `asked`, which is told of everything that is asked for.
  Section(const Value& value, std::string path, AskedKey* asked = nullptr);
  Section(Value&& value, std::string path, AskedKey* asked = nullptr) = delete;

  bool has(std::string_view key);
  /// It is there, and a list.
  bool isList(std::string_view key);
  const std::vector<std::string>& keys() const { return value_->keys; }

  /// A number in [lo, hi]; NaN is in no interval.
  double number(std::string_view key, double lo, double hi);
  /// The same, or the word `derived`, which stands for the value that follows from elsewhere.
  double numberOr(std::string_view key, double lo, double hi, double derived);
  std::int64_t integer(std::string_view key, std::int64_t lo, std::int64_t hi);
  bool flag(std::string_view key);
  std::string text(std::string_view key);
  /// The file that a text is from.
  std::string fileOf(std::string_view key);
  /// A list of texts, which may be empty.
  std::vector<std::string> texts(std::string_view key);
  std::string choice(std::string_view key, const std::vector<std::string_view>& allowed);
  /// `size` numbers; any number of them (at least one) when size is -1.
  Eigen::VectorXd vector(std::string_view key, int size, double lo, double hi);
  /// rows x cols numbers, row by row; any number of rows (at least one) when rows is -1, as many
  /// columns as the first row has when cols is -1.
  Eigen::MatrixXd matrix(std::string_view key, int rows, int cols, double lo, double hi);

  Section section(std::string_view key);
  std::vector<Section> list(std::string_view key);

  /// The only key of this map, which names its kind.
  std::string onlyKey(const std::vector<std::string_view>& allowed,
                      const std::vector<std::string_view>& besides);

  /// Refuses keys that nobody asked for.
  void finish() const;

  [[noreturn]] void fail(std::string_view key, const std::string& what) const;
  /// The same, of a motion that a check would stop. Throws WouldStop.
  [[noreturn]] void failOfMotion(std::string_view key, const std::string& what) const;
  const std::string& path() const { return path_; }

 private:
  const Value& need(std::string_view key);
  AskedKey* asked(std::string_view key);
  std::string chosen(std::string_view key, const std::vector<std::string_view>& allowed);
  [[noreturn]] void failAt(const Value& at, const std::string& path, const std::string& what) const;
  double toNumber(const Value& value, const std::string& path, double lo, double hi) const;

  const Value* value_;
  std::string path_;
  AskedKey* asked_;
  std::set<std::string, std::less<>> used_;
};

}  // namespace ves
