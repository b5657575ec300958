// SPDX-License-Identifier: BSD-3-Clause
//
// A vehicle that feels the weight of what stands on it, against statics and pendulums.
#include <gtest/gtest.h>

#include "support/rig.hpp"
#include "ves/analysis/loop.hpp"
#include "ves/evaluation/summary.hpp"
#include "ves/run/run.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {
namespace {

constexpr double kHeld = 0.01;    // [s]
constexpr double kG = 9.81;       // [m/s^2]
constexpr double kTurns = 200.0;  // [kg m^2] of the vehicle
const RigidBody kLeans{30.0, {0.0, 0.0, 0.7}, Vec3(2.0, 2.0, 0.5).asDiagonal()};
const double kInertia = kTurns + 2.0 + 30.0 * 0.7 * 0.7, kTopples = 30.0 * kG * 0.7;  // [N m/rad]

/// One coordinate moves, against a spring and a damper.
VehicleModel oneMode(int coordinate, double mass, double damping, double stiffness) {
  ModalModel out;
  out.Phi = Vec6::Unit(coordinate) / std::sqrt(mass);
  out.stiffness.setConstant(1, stiffness / mass);
  out.damping.setConstant(1, 1, damping / mass);
  VehicleModel vehicle = out;
  vehicle.gravity = {0.0, 0.0, -kG};
  return vehicle;
}

CarriedBody weighing(const RigidBody& body) {
  CarriedBody out{spatialMass(body)};
  out.mass = body.mass;
  out.moment_P = body.mass * body.p_BoBcm_B;
  return out;
}

std::vector<InteractionPoint> leaning(const VehicleModel& vehicle, const Vec6& start,
                                      double seconds) {
  Interaction i;
  i.vehicle = vehicle;
  i.payload.robot.base = kLeans;
  i.start = start;
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.tolerance = 1e-11;
  options.duration = std::llround(seconds * 1e9);
  return simulate(i, options);
}

TEST(FeltWeight, SwingsAsAPendulumThatASpringHoldsUp) {
  const double k = 1.7 * kTopples, w = std::sqrt((k - kTopples) / kInertia), a = 1e-4;
  const VehicleModel vehicle = oneMode(3, kTurns, 0.0, k);
  const auto should = [&](double t) { return a * std::cos(w * t); };
  for (const InteractionPoint& p : leaning(vehicle, a * Vec6::Unit(3), 10.0))
    ASSERT_NEAR(p.x(3), should(p.t), 1e-6 * a) << p.t;
  // The model, by steps of the order that they say, and ahead of its wrenches too.
  const auto error = [&](double period, double ahead) {
    AdmittanceModel model(vehicle, period);
    model.reset(a * Vec6::Unit(3), spatialMass(kLeans), ahead);
    double most = 0.0;
    for (int n = 1; n * period <= 10.0; ++n) {
      model.step(Wrench{}, weighing(kLeans), period, ahead);
      most = std::max(most, std::abs(model.motion().x(3) - should(n * period)) / a);
    }
    return most;
  };
  EXPECT_LT(error(kHeld, 0.0), 1e-3);
  EXPECT_NEAR(error(kHeld, 0.0) / error(0.5 * kHeld, 0.0), 4.0, 0.3);
  EXPECT_LT(error(0.1 * kHeld, 0.02), 1.5e-4);  // let go without its weight: 1.9e-4
}

TEST(FeltWeight, OfWhatStoodThereIsInBalanceAndOfWhatMovesIsNot) {
  const double k = 5.0 * kTopples, aside = 0.02;
  AdmittanceModel model(oneMode(3, kTurns, 400.0, k), kHeld);
  RigidBody body = kLeans;
  body.p_BoBcm_B.y() = 0.3;
  model.reset(Vec6::Zero(), spatialMass(body));
  for (int n = 0; n < 100; ++n) model.step(Wrench{}, weighing(body), kHeld, 0.0);
  EXPECT_LT(model.motion().x.norm(), 1e-14);
  body.p_BoBcm_B.y() += aside;  // it leans that way: a moment of minus x
  for (int n = 0; n < 3000; ++n) model.step(Wrench{}, weighing(body), kHeld, 0.0);
  EXPECT_NEAR(model.motion().x(3), -30.0 * kG * aside / (k - kTopples), 2e-5);
  // As it is let go anew, all that it has is what it is in balance with.
  model.reset(Vec6::Zero(), spatialMass(body));
  for (int n = 0; n < 100; ++n) model.step(Wrench{}, weighing(body), kHeld, 0.0);
  EXPECT_LT(model.motion().x.norm(), 1e-14);
}

TEST(FeltWeight, PullsDownADeckThatTilts) {
  const double k = 3e4, mass = 400.0, tilt = 0.12;
  VehicleModel vehicle = oneMode(1, mass, 4e3, k);
  vehicle.ground.rows.setZero(18, 2);
  vehicle.ground.rows.row(3).setConstant(tilt);
  vehicle.ground.step = 100.0;
  vehicle.ground.fade = 5.0;
  AdmittanceModel model(vehicle, kHeld);
  model.reset(Vec6::Zero(), spatialMass(kLeans));
  for (int n = 0; n < 3000; ++n) model.step(Wrench{}, weighing(kLeans), kHeld, 0.0);
  const double should = -(mass + kLeans.mass) * kG * std::sin(tilt) / k;
  EXPECT_NEAR(model.motion().x(1), should, 1e-9);
  EXPECT_NEAR(leaning(vehicle, Vec6::Zero(), 30.0).back().x(1), should, 1e-9);
  // A heavier vehicle is pulled more, a stiffer one less.
  model.become({2.0, 1.0, 1.0});
  for (int n = 0; n < 3000; ++n) model.step(Wrench{}, weighing(kLeans), kHeld, 0.0);
  EXPECT_NEAR(model.motion().x(1), should * (2.0 * mass + 30.0) / (mass + 30.0), 1e-9);
}

TEST(FeltWeight, ItsWorkIsInTheBooks) {
  AdmittanceModel model(oneMode(3, kTurns, 0.0, 2.0 * kTopples), kHeld);
  CarriedBody weight{
      Mat6::Zero()};  // a weight without inertia, so that the energy is the vehicle's
  weight.mass = 30.0;
  weight.moment_P = {0.0, 0.1, 21.0};
  model.reset(0.1 * Vec6::Unit(3));
  double given = model.energy(), least = given;
  for (int n = 0; n < 1000; ++n) {
    model.step(Wrench{}, weight, kHeld, 0.0);
    given += model.shaken();
    least = std::min(least, given);
    ASSERT_NEAR(model.energy(), given, 1e-9) << n;
  }
  EXPECT_LT(least, 0.7 * 0.5 * 2.0 * kTopples * 0.01);
}

TEST(FeltWeight, IsAsStiffAsItsPotentialIsCurved) {
  const Vec3 gravity(0.3, -0.2, -9.7), moment(4.0, -3.0, 21.0);
  const auto height = [&](const Vec3& rpy) {
    const Mat3 R =
        (Eigen::AngleAxisd(rpy.z(), Vec3::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Vec3::UnitY()) *
         Eigen::AngleAxisd(rpy.x(), Vec3::UnitX()))
            .toRotationMatrix();
    return -gravity.dot(R * moment);
  };
  constexpr double h = 1e-3;
  const Mat6 K = stiffnessOfWeight(gravity, moment);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const Vec3 a = h * Vec3::Unit(i), b = h * Vec3::Unit(j);
      const double second =
          (height(a + b) - height(a - b) - height(b - a) + height(-a - b)) / (4.0 * h * h);
      EXPECT_NEAR(K(3 + i, 3 + j), second, 1e-3) << i << j;
    }
  // And works as it falls, however far it is turned.
  const Vec3 turned(0.4, -0.3, 0.6);
  const Vec6 work = workOfWeight(gravity, 7.0, moment, turned);
  EXPECT_LT((work.head<3>() - 7.0 * gravity).norm(), 1e-15);
  for (int i = 0; i < 3; ++i) {
    const Vec3 a = h * Vec3::Unit(i);
    EXPECT_NEAR(work(3 + i), (height(turned - a) - height(turned + a)) / (2.0 * h), 1e-4) << i;
  }
  EXPECT_TRUE(K.topRows<3>().isZero(0.0) && K.leftCols<3>().isZero(0.0));
}

TEST(FeltWeight, OfWhatFallsOverTheLoopSaysHowFast) {
  const Experiment e = test::experiment("puma_on_table_4_1", test::kCompensated);
  Loop loop = loopOf(e.controller, JointVector::Zero(), Direction::kExtending);
  loop.robot_P = loop.model.robot_P = kLeans;
  constexpr double kDamping = 80.0;  // [N m s/rad]
  for (const double share : {0.6, 0.95}) {
    const VehicleModel vehicle = oneMode(3, kTurns, kDamping, share * kTopples);
    loop.base = linearised(vehicle);
    loop.gravity = vehicle.gravity;
    const double half = 0.5 * kDamping / kInertia, lacks = (1.0 - share) * kTopples / kInertia;
    const DominantRoot root = dominantRoot(loop);
    EXPECT_FALSE(decays(loop)) << share;
    EXPECT_NEAR(root.frequency, 0.0, 1e-9) << share;
    EXPECT_NEAR(root.growth, -half + std::sqrt(half * half + lacks), 5e-4) << share;
    // As published the wrench brings the inertia, and hardly later where nothing is fast.
    Loop published = loop;
    published.model.inertia = published.model.feed_forward = false;
    EXPECT_NEAR(dominantRoot(published).growth, root.growth, 0.02 * root.growth) << share;
  }
  loop.base = linearised(oneMode(3, kTurns, kDamping, 1.05 * kTopples));
  EXPECT_TRUE(decays(loop));
  loop.gravity.setZero();
  loop.base = linearised(oneMode(3, kTurns, kDamping, 0.6 * kTopples));
  EXPECT_TRUE(decays(loop));
}

TEST(FeltWeight, OfABaseThatFallsOverNoRunBegins) {
  std::vector<std::string> sets = test::kCompensated;
  sets.push_back("base.stiffness_diagonal=[1500, 1500, 1500, 300, 1000, 2000]");
  Experiment stands = test::unassessed("puma_on_table_4_1", sets);
  EXPECT_EQ(applyStabilityCheck(stands), "");
  sets.push_back("base.weight=felt");
  Experiment falls = test::unassessed("puma_on_table_4_1", sets);
  const std::string why = applyStabilityCheck(falls);
  EXPECT_NE(why.find("most in alpha"), std::string::npos) << why;
  EXPECT_NE(why.find("a lighter or lower robot, or a stiffer base"), std::string::npos) << why;
  EXPECT_EQ(falls.controller.stability, Stability::kUnstable);
}

TEST(FeltWeight, IsEmulatedAsItIsInFreeSpace) {
  // An arm that is laid down on a base that gives way under its weight.
  for (const char* noise : {"sensor.noise=false", "controller.compensation.wrench=aided"}) {
    std::vector<std::string> sets = {test::kCompensated.begin(), test::kCompensated.end()};
    sets.insert(sets.end(), {"base.weight=felt", noise});
    const RecordedRun run = recordLockstep(test::experiment("puma_on_table_4_1", sets));
    const auto summary = summarise(run.series, run.result);
    ASSERT_EQ(run.result.phase, Phase::kParked);
    EXPECT_LT(summary["emulation_error_position_share"].get<double>(), 1e-3) << noise;
    EXPECT_LT(summary["emulation_error_attitude_share"].get<double>(), 3e-3) << noise;
    EXPECT_GT(summary["emulation_travel_rad"].get<double>(), 5.5 * kDegree) << noise;  // 4 without
  }
}

}  // namespace
}  // namespace ves
