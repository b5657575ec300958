// SPDX-License-Identifier: BSD-3-Clause
//
// Platforms of any six legs: joints in three dimensions, limits that follow from them.
#include <gtest/gtest.h>

#include <random>

#include "support/poses.hpp"
#include "ves/analysis/platform.hpp"
#include "ves/config/experiment.hpp"
#include "ves/config/platform.hpp"
#include "ves/plant/lockstep.hpp"
#include "ves/plant/nominal_servo.hpp"

namespace ves {
namespace {

const std::filesystem::path kConfig = VES_TEST_CONFIG_DIR;

Platform shipped(const std::string& name) { return loadPlatform(findPlatform(name, kConfig)); }

/// Every length of the platform times s.
Geometry scaled(Geometry g, double s) {
  for (auto* joints : {&g.p_IBi_I, &g.p_PPi_P})
    for (Vec3& p : *joints) p *= s;
  g.home_height *= s;
  return g;
}

struct Corner {
  Vec6 farthest;
  std::mt19937 random{7};
  Pose operator()() {
    std::uniform_real_distribution<double> u(-1.0, 1.0);
    Vec6 x;
    for (int i = 0; i < 6; ++i) x(i) = farthest(i) * u(random);
    return Pose::from(x);
  }
};

Corner workspace(const Platform& p) {
  Corner out;
  out.farthest << Vec3::Constant(p.limits.translation), Vec3::Constant(p.limits.rotation);
  return out;
}

class Shipped : public testing::TestWithParam<const char*> {};

TEST_P(Shipped, JointsAreWhereTheFileSaysInThreeDimensions) {
  const Platform p = shipped(GetParam());
  bool spatial = false;
  for (const Vec3& joint : p.geometry.p_IBi_I) spatial = spatial || joint.z() != 0.0;
  EXPECT_TRUE(spatial);
  Corner corner = workspace(p);
  for (int n = 0; n < 100; ++n) {
    const Pose x = corner();
    const Vec6 L = legLengths(p.geometry, p.geometry.fromHome(x));
    for (int i = 0; i < kLegs; ++i) {
      const auto k = static_cast<std::size_t>(i);
      // Quaternions instead of the matrix of (2.19).
      const Eigen::Quaterniond q = Eigen::AngleAxisd(x.rpy.z(), Vec3::UnitZ()) *
                                   Eigen::AngleAxisd(x.rpy.y(), Vec3::UnitY()) *
                                   Eigen::AngleAxisd(x.rpy.x(), Vec3::UnitX());
      const Vec3 end = Vec3(0.0, 0.0, p.geometry.home_height) + x.p + q * p.geometry.p_PPi_P[k];
      EXPECT_NEAR(L(i), (end - p.geometry.p_IBi_I[k]).norm(), 1e-12);
    }
  }
}

TEST_P(Shipped, ForwardKinematicsFindsEveryPoseOfTheWorkspaceFromHome) {
  const Platform p = shipped(GetParam());
  const Transform home = p.geometry.fromHome({});
  Corner corner = workspace(p);
  constexpr int kPoses = 100'000;
  int failed = 0;
  double worst = 0.0;
  for (int n = 0; n < kPoses; ++n) {
    const Pose x = corner();
    const ForwardSolution found =
        forwardPose(p.geometry, legLengths(p.geometry, p.geometry.fromHome(x)), home);
    failed += !found.ok();
    const Vec6 off = p.geometry.toHome(found.X_IP).stacked() - x.stacked();
    worst = std::max({worst, off.head<3>().norm() / jointRadius(p.geometry), off.tail<3>().norm()});
  }
  EXPECT_EQ(failed, 0);
  EXPECT_LT(worst, 1e-7);
}

TEST_P(Shipped, NothingStopsItInTheWorkspaceItsLimitsAreDerivedFrom) {
  const Platform p = shipped(GetParam());
  const JointAxes axes(p.geometry);
  Corner corner = workspace(p);
  corner.farthest *= 0.5;
  for (int n = 0; n < 2000; ++n) {
    const Transform X = p.geometry.fromHome(corner());
    EXPECT_TRUE(actuatorLimitsCheck(p.limits, legLengths(p.geometry, X)));
    const LegLines lines = legLines(p.geometry, X);
    EXPECT_TRUE(axes.check(p.limits, X.R, lines));
    EXPECT_TRUE(collideCheck(p.limits, p.geometry, X, lines));
    EXPECT_TRUE(conditioningCheck(p.limits, lines, jointRadius(p.geometry)));
  }
  for (int i = 0; i < 6; ++i)
    for (const double sign : {-1.0, 1.0}) {
      const double allowed = i < 3 ? p.limits.translation : p.limits.rotation;
      EXPECT_EQ(travel(p.geometry, p.limits, i, sign, allowed).ends, Check::kMotionLimits)
          << i << sign;
    }
}

INSTANTIATE_TEST_SUITE_P(Sizes, Shipped, testing::Values("desk", "hall"));

TEST(AnyPlatform, WhatFollowsFromTheGeometryScalesWithIt) {
  const Geometry g = shipped("desk").geometry;
  const double t = 0.02, r = 12.0 * kDegree;
  const WorkspaceUse one = workspaceUse(g, t, r);
  for (const double s : {0.1, 3.7, 30.0}) {
    const WorkspaceUse other = workspaceUse(scaled(g, s), s * t, r);
    EXPECT_LT((other.leg_least - s * one.leg_least).norm(), 1e-12 * s);
    EXPECT_LT((other.leg_most - s * one.leg_most).norm(), 1e-12 * s);
    EXPECT_NEAR(other.clearance, s * one.clearance, 1e-12 * s);
    EXPECT_NEAR(other.joint_angle, one.joint_angle, 1e-9);
    EXPECT_NEAR(other.plate_angle, one.plate_angle, 1e-9);
    EXPECT_NEAR(other.condition, one.condition, 1e-9);
    EXPECT_NEAR(derivedStroke(other).max, s * derivedStroke(one).max, 1e-12 * s);
    EXPECT_NEAR(jointRadius(scaled(g, s)), s * jointRadius(g), 1e-12 * s);
  }
}

TEST(AnyPlatform, TheWorkspaceHoldsItsEndsAndItsHalfCorners) {
  const Geometry g = test::geometry();
  const WorkspaceUse use = workspaceUse(g, 0.1, 10.0 * kDegree);
  double least = HUGE_VAL, most = 0.0;
  const auto look = [&](const Vec6& x) {
    const Vec6 L = legLengths(g, g.fromHome(Pose::from(x)));
    least = std::min(least, L.minCoeff());
    most = std::max(most, L.maxCoeff());
    EXPECT_GE(L.minCoeff(), use.leg_least.minCoeff() - 1e-12);
    EXPECT_LE(L.maxCoeff(), use.leg_most.maxCoeff() + 1e-12);
  };
  Vec6 farthest;
  farthest << Vec3::Constant(0.1), Vec3::Constant(10.0 * kDegree);
  for (int i = 0; i < 6; ++i)
    for (const double sign : {-1.0, 1.0}) look(sign * farthest(i) * Vec6::Unit(i));
  for (unsigned corner = 0; corner < 64; ++corner) {
    Vec6 x = 0.5 * farthest;
    for (unsigned i = 0; i < 6; ++i)
      if (corner & (1u << i)) x(static_cast<int>(i)) *= -1.0;
    look(x);
  }
  EXPECT_NEAR(least, use.leg_least.minCoeff(), 1e-12);
  EXPECT_NEAR(most, use.leg_most.maxCoeff(), 1e-12);
}

// A leg that rises from under its joint leans by as much as the joint has moved aside: by hand.
TEST(AnyPlatform, AnglesAndGapsAreThoseOfElementaryGeometry) {
  Geometry g;
  for (std::size_t i = 0; i < kLegs; ++i) {
    const double a = static_cast<double>(i) * 60.0 * kDegree;
    g.p_IBi_I[i] = g.p_PPi_P[i] = {std::cos(a), std::sin(a), 0.0};
  }
  g.home_height = 2.0;
  const Transform aside = g.fromHome({{0.5, 0.0, 0.0}, Vec3::Zero()});
  EXPECT_NEAR(largestJointAngle(g, aside), std::atan2(0.5, 2.0), 1e-12);
  EXPECT_NEAR(flattestLeg(g, aside).angle, std::atan2(2.0, 0.5), 1e-12);
  EXPECT_NEAR(nearestLegs(g, aside).distance, nearestLegs(g, g.fromHome({})).distance, 0.05);
  EXPECT_NEAR(nearestLegs(g, g.fromHome({})).distance, 1.0, 1e-12);  // the hexagon's side
  // Tilted by alpha the legs hardly turn in the base, but by about alpha in the platform.
  const Transform tilted = g.fromHome({Vec3::Zero(), {0.0, 0.3, 0.0}});
  EXPECT_NEAR(largestJointAngle(g, tilted), 0.3, 0.06);
  EXPECT_NEAR(flattestLeg(g, tilted).angle, 0.5 * M_PI - 0.3, 0.06);
  EXPECT_NEAR(jointRadius(g), 1.0, 1e-12);
  for (Vec3& p : g.p_PPi_P) p += Vec3(0.3, 0.0, -0.2);  // Po need not be in their middle
  EXPECT_NEAR(jointRadius(g), 1.0, 1e-12);
}

// 40 mA through 1.18 and 0.77 in/s/mA; velocity gains of 17.4 and 11.3 1/s.
TEST(AnyPlatform, SpeedAndErrorsFollowFromTheSlowerDirection) {
  const Platform p = shipped("z_sine");
  const SafetyLimits l = derivedLimits(p.use, {p.actuator.length_min, p.actuator.length_max},
                                       plant::nominalServo(p.gains, p.actuator, p.transducer));
  const double speed = 0.95 * 0.77 * 40.0 * kMetrePerInch;  // [m/s]
  EXPECT_NEAR(l.leg_velocity, speed, 1e-3 * speed);
  EXPECT_NEAR(l.position_error, 1.5 * speed / 11.3, 0.01 * l.position_error);
  EXPECT_NEAR(l.position_error_lag, 1.35 / 11.3, 0.01 * l.position_error_lag);
  EXPECT_NEAR(l.leg_min, 1.20 + 0.03 * 0.65, 1e-12);
  EXPECT_NEAR(l.leg_max, 1.85 - 0.03 * 0.65, 1e-12);
  EXPECT_NEAR(l.position_error_still, 0.015 * 0.65, 1e-12);
  EXPECT_NEAR(l.reading_jump, 0.003 * 0.65, 1e-12);
  EXPECT_NEAR(l.joint_cone, p.use.joint_angle + 5.0 * kDegree, 1e-12);
  EXPECT_NEAR(l.leg_clearance, 0.8 * p.use.clearance, 1e-12);
  EXPECT_NEAR(l.plate_angle, 0.8 * p.use.plate_angle, 1e-12);
  EXPECT_NEAR(l.condition, 1.5 * p.use.condition, 1e-12);
  const double least = p.use.leg_least.minCoeff(), most = p.use.leg_most.maxCoeff();
  EXPECT_NEAR(derivedStroke(p.use).max - most, 0.05 * (most - least), 1e-12);
  EXPECT_NEAR(least - derivedStroke(p.use).min, 0.05 * (most - least), 1e-12);
}

TEST(AnyPlatform, TravelEndsWhereTheNamedCheckBeginsToFail) {
  const Platform p = shipped("desk");
  const auto lengths = [&](double z) {
    return legLengths(p.geometry, p.geometry.fromHome({{0.0, 0.0, z}, Vec3::Zero()}));
  };
  const Travel up = travel(p.geometry, p.limits, 2, 1.0, 0.1);
  ASSERT_EQ(up.ends, Check::kActuatorLimits);
  EXPECT_NEAR(lengths(up.distance).maxCoeff(), p.limits.leg_max, 1e-9);
  const Travel down = travel(p.geometry, p.limits, 2, -1.0, 0.1);
  ASSERT_EQ(down.ends, Check::kActuatorLimits);
  EXPECT_NEAR(lengths(-down.distance).minCoeff(), p.limits.leg_min, 1e-9);
  SafetyLimits narrow = p.limits;
  narrow.leg_max = HUGE_VAL;
  narrow.joint_cone = M_PI;
  narrow.leg_clearance = 0.0;
  narrow.condition = 1.6;
  const Travel turn = travel(p.geometry, narrow, 5, 1.0, 1.0);
  ASSERT_EQ(turn.ends, Check::kConditioning);
  const auto condition = [&](double gamma) {
    return conditionNumber(p.geometry, p.geometry.fromHome({Vec3::Zero(), {0.0, 0.0, gamma}}));
  };
  EXPECT_NEAR(condition(turn.distance), 1.6, 1e-6);
}

TEST(AnyPlatform, DerivedIsWhatTheSameNumberWrittenOutWouldBe) {
  const Platform p = shipped("desk");
  const Stroke stroke = derivedStroke(p.use);
  EXPECT_EQ(p.actuator.length_min, stroke.min);
  const double range = p.transducer.scale * kMaxLegCount;
  EXPECT_NEAR(p.transducer.offset + 0.5 * range, 0.5 * (stroke.min + stroke.max), 1e-12);
  // A number in the file stands, and what depends on it follows.
  const Platform other = loadPlatform(findPlatform("desk", kConfig), {"legs.stroke_min_m=0.110"});
  EXPECT_EQ(other.actuator.length_min, 0.110);
  EXPECT_NEAR(other.limits.leg_min, 0.110 + 0.03 * (stroke.max - 0.110), 1e-12);
  EXPECT_GT(loadPlatform(findPlatform("desk", kConfig), {"safety.translation_m=0.025"})
                .actuator.length_max,
            p.actuator.length_max);
}

// Emulation: what the base does in free space, wherever its platform stands.
TEST(AnyPlatform, ARobotsLoadMovesItsBaseAsItMovesThePlatform) {
  for (const char* scenario : {"arm_on_desk", "puma_on_hall"}) {
    Experiment e = loadExperiment(findScenario(scenario, kConfig), {});
    ASSERT_EQ(applyStabilityCheck(e), "") << scenario;
    Lockstep machine(e.controller, e.plant);
    machine.step({Request::kStart, {}, {}});
    double worst = 0.0;
    while (machine.state().phase != Phase::kParked && machine.state().phase != Phase::kStopped) {
      const TickState& s = machine.step();
      worst = std::max(worst, (s.measured.p - s.motion.x.head<3>()).norm());
    }
    EXPECT_EQ(machine.state().phase, Phase::kParked) << scenario;
    EXPECT_LT(worst, 0.02 * jointRadius(e.plant.geometry)) << scenario;
  }
}

}  // namespace
}  // namespace ves
