// SPDX-License-Identifier: BSD-3-Clause
//
// What an experiment asks of the robot, and what is there for it to touch: known to everybody who
// prepares a run, whatever the machine truly is.
#pragma once

#include <optional>
#include <vector>

#include "ves/contact/environment.hpp"
#include "ves/contract/order.hpp"
#include "ves/planning/moving_robot.hpp"

namespace ves {

struct RobotEvent {
  Cue cue;
  RobotAction action;
};

struct RobotTask {
  JointVector initial_joints = JointVector::Zero();  // [rad | m]
  std::vector<RobotEvent> robot_events;
  std::optional<World> world;  // what the tool may touch
};

}  // namespace ves
