// SPDX-License-Identifier: BSD-3-Clause
//
// The keys of scenario files, as the readers themselves ask for them, and the sentences of
// config/keys.yaml about them.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "ves/config/document.hpp"

namespace ves {

/// What readers have asked of one key, and of the keys below it. The key of a list's entries is
/// "[]", that of keys which whoever writes the file names is "*".
struct AskedKey {
  enum Kind : unsigned {
    kNumber = 1u << 0,
    kInteger = 1u << 1,
    kFlag = 1u << 2,
    kText = 1u << 3,
    kTexts = 1u << 4,
    kChoice = 1u << 5,
    kVector = 1u << 6,
    kMatrix = 1u << 7,
    kMap = 1u << 8,
    kList = 1u << 9,
    kDerived = 1u << 10,  // the word `derived`
  };
  /// What readers may ask for differently: then it depends on other keys.
  template <class T>
  struct Same {
    std::optional<T> first;
    bool differs = false;

    void take(T asked) {
      differs = differs || (first && *first != asked);
      if (!first) first = asked;
    }
    std::optional<T> known() const { return differs ? std::nullopt : first; }
  };

  unsigned kinds = 0;                 // 0: nobody has read it
  Same<double> lo, hi;                // of each number
  Same<int> rows, cols;               // of kVector and kMatrix; -1: any
  std::vector<std::string> choices;   // of kChoice
  std::vector<std::string> variants;  // of kMap: exactly one of these keys
  std::string example;                // the first value, where it is short
  int visits = 0;                     // [-] sections that were read
  int needed = 0;                     // [-] times that it had to be there
  std::map<std::string, AskedKey, std::less<>> keys;

  void take(unsigned kind, double least, double most);
  void need(const Value* value);
  void join(const AskedKey& other);
};

/// A key of scenario files.
struct KeyMeaning {
  std::string path;      // "program[].move.to.x_m"; empty: the whole file
  std::string sentence;  // empty: there is none
  std::string standard;  // what it is in ves.yaml, where that is short; empty: it is not there
  AskedKey asked;        // without its keys
  std::vector<KeyMeaning> keys;
};

/// [kg], [N | N m], ...: of a key's name; empty: it has none.
std::string unitOfKey(std::string_view key);

/// What its values are, in words: "number, 0 to 100", "one of raw, aided".
std::string typeOfKey(const AskedKey& key);

/// Reads every scenario of the folder of configurations, and the examples of its keys.yaml, for
/// what readers ask. A key that nobody has asked for is there with `asked.kinds` 0.
KeyMeaning keyMeanings(const std::filesystem::path& config);

/// The key of that path below `root`; "program.move" finds "program[].move". Throws InputError,
/// with what may be meant.
const KeyMeaning& keyAt(const KeyMeaning& root, const std::string& path);

/// `visit`s all keys below, parts after their whole.
void walkKeys(const KeyMeaning& root, const std::function<void(const KeyMeaning&)>& visit);

}  // namespace ves
