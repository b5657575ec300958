// SPDX-License-Identifier: BSD-3-Clause
//
// The force of a compliant contact at one point.
#pragma once

#include "ves/math/frames.hpp"

namespace ves {

/// Stiffness, damping that fades with the penetration, friction that slips.
struct ContactLaw {
  double stiffness = 0.0;    // [N/m^exponent] k
  double exponent = 1.0;     // [-] n: 1 a spring, 1.5 a Hertzian sphere
  double damping = 0.0;      // [s/m] c of Hunt and Crossley
  double friction = 0.0;     // [-] mu of Coulomb
  double slip_speed = 1e-3;  // [m/s] at which friction has 71 % of it

  bool operator==(const ContactLaw&) const = default;
};

/// Normal force [N] at penetration d [m] growing by d_dot [m/s]: k d^n (1 + c d_dot), never a pull
/// (Hunt and Crossley 1975, J. Appl. Mech. 42(2), 440). With n = 1 and c = 0 a spring. 0 for d <=
/// 0.
double normalForce(const ContactLaw& law, double d, double d_dot) noexcept;

/// Force [N] on a point that has sunk by d into a wall with the outward normal n, moving with v
/// against it: the normal force along n, and against the slipping mu times that, regularised:
/// v_t / sqrt(v_t^2 + slip_speed^2).
Vec3 contactForce(const ContactLaw& law, double d, const Vec3& n, const Vec3& v) noexcept;

/// Restitution of a body that arrives with `speed` [m/s], whatever its mass and the stiffness: the
/// first integral of Hunt and Crossley's law, v/c - ln(1 + c v)/c^2, has one value on arrival and
/// on leaving.
double restitution(const ContactLaw& law, double speed) noexcept;

/// [N/m] of a spring on which a mass [kg] that arrives with `speed` [m/s] meets the same peak
/// force, damping aside.
double springLike(const ContactLaw& law, double mass, double speed) noexcept;

/// [J] that a spring so compressed gives back.
double storedEnergy(const ContactLaw& law, double d) noexcept;

}  // namespace ves
