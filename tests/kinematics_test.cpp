// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <limits>

#include "support/poses.hpp"

namespace ves {
namespace {

using test::geometry;

double distance(const Transform& a, const Transform& b) {
  return (a.p - b.p).norm() + (a.R - b.R).norm();
}

TEST(InverseKinematics, HomeLegsAreEqualAndAsComputedByHand) {
  const Vec6 L = legLengths(geometry(), geometry().fromHome({}));
  const double chord = 1.0 + 0.55 * 0.55 - 2 * 0.55 * std::cos(44 * kDegree);  // law of cosines
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(L(i), std::sqrt(chord + 1.35 * 1.35), 1e-14);
}

TEST(ForwardPose, FindsThePoseOfTheInverseFromHome) {
  const Geometry g = geometry();
  for (const Pose& x : test::poses(20000)) {
    const Transform X_IP = g.fromHome(x);
    const ForwardSolution found = forwardPose(g, legLengths(g, X_IP), g.fromHome({}));
    ASSERT_TRUE(found.ok()) << x.stacked().transpose();
    ASSERT_LT(distance(found.X_IP, X_IP), 1e-8) << x.stacked().transpose();
  }
}

TEST(ForwardPose, WarmStartTakesFewIterations) {
  const Geometry g = geometry();
  for (const Pose& x : test::poses()) {
    const Pose near = Pose::from(x.stacked() * 0.98);
    const ForwardSolution found = forwardPose(g, legLengths(g, g.fromHome(x)), g.fromHome(near));
    ASSERT_TRUE(found.ok());
    ASSERT_LE(found.iterations, 6);  // 6 at corners that no leg can reach, 5 elsewhere
  }
}

TEST(ForwardPose, StaysOrthogonalOverAMillionWarmStarts) {
  const Geometry g = geometry();
  const test::Swing swing(8);
  Transform X = g.fromHome({});
  for (int i = 0; i < 1'000'000; ++i)
    X = forwardPose(g, legLengths(g, g.fromHome(Pose::from(swing.x(i * 1e-3)))), X).X_IP;
  EXPECT_LT((X.R.transpose() * X.R - Mat3::Identity()).norm(), 1e-13);
}

TEST(ForwardPose, WithTheFactorsOfThePoseBeforeFindsTheSame) {
  const Geometry g = geometry();
  JacobianFactors factors;
  BodyMotion P;
  for (const Pose& x : test::poses(2000)) {  // from home, however far
    const Transform X_IP = g.fromHome(x), home = g.fromHome({});
    ASSERT_TRUE(
        forwardMotion(g, home, {legLengths(g, home), Vec6::Zero(), Vec6::Zero()}, P, factors));
    const ForwardSolution found = forwardPose(g, legLengths(g, X_IP), home, factors);
    ASSERT_TRUE(found.ok()) << x.stacked().transpose();
    const Vec6 off = legLengths(g, found.X_IP) - legLengths(g, X_IP);
    ASSERT_LE(off.cwiseAbs().maxCoeff(), 1.01 * kForwardTolerance) << x.stacked().transpose();
    ASSERT_LT(distance(found.X_IP, X_IP), 1e-5) << x.stacked().transpose();  // the same root
  }
  // Of a pose nearby they do: two steps, and no factors in between.
  const test::Swing swing(8);
  Transform X = g.fromHome(Pose::from(swing.x(0.0)));
  const LegMotion rest{legLengths(g, X), Vec6::Zero(), Vec6::Zero()};
  ASSERT_TRUE(forwardMotion(g, X, rest, P, factors));
  for (int i = 1; i < 1000; ++i) {
    const Transform next = g.fromHome(Pose::from(swing.x(i * 1e-4)));
    const Mat6 before = factors.lu.inverse();
    const Transform guess = g.fromHome(Pose::from(swing.x((i - 0.5) * 1e-4)));
    const ForwardSolution found = forwardPose(g, legLengths(g, next), guess, factors);
    ASSERT_TRUE(found.ok());
    ASSERT_LT(distance(found.X_IP, next), 1e-8);
    ASSERT_EQ(factors.lu.inverse(), before) << i;
    ASSERT_TRUE(forwardMotion(g, found.X_IP, {legLengths(g, next), Vec6::Zero(), Vec6::Zero()}, P,
                              factors));
    X = found.X_IP;
  }
}

TEST(RotationOf, IsTheExponentialForEveryAngle) {
  for (const Vec3& axis : {Vec3(1, 0, 0), Vec3(0.3, -0.5, 0.8), Vec3(-0.1, 0.9, 0.2)})
    for (const double angle : {0.0, 1e-9, 1e-4, 0.00999, 0.01001, 0.5, 3.0, -2.0}) {
      const Vec3 v = angle * axis.normalized();
      Mat3 series = Mat3::Identity(), term = Mat3::Identity();
      for (int n = 1; n < 40; ++n) series += term = (term * skew(v) / n).eval();
      EXPECT_LT((rotationOf(v) - series).norm(), 1e-14 * std::max(1.0, std::exp(std::abs(angle))))
          << angle;
    }
}

TEST(ForwardPose, NeverCallsNonsenseASuccess) {
  const Geometry g = geometry();
  const Transform home = g.fromHome({});
  const Vec6 L = legLengths(g, home);
  for (double bad : {std::numeric_limits<double>::quiet_NaN(),
                     std::numeric_limits<double>::infinity(), -1.4, 0.0}) {
    for (int i = 0; i < 6; ++i) {
      Vec6 broken = L;
      broken(i) = bad;
      EXPECT_EQ(forwardPose(g, broken, home).status, SolveStatus::kInvalid);
    }
  }
  Transform nowhere = home;
  nowhere.p.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(forwardPose(g, L, nowhere).status, SolveStatus::kInvalid);
  // Legs that reach no common pose.
  Vec6 apart = L;
  apart << 0.3, 5.0, 0.3, 5.0, 0.3, 5.0;
  EXPECT_FALSE(forwardPose(g, apart, home).ok());
}

TEST(LegMotion, RatesAndAccelerationsMatchFiniteDifferences) {  // (2.25), (2.31)
  const Geometry g = geometry();
  const double h = 1e-4;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const test::Swing swing(seed);
    for (double t = 0.0; t < 2.0; t += 0.1) {
      const auto L = [&](double s) { return legLengths(g, swing.motion(s).X); };
      const LegMotion legs = legMotion(g, swing.motion(t));
      ASSERT_LT((legs.L_dot - (L(t + h) - L(t - h)) / (2 * h)).norm(), 1e-7);
      ASSERT_LT((legs.L_ddot - (L(t + h) - 2 * L(t) + L(t - h)) / (h * h)).norm(), 1e-6);
    }
  }
}

TEST(ForwardMotion, UndoesTheLegMotion) {  // (2.24), (2.32): the inverse route is checked above
  const Geometry g = geometry();
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const test::Swing swing(seed);
    for (double t = 0.0; t < 2.0; t += 0.1) {
      const BodyMotion P = swing.motion(t);
      BodyMotion found;
      ASSERT_TRUE(forwardMotion(g, P.X, legMotion(g, P), found));
      ASSERT_LT((found.v - P.v).norm() + (found.w - P.w).norm(), 1e-12);
      ASSERT_LT((found.a - P.a).norm() + (found.alpha - P.alpha).norm(), 1e-11);
    }
  }
}

TEST(ForwardMotion, RefusesASingularPlatform) {
  Geometry g = geometry();
  for (std::size_t i = 0; i < kLegs; ++i) g.p_PPi_P[i] = 0.55 * g.p_IBi_I[i];  // similar hexagons
  BodyMotion P;
  const Transform home = g.fromHome({});
  EXPECT_FALSE(forwardMotion(g, home, {legLengths(g, home), Vec6::Zero(), Vec6::Zero()}, P));
}

TEST(ForwardPose, SaysThatAPlatformIsSingular) {  // similar hexagons turn without lengthening a leg
  Geometry g = geometry();
  for (std::size_t i = 0; i < kLegs; ++i) g.p_PPi_P[i] = 0.55 * g.p_IBi_I[i];
  const Transform home = g.fromHome({});
  const Vec6 longer = legLengths(g, home) + 1e-3 * Vec6::LinSpaced(-1.0, 2.0);
  EXPECT_EQ(forwardPose(g, longer, home).status, SolveStatus::kSingular);
  EXPECT_EQ(conditionNumber(g, home), HUGE_VAL);
}

TEST(BodyMotionOfCoordinates, MatchesFiniteDifferences) {  // (2.27), (2.33)
  const double h = 1e-5;
  const test::Swing swing(5);
  for (double t = 0.0; t < 2.0; t += 0.1) {
    const BodyMotion P = swing.motion(t);
    const Vec3 alpha = (swing.motion(t + h).w - swing.motion(t - h).w) / (2 * h);
    ASSERT_LT((P.alpha - alpha).norm(), 1e-7);
    ASSERT_LT((P.v - (swing.motion(t + h).X.p - swing.motion(t - h).X.p) / (2 * h)).norm(), 1e-8);
  }
}

TEST(PlatformMotions, AreThoseWhoseLegsTheyAre) {
  const Geometry g = geometry();
  for (const Pose& x : test::poses()) {
    const Transform X = g.fromHome(x);
    Motions twists, legs;
    for (int i = 0; i < 4; ++i) {
      twists.col(i) = Vec6::Unit(i) - 0.3 * Vec6::Unit(5 - i) + 0.1 * Vec6::Ones();
      BodyMotion P;
      P.X = X;
      P.v = twists.col(i).head<3>();
      P.w = twists.col(i).tail<3>();
      legs.col(i) = legMotion(g, P).L_dot;
    }
    ASSERT_TRUE(platformMotions(g, X, legs));
    ASSERT_LT((legs - twists).norm(), 1e-11) << x.stacked().transpose();
  }
}

TEST(PlatformMotions, OfASingularPoseStayAsTheyWere) {
  Geometry g = geometry();
  g.p_PPi_P.fill(g.p_PPi_P[0]);  // all legs end in one joint
  const Motions legs = Motions::Constant(0.01);
  Motions motions = legs;
  EXPECT_FALSE(platformMotions(g, g.fromHome({}), motions));
  EXPECT_EQ(motions, legs);
}

}  // namespace
}  // namespace ves
