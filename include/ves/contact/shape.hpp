// SPDX-License-Identifier: BSD-3-Clause
//
// Surfaces that a point can touch, each in its own frame B.
#pragma once

#include <variant>

#include "ves/math/frames.hpp"

namespace ves {

/// Everything below z = 0 of B.
struct HalfSpace {
  bool operator==(const HalfSpace&) const = default;
};

struct Ball {
  double radius = 0.0;  // [m] about Bo
  bool operator==(const Ball&) const = default;
};

struct Box {
  Vec3 size = Vec3::Zero();  // [m] edges, about Bo
  bool operator==(const Box&) const = default;
};

/// A half space with a round hole along -z, its edge broken by a chamfer.
struct Socket {
  double radius = 0.0;   // [m]
  double depth = 0.0;    // [m]
  double chamfer = 0.0;  // [m] along z and across, at 45 degrees
  bool operator==(const Socket&) const = default;
};

using Shape = std::variant<HalfSpace, Ball, Box, Socket>;

/// How far a point is from a surface, and which way out.
struct Proximity {
  double distance = 0.0;        // [m] negative inside
  Vec3 normal = Vec3::UnitZ();  // [-] outward
};

/// Of a point p_BQ_B [m]. Inside a box, towards its nearest face.
Proximity proximity(const Shape& shape, const Vec3& p_BQ_B) noexcept;

}  // namespace ves
