// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/residual_noise.hpp"

#include <algorithm>
#include <cmath>

#include "ves/math/dense.hpp"
#include "ves/robot/momentum.hpp"

namespace ves {

SensorCounts::SensorCounts(const ForceSensor& sensor)
    : X_SP_(inverse(sensor.X_PS)), S_proc_(inverse(sensor.C_proc)), C_proc_(sensor.C_proc) {}

Mat6 SensorCounts::perWrench(const Mat3& R_IP) const noexcept {
  Mat6 out;
  for (int i = 0; i < 6; ++i)
    out.col(i) =
        S_proc_ * transfer(X_SP_, rotate(R_IP.transpose(), Wrench::from(Vec6::Unit(i)))).stacked();
  return out;
}

Wrench SensorCounts::wrench(const Vec6& counts) const noexcept {
  return transfer(inverse(X_SP_), Wrench::from(C_proc_ * counts));
}

Vec6 ResidualNoise::ofMean(int samples) const noexcept {
  // Where no noise dithers them, what a count leaves out stays the same from sample to sample.
  const auto undithered = (-4.0 * M_PI * M_PI * sensor.variance.array()).exp() / 12.0;
  return sensor.ofMean(samples) + undithered.matrix() + weight + (joints / samples).cwiseAbs2();
}

NoiseOfResidual::NoiseOfResidual(const ControllerConfig& config)
    : geometry_(config.geometry),
      servo_(config.servo),
      period_(config.periodSeconds()),
      rounding_(config.servo.readings.scale.maxCoeff() / std::sqrt(12.0)),
      least_correlation_(filteredCorrelation(config.servo, config.periodSeconds())),
      joint_speed_(JointParabola(config).speed * config.joints.deviation),
      X_PL0_(config.payload.X_PL0()),
      counts_(config.sensor) {}

/// A leg that is early or late by an update of its LegSlave is off by K count for that long.
Vec6 NoiseOfResidual::ofMomentum() const noexcept {
  constexpr double kShare = 0.05;  // [-] rms, of a leg that is off by K count for good: measured
  return (kShare * now_.legs).cwiseAbs2() + (M_SQRT1_2 * period_ * now_.joints).cwiseAbs2();
}

/// What a sample's difference of the joints' momentum is off by.
Vec6 NoiseOfResidual::ofJoints(const Input& in) const noexcept {
  Vec6 squared = Vec6::Zero();
  if (joint_speed_.isZero(0.0)) return squared;
  const Mat6 counts = counts_.perWrench(in.X_IP.R);
  for (int i = 0; i < in.carried.joints; ++i) {
    const Wrench one =
        Wrench::from(jointMomentum(in.carried, in.q, joint_speed_(i) * JointVector::Unit(i)));
    squared += (counts * rotate(in.X_IP.R, transfer(X_PL0_, one)).stacked()).cwiseAbs2();
  }
  return M_SQRT2 / period_ * squared.cwiseSqrt();
}

/// A leg whose length is taken wrongly turns the weight; one whose acceleration is, the inertia.
void NoiseOfResidual::refresh(const Input& in) noexcept {
  now_.sensor = in.sensor;
  now_.sensor.correlation = std::max(now_.sensor.correlation, least_correlation_);
  now_.weight.setZero();
  felt_of_legs_.setZero();
  now_.joints = ofJoints(in);
  const double mass = in.M_1(0, 0);
  if (!(mass > 0.0)) return;
  const Vec3 p_PoBcm_I = Vec3(in.M_1(5, 1), in.M_1(3, 2), in.M_1(4, 0)) / mass;
  const Mat6 counts = counts_.perWrench(in.X_IP.R);
  LegMotion one;
  const LegLines lines = legLines(geometry_, in.X_IP);
  one.L = lines.L;
  rates_of_twist_ = lines.J;
  for (int i = 0; i < kLegs; ++i) {
    BodyMotion P;
    one.L_ddot = Vec6::Unit(i);
    if (!forwardMotion(geometry_, in.X_IP, one, P)) return;
    const Vec6 inertial = in.M_1 * (Vec6() << P.a, P.alpha).finished();
    const Vec3 turned = P.alpha.cross(in.weight.f);
    const auto squared = [&](double size, const Wrench& wrench) -> Vec6 {
      return (size * counts * wrench.stacked()).cwiseAbs2();
    };
    now_.weight += squared(rounding_, {turned, p_PoBcm_I.cross(turned)});
    felt_of_legs_.col(i) = counts * inertial;
  }
}

/// A leg that moves takes what it is told sooner or later by up to an update of its LegSlave, and
/// has gone so much farther.
void NoiseOfResidual::refreshLegs(const BodyMotion& P) noexcept {
  constexpr double kKept = 1.0 - 1.0 / ResidualNoise::kLongestMean;  // [-] of the speed of before
  const Vec6 twist = (Vec6() << P.v, P.w).finished();
  leg_speed_ = (rates_of_twist_ * twist).cwiseAbs().cwiseMax(kKept * leg_speed_);
  const Vec6 off =
      steepest(servo_).cwiseProduct(servo_.readings.scale + servo_.update * leg_speed_);
  now_.legs = (felt_of_legs_.cwiseAbs2() * off.cwiseAbs2()).cwiseSqrt();
}

}  // namespace ves
