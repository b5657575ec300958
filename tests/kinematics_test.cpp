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

}  // namespace
}  // namespace ves
