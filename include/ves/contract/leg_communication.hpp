// SPDX-License-Identifier: BSD-3-Clause
//
// Leg communication (Appendix C): metres to LegCommand counts, and measured counts back to metres.
#pragma once

#include <cmath>

#include "ves/contract/sample.hpp"

namespace ves {

// The LegSlaves' times (report, 2.4).
inline constexpr std::int64_t kTransducerPeriod = 341'000;                             // [ns]
inline constexpr int kReadingsPerUpdate = 3;                                           // [-]
inline constexpr std::int64_t kUpdatePeriod = kReadingsPerUpdate * kTransducerPeriod;  // [ns]

struct LegCodec {
  Vec6 offset = Vec6::Zero();  // [m] length at zero counts
  Vec6 scale = Vec6::Ones();   // [m/count]
};

/// (C.13), to the nearest count. L must be finite.
inline LegCounts legCounts(const LegCodec& codec, const Vec6& L) noexcept {
  LegCounts counts;
  for (int i = 0; i < kLegs; ++i)
    counts[static_cast<std::size_t>(i)] =
        static_cast<std::int32_t>(std::lround((L(i) - codec.offset(i)) / codec.scale(i)));
  return counts;
}

/// The length at the middle of each count.
inline Vec6 legLengths(const LegCodec& codec, const LegCounts& counts) noexcept {
  Vec6 L;
  for (int i = 0; i < kLegs; ++i)
    L(i) = codec.offset(i) + codec.scale(i) * counts[static_cast<std::size_t>(i)];
  return L;
}

}  // namespace ves
