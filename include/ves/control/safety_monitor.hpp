// SPDX-License-Identifier: BSD-3-Clause
//
// All safety checks of a tick, collected into one set.
#pragma once

#include "ves/control/checked.hpp"
#include "ves/control/leg_estimator.hpp"
#include "ves/control/path_checks.hpp"

namespace ves {

/// Where a tick's command finds the legs. [m]
struct LegContext {
  Vec6 last;      // commanded before
  Vec6 expected;  // where they should be now
};

/// What the checks of a tick look at, beside their own memories.
struct Findings {
  const LegContext& context;
  const SampleStream& samples;
  const LegEstimator& legs;
  const Wrench& dynamic;
  const Oscillation& oscillation;
  bool conflict;  // another node was heard on the bus
};

class SafetyMonitor {
 public:
  SafetyMonitor(const SafetyLimits& limits, const Geometry& geometry, double period)
      : checks_(limits, geometry), period_(period) {}

  /// The memories of this tick: late ticks, and the sensor's readings beside those of the static
  /// load [count].
  void watch(const Elapsed& elapsed, const SampleStream& samples,
             const Vec6& static_counts) noexcept;

  /// Every check of Appendix C and beyond, of what would be commanded.
  Checked check(const Proposal& proposal, const Findings& now) const noexcept;

  const PathChecks& path() const noexcept { return checks_; }

 private:
  /// The requirement of one check; `path`: what of the path fails.
  bool holds(Check check, const Proposal& p, const Findings& now, Tripped path) const noexcept;

  PathChecks checks_;
  double period_;  // [s]
  FrozenSensor frozen_;
  Overruns overruns_;
  std::int64_t missed_ = 0;  // [-] ticks before this one
};

}  // namespace ves
