// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/leg_commander.hpp"

namespace ves {

LegCommander::LegCommander(const ControllerConfig& config)
    : codec_(config.legs),
      compensation_(config.compensation),
      period_(config.periodSeconds()),
      leg_min_(config.safety.leg_min),
      leg_max_(config.safety.leg_max) {}

void LegCommander::send(const Checked& next, std::int32_t segment, double share,
                        const ServoObserver& servo, double age) noexcept {
  if (!next.passes()) {
    hold();
    return;
  }
  legs_ = next.proposal().legs;
  ahead_ = next.proposal().x.ahead;
  reference_ = referenceOf(legs_, ahead_, share, servo, age);
  // What rounding leaves goes with the next command; at rest it would only make the legs hum.
  const bool carries = compensation_.observer && share == 1.0 && ahead_ > 0.0;
  if (!carries) rounding_residual_.setZero();
  command_.engaged = true;
  command_.segment = segment;
  command_.counts = legCounts(codec_, reference_ + rounding_residual_);
  command_.rest = compensation_.any() ? legCounts(codec_, legs_.L) : command_.counts;
  command_.ahead = std::llround(ahead_ * 1e9);
  rounding_residual_ += reference_ - legLengths(codec_, command_.counts);
}

void LegCommander::hold() noexcept {
  legs_.L_dot.setZero();
  legs_.L_ddot.setZero();
  ahead_ = 0.0;
  reference_ = legs_.L;
  friction_.settle();
  rounding_residual_.setZero();
  command_.counts = command_.rest;
  command_.ahead = 0;
}

void LegCommander::release(const LegMotion& legs) noexcept {
  command_.engaged = false;
  command_.segment = -1;
  if (legs.L.allFinite()) {
    legs_ = legs;
    command_.rest = legCounts(codec_, legs.L);
  }
  friction_.reset();  // as the servos' model begins
  hold();
}

Vec6 LegCommander::expected(double share) const noexcept {
  if (!compensation_.feed_forward) return legs_.L;
  return legs_.L + share * (period_ - ahead_) * legs_.L_dot;
}

/// [m] of E that friction takes while this command is held.
Vec6 LegCommander::rubbing(const ServoModel& servo, const LegMotion& legs, double ahead) noexcept {
  if (servo.friction.isZero(0.0)) return Vec6::Zero();
  Vec6 v;
  for (int i = 0; i < kLegs; ++i)
    v(i) = legs.L_dot(i) + commandDelay(servo, i, ahead, period_) * legs.L_ddot(i);
  return friction_.turn(servo, v, period_);
}

/// The legs' lengths, or what takes the legs there; inside the limits in any case.
Vec6 LegCommander::referenceOf(const LegMotion& legs, double ahead, double share,
                               const ServoObserver& servo, double age) noexcept {
  if (!compensation_.any()) return legs.L;
  Vec6 L = legs.L;
  if (compensation_.feed_forward)
    L = feedForward(servo.model(), legs, ahead, period_, share,
                    rubbing(servo.model(), legs, ahead));
  if (compensation_.observer) L += share * servo.rounding(legs.L_dot, age);
  return L.cwiseMax(leg_min_).cwiseMin(leg_max_);
}

}  // namespace ves
