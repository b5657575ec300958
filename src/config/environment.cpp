// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include "readers.hpp"

namespace ves {
namespace {

constexpr double kFarAway = 100.0;  // [m]

/// at_m in {I}, or from_tool_m: from where the tool stands at home, the robot as it begins.
Vec3 readPlace(Section& s, const Vec3& tool_I) {
  if (s.has("at_m") == s.has("from_tool_m"))
    s.fail("at_m", "want this or from_tool_m, and one of them only");
  if (s.has("at_m")) return s.vector("at_m", 3, -kFarAway, kFarAway);
  return tool_I + Vec3(s.vector("from_tool_m", 3, -kFarAway, kFarAway));
}

Mat3 readTurn(Section& s) {
  return s.has("rpy_deg") ? rotation(s.vector("rpy_deg", 3, -360.0, 360.0) * kDegree)
                          : Mat3(Mat3::Identity());
}

Shape readShape(Section& s, std::initializer_list<std::string_view> allowed,
                std::initializer_list<std::string_view> besides) {
  const std::string kind = s.onlyKey(allowed, besides);
  Section shape = s.section(kind);
  Shape out = HalfSpace{};
  if (kind == "ball") out = Ball{shape.number("radius_m", kTiny, kFarAway)};
  if (kind == "box") out = Box{shape.vector("size_m", 3, kTiny, kFarAway)};
  if (kind == "socket") {
    Socket socket;
    socket.radius = shape.number("radius_m", kTiny, kFarAway);
    socket.depth = shape.number("depth_m", kTiny, kFarAway);
    socket.chamfer = shape.number("chamfer_m", 0.0, socket.depth);
    out = socket;
  }
  shape.finish();
  return out;
}

ContactLaw readLaw(Section s) {
  ContactLaw law;
  law.stiffness = s.number("stiffness", kTiny, 1e12);
  law.exponent = s.has("exponent") ? s.number("exponent", 1.0, 3.0) : 1.0;
  law.damping = s.has("damping_s_per_m") ? s.number("damping_s_per_m", 0.0, 1e4) : 0.0;
  law.friction = s.has("friction") ? s.number("friction", 0.0, 10.0) : 0.0;
  if (s.has("slip_speed_m_per_s")) law.slip_speed = s.number("slip_speed_m_per_s", 1e-6, 1.0);
  s.finish();
  return law;
}

Grip readGrip(Section s) {
  Grip grip;
  grip.stiffness = s.number("stiffness_n_per_m", kTiny, 1e9);
  grip.damping = s.number("damping_n_s_per_m", 0.0, 1e9);
  grip.turn_stiffness = s.number("turn_stiffness_nm_per_rad", kTiny, 1e9);
  grip.turn_damping = s.number("turn_damping_nm_s_per_rad", 0.0, 1e9);
  grip.reach = s.number("reach_m", 0.0, 1.0);
  s.finish();
  return grip;
}

Target readTarget(Section s, const Vec3& tool_I) {
  Target target;
  target.mass = s.number("mass_kg", kTiny, 1e6);
  target.start.p = readPlace(s, tool_I);
  target.start.q = Eigen::Quaterniond(readTurn(s));
  if (s.has("velocity_m_per_s")) target.start.v = s.vector("velocity_m_per_s", 3, -10.0, 10.0);
  if (s.has("turning_deg_per_s"))
    target.start.w = s.vector("turning_deg_per_s", 3, -360.0, 360.0) * kDegree;
  target.shape = readShape(
      s, {"ball", "box"},
      {"mass_kg", "at_m", "from_tool_m", "rpy_deg", "velocity_m_per_s", "turning_deg_per_s"});
  // Uniform.
  if (const Ball* ball = std::get_if<Ball>(&target.shape))
    target.I_Bcm_B = 0.4 * target.mass * ball->radius * ball->radius * Mat3::Identity();
  else
    target.I_Bcm_B = boxInertia(target.mass, std::get<Box>(target.shape).size);
  s.finish();
  return target;
}

}  // namespace

World readEnvironment(Section s, const Experiment& e) {
  const NamedFrame* tool = e.robot.tool();
  if (!tool) s.fail("tool", "there is no robot with a tool that could touch anything");
  World world;
  world.link = tool->link;
  world.X_link = tool->X_link;
  const Payload& payload = e.plant.payload;
  const Transform X_L0T = tool->pose(linkPoses(payload.robot, e.plant.task.initial_joints));
  const Vec3 tool_I = (e.plant.geometry.fromHome({}) * payload.X_PL0() * X_L0T).p;
  Environment& environment = world.environment;
  environment.gravity = e.plant.gravity;
  if (const auto* free = std::get_if<FreeBodyModel>(&e.controller.vehicle.kind)) {
    environment.orbit = free->orbit;
    environment.p_IO_I = e.plant.geometry.home();
  }
  environment.law = readLaw(s.section("contact"));
  for (Section one : s.list("tool")) {
    Feeler feeler;
    if (one.has("at_m")) feeler.p_TQ_T = one.vector("at_m", 3, -10.0, 10.0);
    feeler.radius = one.number("radius_m", 0.0, 10.0);
    one.finish();
    environment.tool.push_back(feeler);
  }
  if (environment.tool.empty()) s.fail("tool", "has no balls, want at least one");
  if (s.has("bodies"))
    for (Section one : s.list("bodies")) {
      FixedBody body;
      body.X_IB = {readTurn(one), readPlace(one, tool_I)};
      body.shape = readShape(one, {"half_space", "ball", "box", "socket"},
                             {"at_m", "from_tool_m", "rpy_deg"});
      one.finish();
      environment.bodies.push_back(body);
    }
  if (s.has("target")) environment.target = readTarget(s.section("target"), tool_I);
  if (s.has("grip")) environment.grip = readGrip(s.section("grip"));
  if (environment.bodies.empty() && !environment.target)
    s.fail("bodies", "and target are both missing: there is nothing to touch");
  s.finish();
  JointState joints;
  joints.q = e.plant.task.initial_joints;
  BodyMotion P;  // at rest
  P.X = e.plant.geometry.fromHome(e.plant.initial_pose);
  const Touch start =
      touch(environment,
            carriedFrame(payload.robot, joints, P, payload.X_PL0(), world.link, world.X_link),
            environment.target ? environment.target->start : Floating{});
  if (start.least < 0.0)
    s.fail("tool",
           fmt::format("is {:.4f} m inside a body at the start, want it free", -start.least));
  return world;
}

}  // namespace ves
