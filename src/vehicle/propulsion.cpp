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

void Firings::add(const Wrench& F_P, double share, int bit) noexcept {
  constexpr double kNone = 1e-9;  // [-] that rounding leaves
  if (!(share > kNone)) return;
  mean = mean + Wrench::from(share * F_P.stacked());
  on |= 1u << static_cast<unsigned>(bit);
}

namespace {

Firing both(const Firing& a, const Firing& b) noexcept {
  return {std::max(a.from, b.from), std::min(a.until, b.until)};
}

double length(const Firing& one) noexcept { return std::max(0.0, one.until - one.from); }

}  // namespace

Firings firings(const Propulsion& propulsion, const Pulses& pulses,
                std::span<const OrderedFiring> ordered, double t, double dt) noexcept {
  Firings out;
  if (!(dt > 0.0)) return out;
  const Firing window{t, t + dt};
  for (int i = 0; i < propulsion.size; ++i) {
    const Thruster& thruster = propulsion.thrusters[static_cast<std::size_t>(i)];
    const std::span schedule(thruster.firings.data(), static_cast<std::size_t>(thruster.size));
    double on = 0.0;  // [s]
    for (const Firing& one : schedule) on += length(both(one, window));
    for (const OrderedFiring& order : ordered) {
      if (order.thruster != i) continue;
      const Firing more = both(order.on, window);
      on += length(more);
      for (const Firing& one : schedule) on -= length(both(one, more));
    }
    out.add({thruster.force_P, thruster.p_PoT_P.cross(thruster.force_P)}, on / dt, i);
  }
  for (int i = 0; i < 3; ++i) {
    Wrench couple;
    couple.n(i) = pulses.sense(i) * propulsion.hold.torque_P(i);
    out.add(couple, std::min(pulses.left(i), dt) / dt, kMostThrusters + i);
  }
  return out;
}

}  // namespace ves
