// SPDX-License-Identifier: BSD-3-Clause
//
// What testPlatform does about what goes wrong: on the plant, in lockstep.
#include <gtest/gtest.h>

#include "support/poses.hpp"
#include "support/rig.hpp"

namespace ves {
namespace {

using test::experiment;
using test::Rig;
using test::segment;
using test::sine;

/// In full swing: z by +-0.2 m, on its way up through the middle.
void swing(Rig& rig) {
  rig.arm();
  rig.order(Request::kRun, sine(2, 0.2, 0.5, 20.0));
  rig.run(200);
  ASSERT_GT(rig.state().motion.x_dot(2), 0.6);
}

// --- Freeze, and controlled stop -----------------------------------------------------------------

struct Cause {
  const char* name;
  Check check;
  void (*inject)(Sample&);
  int within;  // [-] ticks
};
std::ostream& operator<<(std::ostream& out, const Cause& c) { return out << c.name; }

class Causes : public testing::TestWithParam<Cause> {};

TEST_P(Causes, StopAloneAndByName) {
  Rig rig(experiment("z_sine"));
  swing(rig);
  rig.disturb(GetParam().inject);
  const std::int64_t injected = rig.state().tick;
  rig.until([](const TickState& s) { return s.phase != Phase::kRunning; }, 100);
  ASSERT_NE(rig.state().phase, Phase::kRunning);
  EXPECT_EQ(rig.state().cause, GetParam().check) << name(rig.state().cause);
  EXPECT_EQ(rig.state().latched.bits(), 1u << static_cast<unsigned>(GetParam().check));
  EXPECT_LE(rig.state().cause_tick - injected, GetParam().within);
  EXPECT_EQ(rig.state().phase, Tripped(1u << static_cast<unsigned>(GetParam().check)).freeze()
                                   ? Phase::kStopped
                                   : Phase::kStopping);
  EXPECT_EQ(rig.until(Phase::kStopped).phase, Phase::kStopped);
  EXPECT_EQ(rig.state().cause, GetParam().check);
  EXPECT_FALSE(rig.state().command.park);
}

INSTANTIATE_TEST_SUITE_P(
    Safety, Causes,
    testing::Values(
        Cause{"panic_button", Check::kPanicButton,
              [](Sample& s) { s.switches &= ~kPanicButtonClosed; }, 1},
        Cause{"floor_mat", Check::kFloorMat, [](Sample& s) { s.switches &= ~kFloorMatClosed; }, 1},
        Cause{"pressure_low", Check::kPressure, [](Sample& s) { s.adc[6] = 0; }, 1},
        Cause{"pressure_high", Check::kPressure, [](Sample& s) { s.adc[6] = 20000; }, 1},
        Cause{"saturated_high", Check::kSensorSaturated, [](Sample& s) { s.adc[4] = 32767; }, 1},
        Cause{"saturated_low", Check::kSensorSaturated, [](Sample& s) { s.adc[0] = -32768; }, 1},
        Cause{"leg_reading_jumps", Check::kLegReading,
              [](Sample& s) { s.legs[3] += s.sequence % 2 ? 600 : -600; }, 2},
        Cause{"silence", Check::kStale, [](Sample& s) { s.sequence = 5; }, 7}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(Safety, ControlledStopBrakesAlongTheMotion) {
  const Experiment e = experiment("z_sine");
  Rig rig(e);
  swing(rig);
  const double v = rig.state().motion.x_dot(2), x = rig.state().motion.x(2);
  rig.disturb([](Sample& s) { s.adc[6] = 0; });
  const double a = e.controller.stop_braking.translation;
  double last = v;
  int ticks = 0;
  while (rig.tick().phase == Phase::kStopping) {
    ++ticks;
    const double now = rig.state().motion.x_dot(2);
    EXPECT_GE(now, -1e-12);
    // A quintic from v to rest in v/a brakes with at most 2 a (here 5 m/s^2).
    EXPECT_LE(std::abs(now - last), 2.2 * a * 0.01);
    last = now;
    // Every other coordinate stays.
    EXPECT_LT((rig.state().motion.x - x * Vec6::Unit(2)).cwiseAbs().maxCoeff(),
              0.5 * v * v / a + 0.02);
  }
  EXPECT_EQ(rig.state().phase, Phase::kStopped);
  EXPECT_NEAR(ticks * 0.01, v / a, 0.05);
  EXPECT_NEAR(rig.state().motion.x(2) - x, 0.5 * v * v / a, 0.01);
}

TEST(Safety, AFreezingCauseDuringAControlledStopFreezes) {
  Rig rig(experiment("z_sine"));
  swing(rig);
  rig.disturb([](Sample& s) { s.adc[6] = 0; });
  EXPECT_EQ(rig.run(5).phase, Phase::kStopping);
  rig.disturb([](Sample& s) { s.switches = 0; });
  const LegCounts last = rig.state().command.counts;
  EXPECT_EQ(rig.tick().phase, Phase::kStopped);
  EXPECT_EQ(rig.state().command.counts, last);
  EXPECT_EQ(rig.state().cause, Check::kPressure);  // the first stays the cause
  EXPECT_TRUE(rig.state().latched.has(Check::kPanicButton));
}

TEST(Safety, TwoFaultsOfOneTickAreBothRecordedAndTheFirstIsByPriority) {
  for (int i = 0; i < 3; ++i) {
    Rig rig(experiment("z_sine"));
    swing(rig);
    rig.disturb([](Sample& s) {
      s.adc[6] = 0;
      s.switches &= ~kFloorMatClosed;
    });
    rig.tick();
    EXPECT_EQ(rig.state().cause, Check::kFloorMat);
    EXPECT_TRUE(rig.state().latched.has(Check::kFloorMat));
    EXPECT_TRUE(rig.state().latched.has(Check::kPressure));
  }
}

// --- Legs ----------------------------------------------------------------------------------------

TEST(Safety, OneWrongLegReadingIsNotBelieved) {
  Rig rig(experiment("z_sine")), twin(experiment("z_sine"));
  for (Rig* r : {&rig, &twin}) {
    r->arm();
    r->run(100);
  }
  rig.disturb([](Sample& s) { s.legs[2] += 150; });  // 10 mm
  rig.tick();
  twin.tick();
  EXPECT_EQ(rig.state().phase, Phase::kArmed);
  EXPECT_LT((rig.state().L_measured - twin.state().L_measured).cwiseAbs().maxCoeff(), 0.2e-3);
  rig.disturb(nullptr);
  EXPECT_EQ(rig.run(50).phase, Phase::kArmed);
}

TEST(Safety, AStuckLegStopsAllSix) {
  Rig rig(experiment("z_sine"));
  rig.arm();
  rig.order(Request::kRun, sine(2, 0.1, 0.5, 20.0));
  rig.run(100);
  rig.disturb([first = std::optional<std::int32_t>()](Sample& s) mutable {
    if (!first) first = s.legs[5];
    s.legs[5] = *first;
  });
  rig.until(Phase::kStopped, 100);
  EXPECT_EQ(rig.state().cause, Check::kPositionError);
}

TEST(Safety, UnsolvableLegsNeverArm) {
  Rig rig(experiment("z_sine"));
  rig.disturb([](Sample& s) { s.legs = {0, 16383, 0, 16383, 0, 16383}; });
  rig.run(20);
  rig.tick(Request::kArm);
  EXPECT_EQ(rig.run(100).phase, Phase::kDisarmed);
  EXPECT_TRUE(rig.state().tripped.has(Check::kForwardKinematics));
}

// --- Sensor --------------------------------------------------------------------------------------

TEST(Safety, AFrozenSensorShowsOnceTheWeightTurns) {
  const Experiment e = experiment("puma_tilt", {"sensor.noise=true"});
  Rig rig(e);
  rig.arm();
  rig.order(Request::kRun, segment(SegmentKind::kCalibration));
  rig.until(Phase::kArmed);
  rig.disturb([held = std::optional<AdcCounts>()](Sample& s) mutable {
    if (!held) held = s.adc;
    s.adc = *held;
  });
  EXPECT_EQ(rig.run(300).phase, Phase::kArmed);  // still: nothing to see
  Segment tilt = segment(SegmentKind::kMove, 4.0);
  tilt.target.rpy.x() = 15 * kDegree;
  rig.order(Request::kRun, tilt);
  // The weight of 721 N turns; 50 counts of a channel are 2.3 N or 0.9 N m.
  double turned = 0.0;
  rig.until([&](const TickState& s) {
    if (s.phase == Phase::kRunning) turned = s.measured.rpy.x();
    return s.phase != Phase::kRunning;
  });
  EXPECT_EQ(rig.state().cause, Check::kSensorFrozen);
  EXPECT_LT(turned, 1.0 * kDegree);
}

TEST(Safety, AdmittanceControlDoesNotBeginLoaded) {
  Rig rig(experiment("puma_on_table_4_1"));  // not calibrated: 181 N of bias in z
  rig.arm();
  EXPECT_EQ(rig.order(Request::kRun, segment(SegmentKind::kAdmittance, 5.0)).refusal,
            Refusal::kLoaded);
  rig.order(Request::kRun, segment(SegmentKind::kCalibration));
  rig.until(Phase::kArmed);
  EXPECT_EQ(rig.order(Request::kRun, segment(SegmentKind::kAdmittance, 5.0)).refusal,
            Refusal::kNone);
}

TEST(Safety, CalibrationRefusesAnUnknownLoad) {
  // The controller believes the sensor to be wired the other way round.
  Experiment e = experiment("puma_on_table_4_1");
  e.controller.sensor.C_proc.row(2) *= -1.0;
  Rig rig(e);
  rig.arm();
  rig.order(Request::kRun, segment(SegmentKind::kCalibration));
  rig.until(Phase::kArmed);
  EXPECT_EQ(rig.state().calibration, CalibrationStatus::kRefused);
  EXPECT_EQ(rig.state().violation, StillnessViolation::kBias);
  EXPECT_EQ(rig.state().violation_index, 2);
}

// --- Time ----------------------------------------------------------------------------------------

TEST(Safety, AFewLateTicksCountAndManyStop) {
  const Experiment e = experiment("z_sine");
  const int allowed = e.controller.safety.overruns;
  Rig rig(e);
  swing(rig);
  for (int i = 0; i < allowed; ++i) {
    rig.run(9);
    rig.in().tick += 1;
    EXPECT_EQ(rig.tick().phase, Phase::kRunning) << i;
  }
  EXPECT_EQ(rig.state().late_ticks, allowed);
  rig.run(3);
  rig.in().tick += 1;
  EXPECT_EQ(rig.tick().phase, Phase::kStopping);
  EXPECT_EQ(rig.state().cause, Check::kOverrun);
}

TEST(Safety, LateTicksFarApartAreForgotten) {
  Rig rig(experiment("z_sine"));
  rig.arm();
  for (int i = 0; i < 30; ++i) {
    rig.run(30);
    rig.in().tick += 1;
    EXPECT_EQ(rig.tick().phase, Phase::kArmed) << i;
  }
}

TEST(Safety, AStallStopsAndIsNotMadeUpFor) {
  Rig rig(experiment("z_sine"));
  swing(rig);
  const Vec6 before = rig.state().motion.x;
  rig.in().tick += 50;
  rig.tick();
  EXPECT_EQ(rig.state().cause, Check::kOverrun);
  // One step of the path, not fifty.
  EXPECT_LT((rig.state().motion.x - before).norm(), 0.01);
}

// --- Where it may go -----------------------------------------------------------------------------

TEST(Safety, AdmittanceRunPushedAgainstItsLimitsComesToRestInside) {
  // A force that no spring of this soft base can hold within the workspace: 400 N against 400 N/m.
  for (const Vec3& push :
       {Vec3(0.0, 0.0, 400.0), Vec3(150.0, -250.0, 0.0), Vec3(-90.0, 30.0, -300.0)}) {
    const Experiment e = experiment("puma_on_table_4_1",
                                    {"sensor.noise=false", "initial_pose={}",
                                     "base.stiffness_diagonal=[150, 250, 400, 1500, 1000, 2000]"});
    Rig rig(e);
    rig.arm();
    rig.order(Request::kRun, segment(SegmentKind::kCalibration));
    rig.until(Phase::kArmed);
    rig.order(Request::kRun, segment(SegmentKind::kAdmittance, 60.0));
    const Mat6 S_proc = e.plant.sensor.S_proc();
    rig.disturb([&, t = 0](Sample& s) mutable {
      const double ramp = std::min(1.0, ++t / 100.0);
      const Wrench F_So_S = transfer(
          Transform{e.controller.sensor.X_PS.R.transpose(),
                    -(e.controller.sensor.X_PS.R.transpose() * e.controller.sensor.X_PS.p)},
          Wrench{ramp * push, Vec3::Zero()});
      const Vec6 counts = S_proc * F_So_S.stacked();
      for (int i = 0; i < 6; ++i)
        s.adc[static_cast<std::size_t>(i)] += static_cast<int>(std::lround(counts(i)));
    });
    Vec6 last = rig.state().motion.x_dot;
    bool envelope_scale = false;
    for (int i = 0; i < 1500; ++i) {
      ASSERT_EQ(rig.tick().phase, Phase::kRunning) << name(rig.state().cause) << " in " << i;
      envelope_scale = envelope_scale || rig.state().envelope_scale < 1.0;
      // The envelope brakes gently: no jerk into the wall.
      const Vec6 change = rig.state().motion.x_dot - last;
      EXPECT_LT(change.head<3>().norm(),
                3.0 * e.controller.gentle.braking.translation * 0.01 + 0.1);
      last = rig.state().motion.x_dot;
    }
    EXPECT_TRUE(envelope_scale);
    EXPECT_LT(rig.state().motion.x_dot.norm(), 1e-3);  // at rest
    const Vec6 wall = rig.state().motion.x;
    EXPECT_TRUE(motionLimitsCheck(e.controller.safety, Pose::from(wall)));
    EXPECT_TRUE(actuatorLimitsCheck(e.controller.safety, rig.state().legs.L));
    // Let go, the base swings back.
    rig.disturb(nullptr);
    rig.run(100);
    EXPECT_EQ(rig.state().phase, Phase::kRunning);
    EXPECT_LT(rig.state().motion.x.norm(), 0.9 * wall.norm());
  }
}

TEST(Safety, TheEnvelopeLeavesAFreeRunAlone) {
  Rig rig(experiment("free_decay"));
  rig.run(20);
  rig.tick(Request::kStart);
  rig.until([](const TickState& s) {
    EXPECT_EQ(s.envelope_scale, 1.0);
    return s.phase == Phase::kParked;
  });
  EXPECT_EQ(rig.state().phase, Phase::kParked);
}

struct Path {
  const char* name;
  Segment segment;
  Check check;
};
std::ostream& operator<<(std::ostream& out, const Path& p) { return out << p.name; }

class Paths : public testing::TestWithParam<Path> {};

TEST_P(Paths, ThatFailACheckAreRefusedBeforeTheyBegin) {
  Rig rig(experiment("z_sine"));
  rig.arm();
  const Vec6 x = rig.state().motion.x;
  rig.order(Request::kRun, GetParam().segment);
  EXPECT_EQ(rig.state().refusal, Refusal::kOutside);
  EXPECT_EQ(rig.state().refused_by, GetParam().check) << name(rig.state().refused_by);
  EXPECT_EQ(rig.run(100).phase, Phase::kArmed);
  EXPECT_EQ(rig.state().motion.x, x);
}

Segment far(const Vec6& x) {
  Segment s = segment(SegmentKind::kMove, 5.0);
  s.target = Pose::from(x);
  return s;
}

INSTANTIATE_TEST_SUITE_P(
    Safety, Paths,
    testing::Values(Path{"beyond_the_workspace", sine(0, 0.4, 0.1, 10.0), Check::kMotionLimits},
                    Path{"too_fast", sine(2, 0.2, 3.0, 2.0), Check::kVelocity},
                    Path{"move_beyond_the_legs",
                         far((Vec6() << 0.3, 0.3, 0.3, 0.5, 0.5, 0.5).finished()),
                         Check::kActuatorLimits}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(Safety, WhatTheLoopFeedsIsStoppedBeforeItIsLarge) {
  // Appendix E: a base of 4 Hz, six times lighter than the robot on it. The robot stands still.
  const Experiment e = experiment(
      "puma_on_table_4_1",
      {"base={mass_diagonal: [12.5, 12.5, 12.5, 12.5, 12.5, 12.5], damping_diagonal: [2, 2, 2, 1, "
       "1, 1], stiffness_diagonal: [7900, 7900, 7900, 7900, 7900, 7900]}",
       "program=[{calibration: {}},{move: {to: {x_m: 0.002}}},{admittance: {duration_s: 30}}]"});
  Rig rig(e);
  rig.run(20);
  rig.tick(Request::kStart);
  double largest = 0.0;
  rig.until([&](const TickState& s) {
    largest = std::max(largest, s.motion.x.head<3>().norm());
    return s.phase == Phase::kStopped || s.phase == Phase::kParked;
  });
  EXPECT_EQ(rig.state().phase, Phase::kStopped);
  EXPECT_EQ(rig.state().cause, Check::kOscillation) << name(rig.state().cause);
  EXPECT_LT(largest, 0.1);  // over eight seeds 0.03 to 0.065
  rig.run(50);
  EXPECT_EQ(rig.tick(Request::kReset).phase, Phase::kDisarmed);
}

}  // namespace
}  // namespace ves
