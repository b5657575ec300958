// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/monitors.hpp"

#include <algorithm>
#include <cmath>

namespace ves {

const Vec6& LegReadings::take(const SafetyLimits& limits, const Vec6& L, const Vec6& speed,
                              double time) noexcept {
  // A servo that catches up is faster than it was told.
  const double reach = limits.reading_speed * (wrong_ + 1) * time;  // [s]
  bool plausible = true;
  for (int i = 0; i < kLegs; ++i)
    plausible = plausible && std::abs(L(i) - L_(i)) <= limits.reading_jump + reach * speed(i);
  if (known_ && !plausible) {
    ++wrong_;
    return L_;
  }
  known_ = true;
  wrong_ = 0;
  L_ = L;
  return L_;
}

void FrozenSensor::take(const AdcCounts& adc, const Vec6& expected) noexcept {
  if (!std::equal(adc.begin(), adc.begin() + kWrenchChannels, last_.begin())) {
    last_ = adc;
    expected_ = expected;
    same_ = 0;
  } else {
    ++same_;
  }
  change_ = (expected - expected_).cwiseAbs().maxCoeff();
}

void Overruns::take(std::int64_t tick, std::int64_t missed) noexcept {
  tick_ = tick;
  missed_ = missed;
  if (missed > 0) late_[count_++ % kKept] = tick;
}

bool Overruns::good(const SafetyLimits& limits, std::int64_t ticks_per_second) const noexcept {
  if (missed_ > limits.stall_ticks) return false;
  const auto allowed = static_cast<std::size_t>(limits.overruns);
  if (count_ <= allowed) return true;
  // The one that would be too many, counted back from the last.
  return tick_ - late_[(count_ - 1 - allowed) % kKept] > ticks_per_second;
}

void Oscillation::take(const SafetyLimits& limits, double energy, bool held, const JointVector& q,
                       double moved, double period) noexcept {
  if (!((q - q_).cwiseAbs().maxCoeff() <= moved)) {
    reset();
    q_ = q;
  }
  most_ = std::max(most_, energy);
  held_ = held_ || held;
  time_ += period;
  if (time_ < limits.window) return;
  const bool grows = most_ > limits.window_growth * last_ && last_ > 0.0;
  grown_ = (grows || held_) && most_ > limits.growth_floor ? grown_ + 1 : 0;
  last_ = most_;
  most_ = 0.0;
  held_ = false;
  time_ = 0.0;
}

}  // namespace ves
