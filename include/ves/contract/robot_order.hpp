// SPDX-License-Identifier: BSD-3-Clause
//
// What anybody may ask of the simulated robot.
#pragma once

#include <optional>
#include <string_view>
#include <variant>

#include "ves/robot/robot_model.hpp"

namespace ves {

/// A fifth-order motion of one joint, from wherever it is.
struct RobotMove {
  int joint = 0;          // [-] from 0
  double target = 0.0;    // [rad | m]
  double duration = 1.0;  // [s]

  bool operator==(const RobotMove&) const = default;
};

/// A tool path as people say it.
struct ToolOrder {
  enum class Frame { kRobot, kPlatform, kInertial };

  bool by = false;               // from where the tool is; otherwise to a pose
  Frame in = Frame::kRobot;      // whose axes and, of a pose, origin
  std::optional<Vec3> position;  // [m]; none: as it is
  std::optional<Vec3> rpy;       // [rad] of the tool, or the turn of it; none: as it is
  std::optional<Vec3> via;       // [m] like `position`
  double duration = 0.0;         // [s]; 0: by `speed`
  double speed = 0.0;            // [m/s]
};
inline constexpr std::string_view kToolFrameNames[] = {"robot", "platform", "inertial"};

/// A body taken in hand, in the tool's frame.
struct HandOrder {
  RigidBody body_T;
};

/// Lets go of what the hand holds.
struct Release {
  bool operator==(const Release&) const = default;
};

using RobotOrder = std::variant<RobotMove, ToolOrder, HandOrder, Release>;

}  // namespace ves
