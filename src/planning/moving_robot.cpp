// SPDX-License-Identifier: BSD-3-Clause
#include "ves/planning/moving_robot.hpp"

namespace ves {

double durationOf(const RobotAction& action) noexcept {
  if (const auto* move = std::get_if<RobotMove>(&action)) return move->duration;
  if (const auto* move = std::get_if<ToolMove>(&action)) return move->joints->duration();
  return 0.0;
}

RobotAction slower(const RobotAction& action, double times) {
  if (const auto* move = std::get_if<RobotMove>(&action))
    return RobotMove{move->joint, move->target, move->duration * times};
  if (const auto* move = std::get_if<ToolMove>(&action))
    return ToolMove{std::make_shared<JointTrajectory>(move->joints->slower(times))};
  return action;
}

bool MovingRobot::begin(const RobotAction& action, std::int64_t now) noexcept {
  if (const auto* move = std::get_if<RobotMove>(&action)) return joints_.move(*move, now);
  if (const auto* move = std::get_if<ToolMove>(&action)) return joints_.follow(move->joints, now);
  if (const auto* grasp = std::get_if<Grasp>(&action)) {
    if (held_ || grasp->link < -1 || grasp->link >= robot_.size) return false;
    held_ = true;
    carrier_ = grasp->link;
    empty_hand_ = robot_.bodyOf(carrier_);
    robot_ = withLoad(robot_, carrier_, grasp->body);
    return true;
  }
  if (!held_ || !std::holds_alternative<Release>(action)) return false;
  held_ = false;
  robot_.bodyOf(carrier_) = empty_hand_;
  return true;
}

}  // namespace ves
