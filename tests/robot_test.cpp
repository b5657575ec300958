// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <kdl/chainidsolver_recursive_newton_euler.hpp>
#include <random>

#include "support/momentum.hpp"
#include "support/poses.hpp"
#include "support/robots.hpp"
#include "support/trees.hpp"
#include "ves/planning/joint_paths.hpp"
#include "ves/robot/mass_regressor.hpp"
#include "ves/robot/momentum.hpp"
#include "ves/robot/newton_euler.hpp"

namespace ves {
namespace {

using test::kG;

/// Joints that swing, each its own way, with exact derivatives.
JointState jointSwing(int joints, double t) {
  JointState s;
  for (int i = 0; i < joints; ++i) {
    const double w = 1.0 + 0.3 * i, a = 0.8 - 0.05 * i, phase = 0.7 * i;
    s.q(i) = a * std::sin(w * t + phase);
    s.q_dot(i) = a * w * std::cos(w * t + phase);
    s.q_ddot(i) = -a * w * w * std::sin(w * t + phase);
  }
  return s;
}

/// A revolute-prismatic-revolute arm with skew axes, for what no table robot has.
RobotModel skewRobot() {
  RobotModel robot;
  robot.base = {3.0, {0.1, -0.05, 0.2}, Vec3(0.1, 0.2, 0.15).asDiagonal()};
  for (int i = 0; i < 3; ++i) {
    Link link;
    link.type = i == 1 ? JointType::kPrismatic : JointType::kRevolute;
    link.X_parent = {rotation({0.3 * i, -0.4, 0.2 + i}), {0.2, 0.1 * i, 0.3}};
    link.axis = Vec3(0.2, -0.5 * i, 1.0).normalized();
    link.body = {2.0 + i, {0.05, 0.1, -0.2 * i}, Vec3(0.05, 0.06, 0.07).asDiagonal()};
    robot.extend(link);
  }
  return robot;
}

double totalMass(const RobotModel& robot) {
  double mass = robot.base.mass;
  for (int i = 0; i < robot.size; ++i) mass += robot.link(i).body.mass;
  return mass;
}

class MovingBase : public testing::TestWithParam<const char*> {};

TEST_P(MovingBase, WrenchIsTheRateOfMomentum) {  // Appendix A with link 0 and a base that moves
  const std::string name = GetParam();
  const RobotModel robot = name == "skew" ? skewRobot() : test::robot(name).model;
  const Transform X_PL0{rotation({0.1, -0.2, 0.5}), {0.05, -0.1, 0.12}};
  const double h = 1e-2;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const test::Swing base(seed);
    for (double t = 0.3; t < 2.0; t += 0.4) {
      const auto p = [&](double s) {
        return test::momentum(
            robot, [&](double at) { return base.motion(at).X * X_PL0; },
            [&](double at) { return jointSwing(robot.joints, at).q; }, s, h);
      };
      const Vec6 rate = test::derivative(p, t, h);

      const BodyMotion P = base.motion(t);
      const Wrench F_L0o_L0 =
          newtonEuler(robot, jointSwing(robot.joints, t), properMotion(P, X_PL0, Vec3::Zero()))
              .F_L0o_L0;
      const Wrench F_Io_I = transfer(P.X * X_PL0, F_L0o_L0);
      ASSERT_LT((F_Io_I.stacked() - rate).norm(), 1e-9 * (1.0 + rate.norm()));
    }
  }
}

TEST_P(MovingBase, JointsHaveTheMomentumOfTheirLinks) {  // on a base at rest
  const std::string name = GetParam();
  const RobotModel robot = name == "skew" ? skewRobot() : test::robot(name).model;
  for (double t = 0.3; t < 4.0; t += 0.7) {
    const Vec6 should = test::momentum(
        robot, [](double) { return Transform(); },
        [&](double at) { return jointSwing(robot.joints, at).q; }, t, 1e-2);
    const JointState joints = jointSwing(robot.joints, t);
    ASSERT_LT((jointMomentum(robot, joints.q, joints.q_dot) - should).norm(),
              1e-9 * (1.0 + should.norm()));
  }
}

// Wrong masses and centres: what the columns say of them is what another robot's momentum and
// weight differ by.
TEST_P(MovingBase, MassColumnsAreWhatARobotOfOtherMassesDiffersBy) {
  const std::string name = GetParam();
  const RobotModel robot = name == "skew" ? skewRobot() : test::robot(name).model;
  const MassRegressor regressor(robot);
  const Hand hand{robot.size - 1, Vec3(0.1, -0.05, 0.2)};
  const MassRegressor with_hand(robot, hand);
  const Transform X_PL0{rotation({0.3, -0.2, 0.5}), Vec3(0.1, -0.3, 0.4)};
  const Vec3 g_I(1.0, -2.0, -9.0);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> some(-0.2, 0.2);
  for (double t = 0.3; t < 4.0; t += 0.7) {
    const JointState joints = jointSwing(robot.joints, t);
    const BodyMotion P = test::Swing(4).motion(t);
    MassColumns momentum, weight;
    regressor.evaluate(X_PL0, g_I, {P.X.R, P.v, P.w, joints.q, joints.q_dot}, momentum, weight);
    const MassVector by = MassVector::NullaryExpr(regressor.size(), [&] { return some(random); });

    const auto ofRobot = [&](const RobotModel& of) -> std::pair<Vec6, Vec6> {
      const Wrench in_L0 = Wrench::from(jointMomentum(of, joints.q, joints.q_dot));
      const RigidBody whole = combine(RigidBody{}, X_PL0, compositeBody(of, joints.q));
      const RigidBody whole_I = rotated(P.X.R, whole);
      const Vec6 twist = (Vec6() << P.v, P.w).finished();
      const Vec3 f = whole_I.mass * g_I;
      return {rotate(P.X.R, transfer(X_PL0, in_L0)).stacked() + spatialMass(whole_I) * twist,
              (Vec6() << f, whole_I.p_BoBcm_B.cross(f)).finished()};
    };
    const auto [momentum_0, weight_0] = ofRobot(robot);
    const auto [momentum_1, weight_1] = ofRobot(regressor.changed(by));
    ASSERT_LT((momentum * by - (momentum_1 - momentum_0)).norm(), 1e-10 * momentum_0.norm());
    ASSERT_LT((weight * by - (weight_1 - weight_0)).norm(), 1e-10 * weight_0.norm());
    ASSERT_GT((weight_1 - weight_0).norm(), 1e-3 * weight_0.norm());

    // A body at the hand; what its centre is off by counts in its weight alone.
    with_hand.evaluate(X_PL0, g_I, {P.X.R, P.v, P.w, joints.q, joints.q_dot}, momentum, weight);
    ASSERT_EQ(with_hand.hand(), with_hand.size() - 4);
    const double mass = 3.0;
    const Vec3 off = 0.1 * Vec3(some(random), some(random), some(random));
    const auto [momentum_2, weight_2] =
        ofRobot(withLoad(robot, hand.link, {mass, hand.p_LT_L, Mat3::Zero()}));
    const auto [momentum_3, weight_3] =
        ofRobot(withLoad(robot, hand.link, {mass, hand.p_LT_L + off, Mat3::Zero()}));
    ASSERT_LT((mass * momentum.col(with_hand.hand()) - (momentum_2 - momentum_0)).norm(),
              1e-10 * momentum_0.norm());
    MassVector held = MassVector::Zero(with_hand.size());
    held.tail<4>() << mass, mass * off;
    ASSERT_LT((weight * held - (weight_3 - weight_0)).norm(), 1e-10 * weight_0.norm());
  }
}

// In kg and kg m, and what these are off by: as the robot with those parameters has them.
TEST_P(MovingBase, LearntMassesAreThoseOfTheRobotThatIsReckonedWith) {
  const std::string name = GetParam();
  const RobotModel robot = name == "skew" ? skewRobot() : test::robot(name).model;
  const MassRegressor regressor(robot, {robot.size - 1, Vec3(0.1, -0.05, 0.2)});
  std::mt19937 random(5);
  std::uniform_real_distribution<double> some(-0.2, 0.2);
  const auto draw = [&] { return some(random); };
  const Eigen::Index n = regressor.size();
  const MassVector by = MassVector::NullaryExpr(n, draw);
  const MassCovariance half = MassCovariance::NullaryExpr(n, n, draw);
  const MassCovariance P = half * half.transpose();
  const BodyMasses told = regressor.described(by, P);
  const auto own = [](const RigidBody& body) {
    return (Eigen::Vector4d() << body.mass, body.mass * body.p_BoBcm_B).finished();
  };
  MassVector without_hand = by;
  without_hand.tail<4>().setZero();
  const auto bodies = regressor.links();
  ASSERT_EQ(static_cast<Eigen::Index>(4 * bodies.size()), n);
  for (std::size_t k = 0; k + 1 < bodies.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    const Eigen::Vector4d truth = own(regressor.changed(without_hand).bodyOf(bodies[k]));
    EXPECT_NEAR(told.mass(at), truth(0), 1e-12 * truth(0));
    EXPECT_LT((told.moment.segment<3>(3 * at) - truth.tail<3>()).norm(), 1e-10);
    Eigen::MatrixXd J(4, n);  // linear: a difference is exact
    for (Eigen::Index j = 0; j < n; ++j) {
      MassVector more = without_hand;
      if (j < n - 4) more(j) += 1.0;
      J.col(j) = own(regressor.changed(more).bodyOf(bodies[k])) - truth;
    }
    const Eigen::VectorXd deviation = (J * P * J.transpose()).diagonal().cwiseSqrt();
    EXPECT_NEAR(told.mass_deviation(at), deviation(0), 1e-9 * deviation(0));
    EXPECT_LT((told.moment_deviation.segment<3>(3 * at) - deviation.tail<3>()).norm(), 1e-9);
  }
  const Eigen::Index hand = n / 4 - 1;
  EXPECT_EQ(told.mass(hand), by(n - 4));  // 1 kg a unit, and nothing to begin with
  EXPECT_EQ(Vec3(told.moment.segment<3>(3 * hand)), Vec3(by.tail<3>()));
  EXPECT_DOUBLE_EQ(told.mass_deviation(hand), std::sqrt(P(n - 4, n - 4)));
  for (Eigen::Index k = hand + 1; k < kMaxUncertain; ++k) EXPECT_EQ(told.mass(k), 0.0);
}

TEST_P(MovingBase, GravityIsAnUpwardAcceleration) {
  const std::string name = GetParam();
  const RobotModel robot = name == "skew" ? skewRobot() : test::robot(name).model;
  const test::Swing base(2);
  const BodyMotion P = base.motion(0.7);
  const Vec3 g_I(0.0, 0.0, -kG);
  const JointState q = jointSwing(robot.joints, 0.7);
  const Wrench with = newtonEuler(robot, q, properMotion(P, {}, g_I)).F_L0o_L0;
  const Wrench without = newtonEuler(robot, q, properMotion(P, {}, Vec3::Zero())).F_L0o_L0;
  const Vec3 extra = P.X.R * (with.f - without.f);
  EXPECT_LT((extra + totalMass(robot) * g_I).norm(), 1e-9);
}

INSTANTIATE_TEST_SUITE_P(Robots, MovingBase, testing::Values("puma560", "doss", "skew"),
                         [](const auto& test) { return std::string(test.param); });

class JointEfforts : public testing::TestWithParam<const char*> {};

TEST_P(JointEfforts, EqualKdlOnAFixedBase) {
  const RobotModel robot = test::robot(GetParam()).model;
  const KDL::Chain chain = test::kdlChain(GetParam());
  const auto n = static_cast<unsigned>(robot.joints);
  ASSERT_EQ(chain.getNrOfJoints(), n);
  KDL::ChainIdSolver_RNE solver(chain, KDL::Vector(0, 0, -kG));
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(-3.0, 3.0);
  ProperMotion base;
  base.a = {0.0, 0.0, kG};
  for (int k = 0; k < 1000; ++k) {
    KDL::JntArray q(n), qd(n), qdd(n), tau(n);
    JointState s;
    for (unsigned i = 0; i < n; ++i) {
      s.q(i) = q(i) = u(random);
      s.q_dot(i) = qd(i) = u(random);
      s.q_ddot(i) = qdd(i) = u(random);
    }
    ASSERT_GE(solver.CartToJnt(q, qd, qdd,
                               KDL::Wrenches(chain.getNrOfSegments(), KDL::Wrench::Zero()), tau),
              0);
    const JointVector ours = newtonEuler(robot, s, base).tau;
    for (unsigned i = 0; i < n; ++i) ASSERT_NEAR(ours(i), tau(i), 1e-10 * (1.0 + std::abs(tau(i))));
  }
}

INSTANTIATE_TEST_SUITE_P(Robots, JointEfforts, testing::Values("puma560", "doss"),
                         [](const auto& test) { return std::string(test.param); });

/// Gravity torques in closed form (Armstrong, Khatib and Burdick's frames) with Table 2.1's masses.
struct PumaGravity {
  double g1, g2, g3, g4, g5;
  PumaGravity() {
    const double m2 = 17.4, m3 = 4.8, m4 = 0.82, m5 = 0.34, m6 = 0.09;
    const double a2 = 0.4318, a3 = -0.0203, d4 = 0.4331;
    g1 = -kG * (m2 * 0.068 + (m3 + m4 + m5 + m6) * a2);
    g2 = -kG * (m3 * 0.070 + m4 * (d4 - 0.019) + (m5 + m6) * d4);
    g3 = kG * m2 * 0.006;
    g4 = -kG * (m4 + m5 + m6) * a3;
    g5 = -kG * m6 * 0.032;
  }
  JointVector torques(const JointVector& q) const {
    const double s2 = std::sin(q(1)), c2 = std::cos(q(1));
    const double s23 = std::sin(q(1) + q(2)), c23 = std::cos(q(1) + q(2));
    const double s4 = std::sin(q(3)), c4 = std::cos(q(3)), s5 = std::sin(q(4)), c5 = std::cos(q(4));
    const double wrist = g5 * (s23 * c5 + c23 * c4 * s5);
    JointVector tau = JointVector::Zero();
    tau(1) = g1 * c2 + g2 * s23 + g3 * s2 + g4 * c23 + wrist;
    tau(2) = g2 * s23 + g4 * c23 + wrist;
    tau(3) = -g5 * s23 * s4 * s5;
    tau(4) = g5 * (c23 * s5 + s23 * c4 * c5);
    return tau;
  }
};

TEST(Puma, GravityTorquesAreTheClosedForm) {
  const RobotModel robot = test::robot("puma560").model;
  ProperMotion base;
  base.a = {0.0, 0.0, kG};
  std::mt19937 random(9);
  std::uniform_real_distribution<double> u(-3.0, 3.0);
  const PumaGravity closed;
  for (int k = 0; k < 500; ++k) {
    JointState s;
    for (int i = 0; i < 6; ++i) s.q(i) = u(random);
    ASSERT_LT((newtonEuler(robot, s, base).tau - closed.torques(s.q)).norm(), 1e-10);
  }
}

TEST(Puma, WeighsWhatItsTableSays) {
  const RobotModel robot = test::robot("puma560").model;
  EXPECT_NEAR(totalMass(robot), 52.45, 1e-12);
  // Base moment of links 1 to 6 about frame 0 in the ready pose, added up by hand.
  RobotModel moving = robot;
  moving.base = {};
  ProperMotion base;
  base.a = {0.0, 0.0, kG};
  JointState ready;
  ready.q.head<3>() << 0.0, -90 * kDegree, 90 * kDegree;
  const Wrench F_L0o = newtonEuler(moving, ready, base).F_L0o_L0;
  const Wrench F_frame0 = shift(F_L0o, {0.0, 0.0, 0.672});
  EXPECT_NEAR(F_frame0.f.z(), 318.33, 0.01);
  EXPECT_NEAR(F_frame0.n.x(), 60.31978, 1e-4);
  EXPECT_NEAR(F_frame0.n.y(), -0.77524, 1e-4);
}

TEST(JointPaths, ANewMoveTakesOverWhereTheJointIsAndMeetsItsTargetAtRest) {
  JointVector q0 = JointVector::Zero();
  q0(0) = 0.3;
  JointPaths joints(2, q0);
  const std::int64_t s = 1'000'000'000;
  EXPECT_FALSE(joints.moving(s));
  ASSERT_TRUE(joints.move({0, 1.0, 2.0}, 5 * s));
  EXPECT_TRUE(joints.moving(6 * s));
  const JointState before = joints.at(6 * s + s / 3);
  ASSERT_TRUE(joints.move({0, -0.5, 1.5}, 6 * s + s / 3));
  const JointState after = joints.at(6 * s + s / 3);
  EXPECT_GT(before.q_dot(0), 0.1);
  EXPECT_NEAR(after.q(0), before.q(0), 1e-12);
  EXPECT_NEAR(after.q_dot(0), before.q_dot(0), 1e-12);
  EXPECT_NEAR(after.q_ddot(0), before.q_ddot(0), 1e-12);
  const std::int64_t end = 6 * s + s / 3 + 3 * s / 2;
  EXPECT_TRUE(joints.moving(end - 1));
  EXPECT_FALSE(joints.moving(end));
  EXPECT_NEAR(joints.at(end).q(0), -0.5, 1e-12);
  EXPECT_NEAR(joints.at(end).q_dot(0), 0.0, 1e-12);
  EXPECT_NEAR(joints.at(end - s, 1.0).q(0), joints.at(end).q(0), 1e-12);
  EXPECT_EQ(joints.at(end).q(1), 0.0);
}

TEST(Combine, IsTheBodyItIsMadeOf) {  // a bar of two halves
  RigidBody half;
  half.mass = 3.0;
  half.p_BoBcm_B = {0.5, 0.0, 0.0};
  half.I_Bcm_B = Vec3(0.0, 3.0 / 12, 3.0 / 12).asDiagonal();
  const RigidBody bar = combine(half, {rotation({0.0, 0.0, M_PI}), Vec3::Zero()}, half);
  EXPECT_DOUBLE_EQ(bar.mass, 6.0);
  EXPECT_LT(bar.p_BoBcm_B.norm(), 1e-15);
  EXPECT_LT((bar.I_Bcm_B - Mat3(Vec3(0.0, 6.0 * 4 / 12, 6.0 * 4 / 12).asDiagonal())).norm(), 1e-14);
}

}  // namespace
}  // namespace ves
