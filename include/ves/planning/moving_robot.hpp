// SPDX-License-Identifier: BSD-3-Clause
//
// The simulated robot: how its joints move, and what it holds.
#pragma once

#include <cmath>
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

/// PushOrder, with the point in the frame of what carries it.
struct Push {
  enum class On { kPlatform, kLink, kTarget };

  On on = On::kPlatform;
  int link = -1;                // [-] of kLink; -1: link 0
  Vec3 point = Vec3::Zero();    // [m] in {P}, the link's frame, or the target's
  Vec3 force_I = Vec3::Zero();  // [N]
  double duration = 0.0;        // [s]

  bool operator==(const Push&) const = default;
};

/// One that has begun.
struct BegunPush {
  Push push;
  std::int64_t began = 0;  // [ns]

  std::int64_t end() const noexcept { return began + std::llround(push.duration * 1e9); }
  /// [-] of the time from `from` to `to` [ns] in which it lasts.
  double share(std::int64_t from, std::int64_t to) const noexcept;
};

/// The order on a robot whose tool is X_link in that link.
Push pushOf(const PushOrder& order, int link, const Transform& X_link) noexcept;

/// Where the point is, on a platform at X_IP under a robot at q.
Vec3 pushedPoint(const Push& push, const Transform& X_IP, const Transform& X_PL0,
                 const RobotModel& robot, const JointVector& q, const Transform& X_IB) noexcept;

using RobotAction = std::variant<RobotMove, ToolMove, Grasp, GraspTarget, Release, Push>;

double durationOf(const RobotAction& action) noexcept;  // [s]
RobotAction slower(const RobotAction& action, double times);

class MovingRobot {
 public:
  /// At rest at q, with nothing in hand.
  MovingRobot(const RobotModel& robot, const JointVector& q) noexcept
      : robot_(robot), joints_(robot.joints, q) {}

  /// Begins at `now` [ns]. Refused (false) where JointPaths refuses, for a second body in hand, a
  /// link that is not there, a target, a push, and a release of nothing.
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
