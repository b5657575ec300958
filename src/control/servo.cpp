// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/servo.hpp"

#include <algorithm>
#include <cmath>

namespace ves {
namespace {

/// [m] by which the edge that E opens is open already where the leg rests: more on the side of the
/// slower motion, because the spool rests off the middle. Below zero: what it is still closed by.
double ahead(const ServoModel& servo, int i, double E) noexcept {
  const double up = servo.extend(i), down = servo.retract(i);
  return 2.0 * servo.opening(i) * (E > 0.0 ? down : up) / (up + down);
}

}  // namespace

double speedOf(const ServoModel& servo, int i, double E) noexcept {
  const double K = E > 0.0 ? servo.extend(i) : servo.retract(i);
  if (servo.opening(i) == 0.0) return K * E;
  const double size = std::abs(E), beyond = K * (size + ahead(servo, i, E));
  return std::copysign(servo.opening(i) > 0.0
                           ? std::min((servo.extend(i) + servo.retract(i)) * size, beyond)
                           : std::max(0.0, beyond),
                       E);
}

Vec6 speedsOf(const ServoModel& servo, const Vec6& E) noexcept {
  Vec6 v_end;
  if (servo.opening.isZero(0.0)) {
    for (int i = 0; i < kLegs; ++i)
      v_end(i) = E(i) * (E(i) > 0.0 ? servo.extend : servo.retract)(i);
    return v_end;
  }
  for (int i = 0; i < kLegs; ++i) v_end(i) = speedOf(servo, i, E(i));
  return v_end;
}

double differenceOf(const ServoModel& servo, int i, double v_end) noexcept {
  const double K = v_end > 0.0 ? servo.extend(i) : servo.retract(i);
  if (servo.opening(i) == 0.0) return v_end / K;
  const double size = std::abs(v_end), beyond = size / K - ahead(servo, i, v_end);
  return std::copysign(servo.opening(i) > 0.0
                           ? std::max(size / (servo.extend(i) + servo.retract(i)), beyond)
                           : std::min(kThroughLap * size / K, beyond),
                       v_end);
}

Vec6 steepest(const ServoModel& servo) noexcept {
  return (servo.opening.array() > 0.0)
      .select(servo.extend + servo.retract, servo.extend.cwiseMax(servo.retract));
}

bool nearNull(const ServoModel& servo, int i, double E) noexcept {
  const double K = E > 0.0 ? servo.extend(i) : servo.retract(i);
  return servo.opening(i) > 0.0 &&
         (servo.extend(i) + servo.retract(i) - K) * std::abs(E) < K * ahead(servo, i, E);
}

bool isLapped(const ServoModel& servo, int i, double E) noexcept {
  return servo.opening(i) < 0.0 && std::abs(E) + ahead(servo, i, E) < 0.0;
}

/// z as it goes while the speed stays, z_T behind its mean.
Vec6 SealFriction::turn(const ServoModel& servo, const Vec6& v, double dt) noexcept {
  constexpr double kNone = 1e-9;  // [-] of the way
  const Channels end = v.array().sign(), x = dt / servo.friction_way * v.array().abs(),
                 kept = (-x).exp(),
                 z = end + (z_ - end) * (x > kNone).select((1.0 - kept) / x, 1.0),
                 settled = settled_;
  settled_ += (1.0 - std::exp(-dt / servo.friction_time)) * (z - settled_);
  z_ = end + (z_ - end) * kept;
  return servo.friction.cwiseProduct((z - 0.5 * (settled + settled_)).matrix());
}

Vec6 feedForward(const ServoModel& servo, const LegMotion& legs, double lead, double period,
                 double share, const Vec6& rubs) noexcept {
  Vec6 reference;
  for (int i = 0; i < kLegs; ++i) {
    const double D = commandDelay(servo, i, lead, period);
    const double A = D - servo.reading_age - 0.5 * servo.update;
    const double v = legs.L_dot(i) + D * legs.L_ddot(i);
    const double v_end = v + servo.tau(i) * legs.L_ddot(i);
    const double E = differenceOf(servo, i, v_end) + rubs(i);
    const double forward = A * (legs.L_dot(i) + 0.5 * A * legs.L_ddot(i)) + servo.derivative * v;
    reference(i) = legs.L(i) + share * (forward + std::clamp(E, -servo.rail, servo.rail));
  }
  return reference;
}

}  // namespace ves
