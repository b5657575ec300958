// SPDX-License-Identifier: BSD-3-Clause
//
// What a body that floats pushes itself with: thrusters that fire by a schedule, and couples of
// them that hold its attitude within a dead band. Beyond the report.
#pragma once

#include <array>

#include "ves/math/frames.hpp"

namespace ves {

/// Since the vehicle was let go.
struct Firing {
  double from = 0.0, until = 0.0;  // [s]

  bool operator==(const Firing&) const = default;
};

struct Thruster {
  static constexpr int kMost = 16;         // [-] of a body
  static constexpr int kMostFirings = 64;  // [-] of each

  Vec3 p_PoT_P = Vec3::Zero();  // [m]
  Vec3 force_P = Vec3::Zero();  // [N]
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

struct Propulsion {
  std::array<Thruster, Thruster::kMost> thrusters{};
  int size = 0;  // [-] of them
  AttitudeHold hold;

  bool any() const noexcept { return size > 0 || hold.dead_band > 0.0; }
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

/// The mean of what fires from t on over dt [s], about Po in P.
Wrench thrust(const Propulsion& propulsion, const Pulses& pulses, double t, double dt) noexcept;

}  // namespace ves
