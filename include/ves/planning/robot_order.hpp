// SPDX-License-Identifier: BSD-3-Clause
//
// What anybody may ask of the simulated robot.
#pragma once

#include <variant>

#include "ves/planning/moving_robot.hpp"
#include "ves/planning/tool_planner.hpp"

namespace ves {

/// A body taken in hand, in the tool's frame.
struct HandOrder {
  RigidBody body_T;
};

using RobotOrder = std::variant<RobotMove, ToolOrder, HandOrder, Release>;

}  // namespace ves
