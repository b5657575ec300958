// SPDX-License-Identifier: BSD-3-Clause
//
// The stability check of a scenario: what it bars, what it names, and which cures it offers.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <complex>
#include <filesystem>

#include "support/rig.hpp"
#include "ves/analysis/gate.hpp"
#include "ves/analysis/loop.hpp"
#include "ves/evaluation/comparison.hpp"
#include "ves/run/run.hpp"
#include "ves/series/series.hpp"
#include "ves/srms/modes.hpp"

namespace ves {
namespace {

const std::vector<std::string> kDiverging = {"base.keep_modes=6", "legs.filters=outputs"};

TEST(Gate, NamesWhatGrowsAndWhatItNamesCuresIt) {
  const Experiment e = test::experiment("srms_deploy_doss", kDiverging);
  const LoopVerdict v = assessStability(e.controller, e.plant.task);
  ASSERT_FALSE(v.stable);
  EXPECT_GT(v.worst.growth, 0.0);
  const std::string said = explain(v);
  EXPECT_NE(said.find("keep 3 of the 6 modes"), std::string::npos) << said;
  EXPECT_NE(said.find(", most in "), std::string::npos) << said;
  const auto with = [](const std::string& set) {
    std::vector<std::string> all = kDiverging;
    all.push_back(set);
    const Experiment cured = test::experiment("srms_deploy_doss", all);
    return isStable(cured.controller, cured.plant.task);
  };
  EXPECT_TRUE(with("base.keep_modes=" + std::to_string(v.stable_modes)));
  EXPECT_FALSE(with("base.keep_modes=" + std::to_string(v.stable_modes + 1)));
  EXPECT_NE(said.find("a damping ratio of "), std::string::npos) << said;
  ASSERT_GT(v.damping_ratio, 0.02);
  EXPECT_TRUE(with("base.arm.damping_ratio=" + std::to_string(v.damping_ratio)));
  EXPECT_FALSE(with("base.arm.damping_ratio=" + std::to_string(v.damping_ratio / 1.26)));
}

TEST(Gate, LooksAtLegsThatHardlyMoveWhereTheirValvesAreOpen) {
  // There both edges pass: a machine whose loop just bears its gains may not bear their sum.
  Experiment e = test::experiment("puma_on_table_4_1", test::kCompensated);
  const double up = e.controller.servo.extend.mean(), down = e.controller.servo.retract.mean();
  EXPECT_EQ(directionsOf(e.controller).size(), 2u);
  const LoopVerdict shut = assessStability(e.controller, e.plant.task);
  e.controller.servo.opening.setConstant(1e-4);
  EXPECT_EQ(directionsOf(e.controller).size(), 3u);
  const Loop null = loopOf(e.controller, e.plant.task.initial_joints, Direction::kNearNull);
  EXPECT_DOUBLE_EQ(null.velocity_gain, up + down);
  EXPECT_DOUBLE_EQ(null.model.servo.extend(0), up + down);
  const LoopVerdict open = assessStability(e.controller, e.plant.task);
  EXPECT_GE(open.worst.radius, shut.worst.radius);
  EXPECT_EQ(open.at(Direction::kNearNull).velocity_gain, up + down);
  // What one of three directions does is in the verdict: the sum of both gains alone is refused.
  const auto stable = [&](double gain) {
    Experiment more = e;
    more.controller.servo.opening.setConstant(gain > 0.0 ? 1e-4 : 0.0);
    const double share = std::abs(gain);
    more.controller.servo.extend *= share;
    more.controller.servo.retract *= share;
    return isStable(more.controller, more.plant.task);
  };
  double share = 1.0;
  while (share < 100.0 && stable(share)) share *= 1.6;
  ASSERT_LT(share, 100.0);
  EXPECT_TRUE(stable(-share));
}

TEST(Gate, LooksAtLegsThatTurnRoundWhereFrictionIsBelievedIn) {
  Experiment e = test::experiment("puma_on_table_4_1", test::kCompensated);
  const JointVector& q = e.plant.task.initial_joints;
  e.controller.servo.friction.setConstant(3e-4);
  e.controller.servo.friction_way = 1e-4;
  EXPECT_EQ(directionsOf(e.controller).back(), Direction::kTurning);
  Loop loop = loopOf(e.controller, q, Direction::kTurning);
  EXPECT_DOUBLE_EQ(loop.model.turning, 3.0);
  EXPECT_EQ(loop.model.lapped, 0.0);

  const double T = loop.period;
  // A turn that is felt for ever, of legs that are told their lengths alone, is a platform that
  // goes further: the same as a robot that is heavier by that.
  const auto largest = [](const Loop& l, double least) {
    std::vector<double> out;
    for (const auto& root : roots(l))
      if (std::abs(root - 1.0) > 1e-6 && std::abs(root) > least) out.push_back(std::abs(root));
    std::sort(out.begin(), out.end());
    return out;
  };
  Loop still = loop;
  still.model.feed_forward = still.model.inertia = false;
  still.model.turning = 0.15;
  still.model.turning_time = 1e300;
  Loop heavy = still;
  heavy.model.turning = 0.0;
  heavy.robot_P = scaledDensity(1.15, heavy.robot_P);
  const std::vector<double> turns = largest(still, 0.9), weighs = largest(heavy, 0.9);
  ASSERT_EQ(turns.size(), weighs.size());
  for (std::size_t i = 0; i < turns.size(); ++i) EXPECT_NEAR(turns[i], weighs[i], 1e-7) << i;

  // It is felt for its time, whatever else there is.
  Loop fades = loop;
  fades.robot_P = fades.model.robot_P = RigidBody();
  fades.model.turning_time = 0.05;
  int fading = 0;
  for (const auto& root : roots(fades)) fading += std::abs(root - std::exp(-T / 0.05)) < 1e-4;
  EXPECT_EQ(fading, 6);

  // One that is over within a tick tells the change since the last: their speed, nearly.
  Loop quick = loop;
  quick.model.inertia = false;
  quick.model.turning = 0.4;
  quick.model.turning_time = 1e-6;
  Loop leads = quick;
  leads.model.turning = 0.0;
  leads.model.servo.derivative += 0.4 * T;
  Loop plain = quick;
  plain.model.turning = 0.0;
  const double led = radius(leads) - radius(plain);
  EXPECT_NEAR(radius(quick) - radius(plain), led, 0.1 * std::abs(led));
  EXPECT_GT(std::abs(led), 1e-6);

  // What overlaps is told to a speed and the lag's share of an acceleration.
  e.controller.servo.friction.setZero();
  e.controller.servo.opening.setConstant(-3e-4);
  EXPECT_EQ(directionsOf(e.controller).back(), Direction::kTurning);
  Loop lapped = loopOf(e.controller, q, Direction::kTurning);
  EXPECT_NEAR(lapped.model.lapped, (kThroughLap - 1.0) / lapped.velocity_gain, 1e-12);
  lapped.model.inertia = false;
  lapped.model.servo.delay.setConstant(lapped.model.servo.tau(0) + 0.5 * T -
                                       lapped.model.servo.update);
  Loop same = lapped;
  same.model.lapped = 0.0;
  same.model.servo.derivative += lapped.model.lapped;
  EXPECT_NEAR(radius(lapped), radius(same), 1e-9);

  // Too much of either is refused as believed, for what it is.
  const auto verdict = [&](double way) {
    e.controller.servo.friction.setConstant(3e-3);
    e.controller.servo.friction_way = way;
    e.controller.servo.opening.setZero();
    return assessStability(e.controller, e.plant.task);
  };
  EXPECT_TRUE(verdict(1e-2).stable);
  const LoopVerdict refused = verdict(3e-5);
  EXPECT_FALSE(refused.as_believed);
  EXPECT_EQ(refused.direction, Direction::kTurning);
  EXPECT_NE(explain(refused).find("(legs turning round)"), std::string::npos);
  EXPECT_NE(explain(refused).find("no friction_m"), std::string::npos) << explain(refused);
  e.controller.compensation.feed_forward = false;
  EXPECT_EQ(directionsOf(e.controller).size(), 2u);
}

TEST(Gate, ItsWorstIsTheWorstOfAllPosesAndBothDirections) {
  // Unfolded in the middle of its program, and back.
  const Experiment folds = test::experiment(
      "doss_on_table_4_1",
      {"program=[{admittance: {duration_s: 9}, robot: [{at_s: 1, duration_s: 3, joint: joint_4, "
       "to_deg_or_m: 0}, {at_s: 4, duration_s: 3, joint: joint_4, to_deg_or_m: 90}]}]"});
  for (const Experiment& e : {folds, test::experiment("srms_deploy_doss", kDiverging)}) {
    const LoopVerdict v = assessStability(e.controller, e.plant.task);
    double most = 0.0, of_last = 0.0;
    for (const Direction direction : {Direction::kExtending, Direction::kRetracting})
      for (const ProgramRobot& one : programRobots(e.controller, e.plant.task)) {
        of_last = dominantRoot(loopOf(e.controller, one.q, direction)).radius;
        most = std::max(most, of_last);
      }
    EXPECT_NEAR(v.worst.radius, most, 1e-9) << e.name;
    EXPECT_GT(most - of_last, 1e-7) << e.name << ": the last pose is the worst";
  }
}

TEST(Gate, ItsWorstDirectionIsThatOfTheFasterLegs) {  // the servo that follows best damps least
  const auto worst = [](const std::string& extend, const std::string& retract) {
    const Experiment e =
        test::experiment("doss_on_table_4_1", {"legs.gain_extend_in_per_s_per_ma=" + extend,
                                               "legs.gain_retract_in_per_s_per_ma=" + retract});
    const LoopVerdict v = assessStability(e.controller, e.plant.task);
    EXPECT_TRUE(v.stable);
    const Loop& loop = v.at(v.direction);
    EXPECT_NEAR(v.worst.radius, radius(loop), 1e-9);
    return v.direction;
  };
  EXPECT_EQ(worst("1.18", "0.77"), Direction::kExtending);
  EXPECT_EQ(worst("0.77", "1.18"), Direction::kRetracting);
}

TEST(LoopModel, AnUndampedBaseAloneNeitherGrowsNorDecays) {  // its roots are on the unit circle
  const Experiment e = test::experiment("puma_on_table_4_1");
  Loop loop = loopOf(e.controller, e.plant.task.initial_joints, Direction::kExtending);
  loop.robot_P = RigidBody{};
  loop.base.damping.setZero();
  const Eigen::VectorXd stiffness = loop.base.stiffness;
  for (int n = 1; n <= 40; ++n) {
    loop.base.stiffness = 0.3 * n * stiffness;
    EXPECT_TRUE(decays(loop)) << n;
    EXPECT_NEAR(radius(loop), 1.0, 1e-9) << n;
  }
}

TEST(Gate, LooksAtEveryPoseOfTheRobot) {
  // A base so light that the folded robot is just borne; unfolding its elbow, as its program does,
  // is too much.
  const auto stable = [](double lighter, const std::string& robot) {
    Experiment e = test::experiment("doss_on_table_4_1",
                                    {"program=[{admittance: {duration_s: 5}" + robot + "}]"});
    std::get<ModalModel>(e.controller.vehicle.kind).Phi *= lighter;
    return isStable(e.controller, e.plant.task);
  };
  double lo = 1.0, hi = 100.0;
  ASSERT_TRUE(stable(lo, ""));
  ASSERT_FALSE(stable(hi, ""));
  for (int i = 0; i < 14; ++i) {
    const double mid = std::sqrt(lo * hi);
    (stable(mid, "") ? lo : hi) = mid;
  }
  EXPECT_TRUE(stable(0.99 * lo, ""));
  EXPECT_FALSE(
      stable(0.99 * lo, ", robot: [{at_s: 1, duration_s: 3, joint: joint_4, to_deg_or_m: 0}]"));
}

TEST(Gate, BarsAdmittanceControlUnlessForced) {
  Experiment e = test::unassessed("srms_deploy_doss", kDiverging);
  EXPECT_NE(applyStabilityCheck(e), "");
  EXPECT_EQ(e.controller.stability, Stability::kUnstable);
  test::Rig rig(e);
  rig.arm();
  rig.order(Request::kRun, test::segment(SegmentKind::kAdmittance, 5.0));
  EXPECT_EQ(rig.state().refusal, Refusal::kUnstable);
  EXPECT_EQ(rig.state().phase, Phase::kArmed);
  rig.order(Request::kRun, test::sine(2, 0.01, 0.5, 1.0));  // anything else is free
  EXPECT_EQ(rig.state().phase, Phase::kRunning);

  Experiment forced = e;
  forced.controller.stability = Stability::kForced;
  EXPECT_NE(applyStabilityCheck(forced), "");
  EXPECT_EQ(forced.controller.stability, Stability::kForced);
  EXPECT_EQ(forced.controller.stability_uncompensated, Stability::kForced);
  Experiment good = test::unassessed("srms_deploy_doss");
  EXPECT_EQ(applyStabilityCheck(good), "");
  EXPECT_EQ(good.controller.stability, Stability::kStable);
  EXPECT_EQ(good.controller.stability_uncompensated, Stability::kStable);
  EXPECT_EQ(good.controller.stable_for_uncompensated, HUGE_VAL);
}

TEST(Gate, ProgramThatHasItDoesNotBegin) {
  Experiment e = test::unassessed("srms_deploy_doss", kDiverging);
  applyStabilityCheck(e);
  test::Rig rig(e);
  rig.tick(Request::kStart);
  EXPECT_EQ(rig.state().refusal, Refusal::kUnstable);
  for (int i = 0; i < 100; ++i) rig.tick();
  EXPECT_EQ(rig.state().phase, Phase::kDisarmed);
  rig.arm();
  rig.tick(Request::kStart);
  EXPECT_EQ(rig.state().refusal, Refusal::kUnstable);
  EXPECT_EQ(rig.state().phase, Phase::kArmed);
}

TEST(Gate, LooksAtThePosesBetweenTheEndsOfAMove) {
  // Hanging to either side the arm is borne; swinging over from one to the other it stretches out.
  const auto stable = [](const std::string& to) {
    const Experiment e = test::experiment(
        "doss_on_table_4_1",
        {"legs.filters=outputs", "base.mass_diagonal=[500,500,500,25,500,500]",
         "base.damping_diagonal=[500,500,500,20,250,250]",
         "robot.joints_deg_or_m=[0,0,-180,0,0,0,0]", "gravity_m_per_s2=0",
         "program=[{move: {}}, {admittance: {duration_s: 20}, robot: [{at_s: 1, duration_s: 15, "
         "joint: joint_3, to_deg_or_m: " +
             to + "}]}]"});
    return isStable(e.controller, e.plant.task);
  };
  EXPECT_TRUE(stable("-180"));
  EXPECT_FALSE(stable("0"));
  EXPECT_FALSE(stable("-90"));
}

TEST(Gate, ALoadThatNobodyToldOfIsNotCompensated) {
  Experiment e = test::experiment("srms_deploy_doss", {"controller.compensation.observer=true",
                                                       "controller.compensation.inertia=true"});
  const Loop loop = loopOf(e.controller, e.plant.task.initial_joints, Direction::kExtending);
  const RigidBody light = loop.robot_P, heavy = scaledDensity(3.0, light);
  Loop untold = loop;
  untold.robot_P = heavy;
  Loop told = untold;
  told.model.robot_P = heavy;
  EXPECT_NEAR(radius(carrying(loop, {heavy, light})), radius(untold), 1e-12);
  EXPECT_NEAR(radius(carrying(loop, {heavy, heavy})), radius(told), 1e-12);
  EXPECT_GT(std::abs(radius(told) - radius(untold)), 1e-6);
}

TEST(Gate, LooksAtEachMotionWhateverElseThereIs) {
  const Experiment e = test::experiment(
      "puma_on_table_4_1",
      {"program=[{trajectory: {duration_s: 0.1}, robot: [{at_s: 0, duration_s: 5, joint: joint_2, "
       "to_deg_or_m: 0}]}, {admittance: {duration_s: 400}, robot: [{at_s: 290, duration_s: 1, "
       "joint: joint_3, to_deg_or_m: 60}, {at_s: 4, duration_s: 2, joint: joint_1, to_deg_or_m: "
       "0}, "
       "{at_s: 1, duration_s: 2, joint: joint_1, to_deg_or_m: 100}]}]"});
  const auto poses = programRobots(e.controller, e.plant.task);
  const auto near = [&](int joint, double degrees) {
    return std::any_of(poses.begin(), poses.end(), [&](const ProgramRobot& one) {
      return std::abs(one.q(joint) / kDegree - degrees) < 8.0;
    });
  };
  EXPECT_TRUE(near(0, 50.0));
  EXPECT_TRUE(near(0, 100.0));
  EXPECT_TRUE(near(2, 75.0));
  EXPECT_TRUE(near(1, -45.0));  // begun before admittance control, and still under way in it
  EXPECT_NEAR(poses.back().q(0), 0.0, 1e-9);
}

TEST(Gate, LooksOnceAtAMotionThatIsMadeAgain) {
  const auto count = [](int turns) {
    std::string events;
    for (int k = 0; k < turns; ++k)
      events += fmt::format("{}{{at_s: {}, duration_s: 1.5, joint: joint_2, to_deg_or_m: {}}}",
                            k ? ", " : "", 1 + 3 * k, k % 2 == 0 ? -60 : -90);
    const Experiment e =
        test::experiment("puma_on_table_4_1",
                         {"program=[{admittance: {duration_s: 100}, robot: [" + events + "]}]"});
    return programRobots(e.controller, e.plant.task).size();
  };
  EXPECT_EQ(count(1), 13u);  // twelve steps on one way
  EXPECT_EQ(count(30), 13u);
}

// However long before it the robot has moved there.
TEST(Gate, LooksAtThePoseInWhichAdmittanceControlBegins) {
  const Experiment e = test::experiment(
      "puma_on_table_4_1",
      {"program=[{move: {}, robot: [{at_s: 0, duration_s: 2, joint: joint_1, to_deg_or_m: 70}]}, "
       "{move: {duration_s: 3}}, {calibration: {}}, {admittance: {duration_s: 5}}]"});
  const auto poses = programRobots(e.controller, e.plant.task);
  EXPECT_NEAR(poses.back().q(0), 70.0 * kDegree, 1e-9);
}

TEST(Gate, TakesTheRobotAsTheControllerKnowsIt) {
  Experiment e = test::experiment("srms_deploy_doss", kDiverging);
  e.plant.payload.robot = RobotModel();  // what a URDF without masses would say
  EXPECT_FALSE(isStable(e.controller, e.plant.task));
}

TEST(Gate, LetsAFreeBaseDriftAndStillNamesCures) {
  const auto verdict = [](std::vector<std::string> sets) {
    const Experiment e = test::experiment("puma_on_table_4_1", std::move(sets));
    return assessStability(e.controller, e.plant.task);
  };
  EXPECT_TRUE(
      verdict({"base.stiffness_diagonal=[0,0,0,0,0,0]", "base.damping_diagonal=[0,0,0,0,0,0]"})
          .stable);
  // Free in x alone, too light in the rest: fewer modes, weaker K_P or damping still cure it.
  const LoopVerdict light = verdict(
      {"base.mass_diagonal=[12,12,12,6,6,6]", "base.stiffness_diagonal=[0,250,250,120,120,120]"});
  EXPECT_FALSE(light.stable);
  EXPECT_TRUE(light.stable_modes > 0 || light.damping_ratio > 0.0 || light.K_P > 0.0);
}

TEST(Margins, OfARobotWithoutMassAreTheMostThatIsLookedFor) {
  const Experiment e = test::experiment("free_decay");
  Loop loop = loopOf(e.controller, e.plant.task.initial_joints, Direction::kExtending);
  loop.robot_P = RigidBody{};
  const Margins m = margins(loop);
  EXPECT_EQ(m.gain, Margins::kMostGain);
  EXPECT_EQ(m.delay, Margins::kMostDelay);
}

TEST(Gate, ScenariosOfTheRepositoryPass) {
  for (const auto& entry : std::filesystem::directory_iterator(test::configDir() + "/scenarios")) {
    const Experiment e = loadExperiment(entry.path());
    EXPECT_TRUE(isStable(e.controller, e.plant.task)) << entry.path();
  }
}

TEST(Gate, WhatIsForcedStopsItselfEvenWhereTheEnvelopeHoldsIt) {
  for (const char* scenario : {"srms_deploy_puma", "srms_unberth_puma", "srms_capture_puma"}) {
    const Experiment e = test::experiment(
        scenario, {"base.keep_modes=6", "legs.filters=outputs", "controller.stability=forced",
                   "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 60}}]"});
    const RunResult result = runLockstep(e, nullptr, {});
    EXPECT_EQ(result.phase, Phase::kStopped) << scenario;
  }
}

TEST(LoopModel, AMachineThatHardlyGivesWayIsTheRigidOne) {
  const Experiment e = test::experiment("puma_on_table_4_1", test::kCompensated);
  Loop loop = loopOf(e.controller, e.plant.task.initial_joints, Direction::kExtending);
  // Of what swings faster than the base; that hardly notices.
  const auto slowest = [&] {
    double out = 0.0;
    for (const std::complex<double>& root : roots(loop))
      if (std::abs(std::arg(root)) > 2.0 * M_PI * 3.0 * loop.period)
        out = std::max(out, std::abs(root));
    return out;
  };
  const double rigid = radius(loop), rigid_slowest = slowest();
  for (const double feedback : {0.0, 100.0}) {
    const auto off = [&](double hertz) {
      loop.resonance = {2.0 * M_PI * hertz, 0.7, feedback, 0.03};
      EXPECT_NEAR(radius(loop), rigid, 5e-4) << feedback << " " << hertz;
      return std::abs(slowest() - rigid_slowest);
    };
    // In the first order of its lag.
    EXPECT_LT(off(400.0), 0.025) << feedback;
    EXPECT_LT(off(200.0), 0.7 * off(100.0)) << feedback;
    EXPECT_LT(off(100.0), 0.7 * off(50.0)) << feedback;
  }
}

/// A compensated PUMA on oil, and what becomes of it when nobody asks.
Experiment onOil(const std::string& bulk_modulus, const std::string& feedback,
                 const std::vector<std::string>& more = {}) {
  std::vector<std::string> set = {"legs.model=hydraulic", "sensor.readings_per_tick=4",
                                  "legs.hydraulic.bulk_modulus_mpa=" + bulk_modulus,
                                  "legs.hydraulic.pressure_feedback_ma_per_mpa=" + feedback,
                                  "controller.still.deviation_counts=3000"};
  set.insert(set.end(), test::kCompensated.begin(), test::kCompensated.end());
  return test::experiment("puma_on_table_4_1", set, more);
}

TEST(Gate, AdmitsOilThatIsDampedAndRefusesWhatGrows) {
  for (const char* bulk : {"1400", "690"}) {
    const Experiment damped = onOil(bulk, "1.5"), bare = onOil(bulk, "0");
    EXPECT_TRUE(isStable(damped.controller, damped.plant.task)) << bulk;
    EXPECT_EQ(runLockstep(damped, nullptr, {}).phase, Phase::kParked) << bulk;
    EXPECT_FALSE(isStable(bare.controller, bare.plant.task)) << bulk;
    EXPECT_EQ(runLockstep(bare, nullptr, {}).phase, Phase::kStopped) << bulk;
  }
}

/// [m/s] at most, in the first and in the last third of a run's admittance.
std::pair<double, double> speeds(const Experiment& e) {
  std::vector<double> moved;
  for (const Row& row : recordLockstep(e).series.rows)
    if (inAdmittance(row.state)) moved.push_back(Vec6::Map(row.state.x_dot).norm());
  const auto third = static_cast<std::ptrdiff_t>(moved.size() / 3);
  return {*std::max_element(moved.begin(), moved.begin() + third),
          *std::max_element(moved.end() - third, moved.end())};
}

TEST(Gate, RefusesWhatGrowsByTurningWithFourWayValves) {
  // A light base under soft oil; with three-way valves it decays.
  const auto machine = [](const std::string& circuit, std::vector<std::string> more = {}) {
    more.insert(more.end(), test::kCompensated.begin(), test::kCompensated.end());
    return test::experiment(
        "puma_on_table_4_1",
        {"legs.model=hydraulic", "legs.hydraulic.circuit=" + circuit,
         "legs.hydraulic.bulk_modulus_mpa=1800", "legs.hydraulic.hose_volume_cm3=76",
         "legs.hydraulic.valve_hz=50", "legs.hydraulic.valve_damping=0.74",
         "legs.hydraulic.coulomb_n=50", "legs.hydraulic.breakaway_n=75",
         "legs.hydraulic.viscous_n_s_per_m=2300", "legs.hydraulic.pressure_feedback_ma_per_mpa=0.7",
         "sensor.cutoff_hz=3", "sensor.readings_per_tick=4", "gravity_m_per_s2=0",
         "base={mass_diagonal: [24, 24, 24, 13, 13, 13], "
         "damping_diagonal: [16.5, 16.5, 16.5, 9, 9, 9], "
         "stiffness_diagonal: [12800, 12800, 12800, 7000, 7000, 7000]}",
         "program=[{move: {}}, {calibration: {}}, {move: {to: {x_m: 0.002, z_m: 0.0014}}}, "
         "{admittance: {duration_s: 15}}]"},
        more);
  };
  const Experiment four = machine("four_way"), three = machine("three_way");
  const auto [first, last] = speeds(four);
  EXPECT_GT(last, 1.2 * first);
  const auto [three_first, three_last] = speeds(three);
  EXPECT_LT(three_last, 0.9 * three_first);
  EXPECT_TRUE(isStable(three.controller, three.plant.task));
  const LoopVerdict v = assessStability(four.controller, four.plant.task);
  EXPECT_FALSE(v.stable);
  EXPECT_EQ(v.direction, Direction::kSwinging) << explain(v);
  // It is the turning that decides.
  const Experiment told = machine("four_way", {"machine.resonance.turning_gain=1"});
  EXPECT_TRUE(isStable(told.controller, told.plant.task));
}

TEST(Gate, NamesWhatCuresAMachineThatGivesWay) {
  const Experiment bare = onOil("1400", "0");
  const std::string said = explain(assessStability(bare.controller, bare.plant.task));
  EXPECT_NE(said.find("which gives way at "), std::string::npos) << said;
  const auto cutoff = said.find("a sensor cutoff of "), feedback = said.find("feedback of ");
  ASSERT_NE(std::min(cutoff, feedback), std::string::npos) << said;
  EXPECT_EQ(said.find(" with pressure") != std::string::npos,
            cutoff != std::string::npos && feedback != std::string::npos)
      << said;
  std::vector<std::string> cure;
  if (cutoff != std::string::npos)
    cure.push_back("sensor.cutoff_hz=" + std::to_string(std::stod(said.substr(cutoff + 19))));
  if (feedback != std::string::npos)
    cure.push_back("machine.resonance.pressure_feedback_per_s=" +
                   std::to_string(std::stod(said.substr(feedback + 12))));
  const Experiment cured = onOil("1400", "0", cure);
  const LoopVerdict v = assessStability(cured.controller, cured.plant.task);
  EXPECT_TRUE(v.as_believed) << said;
}

TEST(LoopModel, BasesKeepTheModesThatTheRuleGives) {
  for (const char* configuration : {"unberth", "low_hover", "deploy", "capture"}) {
    int stable = kMaxModes;
    int kept = 0;
    for (const char* robot : {"puma", "doss"})
      for (const char* filters : {"none", "outputs"}) {
        const std::string name = std::string("srms_") + configuration + "_" + robot;
        const auto set = std::string("legs.filters=") + filters;
        kept = static_cast<int>(
            linearised(test::experiment(name).controller.vehicle).stiffness.size());
        const Experiment e = test::experiment(name, {set, "base.keep_modes=8"});
        stable = std::min(stable, stableModes(e.controller, e.plant.task.initial_joints));
      }
    EXPECT_EQ(kept, stable) << configuration;
  }
}

TEST(Gate, NothingOfTheSimulatedMachineChangesItsVerdict) {
  // Every key that makes the plant another one than is believed.
  const auto verdict = [](const std::vector<std::string>& set) {
    const Experiment e = test::experiment("puma_on_table_4_1", test::kCompensated, set);
    const LoopVerdict v = assessStability(e.controller, e.plant.task);
    return std::tuple(v.stable, v.as_believed, v.worst.radius, v.worst.frequency);
  };
  const auto as_believed = verdict({});
  for (const char* key : {"gain_extend", "gain_retract", "tau", "sensor_cutoff", "mass", "center"})
    EXPECT_EQ(verdict({fmt::format("plant_mismatch={{{}: 0.5}}", key)}), as_believed) << key;
  // On oil a verdict takes seconds: what it is made of.
  const auto resonance = [](const std::string& key) {
    std::vector<std::string> set = {"legs.model=hydraulic"};
    if (!key.empty()) set.push_back(fmt::format("plant_mismatch={{{}: 0.8}}", key));
    const Resonance r = test::experiment("puma_on_table_4_1", set).controller.resonance;
    return std::tuple(r.frequency, r.damping, r.feedback, r.feedback_time, r.turning);
  };
  EXPECT_GT(std::get<0>(resonance("")), 0.0);
  for (const char* key :
       {"gain_extend", "tau", "bulk_modulus", "friction", "opening", "mass", "center"})
    EXPECT_EQ(resonance(key), resonance("")) << key;
}

TEST(Gate, LooksAtTheServosThatWereIdentified) {
  Experiment e = test::experiment("puma_on_table_4_1", test::kCompensated);
  const double nominal =
      loopOf(e.controller, e.plant.task.initial_joints, Direction::kExtending).velocity_gain;
  e.controller.servo.extend *= 0.75;
  EXPECT_NEAR(
      loopOf(e.controller, e.plant.task.initial_joints, Direction::kExtending).velocity_gain,
      0.75 * nominal, 1e-12 * nominal);
}

// Twice mass_error is learnt at most. Where the truth is on the other side of the belief, the robot
// is (1 + e) / (1 - 2 e) times as heavy as the model has it, or (1 - e) / (1 + 2 e) times.
TEST(Gate, LooksAtTheMassesThatMayBeLearnt) {
  std::vector<std::string> sets = test::kCompensated;
  for (const char* set :
       {"base.keep_modes=6", "sensor.readings_per_tick=4", "controller.compensation.wrench=aided",
        "controller.compensation.learns_masses=true", "controller.compensation.hand_mass_kg=0",
        "program=[{calibration: {}}, {admittance: {duration_s: 20}}]"})
    sets.push_back(set);
  for (const auto& [scenario, first] :
       {std::pair{"srms_capture_puma", "lighter"}, {"srms_capture_doss", "heavier"}}) {
    const bool heavy = std::string_view(first) == "heavier";
    std::vector<std::string> damped;  // which what is too light does not bear
    if (heavy) damped = {"base.arm.damping_ratio=0.05"};
    Experiment e = test::experiment(scenario, sets, damped);
    const auto admitted = [&](double mass_error) {
      e.controller.compensation.mass_error = mass_error;
      return isStable(e.controller, e.plant.task);
    };
    const auto decaysWith = [&](double times) {
      const Compensation& c = e.controller.compensation;
      for (const Direction direction : {Direction::kExtending, Direction::kRetracting})
        for (const int gain : {1, -1})
          for (const int timing : {1, -1}) {
            Loop loop = loopOf(e.controller, e.plant.task.initial_joints, direction);
            loop.robot_P = scaledDensity(times, loop.robot_P);
            if (!decays(off(loop, {c.timing_error, c.gain_error, 0.0, 0.0}, timing, gain)))
              return false;
          }
      return true;
    };
    const auto heavier = [](double error) { return (1.0 + error) / (1.0 - 2.0 * error); };
    const auto lighter = [](double error) { return (1.0 - error) / (1.0 + 2.0 * error); };
    const auto bears = [&](double error) {
      return decaysWith(heavier(error)) && decaysWith(lighter(error));
    };
    double most = 0.0, grows = 0.45;
    ASSERT_TRUE(bears(most) && !bears(grows));
    while (grows - most > 1e-4) (bears(0.5 * (most + grows)) ? most : grows) = 0.5 * (most + grows);
    EXPECT_TRUE(admitted(0.98 * most));
    EXPECT_FALSE(admitted(1.02 * most));
    const double by = heavy ? heavier(1.02 * most) - 1.0 : 1.0 - lighter(1.02 * most);
    const std::string said = explain(assessStability(e.controller, e.plant.task));
    EXPECT_NE(said.find(fmt::format("a robot {:.3g} % {}", 100.0 * by, first)), std::string::npos)
        << said;
    // So may what a gripper holds, which nobody tells.
    e.controller.compensation.hand_mass = 1e3;
    e.controller.hand.link = 5;
    EXPECT_FALSE(admitted(0.0));
    const LoopVerdict hand = assessStability(e.controller, e.plant.task);
    const std::string knows =
        fmt::format("and {:.3g} kg in the robot's hand that {}: ", 3e3,
                    hand.off[2] > 0 ? "nobody knows of" : "are believed and not there");
    EXPECT_NE(explain(hand).find(knows), std::string::npos) << explain(hand);
    EXPECT_NE(explain(hand).find("hand_mass_kg"), std::string::npos);
    e.controller.hand = {};
    EXPECT_TRUE(admitted(0.0));
    e.controller.compensation.learns_masses = false;
    EXPECT_TRUE(admitted(1.02 * most));
  }
}

// An undamped base whose loop grows by less than a thousandth in a minute, and by much in a week.
TEST(Gate, HoldsSlowGrowthAgainstTheLengthOfTheRun) {
  const auto assessed = [](double seconds, double most) {
    Experiment e = test::unassessed(
        "puma_on_table_4_1",
        {"sensor.readings_per_tick=10",
         "base.stiffness_diagonal=[4935, 4935, 4935, 2467, 2467, 2467]",
         "base.damping_diagonal=[0, 0, 0, 0, 0, 0]", fmt::format("controller.most_growth={}", most),
         "controller.compensation.feed_forward=true", "controller.compensation.observer=true",
         "controller.compensation.inertia=true",
         fmt::format("program=[{{move: {{}}}}, {{admittance: {{duration_s: {}}}}}]", seconds)});
    applyStabilityCheck(e);
    EXPECT_EQ(parseExperiment(e.source.resolved(), "resolved").controller.stable_for,
              e.controller.stable_for);
    return e.controller;
  };
  // A verdict leaves nothing of an earlier one in the text that others read.
  Experiment again = test::unassessed("puma_on_table_4_1", {"controller.stable_for_s=5"});
  EXPECT_EQ(again.controller.stable_for, 5.0);
  applyStabilityCheck(again);
  EXPECT_EQ(again.controller.stable_for, HUGE_VAL);
  EXPECT_EQ(parseExperiment(again.source.resolved(), "again").controller.stable_for, HUGE_VAL);
  const ControllerConfig minute = assessed(60.0, 1.1), week = assessed(6e5, 1.1);
  EXPECT_EQ(minute.stability, Stability::kStable);
  EXPECT_EQ(minute.stable_for, 60.0);
  EXPECT_EQ(week.stability, Stability::kUnstable);
  EXPECT_EQ(assessed(60.0, 1.0).stability, Stability::kUnstable);  // nothing is let pass
  // The published loop decays, for as long as one likes.
  EXPECT_EQ(minute.stable_for_uncompensated, HUGE_VAL);
  EXPECT_EQ(week.stability_uncompensated, Stability::kStable);
}

}  // namespace
}  // namespace ves
