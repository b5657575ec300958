// SPDX-License-Identifier: BSD-3-Clause
//
// A finger on the simulated machine: what is felt, what moves, and what is told of it.
#include <gtest/gtest.h>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/contract/plausible.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/run/robot_orders.hpp"
#include "ves/series/series.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {
namespace {

const Vec3 kForce(7.0, -12.0, 14.0);
constexpr std::int64_t kMillisecond = 1'000'000;

Experiment calm(const std::string& scenario, const std::vector<std::string>& set = {}) {
  std::vector<std::string> all = {"gravity_m_per_s2=0", "sensor.noise=false", "initial_pose={}"};
  all.insert(all.end(), set.begin(), set.end());
  return test::experiment(scenario, all);
}

/// Impulse [N s], [N m s] about Po in {I} that the sensor's true wrench has in a tenth of a second.
Wrench impulseOf(plant::Plant& plant) {
  Wrench sum;
  for (int i = 1; i <= 10'000; ++i) {
    plant.advance(i * 10'000);
    plant.sample();
    sum.f += 1e-5 * plant.truth().F_Po_I.f;
    sum.n += 1e-5 * plant.truth().F_Po_I.n;
  }
  return sum;
}

// Legs that nobody commands hold the platform: the sensor's elastic platform passes every impulse
// on, whatever share of a step of the mechanics the push begins and ends in.
TEST(Push, TheSensorFeelsItsImpulseAndMoment) {
  const Experiment e = calm("puma_on_table_4_1");
  const NamedFrame& tool = *e.robot.tool();
  for (const double duration : {0.05, 0.0123456789, 0.0004, 3e-6}) {
    for (const auto on : {PushOrder::On::kPlatform, PushOrder::On::kTool}) {
      plant::Plant plant(e.plant), calm(e.plant);
      plant.advance(3'333);
      const PushOrder order{on, Vec3(0.1, -0.05, 0.2), kForce, duration};
      ASSERT_TRUE(plant.moveRobot(pushOf(order, tool.link, tool.X_link)));
      const Transform X_IP = plant.truth().P.X;
      Transform X_PF;
      if (on == PushOrder::On::kTool)
        X_PF = e.plant.payload.X_PL0() *
               linkPoses(e.plant.payload.robot, e.plant.task.initial_joints)[tool.link] *
               tool.X_link;
      const Vec3 at = X_IP.R * (X_PF * order.point);
      const Wrench felt = impulseOf(plant), without = impulseOf(calm);
      const Vec3 impulse = duration * kForce;
      EXPECT_LT((felt.f - without.f - impulse).norm(), 1e-6 * impulse.norm()) << duration;
      EXPECT_LT((felt.n - without.n - at.cross(impulse)).norm(), 1e-6 * impulse.norm());
      EXPECT_EQ(plant.truth().pushes, 1);
    }
  }
}

TEST(Push, WhatFloatsTakesItsMomentum) {
  const double mass = 20.0, radius = 0.3;
  Experiment e =
      calm("puma_on_table_4_1",
           {fmt::format("environment={{tool: [{{radius_m: 0.02}}], contact: {{stiffness: "
                        "1000}}, target: {{mass_kg: {}, at_m: [3, 0, 3], ball: "
                        "{{radius_m: {}}}}}}}",
                        mass, radius)});
  e.plant.task.world->release = -1;
  plant::Plant plant(e.plant);
  const double inertia = 0.4 * mass * radius * radius;
  const Vec3 at(0.0, radius, 0.0), impulse = 0.25 * kForce;
  ASSERT_TRUE(plant.moveRobot(Push{Push::On::kTarget, -1, at, kForce, 0.25}));
  plant.advance(250 * kMillisecond);
  plant.sample();
  EXPECT_LT((plant.truth().target.v - impulse / mass).norm(), 1e-9);
  // The point goes with the ball, which has turned a little.
  EXPECT_LT((plant.truth().target.w - at.cross(impulse) / inertia).norm(),
            0.1 * at.cross(impulse).norm() / inertia);
  plant.advance(2000 * kMillisecond);
  plant.sample();
  EXPECT_LT((plant.truth().target.v - impulse / mass).norm(), 1e-9);
  EXPECT_FALSE(plant::Plant(calm("puma_on_table_4_1").plant)
                   .moveRobot(Push{Push::On::kTarget, -1, at, kForce, 0.25}));
}

/// m x'' + c x' + k x = F for `duration` from 0 on, from rest.
double pushed(double m, double c, double k, double F, double duration, double t) {
  const double decay = c / m / 2.0, turn = std::sqrt(k / m - decay * decay);
  const auto step = [&](double s) {
    if (s <= 0.0) return 0.0;
    return F / k *
           (1.0 - std::exp(-decay * s) * (std::cos(turn * s) + decay / turn * std::sin(turn * s)));
  };
  return step(t) - step(t - duration);
}

const std::vector<std::string> kPushedTable = {
    "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 6}, robot: [{at_s: 0.5, "
    "duration_s: 0.2, push: {on: platform, force_n: [20, 20, 20]}}, {at_s: 3.0034, duration_s: "
    "0.2, push: {on: platform, force_n: [0, 0, -20]}}]}]"};

double due(int i, double t) {  // Table 4.1
  const double k[] = {1500, 2500, 4000};
  double x = pushed(500, 500, k[i], 20.0, 0.2, t - 0.5);
  if (i == 2) x += pushed(500, 500, k[i], -20.0, 0.2, t - 3.0034);
  return x;
}

// No robot: the base of Table 4.1 is six oscillators.
TEST(Push, InFreeSpaceIsThatOfAnOscillator) {
  const Experiment e = calm("free_decay", kPushedTable);
  std::int64_t duration = 0;
  const Interaction i = interactionOf(e, duration);
  InteractionOptions options;
  options.duration = duration;
  for (const auto model : {InteractionModel::kWhole, InteractionModel::kSplit}) {
    options.model = model;
    for (const InteractionPoint& p : simulate(i, options))
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(p.x(k), due(k, p.t), 1e-9) << p.t;
  }
}

// The machine tells what it was pushed with; the program need not have said so.
TEST(Push, MovesThePlatformAsItWouldTheVehicle) {
  std::vector<std::string> set = kPushedTable;
  set.insert(set.end(), test::kCompensated.begin(), test::kCompensated.end());
  Series series = recordLockstep(calm("free_decay", set)).series;
  // What it does not tell, or not yet, is as the program has it; what both say is one push.
  ReferenceMotions references;
  LetGo begins(series.experiment), between(series.experiment), at_the_end(series.experiment);
  double t = NAN;  // [s] in admittance control
  for (const Row& row : series.rows) {
    if (inAdmittance(row.state) && std::isnan(t)) t = -row.t;
    if (!(t + row.t > 0.0)) begins.add(row);
    if (!(t + row.t > 2.0)) between.add(row);
    at_the_end.add(row);
  }
  EXPECT_EQ(begins.pushes().size(), 0u);
  EXPECT_EQ(between.pushes().size(), 1u);
  for (const LetGo* known : {&begins, &between, &at_the_end}) {
    const auto base = baseMotion(series.experiment, *known, references);
    ASSERT_TRUE(base);
    for (std::size_t i = 0; i < base->x.size(); ++i)
      for (int k = 0; k < 3; ++k) EXPECT_NEAR(base->x[i](k), due(k, base->t[i]), 5e-6);
  }
  series.experiment.plant.task.robot_events.clear();
  const std::vector<TimedAction> told = letGoOf(series).pushes();
  ASSERT_EQ(told.size(), 2u);
  EXPECT_NEAR(static_cast<double>(told[0].start), 0.5e9, 1e6);
  EXPECT_NEAR(static_cast<double>(told[1].start), 3.0034e9, 1e6);
  EXPECT_EQ(std::get<Push>(told[1].action).force_I, Vec3(0, 0, -20));

  const auto both = emulation(series, references);
  ASSERT_TRUE(both);
  double most = 0.0;
  for (std::size_t i = 0; i < both->base.x.size(); ++i)
    for (int k = 0; k < 3; ++k) {
      const double x = due(k, both->base.t[i] - both->base.t[0]);
      EXPECT_NEAR(both->base.x[i](k), x, 5e-6);
      most = std::max(most, std::abs(x));
    }
  EXPECT_GT(most, 2e-3);
  const Distance off = distance(both->platform, both->base), moved = travel(both->base);
  EXPECT_LT(off.rms_position, 0.05 * moved.rms_position);
  EXPECT_GT(off.rms_position, 0.0);
}

TEST(Push, OneTakesThePlaceOfAnother) {
  const Experiment e = calm("free_decay");
  plant::Plant twice(e.plant), once(e.plant);
  EXPECT_TRUE(twice.moveRobot(Push{Push::On::kPlatform, -1, Vec3::Zero(), kForce, 30.0}));
  EXPECT_TRUE(once.moveRobot(Push{Push::On::kPlatform, -1, Vec3::Zero(), kForce, 0.1}));
  twice.advance(100 * kMillisecond);
  once.advance(100 * kMillisecond);
  EXPECT_TRUE(twice.moveRobot(Push{Push::On::kPlatform, -1, Vec3::Zero(), Vec3::Zero(), 0.001}));
  for (int i = 101; i <= 300; ++i) {
    twice.advance(i * kMillisecond);
    once.advance(i * kMillisecond);
    const auto a = twice.sample().adc, b = once.sample().adc;
    for (std::size_t k = 0; k < a.size(); ++k) EXPECT_NEAR(a[k], b[k], 1) << i;
  }
  EXPECT_EQ(twice.truth().pushes, 2);
}

TEST(Push, NothingRealIsPushed) {
  const std::string real = "machine.legs=external";
  const std::string event =
      "program=[{move: {}}, {admittance: {duration_s: 2}, robot: [{at_s: 1, duration_s: 0.2, push: "
      "{on: platform, force_n: [1, 0, 0]}}]}]";
  EXPECT_NE(test::refusal([&] {
              calm("free_decay", {real, event});
            }).find("pieces of this one are real"),
            std::string::npos);
  const PushOrder order{PushOrder::On::kPlatform, Vec3::Zero(), Vec3(1, 0, 0), 0.2};
  const Experiment some = calm("puma_on_table_4_1", {real}), all = calm("puma_on_table_4_1");
  RobotOrders refused(some), taken(all);
  EXPECT_EQ(test::refusal([&] { refused.take(order, {}); }),
            "a push is for a machine that is all simulated; pieces of this one are real");
  EXPECT_TRUE(taken.take(order, {}));
  PushOrder nowhere = order;
  nowhere.on = static_cast<PushOrder::On>(3);
  EXPECT_TRUE(plausible(order));
  EXPECT_FALSE(plausible(nowhere));
  for (const double bad : std::initializer_list<double>{NAN, -INFINITY, 1e3}) {
    PushOrder far = order, hard = order, long_one = order;
    far.point.y() = bad;
    hard.force_I.z() = bad;
    long_one.duration = bad;
    EXPECT_FALSE(plausible(far)) << bad;
    EXPECT_FALSE(plausible(hard)) << bad;
    EXPECT_FALSE(plausible(long_one)) << bad;
  }
  PushOrder askew = order;  // each within, all of it too much
  askew.force_I.setConstant(150.0);
  EXPECT_FALSE(plausible(askew));
  const Experiment none = calm("free_decay");
  RobotOrders nobody(none);
  EXPECT_TRUE(nobody.take(order, {}));
  PushOrder tool = order;
  tool.on = PushOrder::On::kTool;
  EXPECT_EQ(test::refusal([&] { nobody.take(tool, {}); }),
            "there is no robot with one tip to push");
}

}  // namespace
}  // namespace ves
