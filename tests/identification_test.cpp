// SPDX-License-Identifier: BSD-3-Clause
//
// Appendix B: what static wrenches tell of a robot's mass parameters.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <random>

#include "support/programs.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/config/masses.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/evaluation/static_intervals.hpp"
#include "ves/identification/scenario.hpp"
#include "ves/plant/force_torque_sensor.hpp"
#include "ves/validation/iterative_compensation.hpp"

namespace ves {
namespace {

using Eigen::VectorXd;

Link joint(JointType type, const Vec3& axis, const Vec3& at) {
  Link link;
  link.type = type;
  link.axis = axis;
  link.X_parent.p = at;
  link.body = {2.0, Vec3(0.1, -0.2, 0.3), Mat3::Identity()};
  return link;
}

RobotModel chain(std::initializer_list<Link> links) {
  RobotModel robot;
  robot.base = {5.0, Vec3(0.0, 0.01, 0.2), Mat3::Identity()};
  for (const Link& link : links) robot.extend(link);
  return robot;
}

const Vec3 X = Vec3::UnitX(), Z = Vec3::UnitZ();

JointVector anyPose(const RobotModel& robot, std::mt19937& draw) {
  std::uniform_real_distribution<double> u(-2.0, 2.0);
  JointVector q = JointVector::Zero();
  for (int i = 0; i < robot.joints; ++i) q(i) = u(draw);
  return q;
}

TEST(StaticRegressor, TimesTheParametersIsTheWrenchThatGravityCompensationSums) {
  std::mt19937 draw(3);
  std::uniform_real_distribution<double> u(-0.4, 0.4);
  for (const char* name : {"puma_on_table_4_1", "doss_on_table_4_1"}) {
    const Experiment e = test::experiment(name);
    const StaticSetup setup = staticSetup(e.controller);
    const VectorXd masses = massParameters(setup.robot);
    for (int k = 0; k < 100; ++k) {
      const JointVector q = anyPose(setup.robot, draw);
      const Vec3 rpy(u(draw), u(draw), u(draw));
      const Vec6 summed =
          setup.S_proc * staticWrench(e.controller.payload, q, rotation(rpy), setup.g_I).stacked();
      const Vec6 counts = countRegressor(setup, q, rpy) * masses;
      EXPECT_LT((counts - summed).cwiseAbs().maxCoeff(), 1e-9 * summed.cwiseAbs().maxCoeff());
    }
  }
}

// Link 0 always gives four. Turning about an axis shows the first moment across it; what lies along
// it, and the mass, pass to the link before. Sliding shows the mass alone.
TEST(SeparableCombinations, RankIsWhatTheoryGives) {
  const Vec3 p(0.3, 0.0, 0.5);
  const auto rank = [](const RobotModel& robot) { return separableCombinations(robot).rank(); };
  const auto R = JointType::kRevolute, P = JointType::kPrismatic;
  EXPECT_EQ(rank(chain({})), 4);
  EXPECT_EQ(rank(chain({joint(R, Z, p)})), 6);
  EXPECT_EQ(rank(chain({joint(P, X, p)})), 5);
  EXPECT_EQ(rank(chain({joint(R, Z, p), joint(R, Z, p)})), 8);
  EXPECT_EQ(rank(chain({joint(R, Z, p), joint(R, X, p)})), 8);
  EXPECT_EQ(rank(chain({joint(R, Z, p), joint(P, Z, p)})), 7);
  EXPECT_EQ(rank(chain({joint(R, Z, p), joint(P, X, p)})), 7);
  EXPECT_EQ(rank(test::robot("puma560").model), 4 + 2 * 6);
  EXPECT_EQ(rank(test::robot("doss").model), 4 + 2 * 7);
}

TEST(SeparableCombinations, AreNamedAsOneWouldWriteThem) {
  const RobotModel one = chain({joint(JointType::kRevolute, Z, Vec3(0.0, 0.0, 0.5))});
  const std::vector<std::string> expected = {"m0 + m1", "m0 x0", "m0 y0", "m0 z0 + m1 z1 + 0.5 m1",
                                             "m1 x1",   "m1 y1"};
  EXPECT_EQ(separableCombinations(one).names, expected);
  const RobotModel two = chain({joint(JointType::kRevolute, Z, Vec3::Zero()),
                                joint(JointType::kRevolute, Z, Vec3(0.25, 0.0, 0.0))});
  const std::vector<std::string> names = separableCombinations(two).names;
  EXPECT_EQ(names[4], "m1 x1 + 0.25 m2");
  EXPECT_EQ(names[3], "m0 z0 + m1 z1 + m2 z2");
}

TEST(SeparableCombinations, AnyParametersThatShareThemGiveTheSameWrench) {
  std::mt19937 draw(5);
  std::uniform_real_distribution<double> u(-0.4, 0.4);
  for (const char* name : {"puma_on_table_4_1", "doss_on_table_4_1"}) {
    const StaticSetup setup = staticSetup(test::experiment(name).controller);
    const SeparableCombinations c = separableCombinations(setup.robot);
    const VectorXd truth = massParameters(setup.robot);
    for (const VectorXd& prior : {truth, VectorXd(VectorXd::Zero(truth.size()))}) {
      const VectorXd other = completed(c, c.C * truth, prior);
      for (int i = 0; i < other.size(); i += 4) EXPECT_GT(other(i), 0.0) << name << " body " << i;
      for (int k = 0; k < 50; ++k) {
        const JointVector q = anyPose(setup.robot, draw);
        const auto Y = countRegressor(setup, q, Vec3(u(draw), u(draw), 0.0));
        const Vec6 a = Y * truth, b = Y * other;
        EXPECT_LT((a - b).cwiseAbs().maxCoeff(), 1e-8 * a.cwiseAbs().maxCoeff()) << name;
      }
    }
  }
}

TEST(SeparableCombinations, OfASlidingRobotLeaveEveryMassPositive) {
  RobotModel robot = chain({joint(JointType::kRevolute, Z, Vec3(0.3, 0.0, 0.5)),
                            joint(JointType::kPrismatic, X, Vec3(0.1, 0.0, 0.2)),
                            joint(JointType::kRevolute, X, Vec3(0.0, 0.2, 0.0))});
  robot.base.mass = 100.0;
  const SeparableCombinations c = separableCombinations(robot);
  const VectorXd truth = massParameters(robot);
  for (const VectorXd& prior : {truth, VectorXd(VectorXd::Zero(truth.size()))}) {
    const VectorXd other = completed(c, c.C * truth, prior);
    EXPECT_LT((c.C * (other - truth)).cwiseAbs().maxCoeff(), 1e-9);
    for (int i = 0; i < other.size(); i += 4) EXPECT_GT(other(i), 0.0) << "body " << i / 4;
  }
}

/// Rests as the machine gives them: legs read in counts, a noisy, biased, drifting sensor.
std::vector<StaticInterval> readings(const Experiment& e, const StaticSetup& setup,
                                     const PosePlan& plan, std::uint32_t seed) {
  constexpr int kSettling = 40, kReadings = 120;
  plant::ForceTorqueSensor sensor(e.plant.sensor, plant::Noise(seed));
  const auto step = sensor.prepare(0.01);
  std::mt19937 draw(seed);
  std::uniform_real_distribution<double> u(-0.5, 0.5);
  std::vector<StaticInterval> rests;
  for (const PosePlan::Attitude& a : plan.attitudes)
    for (const JointVector& q : a.q) {
      StaticInterval rest;
      rest.t = 10.0 * static_cast<double>(rests.size());
      rest.q = q;
      const Transform X_IP = e.controller.geometry.fromHome({Vec3::Zero(), a.rpy});
      // A leg rests anywhere within the count that it reads.
      Vec6 L = legLengths(e.controller.geometry, X_IP);
      L = legLengths(e.controller.legs, legCounts(e.controller.legs, L));
      Vec6 truly = L;
      for (int i = 0; i < kLegs; ++i) truly(i) += u(draw) * e.controller.legs.scale(i);
      rest.rpy = e.controller.geometry.toHome(forwardPose(e.controller.geometry, L, X_IP).X_IP).rpy;
      const Mat3 R = forwardPose(e.controller.geometry, truly, X_IP).X_IP.R;
      const Wrench F = staticWrench(e.plant.payload, q, R, setup.g_I);
      sensor.settle(F);
      for (int k = 0; k < kSettling + kReadings; ++k) {
        sensor.advance(step, F, plant::ForceTorqueSensor::Over::kConstant);
        const AdcCounts adc = sensor.convert(1e-4 * rest.t);
        if (k < kSettling) continue;
        for (int i = 0; i < kWrenchChannels; ++i)
          rest.counts(i) += adc[static_cast<std::size_t>(i)] / static_cast<double>(kReadings);
      }
      rests.push_back(rest);
    }
  return rests;
}

TEST(Identification, ParametersAreWithinThreeDeviationsInNinetyNinePercent) {
  for (const char* name : {"puma_on_table_4_1", "doss_on_table_4_1"}) {
    const Experiment e = test::experiment(name);
    const StaticSetup setup = staticSetup(e.controller);
    const SeparableCombinations c = separableCombinations(setup.robot);
    const PosePlan plan = planPoses(setup, c, e.controller, e.plant.task.initial_joints, {});
    const VectorXd truth = c.C * massParameters(setup.robot);
    constexpr int kSeeds = 200;
    int within = 0, of = 0;
    double squares = 0.0;
    for (int seed = 1; seed <= kSeeds; ++seed) {
      const MassEstimate m =
          estimateMasses(setup, c, readings(e, setup, plan, static_cast<std::uint32_t>(seed)));
      const VectorXd z = (m.beta - truth).cwiseQuotient(m.standard_deviation);
      within += static_cast<int>((z.array().abs() < 3.0).count());
      of += static_cast<int>(z.size());
      squares += z.squaredNorm();
      EXPECT_LT(m.inflation.maxCoeff(), MassEstimate::kMixed);
    }
    EXPECT_GE(within, 0.99 * of) << name;
    // Deviations that were too large would pass the first.
    EXPECT_NEAR(std::sqrt(squares / of), 1.0, 0.15) << name;
  }
}

// What it says of the weight's readings is what they scatter by, and what the plan foretold of it.
TEST(Identification, ItsDeviationIsThatOfTheWeightsReadings) {
  const Experiment e = test::experiment("puma_on_table_4_1");
  const StaticSetup setup = staticSetup(e.controller);
  const SeparableCombinations c = separableCombinations(setup.robot);
  PosePlanOptions few;
  few.attitudes = 4;
  const PosePlan plan = planPoses(setup, c, e.controller, e.plant.task.initial_joints, few);
  const VectorXd truth = c.C * massParameters(setup.robot);
  constexpr int kSeeds = 100;
  double scatter = 0.0, said = 0.0, foretold = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const auto rests = readings(e, setup, plan, static_cast<std::uint32_t>(seed));
    const MassEstimate m = estimateMasses(setup, c, rests);
    double off = 0.0, weight = 0.0;
    for (const StaticInterval& rest : rests) {
      const Eigen::MatrixXd Y = countRegressor(setup, rest.q, rest.rpy)(Eigen::all, c.leads).eval();
      const auto weighed = [&](const VectorXd& beta) {
        return (Y * beta).cwiseQuotient(m.residual).squaredNorm();
      };
      off += weighed(m.beta - truth);
      weight += weighed(truth);
    }
    scatter += off / weight / kSeeds;
    said += m.deviation * m.deviation / kSeeds;
    foretold += std::pow(plan.deviation * m.residual.mean(), 2) / kSeeds;
  }
  EXPECT_NEAR(std::sqrt(scatter / said), 1.0, 0.15);
  EXPECT_NEAR(std::sqrt(foretold / said), 1.0, 0.5);  // without drift, channels alike
}

// The composite of points on sticks, by hand.
TEST(Identification, LeavesTheLinksOwnInertiaAsItWas) {
  RobotModel robot = chain({joint(JointType::kRevolute, Z, Vec3::Zero())});
  robot.base = {};
  robot.links[0].body = {4.0, Vec3(0.5, 0.0, 0.0), Vec3(0.1, 0.2, 0.3).asDiagonal()};
  Link second = joint(JointType::kPrismatic, X, Vec3(1.0, 0.0, 0.0));
  second.body = {4.0, Vec3(0.5, 0.0, 0.0), Mat3::Zero()};
  robot.extend(second);
  // Two points of 4 kg, 1 m apart: 2 kg m^2 across, twice; and 0.6 kg m^2 of their own.
  const double own = 0.6 / (0.6 + 4.0);
  MassRecord record;
  record.deviation = 0.002;
  EXPECT_NEAR(massErrorOf(record, robot, JointVector::Zero(), 0.05), 0.006 + 0.05 * own, 1e-12);
}

TEST(Identification, BiasIsThatOfTheMiddleOfTheRests) {  // where its drift has no say
  const Experiment e = test::experiment("puma_on_table_4_1");
  const StaticSetup setup = staticSetup(e.controller);
  const SeparableCombinations c = separableCombinations(setup.robot);
  const PosePlan plan = planPoses(setup, c, e.controller, e.plant.task.initial_joints, {});
  std::vector<StaticInterval> rests = readings(e, setup, plan, 1);
  const MassEstimate before = estimateMasses(setup, c, rests);
  double middle = 0.0;
  for (const StaticInterval& rest : rests) middle += rest.t / static_cast<double>(rests.size());
  const double drift = 0.5;  // [count/s]
  for (StaticInterval& rest : rests) rest.counts.array() += drift * (rest.t - middle);
  const MassEstimate after = estimateMasses(setup, c, rests);
  EXPECT_LT((after.bias - before.bias).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((after.bias_drift - before.bias_drift).array().abs().maxCoeff() - drift, 1e-9);
  EXPECT_LT((after.beta - before.beta).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(Identification, ResidualIsWhatTheRestsScatterByChannel) {
  const Experiment e = test::experiment("puma_on_table_4_1");
  const StaticSetup setup = staticSetup(e.controller);
  const SeparableCombinations c = separableCombinations(setup.robot);
  const PosePlan plan = planPoses(setup, c, e.controller, e.plant.task.initial_joints, {});
  std::vector<StaticInterval> rests = readings(e, setup, plan, 1);
  std::mt19937 draw(2);
  std::normal_distribution<double> n(0.0, 20.0);  // far above the sensor's own
  for (StaticInterval& rest : rests) rest.counts(3) += n(draw);
  const MassEstimate m = estimateMasses(setup, c, rests);
  EXPECT_NEAR(m.residual(3), 20.0, 6.0);
  EXPECT_LT(m.residual(0), 5.0);
}

TEST(Identification, SaysWhichParametersAreMixed) {
  // One attitude tells the weight from the bias of Fz by nothing.
  const Experiment e = test::experiment("puma_on_table_4_1");
  const StaticSetup setup = staticSetup(e.controller);
  const SeparableCombinations c = separableCombinations(setup.robot);
  PosePlanOptions little;
  little.tilt = 0.5 * kDegree;
  const PosePlan plan = planPoses(setup, c, e.controller, e.plant.task.initial_joints, little);
  const MassEstimate m = estimateMasses(setup, c, readings(e, setup, plan, 1));
  EXPECT_GT(m.inflation(0), MassEstimate::kMixed);  // m0 + m1 + ..
  EXPECT_LT(m.inflation(c.rank() - 1), MassEstimate::kMixed);
}

TEST(Identification, RefusesWhatCannotTell) {
  const Experiment e = test::experiment("puma_on_table_4_1");
  const StaticSetup setup = staticSetup(e.controller);
  const SeparableCombinations c = separableCombinations(setup.robot);
  EXPECT_THROW(estimateMasses(setup, c, std::vector<StaticInterval>(3)), std::domain_error);
  EXPECT_THROW(estimateMasses(setup, c, std::vector<StaticInterval>(100)),
               std::domain_error);  // one pose
}

// --- Kuklinski's compensation --------------------------------------------------------------------

const std::vector<std::string> kShort = {
    "sensor.noise=false",
    "program=[{move: {}}, {calibration: {}}, {move: {to: {x_m: 0.01}}}, {admittance: {duration_s: "
    "5}, robot: [{at_s: 0.5, "
    "duration_s: 2, joint: joint_1, to_deg_or_m: 30}]}]"};

TEST(IterativeCompensation, EndsWhereCompensationWithKnownMassesIs) {
  const Experiment e = test::experiment("puma_on_table_4_1", kShort);
  IterativeOptions options;
  options.weight = 1.0;
  options.translation = 0.05e-3;
  const IterativeResult r = compensateIteratively(e, options, {});
  ASSERT_TRUE(r.converged);
  for (std::size_t i = 1; i < r.changes.size(); ++i)
    EXPECT_LT(r.changes[i].translation, r.changes[i - 1].translation);

  RecordedPath online = r.path.col(0).replicate(1, r.path.cols());
  Eigen::Index n = 0;
  runLockstep(e, nullptr, [&](const TickState& state) {
    if (state.kind == SegmentKind::kAdmittance && n + 1 < online.cols())
      online.col(++n) = state.motion.x;
    return Order();
  });
  ASSERT_EQ(n + 1, online.cols());
  const double moved = online.topRows<3>().colwise().norm().maxCoeff();
  EXPECT_GT(moved, 1e-3);
  // Apart by the legs' counts (0.07 mm each), which both feel as weight that turns, and by a
  // hundredth of the inertial forces in the slow passes.
  EXPECT_LT((online - r.path).topRows<3>().colwise().norm().maxCoeff(), 0.03 * moved + 0.15e-3);
}

TEST(IterativeCompensation, DivergesOnALightlyDampedBase) {
  // Mass ratio over twice the damping ratio is far above one; on line the same loop is stable.
  const Experiment e = test::experiment("srms_low_hover_puma", {"sensor.noise=false"});
  IterativeOptions options;
  options.slower = 2;
  options.most = 4;
  const IterativeResult r = compensateIteratively(e, options, {});
  EXPECT_FALSE(r.converged);
  EXPECT_GT(r.changes.back().translation, 2.0 * r.changes.front().translation);
}

TEST(IterativeCompensation, SaysWhichCheckStoppedAPass) {
  std::vector<std::string> without_oil = kShort;
  without_oil.push_back("sensor.pressure_v=1");
  const IterativeResult r =
      compensateIteratively(test::experiment("puma_on_table_4_1", without_oil), {}, {});
  EXPECT_FALSE(r.converged);
  EXPECT_EQ(r.stopped_by, Check::kPressure);
  EXPECT_TRUE(r.changes.empty());
}

TEST(RecordedPath, IsGoneThroughColumnByColumnAndStandsAtItsEnds) {
  constexpr double kPeriod = 0.01;
  RecordedPath path(6, 200);
  for (int i = 0; i < path.cols(); ++i)
    for (int c = 0; c < 6; ++c) path(c, i) = 0.01 * (c + 1) * std::sin(2.0 * i * kPeriod);
  for (int n = 1; n + 1 < path.cols(); ++n) {
    const PathPoint<6> at = recordedPath(path, n, kPeriod);
    const double t = n * kPeriod;
    EXPECT_EQ(at.x, Vec6(path.col(n)));
    EXPECT_NEAR(at.x_dot(2), 0.06 * std::cos(2.0 * t), 1e-5);
    EXPECT_NEAR(at.x_ddot(2), -0.12 * std::sin(2.0 * t), 1e-5);
  }
  EXPECT_EQ(recordedPath(path, -5, kPeriod).x, Vec6(path.col(0)));
  EXPECT_EQ(recordedPath(path, 1000, kPeriod).x, Vec6(path.col(199)));
  EXPECT_TRUE(recordedPath(path, 1000, kPeriod).x_dot.isZero(0.0));
}

TEST(RecordedPath, OfAScenarioIsCommanded) {
  const Experiment e = test::experiment(
      "free_decay",
      {"program=[{path: {rows_m_deg: [[0, 0, 0, 0, 0, 0], [1.0e-4, 0, 0, 0, 0, 0.01], "
       "[2.0e-4, 0, 0, 0, 0, 0.02], [3.0e-4, 0, 0, 0, 0, 0.03]]}}]"});
  std::vector<Vec6> seen;
  runLockstep(e, nullptr, [&](const TickState& state) {
    if (state.kind == SegmentKind::kPath) seen.push_back(state.motion.x);
    return Order();
  });
  ASSERT_EQ(seen.size(), 3u);
  EXPECT_NEAR(seen[0](0), 1e-4, 1e-15);
  EXPECT_NEAR(seen[2](5), 0.03 * kDegree, 1e-15);
}

// --- As a person does it -------------------------------------------------------------------------

class Identify : public test::Programs {};

TEST_F(Identify, PlanRunMassesAndTheirUse) {
  for (const std::string scenario : {"puma_on_table_4_1", "doss_on_table_4_1"}) {
    ASSERT_EQ(test::sh(app("identify") + "plan " + scenario + " --attitudes 7 " + "--out " +
                       file("plan.yaml"))
                  .status,
              0);
    ASSERT_EQ(run(file("plan.yaml") + " --lockstep --no-plots --overwrite" + out("run")).status, 0);
    const test::Output masses = test::sh(app("identify") + "masses " + file("run/run.lcmlog") +
                                         " --out " + file("masses.yaml"));
    ASSERT_EQ(masses.status, 0) << masses.text;

    // Truth is in the plant; the controller has nothing but the file.
    const Experiment e =
        loadExperiment(std::string(VES_TEST_CONFIG_DIR) + "/scenarios/" + scenario + ".yaml", {},
                       {.masses = file("masses.yaml")});
    EXPECT_EQ(e.controller.payload.adapter_R.mass, 0.0);
    EXPECT_GT(e.plant.payload.adapter_R.mass, 0.0);
    std::mt19937 draw(7);
    std::uniform_real_distribution<double> u(-0.3, 0.3);
    for (int k = 0; k < 100; ++k) {  // fresh poses
      const JointVector q = anyPose(e.plant.payload.robot, draw);
      const Mat3 R = rotation(Vec3(u(draw), u(draw), 0.0));
      const Vec6 residual = (staticWrench(e.controller.payload, q, R, e.controller.gravity) -
                             staticWrench(e.plant.payload, q, R, e.controller.gravity))
                                .stacked();
      // The sensor's noise: about 0.3 N in x and y, 1 N in z, 0.1 N m.
      EXPECT_LT(residual.head<3>().cwiseAbs().maxCoeff(), 0.1) << scenario;
      EXPECT_LT(residual.tail<3>().cwiseAbs().maxCoeff(), 0.1) << scenario;
    }
    expectRefusal(app("run") + (scenario == "puma_on_table_4_1" ? "doss" : "puma") +
                      "_on_table_4_1 --lockstep --masses " + file("masses.yaml") + out("x"),
                  "masses.kinematics");
  }
}

// What a run has learnt stands in its folder, says whose it is, and serves the next one.
TEST_F(Identify, WhatARunHasLearntServesTheNext) {
  const auto error = [&](const std::string& name, const std::string& more) {
    std::string line = "puma_on_table_4_1 --lockstep --no-plots --set sensor.readings_per_tick=4";
    for (const char* on : {"feed_forward=true", "observer=true", "inertia=true", "wrench=aided"})
      line += std::string(" --set controller.compensation.") + on;
    const test::Output o = run(line + " --set 'plant_mismatch={mass: 1.05}' " + more + out(name));
    EXPECT_EQ(o.status, 0) << o.text;
    EXPECT_EQ(o.text.find("masses.yaml") != std::string::npos, name == "learns") << o.text;
    return summary(folder_ / name)["emulation_error_rms_m"].get<double>();
  };
  const double believes = error("believes", "");
  error("learns", "--set controller.compensation.learns_masses=true");
  const std::string text = test::readText(file("learns/masses.yaml"));
  EXPECT_EQ(text.rfind("# Masses that a run of puma_on_table_4_1 has learnt.", 0), 0u) << text;
  EXPECT_LT(error("knows", "--masses " + file("learns/masses.yaml")), 0.5 * believes);
}

TEST_F(Identify, RefusesByName) {
  expectRefusal(app("identify") + "plan free_decay", "has no robot with joints");
  std::ofstream(file("space.yaml"))
      << "from: " << VES_TEST_CONFIG_DIR << "/scenarios/puma_tilt.yaml\ngravity_m_per_s2: 0\n";
  expectRefusal(app("identify") + "plan " + file("space.yaml"), "gravity_m_per_s2: 0");
  expectRefusal(app("identify") + "plan puma_tilt --tilt nan", "--tilt");
  expectRefusal(app("identify") + "masses " + file("no.lcmlog"), "no.lcmlog");
  ASSERT_EQ(run("free_decay --lockstep --no-plots" + out("free")).status, 0);
  expectRefusal(app("identify") + "masses " + file("free/run.lcmlog"), "never stand still");
  std::ofstream(file("bad.yaml")) << "date: 2026-01-01T00:00:00Z\nkinematics: x\nbodies:\n"
                                     "  - {mass_kg: -1, moment_kg_m: [0, 0, 0]}\n";
  expectRefusal(app("run") + "puma_tilt --lockstep --masses " + file("bad.yaml") + out("y"),
                "bodies[0].mass_kg");
}

// Platform and robot stand twice; in between a leg leaves by a count more than is allowed.
TEST(StaticIntervals, AreTheStretchesInWhichAllStands) {
  Series series;
  series.experiment = test::experiment("puma_on_table_4_1");
  const int allowed = series.experiment.controller.stillness.leg_counts;
  const auto put = [&](int leg_counts, double x_dot, bool sampled) {
    Row row{};
    const auto k = series.rows.size();
    row.t = 0.01 * static_cast<double>(k);
    row.has_sample = sampled;
    row.sample.legs[2] = 5000 + leg_counts;
    row.sample.q[1] = 0.3;
    for (int c = 0; c < kWrenchChannels; ++c) row.sample.adc[c] = 100 * c + (k % 2 ? 1 : -1);
    row.state.x_measured[4] = -0.1;
    row.state.x_dot[0] = x_dot;
    series.rows.push_back(row);
  };
  for (int k = 0; k < 500; ++k) put(k % 2 ? allowed : 0, 0.0, true);  // to 4.99 s
  for (int k = 0; k < 30; ++k) put(1000 * k, 1e-3, true);
  for (int k = 0; k < 400; ++k) put(0, 0.0, true);  // 5.3 to 9.29 s
  put(0, 0.0, false);
  for (int k = 0; k < 50; ++k) put(0, 0.0, true);  // too short
  const std::vector<StaticInterval> found = staticIntervals(series);
  ASSERT_EQ(found.size(), 2u);
  const double ends[][2] = {{0.0, 4.99}, {5.3, 9.29}};
  for (std::size_t i = 0; i < 2; ++i) {
    const auto& [first, last] = ends[i];
    const StaticInterval& rest = found[i];
    EXPECT_GT(rest.t - 0.5 * rest.duration, first + 0.1);  // the filter settles
    EXPECT_LT(rest.t + 0.5 * rest.duration, last + 0.01);
    EXPECT_GT(rest.t + 0.5 * rest.duration, last - 0.5);
    EXPECT_GT(rest.duration, 1.0);
    for (int c = 0; c < kWrenchChannels; ++c) EXPECT_NEAR(rest.counts(c), 100.0 * c, 0.02);
    EXPECT_NEAR(rest.q(1), 0.3, 1e-12);
    EXPECT_NEAR(rest.rpy(1), -0.1, 1e-12);
  }
  // One count more than is allowed is another stretch.
  for (Row& row : series.rows)
    if (row.sample.legs[2] == 5000 + allowed) row.sample.legs[2] += 1;
  EXPECT_EQ(staticIntervals(series).size(), 1u);
}

}  // namespace
}  // namespace ves
