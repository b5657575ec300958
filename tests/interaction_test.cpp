// SPDX-License-Identifier: BSD-3-Clause
//
// Chapter 3, the robot on its flexible base, against conservation laws.
#include <gtest/gtest.h>

#include <algorithm>

#include "support/momentum.hpp"
#include "support/rig.hpp"
#include "ves/kinematics/stewart.hpp"
#include "ves/math/dense.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

Interaction interaction(const std::string& scenario, const std::vector<std::string>& set = {}) {
  std::int64_t duration = 0;
  return interactionOf(test::experiment(scenario, set), duration);
}

RigidBody lockedInP(const Interaction& i, const JointVector& q) {
  return combine(RigidBody{}, i.payload.X_PL0(), compositeBody(carried(i.payload), q));
}

TEST(Interaction, AugmentedMassIsTheModalMassOfBaseAndRobot) {  // (3.11)
  const Interaction i = interaction("srms_deploy_puma", {"base.keep_modes=8"});
  const RigidBody robot = lockedInP(i, i.q0);
  const MatrixXd expected =
      MatrixXd::Identity(8, 8) + std::get<ModalModel>(i.vehicle.kind).Phi.transpose() *
                                     spatialMass(robot) * std::get<ModalModel>(i.vehicle.kind).Phi;
  EXPECT_LT((augmentedModalMass(std::get<ModalModel>(i.vehicle.kind), robot) - expected)
                .cwiseAbs()
                .maxCoeff(),
            1e-12);
}

/// Kinetic energy of base and rigid robot, and what the base's springs hold.
double energy(const Interaction& i, const InteractionPoint& p, const RigidBody& robot_P,
              const BodyMotion& P) {
  const Vec6 twist = (Vec6() << P.v, P.w).finished();
  const Mat6 M = spatialMass(rotated(P.X.R, robot_P));
  return 0.5 * (p.eta_dot.squaredNorm() +
                std::get<ModalModel>(i.vehicle.kind).stiffness.dot(p.eta.cwiseAbs2()) +
                twist.dot(M * twist));
}

BodyMotion platform(const InteractionPoint& p) {
  return bodyMotion(Vec3::Zero(), Pose::from(p.x), p.x_dot, Vec6::Zero());
}

/// (3.11)'s, which does not turn with the base.
BodyMotion smallAngles(const InteractionPoint& p) {
  BodyMotion P;
  P.v = p.x_dot.head<3>();
  P.w = p.x_dot.tail<3>();
  return P;
}

/// Undamped and let go from a large deflection: 0.1 rad, 0.2 m.
Interaction letGo(InteractionOptions& options) {
  Interaction i = interaction("srms_unberth_doss", {"base.keep_modes=6"});
  std::get<ModalModel>(i.vehicle.kind).damping.setZero();
  i.actions.clear();
  options.duration = 10'000'000'000;
  options.tolerance = 1e-11;
  options.eta = VectorXd::Zero(6);
  options.eta << 1.5, -1.0, 2.0, 1.0, 0.5, 0.4;
  return i;
}

TEST(Interaction, WholeModelConservesEnergyWhenTheRobotStandsStill) {
  InteractionOptions options;
  const Interaction i = letGo(options);
  options.model = InteractionModel::kWhole;
  const std::vector<InteractionPoint> points = simulate(i, options);
  const RigidBody robot = lockedInP(i, i.q0);
  const double at_start = energy(i, points[0], robot, platform(points[0]));
  double most = 0.0, turned_most = 0.0;
  for (const InteractionPoint& p : points) {
    most = std::max(most, std::abs(energy(i, p, robot, platform(p)) - at_start));
    turned_most = std::max(turned_most, p.x.tail<3>().norm());
  }
  EXPECT_GT(turned_most, 0.1);
  EXPECT_LT(most, 1e-8 * at_start);
}

TEST(Interaction, SplitGainsTheWorkOfItsCentripetalTermAndNoMore) {
  // (3.11) keeps the robot's axes and its centripetal force but not how A turns with the base:
  // energy changes by the work of that force on the translation, and by nothing else.
  InteractionOptions options;
  const Interaction i = letGo(options);
  options.step = 1'000'000;
  const std::vector<InteractionPoint> points = simulate(i, options);
  const RigidBody robot = lockedInP(i, i.q0);
  const auto power = [&](const InteractionPoint& p) {
    const Vec6 twist = std::get<ModalModel>(i.vehicle.kind).Phi * p.eta_dot;
    const Vec3 w = twist.tail<3>();
    return robot.mass * twist.head<3>().dot(w.cross(robot.p_BoBcm_B.cross(w)));
  };
  const double at_start = energy(i, points[0], robot, smallAngles(points[0]));
  double work = 0.0, most_work = 0.0;
  for (std::size_t k = 2; k < points.size(); k += 2) {  // Simpson
    work += 1e-3 / 3.0 * (power(points[k - 2]) + 4.0 * power(points[k - 1]) + power(points[k]));
    most_work = std::max(most_work, std::abs(work));
    ASSERT_NEAR(energy(i, points[k], robot, smallAngles(points[k])), at_start + work,
                1e-8 * at_start);
  }
  EXPECT_GT(most_work, 1e-5 * at_start);  // there is something to account for
}

TEST(Interaction, SplitAndWholeBeginAlikeUnderAPointMass) {
  // A point mass on a free base that turns about one axis: without inertia of its own there is no
  // gyroscopic moment, which (3.11) leaves out; its centripetal force acts at its own place. (About
  // several axes at once the angles' rates differ from the angular velocity in the second order.)
  Interaction i = interaction("srms_unberth_doss", {"base.keep_modes=6"});
  std::get<ModalModel>(i.vehicle.kind).stiffness.setZero();
  std::get<ModalModel>(i.vehicle.kind).damping.setZero();
  i.actions.clear();
  for (Link& link : i.payload.robot.links) link.body = {};
  i.payload.top_plate_S = i.payload.adapter_R = {};
  i.payload.robot.base = {900.0, {0.3, -0.2, 0.5}, Mat3::Zero()};
  InteractionOptions options;
  options.duration = options.step = 1'000'000;
  options.tolerance = 1e-12;
  options.eta = VectorXd::Zero(6);
  for (const Vec6& twist :
       {Vec6(0.4 * Vec6::Unit(3)), Vec6(-0.3 * Vec6::Unit(4)), Vec6(0.5 * Vec6::Unit(5))}) {
    options.eta_dot = leastSquares(std::get<ModalModel>(i.vehicle.kind).Phi, twist);
    options.model = InteractionModel::kSplit;
    const Vec6 split = simulate(i, options).back().x_dot - twist;
    options.model = InteractionModel::kWhole;
    const Vec6 whole = simulate(i, options).back().x_dot - twist;
    for (const auto part : {0, 3}) {
      EXPECT_GT(whole.segment<3>(part).norm(), 1e-6);
      EXPECT_LT((split - whole).segment<3>(part).norm(), 0.01 * whole.segment<3>(part).norm());
    }
  }
}

TEST(Interaction, SmallMotionIsTheMatrixExponential) {
  InteractionOptions options;
  Interaction i = letGo(options);
  options.eta *= 1e-6;
  std::get<ModalModel>(i.vehicle.kind).damping =
      (0.04 * std::get<ModalModel>(i.vehicle.kind).stiffness.cwiseSqrt()).asDiagonal();
  const std::vector<InteractionPoint> points = simulate(i, options);
  const MatrixXd A = augmentedModalMass(std::get<ModalModel>(i.vehicle.kind), lockedInP(i, i.q0));
  MatrixXd S = MatrixXd::Zero(12, 12);
  S.topRightCorner(6, 6).setIdentity();
  S.bottomLeftCorner(6, 6) =
      -solvePositive(A, std::get<ModalModel>(i.vehicle.kind).stiffness.asDiagonal());
  S.bottomRightCorner(6, 6) = -solvePositive(A, std::get<ModalModel>(i.vehicle.kind).damping);
  for (const std::size_t k : {1u, 100u, 500u, 1000u}) {
    VectorXd start = VectorXd::Zero(12);
    start.head(6) = options.eta;
    const VectorXd expected = (exponential(S * points[k].t) * start).head(6);
    EXPECT_LT((points[k].eta - expected).norm(), 1e-6 * options.eta.norm()) << points[k].t;
  }
}

TEST(Interaction, MomentumOfAFreeBaseAndItsRobotStaysZero) {
  // A free base of 300 kg: the robot's swing must push it exactly against itself, and turn it so
  // about z. Its energy is of its angles' rates, so that it is the same base after a turn about z,
  // and after no other (Noether).
  Interaction i = interaction("srms_unberth_doss");
  std::get<ModalModel>(i.vehicle.kind).Phi = MatrixXd::Zero(6, 6);
  const double mass = 300.0;
  const Vec3 inertia(40.0, 60.0, 50.0);
  std::get<ModalModel>(i.vehicle.kind).Phi.diagonal() << Vec3::Constant(1.0 / std::sqrt(mass)),
      inertia.cwiseSqrt().cwiseInverse();
  std::get<ModalModel>(i.vehicle.kind).stiffness = VectorXd::Zero(6);
  std::get<ModalModel>(i.vehicle.kind).damping = MatrixXd::Zero(6, 6);
  const RobotMove first{2, -0.3, 2.0}, second{0, 0.8, 2.0};
  i.actions = {{0, first}, {500'000'000, second}};
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.step = 1'000'000;
  options.duration = 2'600'000'000;
  options.tolerance = 1e-12;
  const std::vector<InteractionPoint> points = simulate(i, options);

  const RobotModel robot = carried(i.payload);
  JointPaths joints(robot.joints, i.q0);
  joints.move(first, 0);
  JointPaths later = joints;
  later.move(second, i.actions[1].start);
  const auto index = [](double t) { return static_cast<std::size_t>(std::lround(t * 1e3)); };
  const auto X_IL0 = [&](double t) {
    const InteractionPoint& p = points[index(t)];
    return platform(p).X * i.payload.X_PL0();
  };
  const auto q = [&](double t) {
    const auto ns = std::llround(t * 1e9);
    return (ns < i.actions[1].start ? joints : later).at(ns).q;
  };
  double most_linear = 0.0, most_angular = 0.0;
  for (double t = 0.1; t < 2.5; t += 0.1) {
    const InteractionPoint& p = points[index(t)];
    const Vec6 twist = std::get<ModalModel>(i.vehicle.kind).Phi * p.eta_dot;
    const Vec3 P_base = mass * twist.head<3>();
    const double H_base = inertia.z() * twist(5) + p.x.head<3>().cross(P_base).z();
    const Vec6 of_robot = test::momentum(robot, X_IL0, q, t, 1e-3);
    most_linear = std::max(most_linear, P_base.norm());
    most_angular = std::max(most_angular, std::abs(H_base));
    EXPECT_LT((of_robot.head<3>() + P_base).norm(), 1e-5) << t;
    EXPECT_NEAR(of_robot(5), -H_base, 1e-5) << t;
  }
  EXPECT_GT(most_linear, 1.0);
  EXPECT_GT(most_angular, 1.0);
}

TEST(Interaction, SplitIsWrongByTheOrderOfTheBasesMobility) {
  // A base a hundred times as heavy and stiff moves a hundredth as far; what the split leaves out
  // is a product of that motion with the robot's, so relative to the motion it is a hundredth too.
  const auto error = [](double heavier) {
    Interaction i = interaction("srms_capture_doss", {"base.keep_modes=4"});
    std::get<ModalModel>(i.vehicle.kind).Phi /= std::sqrt(heavier);
    InteractionOptions options;
    options.tolerance = 1e-12;
    const std::vector<InteractionPoint> split = simulate(i, options);
    options.model = InteractionModel::kWhole;
    const std::vector<InteractionPoint> whole = simulate(i, options);
    double most = 0.0, apart = 0.0;
    for (std::size_t k = 0; k < split.size(); ++k) {
      most = std::max(most, whole[k].x.norm());
      apart = std::max(apart, (split[k].x - whole[k].x).norm());
    }
    return apart / most;
  };
  const double light = error(1.0), heavy = error(100.0);
  EXPECT_LT(light, 0.01);
  EXPECT_GT(light / heavy, 30.0);
  EXPECT_LT(light / heavy, 300.0);
}

TEST(Interaction, KeepingTheMassForNStepsErrsInProportionToN) {  // the report's shortcut
  const Interaction i = interaction("srms_capture_doss");
  const auto run = [&](int hold) {
    InteractionOptions options;
    options.hold_mass = hold;
    options.duration = 8'000'000'000;
    return simulate(i, options);
  };
  const std::vector<InteractionPoint> exact = run(0);
  const auto error = [&](int hold) {
    const std::vector<InteractionPoint> kept = run(hold);
    double apart = 0.0;
    for (std::size_t k = 0; k < kept.size(); ++k)
      apart = std::max(apart, (kept[k].x - exact[k].x).norm());
    return apart;
  };
  const double one = error(1), ten = error(10);
  EXPECT_GT(one, 0.0);
  EXPECT_NEAR(ten / one, 10.0, 3.0);
}

// Two methods, and points that no step ends at: a robot that moves, is pushed and stands.
TEST(Interaction, LongStepsAgreeWithShortOnes) {
  for (const char* scenario : {"srms_capture_doss", "puma_on_table_4_1"}) {
    Interaction i = interaction(scenario);
    Push push;
    push.force_I = {20.0, -10.0, 5.0};
    push.duration = 0.3337;
    i.actions = {{0, RobotMove{0, 0.3, 1.0}},
                 {503'000'123, RobotMove{1, -0.2, 0.7}},
                 {2'100'000'001, push},
                 {2'222'222'222, RobotMove{0, -0.3, 0.5}}};
    InteractionOptions options;
    options.model = InteractionModel::kWhole;
    options.duration = 4'004'000'000;  // no multiple of the step
    const std::vector<InteractionPoint> free = simulate(i, options);
    options.hold_mass = 1;  // of no meaning here, but that each step is for itself
    options.tolerance = 1e-12;
    const std::vector<InteractionPoint> stepwise = simulate(i, options);
    ASSERT_EQ(free.size(), 401u);
    ASSERT_EQ(stepwise.size(), 401u);
    double moved = 0.0;
    for (std::size_t k = 0; k < free.size(); ++k) {
      EXPECT_EQ(free[k].t, stepwise[k].t);
      EXPECT_NEAR(free[k].t, 0.01 * static_cast<double>(k), 1e-12);
      ASSERT_LT((free[k].x - stepwise[k].x).norm(), 1e-9) << scenario << " " << k;
      ASSERT_LT((free[k].x_dot - stepwise[k].x_dot).norm(), 1e-8) << scenario << " " << k;
      moved = std::max(moved, free[k].x.norm());
    }
    EXPECT_GT(moved, 1e-3);
  }
}

TEST(Interaction, SaysWhenTheToleranceCannotBeKept) {
  Interaction i = interaction("srms_unberth_doss");
  std::get<ModalModel>(i.vehicle.kind).stiffness.setConstant(NAN);
  EXPECT_THROW(simulate(i, {}), std::domain_error);
}

}  // namespace
}  // namespace ves
