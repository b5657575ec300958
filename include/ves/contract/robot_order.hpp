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

/// A finger on the simulated machine: a force in inertial axes, on what the sensor carries or on
/// what floats before the tool. A new push takes the place of one that lasts.
struct PushOrder {
  enum class On { kPlatform, kTool, kTarget };

  On on = On::kTool;
  Vec3 point = Vec3::Zero();    // [m] that moves with the body: in {P}, {T}, or the target's frame
  Vec3 force_I = Vec3::Zero();  // [N]
  double duration = 0.0;        // [s]

  bool operator==(const PushOrder&) const = default;
};
inline constexpr std::string_view kPushedNames[] = {"platform", "tool", "target"};
inline constexpr double kMostPush = 200.0;                          // [N] that a person pushes
inline constexpr double kShortestPush = 1e-3, kLongestPush = 60.0;  // [s]

inline constexpr double kLeastPace = 1e-3, kMostPace = 1000.0;  // [-] of real time, in lockstep

using RobotOrder = std::variant<RobotMove, ToolOrder, HandOrder, Release, PushOrder>;

}  // namespace ves
