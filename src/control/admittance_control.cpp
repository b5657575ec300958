// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/admittance_control.hpp"

#include <algorithm>

#include "ves/control/motion_plan.hpp"

namespace ves {
namespace {

constexpr double kStraight = 1e-4;  // [m, rad] what a gentle acceleration does in a period

/// Limits that a pose within keeps away from by more than what kStraight may change.
SafetyLimits inside(SafetyLimits limits) {
  constexpr double kMargin = 5.0 * kStraight;  // [m, rad] of a leg, of an angle at its ends
  limits.translation -= kMargin;
  limits.rotation -= kMargin;
  limits.leg_min += kMargin;
  limits.leg_max -= kMargin;
  limits.joint_cone -= kMargin;
  limits.leg_clearance += kMargin;
  limits.plate_angle += kMargin;
  limits.condition *= 1.0 - 10.0 * kMargin;
  return limits;
}

}  // namespace

AdmittanceControl::AdmittanceControl(const ControllerConfig& config)
    : model_(config.vehicle, config.periodSeconds()),
      frame_(config),
      hindsight_(config.periodSeconds()),
      inertia_(config.compensation.inertia),
      aided_(config.compensation.aided),
      wrench_delay_(wrenchDelay(config.servo, config.periodSeconds())),
      port_(config),
      energy_(config),
      change_(config.periodSeconds(), config.passivity.damping),
      period_(config.periodSeconds()),
      joint_moves_(config.stillness.joint),
      braking_(config.gentle.braking),
      slow_(std::min(config.safety.leg_velocity, config.safety.flow / config.safety.bore_area)),
      inside_(inside(config.safety), config.geometry) {
  constexpr double kTurns = 2.0;  // [-] angular velocity per rates of the fixed angles, at most
  for (const Vec3& joint : config.geometry.p_PPi_P)
    reach_ = std::max(reach_, kTurns * joint.norm());
}

void AdmittanceControl::begin(const Vec6& x, const Mat6& M_1, double age, double share) noexcept {
  change_.finish(model_);
  ahead_ = inertia_ ? age + share * wrench_delay_ : 0.0;
  if (frame_.enabled()) {
    model_.reset(frame_.emulated(x), rotated(frame_.laboratory().X.R, M_1), ahead_);
    frame_.begin(model_.bodyMotion());
  } else {
    model_.reset(x, M_1, ahead_);
  }
  begins_ = true;
  unknown_ = asShown() ? 2 : 1;
  shaken_ = 0.0;
  oscillation_.reset();
  port_.reset();
  energy_.reset();
}

void AdmittanceControl::change(const VehicleOrder& order, bool emulated) noexcept {
  change_.begin(order, model_);
  if (!emulated) change_.finish(model_);
}

const PathPoint<6>& AdmittanceControl::step(const AdmittanceInput& in, const PathPoint<6>& last,
                                            const PathChecks& checks) noexcept {
  if (in.F_Po_E.stacked().allFinite()) {
    const double since = begins_ ? std::min(in.wrench.since, period_) : in.wrench.since;
    begins_ = false;
    if (unknown_ > 0) {
      --unknown_;
      if (aided_) hindsight_.reset(model_, in.lesson);
    }
    change_.advance(model_);
    const double ahead = inertia_ ? in.wrench.age + in.share * wrench_delay_ : 0.0;
    if (frame_.enabled()) {  // as far as what is shown goes, late as a tick may be
      const bool steady = frame_.steadyInContact() && in.touches;
      model_.countFrom(frame_.along(model_.atWrench().X.p, ahead_));
      frame_.step(last, model_.coasting(), steady ? 0.0 : in.share, since + ahead - ahead_);
    }
    ahead_ = ahead;
    const double damping = energy_.damping() + change_.damping();
    if (inertia_)
      model_.step(in.F_Po_E, in.body, since, ahead, damping);
    else
      model_.step(in.F_Po_E, damping);
    if (aided_) {
      hindsight_.step(model_, in.body.M_1, since, in.lesson);
      if (hindsight_.any()) model_.displace(hindsight_.due());
    }
    shown_ = frame_.enabled() ? frame_.shown(model_.bodyMotion()) : model_.motion();
    slowInsideEnvelope(last, in.L, checks);
    // Each is paid by its share of the damping.
    const double for_change =
        change_.damping() > 0.0 ? model_.damped() * (change_.damping() / damping) : 0.0;
    change_.pay(for_change);
    energy_.take({model_.taken(in.F_Po_E), model_.takenOfNoise(in.noise), model_.dissipated(),
                  model_.damped() - for_change, model_.kineticEnergy()},
                 port_.take(in.at_port, in.wrench.time, in.X_IP, in.servo));
    const SafetyLimits& limits = checks.limits();
    const bool held = scale_ < 1.0 && model_.kineticEnergy() > limits.growth_floor;
    shaken_ += model_.shaken();
    oscillation_.take(limits, model_.energy() - shaken_, held, in.q, joint_moves_, period_);
  }
  return shown_;
}

/// Slows the motion as a whole, never one leg, so that it can always come to rest, braking gently
/// along its path, where every path check still passes. A laboratory that flies is what is slowed,
/// else the vehicle.
void AdmittanceControl::slowInsideEnvelope(const PathPoint<6>& from, const Vec6& L,
                                           const PathChecks& checks) noexcept {
  const Geometry& geometry = checks.geometry();
  const Vec6 last = from.x, step = shown_.x - last, rate = shown_.x_dot;
  const auto fits = [&](double scale) {
    const Vec6 v = scale * rate;  // that a braking motion would begin with
    const double brake_time = brakeTime(v, braking_);
    const Pose next = Pose::from(last + scale * step);
    const Pose rest = Pose::from(last + scale * step + 0.5 * brake_time * v);
    const Transform X_rest = geometry.fromHome(rest);
    const Vec6 L_next = legLengths(geometry, geometry.fromHome(next)),
               L_rest = legLengths(geometry, X_rest);
    if (checks.step(L_next, L, period_).any()) return false;
    // Near a limit the next pose may be beyond it, though braking leads back.
    if (inside_.pose(X_rest, rest, L_rest).any() &&
        (checks.pose(X_rest, rest, L_rest).any() ||
         checks.pose(geometry.fromHome(next), next, L_next).any()))
      return false;
    // Where the rate leads elsewhere than the step did, between the two.
    const bool turns = !((scale * step - period_ * v).norm() <= kStraight);
    if (turns && checks.pose(geometry.fromHome(next), next, L_next).any()) return false;
    // No braking is faster than the rate that it begins with.
    if (v.head<3>().norm() + reach_ * v.tail<3>().norm() <= slow_) return true;
    const Pose then = Pose::from(last + scale * step + period_ * v);
    return !checks.step(legLengths(geometry, geometry.fromHome(then)), L_next, period_).any();
  };
  scale_ = 1.0;
  if (fits(1.0)) return;
  constexpr int kHalvings = 10;
  double low = 0.0, high = 1.0;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (fits(middle) ? low : high) = middle;
  }
  scale_ = low;
  if (!frame_.enabled()) {
    model_.slow(low);
    shown_ = model_.motion();
    const auto passes = [&] {
      const Pose next = Pose::from(shown_.x);
      const Transform X_next = geometry.fromHome(next);
      const Vec6 L_next = legLengths(geometry, X_next);
      return !checks.step(L_next, L, period_).any() && !checks.pose(X_next, next, L_next).any();
    };
    // A body turns the shortest way, which is not where its fixed angles go straight.
    constexpr int kTries = 20;
    for (int i = 1; i <= kTries && !passes(); ++i) {
      const double less = i < kTries ? 0.95 : 0.0;
      model_.slow(less);
      shown_ = model_.motion();
      scale_ *= less;
    }
    return;
  }
  shown_.x = last + low * step;
  shown_.x_dot = low * rate;
  shown_.x_ddot = (shown_.x_dot - from.x_dot) / period_;
  frame_.yield(model_.bodyMotion(), shown_);
}

}  // namespace ves
