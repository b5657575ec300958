// SPDX-License-Identifier: BSD-3-Clause
#include "ves/realtime/clock_offset.hpp"

#include <cmath>
#include <cstdlib>

namespace ves {

void ClockOffset::take(std::int64_t t1, std::int64_t t2, std::int64_t t3,
                       std::int64_t t4) noexcept {
  // Times of anybody: bounded, so that no difference overflows.
  constexpr std::int64_t kMost = INT64_MAX / 8;
  for (const std::int64_t t : {t1, t2, t3, t4})
    if (t < 0 || t > kMost) return;
  const std::int64_t round_trip = (t4 - t1) - (t3 - t2);
  if (t3 < t2 || t4 < t1 || round_trip < 0) return;
  if (known_ && round_trip / 2 > uncertainty(t4)) return;
  known_ = true;
  offset_ = ((t2 - t1) + (t3 - t4)) / 2;
  half_ = (round_trip + 1) / 2;
  taken_ = t4;
}

std::int64_t ClockOffset::uncertainty(std::int64_t now) const noexcept {
  if (!known_) return -1;
  return half_ + std::llround(kDrift * static_cast<double>(now - taken_));
}

std::int64_t ClockOffset::offset(std::int64_t now) const noexcept {
  return std::abs(offset_) > uncertainty(now) ? offset_ : 0;
}

}  // namespace ves
