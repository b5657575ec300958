// SPDX-License-Identifier: BSD-3-Clause
//
// Latencies: histograms on the bus, medians and tails for people.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

namespace ves {

/// Bins of a latency's histogram, one for each power of two: bin i holds what is below 2^i us and
/// in no earlier bin, the last one everything else.
inline constexpr std::size_t kLatencyBins = 20;

inline std::size_t latencyBin(std::int64_t ns) noexcept {
  const auto us = static_cast<std::uint64_t>(std::max<std::int64_t>(ns, 0)) / 1000;
  return std::min<std::size_t>(static_cast<std::size_t>(std::bit_width(us)), kLatencyBins - 1);
}

/// Median and tail of a latency. [s]
struct Latency {
  double median = 0.0, p99 = 0.0, max = 0.0;
  std::int64_t n = 0;
};
Latency latencyOf(std::vector<double> seconds);

}  // namespace ves
