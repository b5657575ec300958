// SPDX-License-Identifier: BSD-3-Clause
//
// Calibration and tare of the sensor: the bias they find, and when they are refused.
#include <gtest/gtest.h>

#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

using test::experiment;
using test::Rig;
using test::segment;
using test::sine;

Vec6 trueBias(const Experiment& e) { return e.plant.sensor.bias / e.plant.sensor.volts_per_count; }

class CalibrationOf : public testing::TestWithParam<const char*> {};

TEST_P(CalibrationOf, RecoversTheBiasToWithinItsStandardError) {
  // The estimate over its own standard error has nine degrees of freedom: rms sqrt(9/7) = 1.13, and
  // beyond 5 less than once in 1300. 40 seeds times six channels scatter the rms by 8 %.
  double sum = 0.0;
  constexpr int kSeeds = 40;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const Experiment e = experiment(GetParam(), {fmt::format("seed={}", seed)});
    Rig rig(e);
    rig.arm();
    rig.order(Request::kRun, segment(SegmentKind::kCalibration));
    const TickState& s = rig.until(Phase::kArmed);
    ASSERT_EQ(s.calibration, CalibrationStatus::kDone);
    const Vec6 normalised = (s.bias - trueBias(e)).cwiseQuotient(s.standard_error);
    EXPECT_LT(normalised.cwiseAbs().maxCoeff(), 8.0) << seed;
    sum += normalised.squaredNorm();
  }
  const double rms = std::sqrt(sum / (6 * kSeeds));
  EXPECT_GT(rms, 0.8);
  EXPECT_LT(rms, 1.5);
}

INSTANTIATE_TEST_SUITE_P(Loads, CalibrationOf,
                         testing::Values("z_sine", "puma_on_table_4_1", "doss_on_table_4_1"),
                         [](const auto& test) { return std::string(test.param); });

struct Restless {
  const char* name;
  const char* set;
  StillnessViolation violation;
  int index;
  void (*before)(Rig&);
};
std::ostream& operator<<(std::ostream& out, const Restless& r) { return out << r.name; }

class CalibrationIsRefused : public testing::TestWithParam<Restless> {};

TEST_P(CalibrationIsRefused, WithTheEvidence) {
  Rig rig(experiment("puma_on_table_4_1", {GetParam().set}));
  rig.arm();
  GetParam().before(rig);
  const Vec6 bias = rig.order(Request::kRun, segment(SegmentKind::kCalibration)).bias;
  const TickState& s = rig.until(Phase::kArmed);
  EXPECT_EQ(s.calibration, CalibrationStatus::kRefused);
  EXPECT_EQ(s.violation, GetParam().violation);
  EXPECT_EQ(s.violation_index, GetParam().index);
  EXPECT_GT(s.violation_amount, 0.0);
  EXPECT_EQ(s.bias, bias);
}

INSTANTIATE_TEST_SUITE_P(
    Causes, CalibrationIsRefused,
    testing::Values(Restless{"robot_moves", "seed=1", StillnessViolation::kJoint, 1,
                             [](Rig& rig) {
                               rig.plant().moveRobot(RobotMove{1, 0.0, 30.0});
                               rig.run(300);
                             }},
                    Restless{"leg_creeps", "seed=1", StillnessViolation::kLeg, 4,
                             [](Rig& rig) {
                               rig.disturb([n = 0](Sample& s) mutable { s.legs[4] += ++n / 20; });
                             }},
                    Restless{"something_shakes_it",
                             "sensor.noise_v_per_root_hz=[3.7e-7,3.7e-7,4e-6,3.7e-7,3.7e-7,3.7e-7]",
                             StillnessViolation::kChannel, 2, [](Rig&) {}}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(Calibration, WaitsForTheRobotToComeToRest) {
  const Experiment e = experiment("puma_on_table_4_1");
  Rig rig(e);
  rig.arm();
  rig.plant().moveRobot(RobotMove{1, -1.0, 1.5});
  rig.order(Request::kRun, segment(SegmentKind::kCalibration));
  const TickState& s = rig.until(Phase::kArmed);
  EXPECT_EQ(s.calibration, CalibrationStatus::kDone);
  EXPECT_EQ(s.violation, StillnessViolation::kJoint);
  EXPECT_LT((s.bias - trueBias(e)).cwiseQuotient(s.standard_error).cwiseAbs().maxCoeff(), 8.0);
}

TEST(Calibration, WhenRefusedEndsTheProgramAtHome) {
  const Experiment e = experiment("puma_on_table_4_1", {"controller.still.deviation_counts=0.001"});
  const RunResult result = runLockstep(e, nullptr, nullptr);
  EXPECT_EQ(result.phase, Phase::kParked);
  EXPECT_TRUE(result.aborted);
  EXPECT_FALSE(result.good());
  EXPECT_LT(result.ticks, 1000);  // no admittance segment of 14 s
}

// --- Tare ----------------------------------------------------------------------------------------

TEST(Tare, MovesTheCommandedPoseByNothingWhenItIsApplied) {
  // A bias that nobody calibrated away acts on the base; a twin of the rig is not tared.
  const Experiment e =
      experiment("puma_on_table_4_1", {"sensor.noise=false", "safety.start_force_n=1e4"});
  Rig tared(e), twin(e);
  for (Rig* rig : {&tared, &twin}) {
    rig->arm();
    rig->tick(Request::kRun, segment(SegmentKind::kAdmittance, 30.0));
    rig->run(1200);  // the swing that the bias started has died out
  }
  const double felt = tared.state().dynamic.f.norm();
  ASSERT_GT(felt, 40.0);
  tared.tick(Request::kTare);
  twin.tick();
  Vec6 largest = Vec6::Zero();
  Vec6 bias = tared.state().bias;
  int ticks = 0;
  while (tared.tick().bias == bias) {  // averaging
    twin.tick();
    ASSERT_EQ(tared.state().motion.x, twin.state().motion.x);
    ASSERT_LT(++ticks, 200);
  }
  EXPECT_NEAR(ticks, kCalibrationSamples, 2);
  twin.tick();
  for (int i = 0; i < 10; ++i) {  // the first 100 ms
    largest = largest.cwiseMax((tared.tick().motion.x - twin.tick().motion.x).cwiseAbs());
    EXPECT_LT((tared.state().motion.x_dot - twin.state().motion.x_dot).norm(), 1e-3);
  }
  EXPECT_LT(largest.head<3>().maxCoeff(), 0.1e-3);
  EXPECT_LT(largest.tail<3>().maxCoeff(), 0.01 * kDegree);
  EXPECT_LT(tared.run(1500).dynamic.f.norm(), 0.01 * felt);
  EXPECT_LT(tared.state().motion.x.norm(), 0.1 * twin.state().motion.x.norm() + 1e-3);
}

TEST(Tare, IsGivenUpWhereACalibrationBegins) {
  for (const int ticks : {1, 60, 130}) {  // while it averages, and while the bias slides
    const Experiment e = experiment("puma_on_table_4_1", {"sensor.noise=false"});
    Rig rig(e), alone(e);
    for (Rig* r : {&rig, &alone}) r->arm();
    rig.tick(Request::kTare);
    alone.tick();
    for (Rig* r : {&rig, &alone}) {
      r->run(ticks);
      r->order(Request::kRun, segment(SegmentKind::kCalibration));
    }
    const Vec6 found = alone.until(Phase::kArmed).bias;
    EXPECT_LT((rig.until(Phase::kArmed).bias - found).norm(), 1e-9) << ticks;
    for (int i = 0; i < 300; ++i) ASSERT_LT((rig.tick().bias - found).norm(), 1e-9) << ticks;
  }
}

TEST(Tare, ForgetsWhatAFaultHasToldIt) {
  Rig rig(experiment("puma_on_table_4_1"));
  rig.arm();
  rig.order(Request::kRun, segment(SegmentKind::kCalibration));
  const Vec6 bias = rig.until(Phase::kArmed).bias;
  rig.tick(Request::kTare);
  rig.run(30);
  rig.disturb([](Sample& s) { s.adc[2] = 32767; });
  rig.run(40);
  EXPECT_EQ(rig.state().phase, Phase::kStopped);
  rig.disturb(nullptr);
  EXPECT_EQ(rig.run(300).bias, bias);
}

}  // namespace
}  // namespace ves
