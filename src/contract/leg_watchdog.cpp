// SPDX-License-Identifier: BSD-3-Clause
#include "ves/contract/leg_watchdog.hpp"

#include <algorithm>
#include <cmath>

namespace ves {

void LegWatchdog::take(const LegCommand& command, std::int64_t now) noexcept {
  if (command.engaged) {
    heard_ = now;
    parking_ = false;
    reference_ = command.counts;
    rest_ = command.rest;
    may_park_ = command.park;
    return;
  }
  // Somebody is there, and asks for nothing: the legs stay, and the silence begins anew.
  if (heard_ < 0) return;
  heard_ = now;
  if (parking_) rest_ = reference_;
  parking_ = false;
  reference_ = rest_;
}

const LegCounts& LegWatchdog::reference(std::int64_t now) noexcept {
  const std::int64_t silence = now - heard_;
  if (heard_ < 0 || silence < times_.hold_after) return reference_;
  if (parking_ && !may_park_) {
    rest_ = reference_;
    parking_ = false;
  }
  if (!parking_) reference_ = rest_;
  parking_ = may_park_ && silence >= times_.park_after;
  if (!parking_) return reference_;
  const double share = std::min(1.0, static_cast<double>(silence - times_.park_after) /
                                         static_cast<double>(times_.park_time));
  for (std::size_t i = 0; i < kLegs; ++i)
    reference_[i] =
        rest_[i] + static_cast<std::int32_t>(std::lround(share * (home_[i] - rest_[i])));
  return reference_;
}

}  // namespace ves
