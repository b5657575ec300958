// SPDX-License-Identifier: BSD-3-Clause
//
// When a run is over, and how it ended.
#pragma once

#include <algorithm>

#include "ves/run/run.hpp"

namespace ves {

/// Decides when a run is over: parked; asked to stop while nothing is armed. And, where nobody
/// gives orders: a while after a trip, so that the hold is seen; or never armed.
class RunMonitor {
 public:
  explicit RunMonitor(const ControllerConfig& config, bool attended = false)
      : attended_(attended),
        period_(config.period),
        patience_(std::max(kGiveUp, 3 * config.arming_samples * config.period)) {}

  /// `request` is what the next tick would be asked.
  bool reached(const TickState& state, Request request) noexcept {
    ++result_.ticks;
    last_tick_ = state.tick;
    result_.phase = state.phase;
    result_.aborted = state.aborted;
    result_.aborted_by = state.aborted_by;
    const bool stop = request == Request::kStop;
    if (request == Request::kHold) attended_ = true;
    switch (state.phase) {
      case Phase::kParked: return true;
      case Phase::kStopped:
        result_.cause = state.cause;
        result_.cause_tick = state.cause_tick;
        return stop || (!attended_ && state.tick - state.cause_tick >= ticks(kSeeTheHold));
      case Phase::kDisarmed:
        result_.cause = state.tripped.first();
        result_.cause_tick = state.tick;
        result_.let_go = stop;
        return stop || (!attended_ && ++disarmed_ > ticks(patience_));
      default:
        result_.cause = Check::kCount;
        result_.cause_tick = -1;
        return false;
    }
  }

  RunResult result(std::int64_t wall) const noexcept {
    RunResult r = result_;
    r.wall = static_cast<double>(wall) * kSecondPerNanosecond;
    r.simulated = static_cast<double>((last_tick_ + 1) * period_) * kSecondPerNanosecond;
    return r;
  }

 private:
  static constexpr std::int64_t kSeeTheHold = 1'000'000'000;  // [ns]
  static constexpr std::int64_t kGiveUp = 5'000'000'000;      // [ns] disarmed, at least

  std::int64_t ticks(std::int64_t ns) const noexcept { return ns / period_; }

  bool attended_;
  std::int64_t period_;    // [ns]
  std::int64_t patience_;  // [ns]
  std::int64_t disarmed_ = 0;
  std::int64_t last_tick_ = -1;
  RunResult result_;
};

}  // namespace ves
