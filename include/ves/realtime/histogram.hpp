// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

namespace ves {

/// Counts of latencies, a bin for each power of two: bin i holds those below 2^i us that no earlier
/// bin holds, the last one everything else. No heap.
class LatencyHistogram {
 public:
  static constexpr std::size_t kBins = 20;

  void add(std::int64_t ns) noexcept {
    const auto us = static_cast<std::uint64_t>(std::max<std::int64_t>(ns, 0)) / 1000;
    ++bins_[std::min<std::size_t>(static_cast<std::size_t>(std::bit_width(us)), kBins - 1)];
  }
  const std::array<std::int32_t, kBins>& bins() const noexcept { return bins_; }

 private:
  std::array<std::int32_t, kBins> bins_{};
};

}  // namespace ves
