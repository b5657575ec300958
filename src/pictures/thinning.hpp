// SPDX-License-Identifier: BSD-3-Clause
//
// As many points of a line as can be seen.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace ves {

/// Indices of about `most` points at most: the points are cut into equal runs, and the lowest and
/// the highest of each run stay. So no peak is lost. All stay where there are no more than `most`.
inline std::vector<std::size_t> thinned(const std::vector<double>& y, std::size_t most) {
  const std::size_t n = y.size();
  const std::size_t bin = n <= most ? 1 : (2 * n + most - 1) / most;
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < n; i += bin) {
    std::size_t low = i, high = i;
    for (std::size_t k = i; k < std::min(n, i + bin); ++k) {
      if (y[k] < y[low]) low = k;
      if (y[k] > y[high]) high = k;
    }
    out.push_back(std::min(low, high));
    if (low != high) out.push_back(std::max(low, high));
  }
  return out;
}

}  // namespace ves
