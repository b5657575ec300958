// SPDX-License-Identifier: BSD-3-Clause
#include "readers.hpp"

#include <fmt/format.h>

namespace ves {

double jointUnit(const Link& link) { return link.type == JointType::kRevolute ? kDegree : 1.0; }

void requireInLimits(const Section& s, std::string_view key, const UrdfRobot& robot, int joint,
                     double q) {
  const Link& link = robot.model.link(joint);
  if (!(q >= link.lower - 1e-9 && q <= link.upper + 1e-9))
    s.fail(key, fmt::format("joint '{}' at {:.6g}, want [{:.6g}, {:.6g}] {}",
                            robot.joint_names[static_cast<std::size_t>(joint)], q / jointUnit(link),
                            link.lower / jointUnit(link), link.upper / jointUnit(link),
                            link.type == JointType::kRevolute ? "deg" : "m"));
}

Robot readRobot(Section s, const Value& document) {
  Robot robot;
  const Value* text = document.find("robot")->find("urdf_text");
  if (!text) s.fail("urdf", "missing, want the robot's URDF file");
  robot.urdf = loadUrdf(s.text("urdf_text"), *text->file);
  robot.X_PR = {Mat3::Identity(), s.vector("adapter_position_m", 3, -10.0, 10.0)};
  robot.adapter_R = readBox(s.section("adapter"));
  robot.X_RL0 = {rotation(s.vector("mount_rpy_deg", 3, -360.0, 360.0) * kDegree),
                 s.vector("mount_m", 3, -10.0, 10.0)};
  Eigen::VectorXd q(robot.urdf.model.joints);
  if (q.size() > 0)
    q = s.vector("joints_deg_or_m", robot.urdf.model.joints, -1e6, 1e6);
  else if (s.has("joints_deg_or_m") && !s.texts("joints_deg_or_m").empty())
    s.fail("joints_deg_or_m", "the robot has no joint that moves, want none");
  for (int i = 0; i < robot.urdf.model.joints; ++i) {
    robot.q(i) = q(i) * jointUnit(robot.urdf.model.link(i));
    requireInLimits(s, "joints_deg_or_m", robot.urdf, i, robot.q(i));
  }
  s.finish();
  return robot;
}

}  // namespace ves
