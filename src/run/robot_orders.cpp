// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/robot_orders.hpp"

#include <chrono>

namespace ves {

RobotOrders::RobotOrders(const Experiment& experiment) : experiment_(experiment) {}

std::optional<RobotAction> RobotOrders::take(const RobotOrder& order, const plant::Truth& truth) {
  if (const auto* move = std::get_if<RobotMove>(&order)) {
    if (move->joint >= experiment_.robot.model.joints) throw InputError("it has no such joint");
    const std::string why = whyTooFast(experiment_.robot, *move, truth.joints);
    if (!why.empty()) throw InputError(why);
    return *move;
  }
  if (std::holds_alternative<Release>(order)) return Release{};
  if (const auto* push = std::get_if<PushOrder>(&order)) {
    const std::string why = whyNotPushed(experiment_, *push);
    if (!why.empty()) throw InputError(why);
    const NamedFrame* tool = experiment_.robot.tool();
    return pushOf(*push, tool ? tool->link : -1, tool ? tool->X_link : Transform());
  }
  const UrdfRobot& robot = experiment_.robot;
  const NamedFrame* frame = robot.tool();
  if (!frame) throw InputError("the robot has no tip, want tip: LINK in its configuration");
  if (const auto* hand = std::get_if<HandOrder>(&order))
    return Grasp{frame->link, combine(RigidBody{}, frame->X_link, hand->body_T)};
  if (planned_.valid()) throw InputError("another tool path is being planned");
  if (!planner_)
    planner_ = std::make_unique<ToolPlanner>(robot.model, frame->link, frame->X_link, robot.fastest,
                                             robot.joint_names,
                                             experiment_.controller.safety.tool_singularity);
  const auto& tool = std::get<ToolOrder>(order);
  const Transform X_FL0 = baseIn(tool.in, truth.P.X, experiment_.plant.payload.X_PL0());
  const JointVector q = truth.joints.q;
  const ToolGoal goal = goalOf(tool, X_FL0, planner_->pose(q));
  planned_ = std::async(std::launch::async, [this, q, goal] { return planner_->plan(q, goal); });
  return {};
}

std::optional<RobotAction> RobotOrders::done(bool wait) {
  if (!planned_.valid() ||
      (!wait && planned_.wait_for(std::chrono::seconds(0)) != std::future_status::ready))
    return {};
  return ToolMove{std::make_shared<JointTrajectory>(planned_.get())};
}

}  // namespace ves
