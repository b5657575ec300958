// SPDX-License-Identifier: BSD-3-Clause
//
// The safety checks that can be asked of a path before it is commanded: those of a pose, and those
// of going from one pose to the next.
#pragma once

#include "ves/control/safety_checks.hpp"

namespace ves {

class PathChecks {
 public:
  PathChecks(const SafetyLimits& limits, const Geometry& geometry)
      : limits_(limits),
        geometry_(geometry),
        joint_axes_(geometry),
        joint_radius_(jointRadius(geometry)) {}

  /// Of the pose X_IP, which is x about home and takes the lengths L.
  Tripped pose(const Transform& X_IP, const Pose& x, const Vec6& L) const noexcept {
    const LegLines lines = legLines(geometry_, X_IP);
    Tripped t;
    t.require(Check::kMotionLimits, motionLimitsCheck(limits_, x));
    t.require(Check::kActuatorLimits, actuatorLimitsCheck(limits_, L));
    t.require(Check::kJointLimits, joint_axes_.check(limits_, X_IP.R, lines));
    t.require(Check::kCollide, collideCheck(limits_, geometry_, X_IP, lines));
    t.require(Check::kConditioning, conditioningCheck(limits_, lines, joint_radius_));
    return t;
  }

  /// Of going from one set of lengths to another in `time` [s].
  Tripped step(const Vec6& L, const Vec6& L_last, double time) const noexcept {
    Tripped t;
    t.require(Check::kVelocity, velocityCheck(limits_, L, L_last, time));
    t.require(Check::kFlow, flowLimitsCheck(limits_, L, L_last, time));
    return t;
  }

  const SafetyLimits& limits() const noexcept { return limits_; }
  const Geometry& geometry() const noexcept { return geometry_; }

 private:
  SafetyLimits limits_;
  Geometry geometry_;
  JointAxes joint_axes_;
  double joint_radius_;  // [m]
};

}  // namespace ves
