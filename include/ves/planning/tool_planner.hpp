// SPDX-License-Identifier: BSD-3-Clause
//
// Tool paths as joint trajectories, planned before they begin: KDL's paths, velocity profile,
// Jacobian and inverse kinematics.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ves/planning/joint_paths.hpp"

namespace ves {

/// Where a tool T is led to, in the robot's base L0. It turns evenly along its way.
struct ToolGoal {
  Transform X_L0T;             // its pose at the end
  std::optional<Vec3> via_L0;  // [m] a point of the arc to there; none: a straight line
  double duration = 0.0;       // [s]; 0: by `speed`
  double speed = 0.0;          // [m/s] between the ramps
};

/// X_FL0 of a frame, the platform at X_IP.
Transform baseIn(ToolOrder::Frame frame, const Transform& X_IP, const Transform& X_PL0);

/// The goal of an order: the tool stands at X_L0T, and the robot's base at X_FL0 in the frame of
/// the order.
ToolGoal goalOf(const ToolOrder& order, const Transform& X_FL0, const Transform& X_L0T);

class ToolPlanner {
 public:
  /// The share of a path's duration in which its speed rises, and falls again: a trapezoid.
  static constexpr double kRamp = 0.25;  // [-]

  /// `link` [-] carries the tool, -1: link 0; `fastest` [rad/s | m/s] of each joint, infinite where
  /// nobody knows; `names` of the joints, for messages. A pose is singular where the least singular
  /// value of the Jacobian, lengths by the arm's reach, is below so many times the largest. Throws
  /// InputError when the tool is carried by no joint, or by one that follows another.
  ToolPlanner(const RobotModel& robot, int link, const Transform& X_LinkT,
              const JointVector& fastest, const std::vector<std::string>& names, double singular);
  ~ToolPlanner();
  ToolPlanner(const ToolPlanner&) = delete;
  ToolPlanner& operator=(const ToolPlanner&) = delete;

  /// X_L0T.
  Transform pose(const JointVector& q) const;

  /// Joint values inside their limits that put the tool there, the nearest to `near` of those that
  /// are found from many starts. Joints that do not carry the tool stay.
  std::optional<JointVector> inverse(const Transform& X_L0T, const JointVector& near) const;

  /// From rest at q0 to rest. Throws InputError, with the time at which the path leaves the joints'
  /// limits or speeds, is singular or out of reach.
  JointTrajectory plan(const JointVector& q0, const ToolGoal& goal) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ves
