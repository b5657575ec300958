// SPDX-License-Identifier: BSD-3-Clause
//
// Slips of the pen.
#pragma once

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

namespace ves {

/// Letters to insert, remove or exchange, for "did you mean".
inline std::size_t editDistance(std::string_view a, std::string_view b) {
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

/// A word that begins so; empty when none does.
template <class Words>
std::string beginning(std::string_view given, const Words& words) {
  constexpr std::size_t kTelling = 4;  // [-] letters
  for (const auto& word : words)
    if (given.size() >= kTelling && std::string_view(word).substr(0, given.size()) == given)
      return std::string(word);
  return {};
}

/// The word that is meant: one that begins so, or the nearest, the last of those alike; empty when
/// none is near.
template <class Words>
std::string nearest(std::string_view given, const Words& words) {
  std::string out = beginning(given, words);
  if (!out.empty()) return out;
  std::size_t best = 1 + given.size() / 3;
  for (const auto& word : words)
    if (const std::size_t d = editDistance(given, word); d <= best) {
      best = d;
      out = word;
    }
  return out;
}

}  // namespace ves
