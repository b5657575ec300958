// SPDX-License-Identifier: BSD-3-Clause
//
// What a workspace asks of a platform's legs and joints, and the limits that follow from it: for
// machines of another size than the report's.
#pragma once

#include "ves/control/safety_checks.hpp"
#include "ves/control/servo.hpp"
#include "ves/kinematics/stewart.hpp"

namespace ves {

/// The two legs whose axes come nearest.
struct LegGap {
  int first = 0, second = 0;
  double distance = 0.0;  // [m]
};
LegGap nearestLegs(const Geometry& geometry, const Transform& X_IP);

/// The leg that lies flattest on the base or on the platform.
struct LegSlope {
  int leg = 0;
  double angle = 0.0;  // [rad] between leg and plate; negative: it goes through
};
LegSlope flattestLeg(const Geometry& geometry, const Transform& X_IP);

/// [rad] by which a leg turns most in one of its two joints, from where it is at home.
double largestJointAngle(const Geometry& geometry, const Transform& X_IP);

/// Extremes over a workspace: home, each coordinate alone as far as it may go, and all six at once
/// half as far.
struct WorkspaceUse {
  Vec6 leg_least = Vec6::Zero();  // [m]
  Vec6 leg_most = Vec6::Zero();   // [m]
  double joint_angle = 0.0;       // [rad] largest
  double clearance = 0.0;         // [m] least
  Vec6 nearest = Vec6::Zero();    // [m, rad] where
  double plate_angle = 0.0;       // [rad] least
  double condition = 0.0;         // [-] largest
  Vec6 worst = Vec6::Zero();      // [m, rad] where
};
/// `translation` [m] and `rotation` [rad] of each coordinate from home, either way.
WorkspaceUse workspaceUse(const Geometry& geometry, double translation, double rotation);

/// The legs that such a workspace takes, with a twentieth of their travel to spare at either end.
struct Stroke {
  double min = 0.0, max = 0.0;  // [m]
};
Stroke derivedStroke(const WorkspaceUse& use);

/// [m] the length that reads 0, such that the middle of the stroke is the middle of the transducer.
double derivedOffset(const Stroke& stroke, double metre_per_count);

/// Limits of the safety checks that follow from the geometry and the servos: translation and
/// rotation as given; lengths, joints, clearances, condition, speed and errors derived; the rest 0.
SafetyLimits derivedLimits(const WorkspaceUse& use, const Stroke& stroke, const ServoModel& servo);

/// How far one coordinate goes alone from home, and the check that ends it there.
struct Travel {
  double distance = 0.0;  // [m | rad] along the sign asked for
  Check ends = Check::kCount;
};
/// `coordinate` 0..5 of {x, y, z, alpha, beta, gamma}; looks no farther than `farthest` [m | rad],
/// where kMotionLimits ends it.
Travel travel(const Geometry& geometry, const SafetyLimits& limits, int coordinate, double sign,
              double farthest);

}  // namespace ves
