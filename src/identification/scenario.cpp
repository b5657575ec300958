// SPDX-License-Identifier: BSD-3-Clause
#include "ves/identification/scenario.hpp"

#include <fmt/format.h>

#include "ves/config/urdf.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/math/dense.hpp"

namespace ves {
std::string robotMoves(const Experiment& experiment, const std::vector<TimedMove>& moves) {
  const RobotModel& robot = experiment.controller.payload.robot;
  std::string text;
  for (const TimedMove& move : moves)
    for (int i = 0; i < robot.joints; ++i)
      text += fmt::format("{}{{at_s: {:.2f}, duration_s: {:.2f}, joint: {}, to_deg_or_m: {:.6g}}}",
                          text.empty() ? "" : ",\n             ", move.start, move.duration,
                          experiment.robot.joint_names[static_cast<std::size_t>(i)],
                          move.to(i) / jointUnit(robot.jointLink(i).type));
  return text.empty() ? text : fmt::format("    robot: [{}]\n", text);
}

StaticSetup staticSetup(const ControllerConfig& controller) {
  const Payload& payload = controller.payload;
  return {carried(payload), inverse(payload.X_PS) * payload.X_PL0(), payload.X_PS.R,
          inverse(controller.sensor.C_proc), controller.gravity};
}

double accelerationRoom(const ControllerConfig& c, const JointVector& q, int coordinate) {
  constexpr double kFullScale = 32768.0, kRoom = 0.6;  // [count], [-]
  const Mat3 R_IP = Mat3::Identity();
  const Mat6 counts = inverse(wrenchPerCount(c.sensor, R_IP));
  const RigidBody load_P =
      combine(RigidBody{}, c.payload.X_PL0(), compositeBody(carried(c.payload), q));
  const Wrench weight =
      gravityCompensation(c.payload, R_IP, staticWrench(c.payload, q, R_IP, c.gravity));
  const Vec6 stands = counts * weight.stacked(),
             each = counts * spatialMass(load_P).col(coordinate);
  double most = HUGE_VAL;
  for (int i = 0; i < 6; ++i)
    if (each(i) != 0.0)
      most = std::min(most, (kRoom * kFullScale - std::abs(stands(i))) / std::abs(each(i)));
  return most;
}

double sineRoom(double acceleration, double w) {
  constexpr double kTake = 0.015;  // [s]
  return std::min(acceleration * kTake / w, acceleration / (w * w));
}

std::string programOf(const PosePlan& plan, const Experiment& experiment) {
  std::string program;
  for (const PosePlan::Attitude& a : plan.attitudes) {
    const std::string attitude = fmt::format("alpha_deg: {:.4f}, beta_deg: {:.4f}",
                                             a.rpy.x() / kDegree, a.rpy.y() / kDegree);
    program += fmt::format("  - move: {{to: {{{}, z_m: {}}}, duration_s: {:.2f}}}\n", attitude,
                           -PosePlan::kBelow, a.moving.front());
    program += robotMoves(experiment, {{0.0, a.moving.front(), a.q.front()}});
    program += fmt::format("  - move: {{to: {{{}}}, duration_s: {:.2f}}}\n", attitude,
                           PosePlan::kApproach);
    double hold = PosePlan::kLook;
    std::vector<TimedMove> moves;
    for (std::size_t k = 1; k < a.q.size(); ++k) {
      moves.push_back({hold, a.moving[k], a.q[k]});
      hold += a.moving[k] + PosePlan::kLook;
    }
    program += fmt::format("  - trajectory: {{duration_s: {:.2f}}}\n", hold);
    program += robotMoves(experiment, moves);
  }
  return program;
}

std::string scenarioOf(const PosePlan& plan, const Experiment& experiment, const std::string& name,
                       const std::string& from) {
  std::string quoted = "'";
  for (const char letter : from) quoted += letter == '\'' ? "''" : std::string(1, letter);
  quoted += "'";
  return fmt::format(
      "# {} attitudes, {} robot poses in each; condition number {:.1f} ({:.1f} of random poses).\n"
      "# Made by ves identify plan. All legs arrive extending: all rest at the same edge of a "
      "count.\n"
      "from: {}\nname: {}\ndescription: The robot's static wrench in many poses, to identify its "
      "mass parameters.\nprogram:\n{}",
      plan.attitudes.size(), plan.attitudes.front().q.size(), plan.condition, plan.condition_random,
      quoted, name, programOf(plan, experiment));
}

}  // namespace ves
