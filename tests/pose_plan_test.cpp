// SPDX-License-Identifier: BSD-3-Clause
//
// Poses to identify a robot from: inside every limit, and better than chance.
#include <gtest/gtest.h>

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "support/rig.hpp"
#include "ves/identification/pose_plan.hpp"
#include "ves/identification/scenario.hpp"

namespace ves {
namespace {

/// After few exchanges: inside the limits, not yet good.
PosePlan quickPlan(const Experiment& e, double speed = 30.0) {
  const StaticSetup setup = staticSetup(e.controller);
  PosePlanOptions few;
  few.exchanges = 50;
  few.speed = speed;
  return planPoses(setup, separableCombinations(setup.robot), e.controller,
                   e.plant.task.initial_joints, few);
}

TEST(PosePlan, StaysInRangesThatLieFarOff) {
  Experiment e = test::experiment("puma_on_table_4_1");
  Link& first = e.controller.payload.robot.links[0];
  first.lower = 200 * kDegree;
  first.upper = 300 * kDegree;
  const PosePlan plan = quickPlan(e);
  for (const PosePlan::Attitude& a : plan.attitudes)
    for (const JointVector& q : a.q) {
      EXPECT_GE(q(0), first.lower);
      EXPECT_LE(q(0), first.upper);
    }
}

TEST(PosePlan, OfALongRangeTakesWhatLiesAboutItsMiddle) {
  Experiment e = test::experiment("puma_on_table_4_1");
  Link& first = e.controller.payload.robot.links[0];
  first.lower = -5.0;
  first.upper = 25.0;
  const PosePlan plan = quickPlan(e);
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const PosePlan::Attitude& a : plan.attitudes)
    for (const JointVector& q : a.q) {
      low = std::min(low, q(0));
      high = std::max(high, q(0));
    }
  EXPECT_GE(low, 10.0 - M_PI);
  EXPECT_LE(high, 10.0 + M_PI);
  EXPECT_GT(high - low, M_PI);
}

TEST(PosePlan, OfARangeWithoutEndTakesWhatLiesAboutZero) {
  Experiment e = test::experiment("puma_on_table_4_1");
  Link& first = e.controller.payload.robot.links[0];
  first.lower = -1.0;
  first.upper = HUGE_VAL;
  const PosePlan plan = quickPlan(e);
  for (const PosePlan::Attitude& a : plan.attitudes)
    for (const JointVector& q : a.q) {
      EXPECT_GE(q(0), -1.0);
      EXPECT_LE(q(0), M_PI);
    }
}

TEST(PosePlan, ItsScenarioMovesNoJointFasterThanAsked) {
  const Experiment e = test::experiment("doss_on_table_4_1");
  const double speed = 25.0;  // [deg/s | cm/s]
  const PosePlan plan = quickPlan(e, speed);
  const auto file = std::filesystem::temp_directory_path() /
                    ("ves_pose_plan_" + std::to_string(getpid()) + ".yaml");
  std::ofstream(file) << scenarioOf(plan, e, "plan",
                                    test::configDir() + "/scenarios/doss_on_table_4_1.yaml");
  const Experiment planned = loadExperiment(file);
  std::filesystem::remove(file);
  JointVector at = planned.plant.task.initial_joints;
  double fastest = 0.0;
  ASSERT_GT(planned.plant.task.robot_events.size(), 100u);
  for (const RobotEvent& event : planned.plant.task.robot_events) {
    const RobotMove& move = std::get<RobotMove>(event.action);
    const int i = move.joint;
    const bool turns = e.controller.payload.robot.jointLink(i).type == JointType::kRevolute;
    fastest =
        std::max(fastest, std::abs(move.target - at(i)) / move.duration / (turns ? kDegree : 0.01));
    at(i) = move.target;
  }
  EXPECT_LE(fastest, speed * (1.0 + 1e-6));
  EXPECT_GT(fastest, 0.9 * speed);
}

TEST(PosePlan, KeepsTheLegsApartAndInsideTheirStroke) {
  Experiment e = test::experiment("puma_on_table_4_1");
  SafetyLimits& limits = e.controller.safety;
  PosePlanOptions wide;
  wide.exchanges = 50;
  const auto least = [&] {
    const StaticSetup setup = staticSetup(e.controller);
    const PosePlan plan = planPoses(setup, separableCombinations(setup.robot), e.controller,
                                    e.plant.task.initial_joints, wide);
    double shortest = HUGE_VAL;
    for (const PosePlan::Attitude& a : plan.attitudes) {
      const Transform X = e.controller.geometry.fromHome({Vec3::Zero(), a.rpy});
      EXPECT_TRUE(
          collideCheck(limits, e.controller.geometry, X, legLines(e.controller.geometry, X)));
      shortest = std::min(shortest, legLengths(e.controller.geometry, X).minCoeff());
    }
    return shortest;
  };
  const double before = least();
  limits.leg_min = before + 0.05;  // now the stroke is what bounds the tilt
  EXPECT_GE(least(), limits.leg_min);
}

TEST(PosePlan, IsBetterThanChanceAndInsideTheLimits) {
  const Experiment e = test::experiment("doss_on_table_4_1");
  const StaticSetup setup = staticSetup(e.controller);
  const SeparableCombinations c = separableCombinations(setup.robot);
  const PosePlanOptions options;
  const PosePlan plan = planPoses(setup, c, e.controller, e.plant.task.initial_joints, options);
  EXPECT_LT(plan.condition, 0.8 * plan.condition_random);
  ASSERT_EQ(plan.attitudes.size(), 16u);
  for (const PosePlan::Attitude& a : plan.attitudes) {
    EXPECT_LE(a.rpy.cwiseAbs().maxCoeff(), options.tilt);
    ASSERT_EQ(a.q.size(), 3u);
    for (const JointVector& q : a.q)
      for (int i = 0; i < setup.robot.joints; ++i) {
        EXPECT_GE(q(i), setup.robot.jointLink(i).lower);
        EXPECT_LE(q(i), setup.robot.jointLink(i).upper);
      }
  }
}

// As few as the accuracy needs; and inside the time, as long as so few take it.
TEST(PosePlan, TakesTheFewestAttitudesThatAreAccurateEnough) {
  const Experiment e = test::experiment("puma_on_table_4_1");
  const StaticSetup setup = staticSetup(e.controller);
  const SeparableCombinations c = separableCombinations(setup.robot);
  PosePlanOptions options;
  options.attitudes = 8;
  const auto fewest = [&](double accuracy) {
    return planFewestPoses(setup, c, e.controller, e.plant.task.initial_joints, options, accuracy);
  };
  const PosePlan coarse = fewest(1.0);
  const PosePlan fine = fewest(0.7 * coarse.deviation);
  EXPECT_EQ(coarse.attitudes.size(), 3u);
  EXPECT_LE(fine.deviation, 0.7 * coarse.deviation);
  EXPECT_GT(fine.attitudes.size(), coarse.attitudes.size());
  EXPECT_LE(fewest(1e-12).attitudes.size(), 8u);  // nothing is that accurate
  options.most_seconds = 0.6 * coarse.seconds;
  const PosePlan quick = fewest(1.0);
  EXPECT_LT(quick.seconds, 0.8 * coarse.seconds);
  // Its times are those that the moves need.
  double seconds = 0.0;
  for (const PosePlan::Attitude& a : quick.attitudes) {
    ASSERT_EQ(a.moving.size(), a.q.size());
    seconds += PosePlan::kApproach;
    for (const double moving : a.moving) seconds += moving + PosePlan::kLook;
  }
  EXPECT_NEAR(quick.seconds, seconds, 1e-9);
}

}  // namespace
}  // namespace ves
