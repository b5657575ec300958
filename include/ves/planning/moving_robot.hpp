// SPDX-License-Identifier: BSD-3-Clause
//
// The simulated robot: how its joints move, and what it holds.
#pragma once

#include <variant>

#include "ves/planning/joint_paths.hpp"

namespace ves {

/// A joint trajectory that a tool path was planned as.
struct ToolMove {
  std::shared_ptr<const JointTrajectory> joints;

  bool operator==(const ToolMove& other) const {
    return joints == other.joints || (joints && other.joints && *joints == *other.joints);
  }
};

/// A body that a link carries from now on, rigidly and at once; it moves with the link already.
struct Grasp {
  int link = -1;   // [-] index of the link; -1: link 0
  RigidBody body;  // in the link's frame

  bool operator==(const Grasp&) const = default;
};

/// The hand closes on what floats before it (contact/environment.hpp), which is no part of the
/// robot.
struct GraspTarget {
  bool operator==(const GraspTarget&) const = default;
};

using RobotAction = std::variant<RobotMove, ToolMove, Grasp, GraspTarget, Release>;

double durationOf(const RobotAction& action) noexcept;  // [s]
RobotAction slower(const RobotAction& action, double times);

class MovingRobot {
 public:
  /// At rest at q, with nothing in hand.
  MovingRobot(const RobotModel& robot, const JointVector& q) noexcept
      : robot_(robot), joints_(robot.joints, q) {}

  /// Begins at `now` [ns]. Refused (false) where JointPaths refuses, for a second body in hand, a
  /// link that is not there, a target, and a release of nothing.
  bool begin(const RobotAction& action, std::int64_t now) noexcept;

  /// `later` [s] after `now` [ns].
  JointState at(std::int64_t now, double later = 0.0) const noexcept {
    return joints_.at(now, later);
  }
  bool moving(std::int64_t now) const noexcept { return joints_.moving(now); }

  /// With what it holds counted into the link that carries it.
  const RobotModel& model() const noexcept { return robot_; }
  bool holds() const noexcept { return held_; }

 private:
  RobotModel robot_;
  JointPaths joints_;
  bool held_ = false;
  int carrier_ = -1;      // [-] link that holds it,
  RigidBody empty_hand_;  // and its body without
};

}  // namespace ves
