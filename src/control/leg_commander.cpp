// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/leg_commander.hpp"

namespace ves {

LegCommander::LegCommander(const ControllerConfig& config)
    : codec_(config.legs),
      compensation_(config.compensation),
      period_(config.periodSeconds()),
      leg_min_(config.safety.leg_min),
      leg_max_(config.safety.leg_max) {}

void LegCommander::command(const LegMotion& legs, bool engaged, std::int32_t segment, double lead,
                           double share, const ServoObserver& servo, double age) noexcept {
  legs_ = legs;
  command_.engaged = engaged;
  command_.segment = segment;
  if (!legs.L.allFinite()) return;
  reference_ = referenceOf(legs, lead, share, servo, age);
  // What rounding leaves goes with the next command; at rest it would only make the legs hum.
  const bool carries = compensation_.observer && share == 1.0 && lead > 0.0;
  if (!carries) rounding_residual_.setZero();
  command_.counts = legCounts(codec_, reference_ + rounding_residual_);
  rounding_residual_ += reference_ - legLengths(codec_, command_.counts);
}

void LegCommander::hold() noexcept {
  legs_.L_dot.setZero();
  legs_.L_ddot.setZero();
}

Vec6 LegCommander::expected(double lead, double share) const noexcept {
  if (!compensation_.feed_forward) return legs_.L;
  return legs_.L + share * (period_ - lead) * legs_.L_dot;
}

/// The legs' lengths, or what takes the legs there. Inside the limits in any case: should no
/// further command come, the legs end where they were told.
Vec6 LegCommander::referenceOf(const LegMotion& legs, double lead, double share,
                               const ServoObserver& servo, double age) const noexcept {
  if (!compensation_.any()) return legs.L;
  Vec6 L = legs.L;
  if (compensation_.feed_forward) L = feedForward(servo.model(), legs, lead, period_, share);
  if (compensation_.observer && command_.engaged) L += share * servo.rounding(legs.L_dot, age);
  return L.cwiseMax(leg_min_).cwiseMin(leg_max_);
}

}  // namespace ves
