// SPDX-License-Identifier: BSD-3-Clause
//
// Inverse kinematics (Appendix C): the legs of a commanded motion.
#pragma once

#include "ves/kinematics/stewart.hpp"
#include "ves/math/quintic.hpp"

namespace ves {

/// What a tick would command: a pose with its rates, and when it is meant.
struct Proposal {
  Waypoint<6> x;  // coordinates about home
  Transform X_IP;
  LegMotion legs;
};

/// (C.11), (C.12), with rates (2.25) and accelerations (2.31).
inline Proposal inverseKinematics(const Geometry& geometry, const Waypoint<6>& x) noexcept {
  const BodyMotion P = bodyMotion(geometry.home(), Pose::from(x.x), x.x_dot, x.x_ddot);
  return {x, P.X, legMotion(geometry, P)};
}

}  // namespace ves
