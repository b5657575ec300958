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

Checked SafetyMonitor::check(const Proposal& p, const Findings& now) const noexcept {
  const Tripped path = checks_.pose(p.X_IP, Pose::from(p.x.x), p.legs.L) |
                       checks_.step(p.legs.L, now.context.last, period_);
  Tripped tripped;
  for (const CheckMeaning& one : kChecks)
    tripped.require(one.check, holds(one.check, p, now, path));
  return {p, tripped};
}

bool SafetyMonitor::holds(Check check, const Proposal& p, const Findings& now,
                          Tripped path) const noexcept {
  const SafetyLimits& limits = checks_.limits();
  const Sample& sample = now.samples.sample();
  switch (check) {
    case Check::kPanicButton: return sample.switches & kPanicButtonClosed;
    case Check::kFloorMat: return sample.switches & kFloorMatClosed;
    case Check::kFinite:
      return p.x.x.allFinite() && p.x.x_dot.allFinite() && p.x.x_ddot.allFinite() &&
             p.legs.L.allFinite() && sample.q.allFinite() && now.dynamic.stacked().allFinite();
    case Check::kStale:
      return sample.sequence >= 0 && now.samples.age() <= limits.stale_ticks &&
             pieceAgeCheck(limits, sample, period_);
    case Check::kDevice: return sample.faults == 0;
    case Check::kOverrun: return overruns_.good(limits, std::llround(1.0 / period_));
    case Check::kLeftAlone: return leftAloneCheck(limits, missed_, period_);
    case Check::kLegReading: return now.legs.readings().good(limits);
    case Check::kForwardKinematics: return now.legs.measured().solved;
    case Check::kPositionError:
      return positionErrorCheck(limits, now.context.expected, now.legs.measured().L,
                                now.legs.recentSpeed());
    case Check::kPressure: return pressureCheck(limits, sample.adc);
    case Check::kSensorSaturated: return saturationCheck(sample.adc);
    case Check::kSensorFrozen: return frozen_.good(limits);
    case Check::kOscillation: return now.oscillation.good(limits);
    case Check::kMotionLimits:
    case Check::kActuatorLimits:
    case Check::kJointLimits:
    case Check::kCollide:
    case Check::kConditioning:
    case Check::kVelocity:
    case Check::kFlow: return !path.has(check);
    case Check::kConflictingNode: return !now.conflict;
    case Check::kCount: break;
  }
  return false;
}

}  // namespace ves
