// SPDX-License-Identifier: BSD-3-Clause
//
// Contact in the plant and in free space: a target meets the tool, and the books are kept.
#include <gtest/gtest.h>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/bus/messages.hpp"
#include "ves/config/experiment.hpp"
#include "ves/evaluation/contact_pairs.hpp"
#include "ves/evaluation/summary.hpp"
#include "ves/plant/plant.hpp"
#include "ves/run/truth.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {
namespace {

constexpr double kTargetMass = 100.0, kSpeed = 0.02;  // [kg], [m/s] of the target

/// The PUMA in space, a ball of 0.3 m drifting along -x against its tool, 5 mm before it touches.
Experiment meeting(double stiffness, const std::string& contact = "",
                   const std::vector<std::string>& more = {}) {
  std::vector<std::string> set = {
      "gravity_m_per_s2=0", "sensor.noise=false", "initial_pose={}",
      fmt::format("environment={{tool: [{{radius_m: 0.02}}], contact: {{stiffness: {}{}}}, target: "
                  "{{mass_kg: {}, from_tool_m: [0.325, 0, 0], velocity_m_per_s: [{}, 0, 0], ball: "
                  "{{radius_m: 0.3}}}}}}",
                  stiffness, contact, kTargetMass, -kSpeed)};
  set.insert(set.end(), more.begin(), more.end());
  return test::experiment("puma_on_table_4_1", set);
}

/// The plant by itself, without a program that would let the target go.
plant::Plant alone(Experiment e) {
  e.plant.task.world->release = -1;
  return plant::Plant(e.plant);
}

// Legs that nobody commands hold the platform, whatever pushes: the target meets a wall.
TEST(ContactInThePlant, ATargetReboundsFromAToolThatIsHeld) {
  for (const double k : {1e3, 1e5}) {
    const Experiment e = meeting(k);
    plant::Plant plant = alone(e);
    const Vec3 held = plant.truth().P.X.p;
    const double omega = std::sqrt(k / kTargetMass);
    double peak = 0.0, impulse = 0.0, touched = 0.0, felt = 0.0;
    constexpr double dt = 1e-3;
    for (int i = 1; i <= 2000; ++i) {
      plant.advance(static_cast<std::int64_t>(i) * 1'000'000);
      plant.sample();
      const plant::Truth& t = plant.truth();
      // The last step of the mechanics ended now.
      peak = std::max(peak, t.contact_To_I.f.norm());
      felt = std::max(felt, t.F_Po_I.f.norm());
      impulse += dt * t.contact_To_I.f.norm();
      if (t.contact_To_I.f.norm() > 0.0) touched += dt;
      EXPECT_LT((t.P.X.p - held).norm(), 2e-4);  // a count of a leg
    }
    const plant::Truth& t = plant.truth();
    EXPECT_NEAR(t.target.v.x(), kSpeed, 0.01 * kSpeed) << k;
    EXPECT_NEAR(peak, kSpeed * std::sqrt(k * kTargetMass), 0.01 * peak) << k;
    EXPECT_NEAR(touched, M_PI / omega, 0.01 * M_PI / omega + 2.0 * dt) << k;
    EXPECT_NEAR(impulse, 2.0 * kTargetMass * kSpeed, 0.02 * impulse) << k;
    EXPECT_NEAR(felt, peak, 0.05 * peak)
        << k;  // by the sensor's platform, and the robot's own shake
    EXPECT_GT(t.clearance, 0.0);
  }
}

// The wrench on the sensor is the contact's, moved from the tool to the sensor.
TEST(ContactInThePlant, TheSensorFeelsTheToolsWrenchAtItsPlace) {
  const Experiment e = meeting(1e3, ", friction: 0.4");
  plant::Plant plant = alone(e);
  const Payload& payload = e.plant.payload;
  int touched = 0;
  for (int i = 1; i <= 800; ++i) {
    plant.advance(static_cast<std::int64_t>(i) * 1'000'000);
    plant.sample();
    const plant::Truth& t = plant.truth();
    if (!(t.contact_To_I.f.norm() > 1.0)) continue;
    ++touched;
    // In space a robot at rest feels nothing else, but for what the legs' counts shake.
    const Transform X_IT =
        t.P.X * payload.X_PL0() * e.robot.tool()->pose(linkPoses(payload.robot, t.joints.q));
    const Vec3 moment = t.contact_To_I.n + (X_IT.p - t.P.X.p).cross(t.contact_To_I.f);
    EXPECT_LT((t.F_Po_I.f - t.contact_To_I.f).norm(), 0.05 * t.contact_To_I.f.norm() + 0.05);
    EXPECT_LT((t.F_Po_I.n - moment).norm(), 0.05 * moment.norm() + 0.05);
  }
  EXPECT_GT(touched, 100);
}

TEST(ContactInThePlant, IsTheSameHoweverItIsAskedFor) {
  const Experiment e = meeting(1e4, ", exponent: 1.5, damping_s_per_m: 10");
  plant::Plant often = alone(e), seldom = alone(e);
  for (int i = 1; i <= 1500; ++i) often.advance(static_cast<std::int64_t>(i) * 10'000'000);
  seldom.advance(15'000'000'000);  // nothing else moves, but time must not be passed over
  EXPECT_GT(seldom.truth().target.v.x(), 0.0);
  EXPECT_EQ(often.truth().target.v, seldom.truth().target.v);
  EXPECT_EQ(often.truth().target.p, seldom.truth().target.p);
}

// A wall under a tool that the robot lowers: the force is the spring's at the tool's own pose.
TEST(ContactInThePlant, APressedBoardPushesAsDeepAsTheToolIsIn) {
  const Experiment e = test::experiment(
      "puma_on_table_4_1",
      {"gravity_m_per_s2=0", "sensor.noise=false", "initial_pose={}",
       "environment={tool: [{radius_m: 0.02}], contact: {stiffness: 2000}, bodies: [{from_tool_m: "
       "[-0.03, 0, 0], rpy_deg: [0, 90, 0], half_space: {}}]}"});
  plant::Plant plant = alone(e);
  RobotMove move;
  move.joint = 1;
  move.target = e.plant.task.initial_joints(1) - 0.2;
  move.duration = 1.0;
  ASSERT_TRUE(plant.moveRobot(move));
  const Payload& payload = e.plant.payload;
  const FixedBody& board = e.plant.task.world->environment.bodies[0];
  const Vec3 out = board.X_IB.R.col(2);
  int touched = 0;
  for (int i = 1; i <= 1500; ++i) {
    plant.advance(static_cast<std::int64_t>(i) * 1'000'000);
    plant.sample();
    const plant::Truth& t = plant.truth();
    const Transform X_IT =
        t.P.X * payload.X_PL0() * e.robot.tool()->pose(linkPoses(payload.robot, t.joints.q));
    const double depth = 0.02 - out.dot(X_IT.p - board.X_IB.p);
    if (depth < 1e-3) continue;
    ++touched;
    const double speed = 0.2 / 1.0 * 2.0;  // [m/s] at most; the mean is half a millisecond old
    EXPECT_NEAR(t.contact_To_I.f.dot(out), 2000.0 * depth, 2000.0 * speed * 1e-3) << i;
    EXPECT_NEAR(t.contact_To_I.f.norm(), t.contact_To_I.f.dot(out), 1e-9);
  }
  EXPECT_GT(touched, 300);
}

// The target waits for admittance control, as it begins with it in free space.
TEST(ContactInThePlant, WhatFloatsIsLetGoWhenAdmittanceControlBegins) {
  const double speed = 0.05;  // and far enough that the move before does not reach it
  Experiment e = meeting(300.0, "",
                         {"environment.target.from_tool_m=[0.6, 0, 0]",
                          fmt::format("environment.target.velocity_m_per_s=[{}, 0, 0]", -speed)});
  ASSERT_EQ(e.plant.task.world->release, 3);
  ASSERT_EQ(applyStabilityCheck(e), "");
  Lockstep machine(e.controller, e.plant);
  machine.step({Request::kStart, {}, {}});
  const Vec3 start = e.plant.task.world->environment.target->start.p;
  double began = -1.0;
  int drifted = 0;
  bool met = false;
  while (machine.state().phase != Phase::kParked && machine.state().phase != Phase::kStopped) {
    const TickState& s = machine.step();
    const plant::Truth& t = machine.plant().truth();
    const double now = static_cast<double>(t.time) * 1e-9;
    if (s.segment == 3 && began < 0.0) began = now;
    met = met || t.contact_To_I.f.norm() > 0.0;
    if (began < 0.0) {
      EXPECT_EQ(t.target.p, start) << now;
    }
    if (began < 0.0 || met) continue;
    EXPECT_NEAR(t.target.p.x(), start.x() - speed * (now - began), 0.021 * speed);
    ++drifted;
  }
  EXPECT_EQ(machine.state().phase, Phase::kParked);
  EXPECT_GT(drifted, 5);
  EXPECT_TRUE(met);
}

// Until then it stands, whatever its velocity will be: a tool at rest on it feels its spring alone.
TEST(ContactInThePlant, WhatIsHeldStands) {
  const Experiment e = meeting(300.0, ", damping_s_per_m: 30");
  plant::Plant plant(e.plant);  // no program lets it go
  RobotMove move;
  move.joint = 1;
  move.target = e.plant.task.initial_joints(1) + 0.03;
  ASSERT_TRUE(plant.moveRobot(move));
  plant.advance(2'000'000'000);
  plant.sample();
  const plant::Truth& t = plant.truth();
  EXPECT_EQ(t.target.p, e.plant.task.world->environment.target->start.p);
  ASSERT_LT(t.clearance, -0.01);
  EXPECT_NEAR(t.contact_To_I.f.norm(), 300.0 * -t.clearance, 1e-3 * t.contact_To_I.f.norm());
}

// Its time is that of the message, whatever the plant's own clock says.
TEST(ContactInThePlant, IsToldByTheMessagesClock) {
  plant::Plant plant = alone(meeting(1e4));
  plant.advance(1'000'000'000);
  plant.sample();
  const plant::Truth& t = plant.truth();
  const std::int64_t later = 7'000'000'000'000;
  const truth_t m = toMessage(t, header({}, 0, t.time + later));
  EXPECT_EQ(m.contacts, 1);
  EXPECT_EQ(m.touching, 0);
  EXPECT_NEAR(m.contact_began, 7000.0 + t.contacts.last().began, 1e-9);
  EXPECT_NEAR(t.contacts.last().began, 0.005 / kSpeed, 1e-3);
  EXPECT_EQ(m.contact_peak, t.contacts.last().peak);
  EXPECT_EQ(m.contact_separation, t.contacts.last().separation);
  EXPECT_LT((Vec3::Map(m.target_p) - t.target.p).norm(), 1e-15);
  EXPECT_GT(m.clearance, 0.0);
}

/// The same in free space: a base without springs or damping, of so much mass and inertia.
Interaction afloat(const Experiment& e, double mass, double inertia) {
  std::int64_t duration = 0;
  Interaction i = interactionOf(e, duration);
  Vec6 share;
  share << Vec3::Constant(1.0 / std::sqrt(mass)), Vec3::Constant(1.0 / std::sqrt(inertia));
  std::get<ModalModel>(i.vehicle.kind).Phi = share.asDiagonal();
  std::get<ModalModel>(i.vehicle.kind).stiffness = Vec6::Zero();
  std::get<ModalModel>(i.vehicle.kind).damping = Mat6::Zero();
  i.actions.clear();
  return i;
}

// A base that cannot turn and the target are two masses on a spring: closed form.
TEST(ContactInFreeSpace, TwoMassesPartAsTheyMet) {
  const double k = 1e4, base = 400.0;
  const Interaction i = afloat(meeting(k), base, 1e12);
  const double carried = compositeBody(ves::carried(i.payload), i.q0).mass, M = base + carried,
               mu = M * kTargetMass / (M + kTargetMass);
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.duration = 2'000'000'000;
  options.step = 1'000'000;
  double touched = 0.0, peak = 0.0;
  const std::vector<InteractionPoint> points = simulate(i, options);
  for (const InteractionPoint& p : points) {
    if (p.touch.least < 0.0) touched += 1e-3;
    peak = std::max(peak, p.touch.on_tool_To_I.f.norm());
  }
  EXPECT_NEAR(points.back().target.v.x(), -kSpeed * (kTargetMass - M) / (kTargetMass + M), 1e-7);
  EXPECT_NEAR(points.back().x_dot.x(), -kSpeed * 2.0 * kTargetMass / (kTargetMass + M), 1e-7);
  EXPECT_NEAR(touched, M_PI * std::sqrt(mu / k), 2e-3);
  EXPECT_NEAR(peak, kSpeed * std::sqrt(k * mu), 1e-4 * peak);
}

// Nothing is anchored: momentum, moment of momentum and energy of base, robot and target.
TEST(ContactInFreeSpace, NothingIsLostWithoutAnAnchor) {
  Experiment e = meeting(2e3);
  e.plant.task.world->environment.target->start.p += Vec3(0.0, 0.08, 0.05);  // off centre
  const double base = 400.0, inertia = 60.0;
  const Interaction i = afloat(e, base, inertia);
  const RigidBody robot_P =
      combine(RigidBody{}, i.payload.X_PL0(), compositeBody(ves::carried(i.payload), i.q0));
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.duration = 3'000'000'000;
  options.step = 5'000'000;
  options.tolerance = 1e-12;
  const Target& target = *i.world->environment.target;
  // The base's energy is of its angles' rates, so it is the same base after a turn about z and
  // after no other: of the moment of momentum, z is kept (Noether).
  struct Books {
    Vec3 p;
    double L, energy;
  };
  const auto books = [&](const InteractionPoint& at) {
    const BodyMotion P = bodyMotion(i.p_IH, Pose::from(at.x), at.x_dot, Vec6::Zero());
    const Vec3 v = P.v, w = P.w, r = P.X.p, turn = at.x_dot.tail<3>();
    const Vec3 c = P.X.R * robot_P.p_BoBcm_B, v_c = v + w.cross(c);
    const Mat3 I_r = P.X.R * robot_P.I_Bcm_B * P.X.R.transpose();
    const Mat3 R = at.target.q.toRotationMatrix(), I_t = R * target.I_Bcm_B * R.transpose();
    const double m = robot_P.mass, M = target.mass;
    Books b;
    b.p = base * v + m * v_c + M * at.target.v;
    const Vec3 L = inertia * turn + r.cross(base * v) + I_r * w + (r + c).cross(m * v_c) +
                   I_t * at.target.w + at.target.p.cross(M * at.target.v);
    b.L = L.z();
    b.energy =
        0.5 * (base * v.dot(v) + inertia * turn.dot(turn) + m * v_c.dot(v_c) + w.dot(I_r * w) +
               M * at.target.v.dot(at.target.v) + at.target.w.dot(I_t * at.target.w)) +
        at.touch.stored;
    return b;
  };
  const std::vector<InteractionPoint> points = simulate(i, options);
  const Books start = books(points.front());
  double most = 0.0;
  for (const InteractionPoint& at : points) {
    const Books now = books(at);
    EXPECT_LT((now.p - start.p).norm(), 1e-9) << at.t;
    EXPECT_NEAR(now.L, start.L, 1e-9) << at.t;
    EXPECT_NEAR(now.energy, start.energy, 1e-9) << at.t;
    most = std::max(most, at.touch.stored);
  }
  EXPECT_GT(most, 1e-3);                                  // it did touch,
  EXPECT_GT(points.back().x_dot.tail<3>().norm(), 1e-4);  // and turned the base
}

// Damping sees how fast the tool really comes, on a base that turns: the rate of the depth itself.
TEST(ContactInFreeSpace, DampingGoesByTheRateOfTheDepth) {
  Experiment e = meeting(2e3, ", damping_s_per_m: 30");
  const Interaction i = afloat(e, 200.0, 20.0);
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.duration = 1'500'000'000;
  options.step = 1'000'000;
  const std::vector<InteractionPoint> points = simulate(i, options);
  int touched = 0;
  double turned = 0.0;
  for (std::size_t n = 1; n + 1 < points.size(); ++n) {
    const double before = -points[n - 1].touch.least, d = -points[n].touch.least,
                 after = -points[n + 1].touch.least;
    if (!(before > 0.0 && after > 0.0)) continue;
    ++touched;
    turned = std::max(turned, points[n].x_dot.tail<3>().norm());
    const double rate = (after - before) / 2e-3;
    EXPECT_NEAR(points[n].touch.on_tool_To_I.f.norm(), 2e3 * d * (1.0 + 30.0 * rate),
                1e-4 + 1e-3 * 2e3 * d);
  }
  EXPECT_GT(touched, 100);
  EXPECT_GT(turned, 5e-3);
}

// A base too heavy to move is a platform that is held: the plant's steps against adaptive ones, which
// stop where the contact begins and ends.
TEST(ContactInThePlant, IsThatOfAnIndependentIntegration) {
  for (const double k : {3e3, 1e4, 3e5})
    for (const std::string& law : {std::string(), std::string(", exponent: 1.5"),
                                   std::string(", damping_s_per_m: 20, friction: 0.3")}) {
      Experiment e = meeting(k, law, {"environment.target.turning_deg_per_s=[0, 20, 0]"});
      const Interaction i = afloat(e, 1e9, 1e9);
      InteractionOptions options;
      options.model = InteractionModel::kWhole;
      options.duration = 3'000'000'000;
      const Contact due = simulate(i, options).back().contacts.last();
      plant::Plant plant = alone(e);
      plant.advance(3'000'000'000);
      plant.sample();
      const Contact& met = plant.truth().contacts.last();
      ASSERT_TRUE(due.over() && met.over()) << k << law;
      EXPECT_NEAR(met.restitution(), due.restitution(), 0.01 * due.restitution()) << k << law;
      EXPECT_NEAR(met.duration, due.duration, 0.01 * due.duration) << k << law;
      EXPECT_NEAR(met.peak, due.peak, 0.01 * due.peak) << k << law;
      EXPECT_LT((met.impulse - due.impulse).norm(), 0.01 * due.impulse.norm()) << k << law;
      EXPECT_NEAR(met.began, due.began, 2e-3) << k << law;
    }
}

// The events that stop its steps are where the closed form has them.
TEST(ContactInFreeSpace, EventsAreLocated) {
  const double k = 1e4, base = 400.0;
  const Interaction i = afloat(meeting(k), base, 1e12);
  const double M = base + compositeBody(ves::carried(i.payload), i.q0).mass,
               mu = M * kTargetMass / (M + kTargetMass);
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.duration = 1'500'000'000;
  const InteractionPoint end = simulate(i, options).back();
  ASSERT_EQ(end.contacts.count(), 1);
  const Contact& c = end.contacts.last();
  EXPECT_NEAR(c.began, 0.005 / kSpeed, 1e-9);
  EXPECT_NEAR(c.duration, M_PI * std::sqrt(mu / k), 1e-7);
  EXPECT_NEAR(c.peak, kSpeed * std::sqrt(k * mu), 3e-3 * c.peak);
  EXPECT_NEAR(c.impulse.norm(), 2.0 * mu * kSpeed, 1e-3 * c.impulse.norm());
  EXPECT_NEAR(c.restitution(), 1.0, 1e-6);
}

/// With a hand that closes on the ball as it comes.
Experiment capture(const std::vector<std::string>& more = {}) {
  std::vector<std::string> set = {
      "environment.grip={stiffness_n_per_m: 3000, damping_n_s_per_m: 600, "
      "turn_stiffness_nm_per_rad: 300, turn_damping_nm_s_per_rad: 60, reach_m: 0.006}",
      "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 4}, robot: [{at_s: 0.2, "
      "grasp: {target: true}}, {at_s: 3, release: {}}]}]"};
  set.insert(set.end(), more.begin(), more.end());
  return meeting(1e4, "", set);
}

// Base, robot and ball become one body: momenta stay, and their velocities agree.
TEST(ContactInFreeSpace, WhatIsGraspedGoesAlong) {
  const Experiment e = capture();
  std::int64_t duration = 0;
  const std::vector<TimedAction> actions = interactionOf(e, duration).actions;
  ASSERT_EQ(actions.size(), 2U);
  Interaction i = afloat(e, 400.0, 1e12);
  i.actions = actions;
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.duration = duration;
  const std::vector<InteractionPoint> points = simulate(i, options);
  const double M = 400.0 + compositeBody(ves::carried(i.payload), i.q0).mass;
  for (const InteractionPoint& p : points)
    EXPECT_NEAR(M * p.x_dot.x() + kTargetMass * p.target.v.x(), -kTargetMass * kSpeed, 1e-9) << p.t;
  const double together = -kTargetMass * kSpeed / (M + kTargetMass);
  for (const double t : {2.5, 3.5}) {  // held, and let go
    const InteractionPoint& p = points[static_cast<std::size_t>(std::lround(t / 0.01))];
    EXPECT_EQ(p.target.X_TB.has_value(), t < 3.0);
    EXPECT_NEAR(p.target.v.x(), together, 1e-5);
    EXPECT_NEAR(p.x_dot.x(), together, 1e-5);
  }
}

// The machine does it too: in the plant, over the program, beside free space.
TEST(ContactInThePlant, ATargetIsGraspedAndLetGo) {
  Experiment e =
      capture({"controller.compensation.feed_forward=true", "controller.compensation.observer=true",
               "controller.compensation.inertia=true", "sensor.readings_per_tick=4"});
  Lockstep machine(e.controller, e.plant);
  machine.step({Request::kStart, {}, {}});
  double held = 0.0, apart = 0.0;
  while (!test::done(machine.state())) {
    machine.step();
    const plant::Truth& t = machine.plant().truth();
    if (!t.target.X_TB) continue;
    held += e.controller.periodSeconds();
    const Transform X_IT = t.P.X * e.plant.payload.X_PL0() *
                           e.robot.tool()->pose(linkPoses(e.plant.payload.robot, t.joints.q));
    apart = (t.target.p - (X_IT * *t.target.X_TB).p).norm();
  }
  EXPECT_EQ(machine.state().phase, Phase::kParked);
  EXPECT_EQ(machine.plant().refusedEvents(), 0);
  EXPECT_NEAR(held, 2.8, 0.05);
  EXPECT_LT(apart, 2e-3);  // it has come to rest in the hand
  EXPECT_FALSE(machine.plant().truth().target.X_TB);
}

TEST(ContactInThePlant, AHandThatIsTooFarAwayHoldsNothing) {
  Experiment e = capture({"environment.grip.reach_m=0.0001"});
  Lockstep machine(e.controller, e.plant);
  machine.step({Request::kStart, {}, {}});
  while (!test::done(machine.state())) machine.step();
  EXPECT_EQ(machine.plant().refusedEvents(), 2);  // nothing to let go either
}

TEST(ContactInFreeSpace, AWorldThatNobodyTouchesChangesNothing) {
  std::int64_t duration = 0;
  const Experiment with = meeting(1e4, "",
                                  {"environment.target.from_tool_m=[5, 0, 0]",
                                   "base.damping_diagonal=[50, 50, 50, 25, 25, 25]"});
  Interaction i = interactionOf(with, duration);
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.duration = duration;
  const std::vector<InteractionPoint> a = simulate(i, options);
  i.world.reset();
  const std::vector<InteractionPoint> b = simulate(i, options);
  double moved = 0.0;
  for (std::size_t n = 0; n < a.size(); ++n) {
    EXPECT_LT((a[n].x - b[n].x).norm(), 1e-9);
    moved = std::max(moved, b[n].x.norm());
  }
  EXPECT_GT(moved, 1e-3);
}

// What vehicle, robot and ball have gained more than in free space is what the controller's own
// account says that the emulation has put in, which knows nothing of the vehicle's place or of the
// ball.
TEST(ContactResults, EnergyErrorIsWhatTheEmulationHasPutIn) {
  for (const char* robot : {"doss", "puma"})
    for (const bool compensated : {false, true}) {
      const std::string in = compensated ? "true" : "false";
      const Experiment e = test::experiment(
          std::string("contact_rebound_") + robot,
          {"sensor.noise=false", "controller.compensation.feed_forward=" + in,
           "controller.compensation.observer=" + in, "controller.compensation.inertia=" + in});
      const RecordedRun run = recordLockstep(e);
      ASSERT_TRUE(run.result.good());
      const auto pairs = contactPairs(run.series, emulation(run.series));
      ASSERT_EQ(pairs.size(), 1U);
      const Contact &ours = *pairs[0].emulated, &due = *pairs[0].free_space;
      const double approach =
          0.5 * due.impulse.norm() * due.approach * due.approach / (due.approach + due.separation);
      const double after = ours.began + ours.duration + ContactPair::kAfter;
      double put_in = 0.0, last = 0.0;
      eachTick(run.series, [&](const Row& row, double t) {
        if (t <= ours.began) put_in = -row.state.energy_put_in;
        if (t > ours.began && t <= after) last = row.state.energy_put_in;
      });
      put_in += last;
      EXPECT_NEAR(pairs[0].energy_error, put_in / approach, 0.07) << robot << compensated;
    }
}

// What a run says of its contacts, beside what the plant knew and free space.
TEST(ContactResults, StandBesideFreeSpace) {
  const Experiment e = test::experiment("contact_rebound_puma", {"sensor.noise=false"});
  const RecordedRun run = recordLockstep(e);
  ASSERT_EQ(run.result.phase, Phase::kParked);
  Lockstep machine(e.controller, e.plant);
  machine.step({Request::kStart, {}, {}});
  double began = -1.0;
  while (!test::done(machine.state())) {
    const TickState& s = machine.step();
    if (began < 0.0 && s.kind == SegmentKind::kAdmittance)
      began = static_cast<double>(machine.plant().truth().time) * 1e-9;
  }
  const Contact& known = machine.plant().truth().contacts.last();
  const nlohmann::ordered_json s = summarise(run.series, run.result);
  EXPECT_EQ(s["contacts"], 1);
  EXPECT_EQ(s["contacts_free_space"], 1);
  const auto& one = s["contact_list"][0];
  EXPECT_NEAR(one["began_s"].get<double>(), known.began - began, 1e-9);
  EXPECT_EQ(one["duration_s"], known.duration);
  EXPECT_EQ(one["peak_n"], known.peak);
  EXPECT_EQ(one["impulse_ns"], known.impulse.norm());
  EXPECT_EQ(one["approach_m_per_s"], known.approach);
  EXPECT_EQ(one["restitution"], known.restitution());
  // The compensated machine is close to free space.
  for (const char* figure : {"duration_s", "peak_n", "impulse_ns", "approach_m_per_s"}) {
    const double due = one[std::string("free_space_") + figure];
    EXPECT_NEAR(one[figure].get<double>(), due, 0.03 * due) << figure;
  }
  EXPECT_NEAR(one["began_s"].get<double>(), one["free_space_began_s"].get<double>(), 0.02);
  const Contact free_space = *contactPairs(run.series, emulation(run.series)).at(0).free_space;
  EXPECT_NE(free_space.peak, known.peak);
  EXPECT_EQ(one["free_space_peak_n"], free_space.peak);
  EXPECT_EQ(one["free_space_impulse_ns"], free_space.impulse.norm());
  const double e_ = s["contact_restitution"], due = s["contact_restitution_free_space"];
  EXPECT_NEAR(e_, due, 0.04);
  EXPECT_LT(std::abs(s["contact_energy_error"].get<double>()), 0.06);
  EXPECT_EQ(s["contact_peak_n"], known.peak);
  EXPECT_LT(std::abs(s["energy_put_in_j"].get<double>()), 2e-3);
  EXPECT_FALSE(s.contains("energy_paid_j"));
  EXPECT_LT(std::abs(s["tracking_delay_s"].get<double>()), 2e-3);
  EXPECT_NE(table(s).find("contact  1 in the run, 1 on the base in free space"), std::string::npos);
  // The table's columns are those of the truth.
  const std::vector<Column> all = columns(e);
  const auto last = [&](const std::string& name) {
    for (const Column& column : all)
      if (column.name == name) return column.value(run.series.rows.back());
    return double(NAN);
  };
  EXPECT_EQ(last("contacts"), 1.0);
  EXPECT_NEAR(last("x_target_rate_m_per_s"), machine.plant().truth().target.v.x(), 1e-12);
  EXPECT_GT(last("clearance_m"), 0.0);
}

TEST(ContactResults, TheMostEnergyPutInIsThatOfAnyTick) {
  Series series;
  const auto most = [&](const std::vector<double>& put_in) {
    series.rows.clear();
    for (const double joules : put_in) {
      Row row{};
      row.state = {};
      row.state.phase = static_cast<int>(Phase::kRunning);
      row.state.kind = static_cast<int>(SegmentKind::kAdmittance);
      row.state.energy_put_in = joules;
      series.rows.push_back(row);
    }
    nlohmann::ordered_json out;
    addEnergy(series, out);
    EXPECT_EQ(out["energy_put_in_j"], put_in.back());
    return out["energy_put_in_max_j"].get<double>();
  };
  EXPECT_EQ(most({3.0, 1.0, 2.0}), 3.0);
  EXPECT_EQ(most({1.0, 3.0, 2.0}), 3.0);
  EXPECT_EQ(most({1.0, 2.0, 3.0}), 3.0);
}

// What has been before admittance control is not counted; what still touches as it begins is.
TEST(ContactResults, BeginWithAdmittanceControl) {
  Series series;
  const auto row = [&](bool in_admittance, int contacts, bool touching, double began) {
    Row out;
    out.state = {};
    out.truth = {};
    out.state.phase = static_cast<int>(Phase::kRunning);
    out.state.kind =
        static_cast<int>(in_admittance ? SegmentKind::kAdmittance : SegmentKind::kCalibration);
    out.state.segment = in_admittance ? 1 : 0;
    out.state.machine_time_ns = 10'000'000 * std::ssize(series.rows);
    out.has_truth = true;
    out.truth.contacts = contacts;
    out.truth.touching = touching;
    out.truth.contact_began = began;
    series.rows.push_back(out);
  };
  row(false, 2, true, 0.0);
  row(true, 2, true, 0.0);
  row(true, 2, false, 0.0);
  row(true, 3, true, 0.025);
  const std::vector<Contact> touched = contactsOf(series);
  ASSERT_EQ(touched.size(), 2U);
  EXPECT_NEAR(touched[0].began, -0.01, 1e-12);
  EXPECT_NEAR(touched[1].began, 0.015, 1e-12);
  series.rows.erase(series.rows.begin(), series.rows.begin() + 2);  // that one has parted by then
  ASSERT_EQ(contactsOf(series).size(), 1U);
}

TEST(ContactConfig, IsRefusedByName) {
  const auto said = [&](const std::string& set) {
    return test::refusal([&] { meeting(1e4, "", {set}); });
  };
  for (const auto& [set, says] : std::vector<std::pair<std::string, std::string>>{
           {"environment.contact.stiffness=-1", "environment.contact.stiffness: '-1'"},
           {"environment.contact.friction=nan", "environment.contact.friction: 'nan'"},
           {"environment.contact.exponent=0.5", "environment.contact.exponent: '0.5'"},
           {"environment.tool=[]", "environment.tool: has no balls"},
           {"environment.target.at_m=[0, 0, 0]",
            "environment.target.at_m: want this or from_tool_m"},
           {"environment.target.mass_kg=0", "environment.target.mass_kg: '0'"},
           {"environment.target.from_tool_m=[0.3, 0, 0]",
            "environment.tool: is 0.0200 m inside a body at the start"},
           {"environment.grip={stiffness_n_per_m: 0}", "environment.grip.stiffness_n_per_m: '0'"},
           {"environment.grip={stiffness_n_per_m: 1, damping_n_s_per_m: 0, "
            "turn_stiffness_nm_per_rad: 1, turn_damping_nm_s_per_rad: 0, reach_m: 2}",
            "environment.grip.reach_m: '2'"},
           {"program=[{admittance: {duration_s: 3}, robot: [{at_s: 1, grasp: {target: true}}]}]",
            "grasp.target: there is none, or no grip"},
           {"environment.bodies=[{at_m: [0, 0, 9], wall: {}}]", "environment.bodies[0].wall"},
           {"environment.bodies=[{at_m: [0, 0, 9], box: {size_m: [1, 1]}}]",
            "environment.bodies[0].box.size_m: has 2 entries"},
           {"environment.gravity=1", "environment.gravity: unknown key"}})
    EXPECT_NE(said(set).find(says), std::string::npos) << set << ": " << said(set);
  EXPECT_NE(test::refusal([] {
              test::experiment("z_sine",
                               {"environment={tool: [{radius_m: 0}], contact: {stiffness: "
                                "1}, bodies: [{at_m: [0, 0, 9], half_space: {}}]}"});
            }).find("there is no robot with a tool"),
            std::string::npos);
}

}  // namespace
}  // namespace ves
