// SPDX-License-Identifier: BSD-3-Clause
#include "ves/planning/moving_robot.hpp"

#include <algorithm>

namespace ves {

double durationOf(const RobotAction& action) noexcept {
  if (const auto* push = std::get_if<Push>(&action)) return push->duration;
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

double BegunPush::share(std::int64_t from, std::int64_t to) const noexcept {
  const std::int64_t lasted = std::min(to, end()) - std::max(from, began);
  return lasted > 0 ? static_cast<double>(lasted) / static_cast<double>(to - from) : 0.0;
}

Push pushOf(const PushOrder& order, int link, const Transform& X_link) noexcept {
  Push out{Push::On::kPlatform, -1, order.point, order.force_I, order.duration};
  if (order.on == PushOrder::On::kTarget) out.on = Push::On::kTarget;
  if (order.on == PushOrder::On::kTool) {
    out.on = Push::On::kLink;
    out.link = link;
    out.point = X_link * order.point;
  }
  return out;
}

Vec3 pushedPoint(const Push& push, const Transform& X_IP, const Transform& X_PL0,
                 const RobotModel& robot, const JointVector& q, const Transform& X_IB) noexcept {
  if (push.on == Push::On::kPlatform) return X_IP * push.point;
  if (push.on == Push::On::kTarget) return X_IB * push.point;
  Vec3 in_L0 = push.point;
  if (push.link >= 0) in_L0 = linkPoses(robot, q)[push.link] * push.point;
  return X_IP * (X_PL0 * in_L0);
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
