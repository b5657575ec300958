// SPDX-License-Identifier: BSD-3-Clause
//
// What a body that floats pushes itself with: thrusters that fire by a schedule and by orders,
// couples of them that hold its attitude within a dead band, and reaction wheels. Beyond the
// report.
#pragma once

#include <array>
#include <span>

#include "ves/contract/order.hpp"
#include "ves/math/frames.hpp"

namespace ves {

/// Since the vehicle was let go.
struct Firing {
  double from = 0.0, until = 0.0;  // [s]

  bool operator==(const Firing&) const = default;
};

struct Thruster {
  static constexpr int kMostFirings = 64;  // [-] of each

  Vec3 p_PoT_P = Vec3::Zero();  // [m]
  Vec3 force_P = Vec3::Zero();  // [N]
  double least_on = 0.0;        // [s]
  std::array<Firing, kMostFirings> firings{};
  int size = 0;  // [-] of them

  bool operator==(const Thruster&) const = default;
};

/// About each axis of P a pulse against the turn, where the body is out of the dead band and does
/// not come back. Turns are those of the rotation vector from home.
struct AttitudeHold {
  double dead_band = 0.0;        // [rad] 0: none
  double pulse = 0.0;            // [s]
  Vec3 torque_P = Vec3::Zero();  // [N m]

  bool operator==(const AttitudeHold&) const = default;
};

/// A torque on the vehicle about a wheel's axis, as long as a firing.
struct WheelTorque {
  Firing on;
  double torque = 0.0;  // [N m]

  bool operator==(const WheelTorque&) const = default;
};

/// A reaction wheel, which stands still beside the vehicle when that is let go, and takes what it
/// gives: the momentum of both stays. Its mass and inertia are the vehicle's.
struct ReactionWheel {
  static constexpr int kMost = 4;          // [-] of a body
  static constexpr int kMostTorques = 32;  // [-] of each

  Vec3 axis_P = Vec3::UnitZ();  // [-] of length one
  std::array<WheelTorque, kMostTorques> torques{};
  int size = 0;  // [-] of them

  /// [N m s] that it has taken by t [s].
  double momentum(double t) const noexcept;

  bool operator==(const ReactionWheel&) const = default;
};

struct Propulsion {
  std::array<Thruster, kMostThrusters> thrusters{};
  int size = 0;  // [-] of them
  AttitudeHold hold;
  std::array<ReactionWheel, ReactionWheel::kMost> wheels{};
  int wheel_count = 0;  // [-] of them

  bool any() const noexcept { return size > 0 || hold.dead_band > 0.0 || wheel_count > 0; }
  bool operator==(const Propulsion&) const = default;
};

/// The pulses of an attitude hold that fire.
struct Pulses {
  Vec3 left = Vec3::Zero();   // [s] of each,
  Vec3 sense = Vec3::Zero();  // [-] and which way
};

/// Begins pulses for a body that is turned by `turn` [rad] and turns at w [rad/s], both in P.
Pulses pulsesOf(const AttitudeHold& hold, const Pulses& before, const Vec3& turn,
                const Vec3& w) noexcept;
/// They fire for dt [s].
Pulses spent(const Pulses& pulses, double dt) noexcept;

/// One by an order; those of one thruster do not overlap. A thruster that its schedule has on too
/// is on once.
struct OrderedFiring {
  int thruster = 0;  // [-]
  Firing on;

  bool operator==(const OrderedFiring&) const = default;
};

struct Firings {
  Wrench mean;           // about Po in P, over the time
  std::uint32_t on = 0;  // as Thrust::on

  void add(const Wrench& F_P, double share, int bit) noexcept;  // [-] of the time
};
/// What fires from t on over dt [s].
Firings firings(const Propulsion& propulsion, const Pulses& pulses,
                std::span<const OrderedFiring> ordered, double t, double dt) noexcept;

/// [N m s] of the wheels beside the body at t [s], in P.
Vec3 wheelMomentum(const Propulsion& propulsion, double t) noexcept;

}  // namespace ves
