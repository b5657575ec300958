// SPDX-License-Identifier: BSD-3-Clause
#include "ves/vehicle/propulsion.hpp"

#include <algorithm>

namespace ves {

double ReactionWheel::momentum(double t) const noexcept {
  double taken = 0.0;
  for (int i = 0; i < size; ++i) {
    const WheelTorque& one = torques[static_cast<std::size_t>(i)];
    taken -= one.torque * std::clamp(t - one.on.from, 0.0, one.on.until - one.on.from);
  }
  return taken;
}

Vec3 wheelMomentum(const Propulsion& propulsion, double t) noexcept {
  Vec3 sum = Vec3::Zero();
  for (int i = 0; i < propulsion.wheel_count; ++i) {
    const ReactionWheel& wheel = propulsion.wheels[static_cast<std::size_t>(i)];
    sum += wheel.momentum(t) * wheel.axis_P;
  }
  return sum;
}

Pulses pulsesOf(const AttitudeHold& hold, const Pulses& before, const Vec3& turn,
                const Vec3& w) noexcept {
  Pulses out = before;
  if (!(hold.dead_band > 0.0)) return out;
  for (int i = 0; i < 3; ++i) {
    if (out.left(i) > 0.0) continue;
    const double side = turn(i) > hold.dead_band ? 1.0 : turn(i) < -hold.dead_band ? -1.0 : 0.0;
    if (side == 0.0 || side * w(i) < 0.0) continue;
    out.left(i) = hold.pulse;
    out.sense(i) = -side;
  }
  return out;
}

Pulses spent(const Pulses& pulses, double dt) noexcept {
  constexpr double kNone = 1e-12;  // [s] that rounding leaves
  Pulses out = pulses;
  for (int i = 0; i < 3; ++i) out.left(i) = out.left(i) - dt > kNone ? out.left(i) - dt : 0.0;
  return out;
}

Wrench thrust(const Propulsion& propulsion, const Pulses& pulses, double t, double dt) noexcept {
  Wrench sum;
  if (!(dt > 0.0)) return sum;
  for (int i = 0; i < propulsion.size; ++i) {
    const Thruster& thruster = propulsion.thrusters[static_cast<std::size_t>(i)];
    double fires = 0.0;  // [s]
    for (int k = 0; k < thruster.size; ++k) {
      const Firing& one = thruster.firings[static_cast<std::size_t>(k)];
      fires += std::max(0.0, std::min(one.until, t + dt) - std::max(one.from, t));
    }
    const Vec3 force = fires / dt * thruster.force_P;
    sum = sum + Wrench{force, thruster.p_PoT_P.cross(force)};
  }
  for (int i = 0; i < 3; ++i)
    sum.n(i) += pulses.sense(i) * propulsion.hold.torque_P(i) * (std::min(pulses.left(i), dt) / dt);
  return sum;
}

}  // namespace ves
