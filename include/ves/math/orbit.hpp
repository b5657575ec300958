// SPDX-License-Identifier: BSD-3-Clause
//
// A frame that goes round the Earth in a circle: X away from the Earth, Y along the flight, Z
// normal to the orbit. What floats near its origin moves in it as Clohessy and Wiltshire have it.
// Beyond the report.
#pragma once

#include "ves/math/frames.hpp"

namespace ves {

struct Orbit {
  double rate = 0.0;  // [rad/s] 0: far from everything

  /// Of the frame. [rad/s]
  Vec3 w() const noexcept { return rate * Vec3::UnitZ(); }
  /// [m/s^2] of what is at r [m] and moves at v [m/s].
  Vec3 acceleration(const Vec3& r, const Vec3& v) const noexcept {
    return {rate * (3.0 * rate * r.x() + 2.0 * v.y()), -2.0 * rate * v.x(), -rate * rate * r.z()};
  }
  /// [N m] of the Earth's pull on a body of inertia J [kg m^2] about its centre of mass.
  Vec3 gradient(const Mat3& J) const noexcept {
    return 3.0 * rate * rate * Vec3::UnitX().cross(J.col(0));
  }

  bool operator==(const Orbit&) const = default;
};

}  // namespace ves
