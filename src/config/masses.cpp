// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/masses.hpp"

#include <fmt/format.h>

#include <sstream>

#include "ves/config/calibration.hpp"

namespace ves {

std::string write(const MassRecord& r, const std::string& comment) {
  std::string text;
  std::istringstream lines(comment);
  for (std::string line; std::getline(lines, line);)
    text += line.empty() ? "#\n" : "# " + line + "\n";
  text += fmt::format("date: {}\nkinematics: {}  # hash of the geometry it holds for\n",
                      dateText(r.date), r.kinematics);
  if (r.deviation > 0.0)
    text += fmt::format("deviation: {:.3g}  # share of the weight's wrench\n", r.deviation);
  text += "bodies:\n";
  for (const MassRecord::Body& body : r.bodies)
    text += fmt::format("  - {{mass_kg: {}, moment_kg_m: [{}, {}, {}]}}\n", body.mass,
                        body.moment.x(), body.moment.y(), body.moment.z());
  return text;
}

MassRecord readMasses(Section s) {
  MassRecord r;
  r.date = readDate(s);
  r.kinematics = s.text("kinematics");
  if (s.has("deviation")) r.deviation = s.number("deviation", 0.0, 1.0);
  for (Section one : s.list("bodies")) {
    MassRecord::Body body;
    body.mass = one.number("mass_kg", 1e-6, 1e5);
    body.moment = one.vector("moment_kg_m", 3, -1e6, 1e6);
    one.finish();
    r.bodies.push_back(body);
  }
  s.finish();
  return r;
}

std::string kinematicsOf(const Payload& payload) {
  std::string text;
  const auto add = [&](const auto& numbers) {
    for (const double x : numbers.reshaped()) text += fmt::format("{:.9g} ", x + 0.0);
  };
  const auto frame = [&](const Transform& X) {
    add(X.R);
    add(X.p);
  };
  frame(payload.X_PS);
  frame(payload.X_PL0());
  for (int i = 0; i < payload.robot.size; ++i) {
    const Link& link = payload.robot.link(i);
    text += link.type == JointType::kRevolute ? "r " : "p ";
    frame(link.X_parent);
    add(link.axis);
    if (link.parent != i - 1 || link.joint != i)  // no serial arm
      text += fmt::format("on {} by {} {:.9g} {:.9g} ", link.parent, link.joint, link.ratio,
                          link.offset);
  }
  return fingerprint(text);
}

double massErrorOf(const MassRecord& record, const RobotModel& robot, const JointVector& q,
                   double before) {
  constexpr double kDeviations = 3.0;  // [-]
  RobotModel points = robot;
  points.base.I_Bcm_B.setZero();
  for (Link& link : points.links) link.body.I_Bcm_B.setZero();
  const double whole = compositeBody(robot, q).I_Bcm_B.trace();
  const double own = whole > 0.0 ? 1.0 - compositeBody(points, q).I_Bcm_B.trace() / whole : 0.0;
  return kDeviations * record.deviation + own * before;
}

Payload withMasses(Payload payload, const MassRecord& record) {
  payload.top_plate_S = {};
  payload.adapter_R = {};
  for (std::size_t i = 0; i < record.bodies.size(); ++i) {
    RigidBody& body = i == 0 ? payload.robot.base : payload.robot.links[i - 1].body;
    body.mass = record.bodies[i].mass;
    body.p_BoBcm_B = record.bodies[i].moment / body.mass;
  }
  return payload;
}

}  // namespace ves
