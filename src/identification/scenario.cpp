// SPDX-License-Identifier: BSD-3-Clause
#include "ves/identification/scenario.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "ves/config/urdf.hpp"
#include "ves/math/dense.hpp"

namespace ves {
namespace {

constexpr double kLook = 2.0;  // [s] that a scenario stands still for

// A leg comes to rest at the edge of the transducer's count that it meets first. Where all legs
// arrive extending, all are short by the same half count, and the attitude is right.
constexpr double kBelow = 0.01;    // [m] an attitude is approached from
constexpr double kApproach = 1.0;  // [s]

}  // namespace

StaticSetup staticSetup(const ControllerConfig& controller) {
  const Payload& payload = controller.payload;
  return {carried(payload), inverse(payload.X_PS) * payload.X_PL0(), payload.X_PS.R,
          inverse(controller.sensor.C_proc), controller.gravity};
}

std::string scenarioOf(const PosePlan& plan, const Experiment& experiment, const std::string& name,
                       const std::string& from, double speed) {
  std::string quoted = "'";
  for (const char letter : from) quoted += letter == '\'' ? "''" : std::string(1, letter);
  quoted += "'";
  const RobotModel& robot = experiment.controller.payload.robot;
  const ControllerConfig& c = experiment.controller;
  JointVector at = experiment.plant.task.initial_joints;
  // Fifth-order motions of all joints at once, begun `start` [s] into the segment.
  const auto moves = [&](const JointVector& to, double start, double time) {
    std::string text;
    for (int i = 0; i < robot.joints; ++i) {
      const double unit = jointUnit(robot.jointLink(i).type);
      text += fmt::format("{}{{at_s: {:.2f}, duration_s: {:.2f}, joint: {}, to_deg_or_m: {:.6g}}}",
                          text.empty() ? "" : ",\n             ", start, time,
                          experiment.robot.joint_names[static_cast<std::size_t>(i)], to(i) / unit);
    }
    return text.empty() ? text : fmt::format("    robot: [{}]\n", text);
  };
  const auto timeTo = [&](const JointVector& to) {
    double time = 1.0;
    for (int i = 0; i < robot.joints; ++i) {
      const bool turns = robot.jointLink(i).type == JointType::kRevolute;
      const double one = std::abs(to(i) - at(i)) / (speed * (turns ? kDegree : 0.01));
      time = std::max(time, std::ceil(one * 10.0) / 10.0);
    }
    return time;
  };
  std::string program;
  Vec3 rpy = Vec3::Zero();
  for (const PosePlan::Attitude& a : plan.attitudes) {
    const double turning = kQuinticPeakRate * (a.rpy - rpy).norm() / c.gentle.rotation;
    const double time = std::max({1.0, std::ceil(turning * 10.0) / 10.0, timeTo(a.q.front())});
    program += fmt::format(
        "  - move: {{to: {{alpha_deg: {:.4f}, beta_deg: {:.4f}, z_m: {}}}, duration_s: {:.2f}}}\n",
        a.rpy.x() / kDegree, a.rpy.y() / kDegree, -kBelow, time);
    program += moves(a.q.front(), 0.0, time);
    program += fmt::format(
        "  - move: {{to: {{alpha_deg: {:.4f}, beta_deg: {:.4f}}}, duration_s: {:.2f}}}\n",
        a.rpy.x() / kDegree, a.rpy.y() / kDegree, kApproach);
    rpy = a.rpy;
    at = a.q.front();
    double hold = kLook;
    std::string events;
    for (std::size_t k = 1; k < a.q.size(); ++k) {
      const double moving = timeTo(a.q[k]);
      const std::string one = moves(a.q[k], hold, moving);
      if (!one.empty()) events += one.substr(12, one.size() - 14) + ",\n             ";
      hold += moving + kLook;
      at = a.q[k];
    }
    program += fmt::format("  - trajectory: {{duration_s: {:.2f}}}\n", hold);
    if (!events.empty())
      program += fmt::format("    robot: [{}]\n", events.substr(0, events.size() - 15));
  }
  return fmt::format(
      "# {} attitudes, {} robot poses in each; condition number {:.1f} ({:.1f} of random poses).\n"
      "# Made by ves identify plan. All legs arrive extending: all rest at the same edge of a "
      "count.\n"
      "from: {}\nname: {}\ndescription: The robot's static wrench in many poses, to identify its "
      "mass parameters.\nprogram:\n{}",
      plan.attitudes.size(), plan.attitudes.front().q.size(), plan.condition, plan.condition_random,
      quoted, name, program);
}

}  // namespace ves
