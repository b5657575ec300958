// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

#include "ves/run/run.hpp"

namespace ves {

/// Decides when a run is over: parked; a while after a stop, so that the hold is seen; or never
/// armed.
class Ending {
 public:
  explicit Ending(const ControllerConfig& config)
      : period_(config.period),
        patience_(std::max(kGiveUp, 3 * config.arming_samples * config.period)) {}

  bool reached(const TickState& state) noexcept {
    ++result_.ticks;
    result_.phase = state.phase;
    switch (state.phase) {
      case Phase::kParked: return true;
      case Phase::kStopped:
        result_.cause = state.cause;
        result_.cause_tick = state.cause_tick;
        return state.tick - state.cause_tick >= ticks(kSeeTheHold);
      case Phase::kDisarmed:
        result_.cause = state.tripped.first();
        result_.cause_tick = state.tick;
        return ++disarmed_ > ticks(patience_);
      default:
        result_.cause = Check::kCount;
        result_.cause_tick = -1;
        return false;
    }
  }

  RunResult result(std::int64_t wall) const noexcept {
    RunResult r = result_;
    r.wall = static_cast<double>(wall) * kSecondPerNanosecond;
    r.simulated = static_cast<double>(r.ticks * period_) * kSecondPerNanosecond;
    return r;
  }

 private:
  static constexpr std::int64_t kSeeTheHold = 1'000'000'000;  // [ns]
  static constexpr std::int64_t kGiveUp = 5'000'000'000;      // [ns] disarmed, at least

  std::int64_t ticks(std::int64_t ns) const noexcept { return ns / period_; }

  std::int64_t period_;    // [ns]
  std::int64_t patience_;  // [ns]
  std::int64_t disarmed_ = 0;
  RunResult result_;
};

}  // namespace ves
