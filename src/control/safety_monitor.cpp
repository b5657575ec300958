// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/safety_monitor.hpp"

#include <cmath>

namespace ves {

void SafetyMonitor::watch(const Elapsed& elapsed, const SampleStream& samples,
                          const Vec6& static_counts) noexcept {
  missed_ = elapsed.missed;
  overruns_.take(elapsed.tick, elapsed.missed);
  if (samples.fresh()) frozen_.take(samples.sample().adc, static_counts);
}

Checked SafetyMonitor::check(const Proposal& p, const LegContext& context,
                             const SampleStream& samples, const LegEstimator& legs,
                             const Wrench& dynamic, const Oscillation& oscillation,
                             bool conflict) const noexcept {
  const SafetyLimits& limits = checks_.limits();
  const Sample& sample = samples.sample();
  const Measured& m = legs.measured();
  Tripped t = checks_.pose(p.X_IP, Pose::from(p.x.x), p.legs.L) |
              checks_.step(p.legs.L, context.last, period_);
  t.require(Check::kPanicButton, sample.switches & kPanicButtonClosed);
  t.require(Check::kFloorMat, sample.switches & kFloorMatClosed);
  t.require(Check::kFinite, p.x.x.allFinite() && p.x.x_dot.allFinite() && p.x.x_ddot.allFinite() &&
                                p.legs.L.allFinite() && sample.q.allFinite() &&
                                dynamic.stacked().allFinite());
  t.require(Check::kStale, sample.sequence >= 0 && samples.age() <= limits.stale_ticks &&
                               pieceAgeCheck(limits, sample, period_));
  t.require(Check::kDevice, sample.faults == 0);
  t.require(Check::kOverrun, overruns_.good(limits, std::llround(1.0 / period_)));
  t.require(Check::kLeftAlone, leftAloneCheck(limits, missed_, period_));
  t.require(Check::kLegReading, legs.readings().good(checks_.limits()));
  t.require(Check::kForwardKinematics, m.solved);
  t.require(Check::kPositionError,
            positionErrorCheck(limits, context.expected, m.L, legs.recentSpeed()));
  t.require(Check::kPressure, pressureCheck(limits, sample.adc));
  t.require(Check::kSensorSaturated, saturationCheck(sample.adc));
  t.require(Check::kSensorFrozen, frozen_.good(limits));
  t.require(Check::kOscillation, oscillation.good(limits));
  t.require(Check::kConflictingNode, !conflict);
  return {p, t};
}

}  // namespace ves
