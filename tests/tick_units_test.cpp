// SPDX-License-Identifier: BSD-3-Clause
//
// The parts of a tick, each alone.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/rig.hpp"
#include "ves/control/mass_belief.hpp"
#include "ves/control/robot_load.hpp"
#include "ves/control/safety_monitor.hpp"
#include "ves/control/sensor_bias.hpp"
#include "ves/control/supervisor.hpp"

namespace ves {
namespace {

using test::experiment;
using test::kNan;
using test::numbered;
using test::puma;

// Clock and samples

TEST(TickClock, CountsWhatShouldHaveRunAndDidNot) {
  TickClock clock;
  EXPECT_EQ(clock.update(100).missed, 0);  // whatever the first number is
  EXPECT_EQ(clock.update(101).missed, 0);
  const Elapsed& late = clock.update(104);
  EXPECT_EQ(late.between, 2);
  EXPECT_EQ(late.missed, 2);
  EXPECT_EQ(late.late, 1);
  EXPECT_EQ(late.count, 2);
  EXPECT_EQ(clock.update(105).late, 1);
}

TEST(TickClock, IdleTicksMayBePassedOverAndAreNotMissed) {
  TickClock clock;
  clock.update(0);
  clock.announceIdle(5);
  EXPECT_EQ(clock.update(6).missed, 0);  // lockstep passes over all of them
  EXPECT_EQ(clock.update(12).missed, 0);
  EXPECT_EQ(clock.update(20).missed, 2);  // and two more are late
  EXPECT_EQ(clock.update(21).missed, 0);  // real time passes over none
  EXPECT_EQ(clock.update(24).missed, 2);
}

TEST(SampleStream, AgesUntilANewSampleComes) {
  SampleStream stream(10'000'000);
  stream.update(numbered(-1), 0, false, false);
  EXPECT_FALSE(stream.fresh());  // nothing was received yet
  stream.update(numbered(0), 0, false, false);
  EXPECT_TRUE(stream.fresh());
  stream.update(numbered(0), 0, true, false);
  stream.update(numbered(0), 0, true, false);
  EXPECT_EQ(stream.age(), 2);
  EXPECT_EQ(stream.ageBefore(), 1);
  stream.update(numbered(1), 0, true, false);
  EXPECT_EQ(stream.age(), 0);
  EXPECT_EQ(stream.ageBefore(), 2);
}

TEST(SampleStream, AnOlderSampleIsNoneOnlyWhileEngaged) {
  SampleStream stream(10'000'000);
  stream.update(numbered(7), 0, true, false);
  stream.update(numbered(3), 0, true, false);
  EXPECT_EQ(stream.sample().sequence, 7);
  stream.update(numbered(3), 0, false, false);  // a machine that began anew
  EXPECT_EQ(stream.sample().sequence, 3);
  EXPECT_FALSE(stream.fresh());
  stream.update(numbered(4), 0, false, false);
  EXPECT_TRUE(stream.fresh());
}

TEST(SampleStream, SaysWhenTheWrenchWasReadByItsOwnTime) {
  SampleStream stream(10'000'000);
  const auto read = [](std::int64_t sequence, std::int64_t wrench_time) {
    Sample s = numbered(sequence);
    s.wrench_time = wrench_time;
    return s;
  };
  stream.update(read(0, 1'000'000), 3'000'000, true, false);
  EXPECT_NEAR(stream.wrench().since, 0.010, 1e-12);  // the first: a period
  EXPECT_NEAR(stream.wrench().age, 0.002, 1e-12);
  stream.update(read(1, 8'500'000), 13'000'000, true, false);
  EXPECT_NEAR(stream.wrench().since, 0.0075, 1e-12);
  EXPECT_NEAR(stream.wrench().age, 0.0045, 1e-12);
  stream.update(read(1, 8'500'000), 23'000'000, true, false);  // the same again
  EXPECT_EQ(stream.wrench().since, 0.0);
  EXPECT_NEAR(stream.wrench().age, 0.0145, 1e-12);
  stream.update(read(2, 8'500'000), 33'000'000, true, false);  // a sample, but no new wrench
  EXPECT_EQ(stream.wrench().since, 0.0);
  stream.update(read(3, 33'000'000), 32'000'000, true, false);  // clocks that disagree a little
  EXPECT_EQ(stream.wrench().age, 0.0);
  stream.update(read(4, 600'000'000), 900'000'000, true, false);
  EXPECT_NEAR(stream.wrench().since, 0.05, 1e-12);  // five periods are the most
  EXPECT_NEAR(stream.wrench().age, 0.05, 1e-12);
}

TEST(SampleStream, AClockThatGoesBackIsStaleUntilItIsLaterThanEver) {
  SampleStream stream(10'000'000);
  const auto at = [](std::int64_t sequence, std::int64_t time) {
    Sample s = numbered(sequence);
    s.time = s.legs_time = s.wrench_time = s.joints_time = time;
    return s;
  };
  stream.update(at(0, 100), 0, true, false);
  stream.update(at(1, 3'600'000'000'000), 0, true, false);  // once, an hour ahead
  EXPECT_TRUE(stream.fresh());
  for (int n = 2; n < 8; ++n) {
    stream.update(at(n, n * 10'000'000), 0, true, false);
    EXPECT_EQ(stream.age(), n - 1);
    EXPECT_EQ(stream.wrench().since, 0.0);
  }
  // While nobody is engaged a machine may begin anew.
  stream.update(at(8, 80'000'000), 0, false, false);
  stream.update(at(9, 70'000'000), 0, false, false);
  stream.update(at(10, 80'000'000), 0, false, false);
  EXPECT_TRUE(stream.fresh());
}

TEST(SampleStream, FreshTicksCountInARowAndWithoutAConflict) {
  SampleStream stream(10'000'000);
  for (int n = 0; n < 5; ++n) stream.update(numbered(n), 0, false, false);
  EXPECT_EQ(stream.freshTicks(), 5);
  stream.update(numbered(5), 0, false, true);
  EXPECT_EQ(stream.freshTicks(), 0);
  stream.update(numbered(6), 0, false, false);
  stream.update(numbered(6), 0, false, false);
  EXPECT_EQ(stream.freshTicks(), 0);
  stream.update(numbered(7), 0, false, false);
  stream.restart();
  EXPECT_EQ(stream.freshTicks(), 0);
}

// Compensation's share

TEST(CompensationShare, ComesAndGoesOverItsRampAndStaysWithinZeroAndOne) {
  Compensation c;
  c.feed_forward = true;
  c.ramp = 0.5;
  CompensationShare share(c, 0.01);
  for (int n = 1; n <= 60; ++n) {
    share.advance();
    EXPECT_NEAR(share.value(), std::min(1.0, n * 0.02), 1e-12);
  }
  share.want(false);
  for (int n = 1; n <= 60; ++n) {
    share.advance();
    EXPECT_NEAR(share.value(), std::max(0.0, 1.0 - n * 0.02), 1e-12);
  }
  CompensationShare none(Compensation{}, 0.01);
  none.advance();
  EXPECT_EQ(none.value(), 0.0);
  EXPECT_FALSE(none.exists());
}

// Bias

/// A sample whose wrench channels all read `counts`.
Sample reading(std::int32_t counts, std::int64_t sequence = 0) {
  Sample s = numbered(sequence);
  s.adc.fill(counts);
  return s;
}

TEST(SensorBias, ATareEndsAtTheMeanWithoutAStepAndTakesItsRamp) {
  SensorBias bias(puma());
  const Vec6 before = bias.counts(), load = Vec6::LinSpaced(-20.0, 30.0);
  bias.beginTare();
  for (int n = 0; n < kCalibrationSamples; ++n) {
    bias.stepTare(reading(100 + (n % 2 ? 4 : -4)), true, load);
    EXPECT_EQ(bias.counts(), before);
  }
  const Vec6 after = Vec6::Constant(100.0) - load;
  const double period = puma().periodSeconds();
  const int ramp = static_cast<int>(std::lround(puma().tare_ramp / period));
  const double fastest = (after - before).cwiseAbs().maxCoeff() * kQuinticPeakRate / ramp;
  Vec6 last = before;
  for (int n = 1; n <= ramp; ++n) {
    EXPECT_TRUE(bias.taring()) << n;
    bias.stepTare(reading(5000), true, load);  // no longer looked at
    EXPECT_LE((bias.counts() - last).cwiseAbs().maxCoeff(), fastest * 1.001);
    last = bias.counts();
  }
  EXPECT_FALSE(bias.taring());
  EXPECT_LT((bias.counts() - after).norm(), 1e-9);
}

TEST(SensorBias, WhatWasLearntIsKeptWhenATareBegins) {
  SensorBias bias(puma());
  const Vec6 learnt = (Vec6() << 1, -2, 3, -4, 5, -6).finished(), found = bias.found();
  bias.learn(learnt);
  const Vec6 counts = bias.counts();
  EXPECT_EQ(counts, found + learnt);
  bias.beginTare();
  EXPECT_EQ(bias.counts(), counts);
  EXPECT_EQ(bias.found(), found + learnt);
  EXPECT_TRUE(bias.learnt().isZero(0.0));
  bias.learn(learnt);  // not during a tare
  EXPECT_EQ(bias.counts(), counts);
  bias.cancelTare();
  bias.learn(learnt);
  EXPECT_EQ(bias.counts(), counts + learnt);
}

TEST(SensorBias, ACalibrationFindsAllOfItWhateverWasLearntBefore) {
  SensorBias bias(puma());
  bias.learn(Vec6::Constant(7.0));
  bias.beginCalibration();
  for (int n = 0; n < kCalibrationSamples; ++n)
    bias.calibrate(reading(100 + (n % 2 ? 4 : -4), n), true, Vec6::Zero());
  ASSERT_TRUE(bias.calibrated());
  EXPECT_LT((bias.counts() - Vec6::Constant(100.0)).norm(), 1e-9);
}

TEST(SensorBias, ATareAveragesNewSamplesOnlyAndRefusesALoad) {
  ControllerConfig config = puma();
  SensorBias bias(config);
  bias.beginTare();
  for (int n = 0; n < 3 * kCalibrationSamples; ++n) bias.stepTare(reading(50), false, Vec6::Zero());
  EXPECT_EQ(bias.counts(), config.bias);
  Sample lost = reading(50);
  lost.q(0) = kNan;
  for (int n = 0; n < 3 * kCalibrationSamples; ++n) bias.stepTare(lost, true, Vec6::Zero());
  EXPECT_EQ(bias.counts(), config.bias);

  const auto most = static_cast<std::int32_t>(std::floor(config.stillness.bias));
  for (const bool beyond : {false, true}) {
    SensorBias one(config);
    one.beginTare();
    for (int n = 0; n < kCalibrationSamples; ++n)
      one.stepTare(reading(most + beyond), true, Vec6::Zero());
    EXPECT_EQ(one.taring(), !beyond);
  }
}

TEST(Calibration, AllowsExactlyTheCountsThatItsLimitSays) {
  StillnessLimits limits = puma().stillness;
  limits.leg_counts = 3;
  for (const int moved : {3, 4, -3, -4}) {
    Calibration calibration(limits);
    calibration.begin();
    Sample sample = numbered(0);
    sample.legs.fill(9000);
    calibration.add(sample, Vec6::Zero());
    sample.legs[4] += moved;
    calibration.add(sample, Vec6::Zero());
    EXPECT_EQ(calibration.violation(),
              std::abs(moved) > 3 ? StillnessViolation::kLeg : StillnessViolation::kNone);
  }
}

TEST(SensorBias, ACalibrationThatSucceedsSetsBiasDeviationAndError) {
  SensorBias bias(puma());
  bias.beginCalibration();
  for (int n = 0; n < kCalibrationSamples; ++n)
    bias.calibrate(reading(100 + (n % 2 ? 3 : -3), n), true, Vec6::Constant(10.0));
  EXPECT_EQ(bias.calibration().status(), CalibrationStatus::kDone);
  EXPECT_LT((bias.counts() - Vec6::Constant(90.0)).norm(), 1e-9);
  EXPECT_NEAR(bias.deviation()(0), 3.0 * std::sqrt(100.0 / 99.0), 1e-9);
  EXPECT_LT(bias.standardError()(0), 1e-9);  // every batch has the same mean
}

// Robot's weight and inertia

TEST(RobotInertia, IsMassTimesAccelerationOfAPlatformThatSlides) {
  ControllerConfig config = puma();
  config.compensation.inertia = config.compensation.observer = true;
  RobotInertia inertia(config);
  const Geometry& g = config.geometry;
  const Vec3 a(0.3, -0.2, 0.5);
  BodyMotion P{g.fromHome({}), Vec3::Zero(), Vec3::Zero(), a, Vec3::Zero()};
  const LegMotion legs = legMotion(g, P);
  const JointVector q = JointVector::Zero();
  EXPECT_EQ(inertia.update(KnownPayload(config), 0, q, 0.01, P.X, P.X.R, legs, false, 1.0)
                .stacked()
                .norm(),
            0.0);  // not engaged
  const Wrench F = inertia.update(KnownPayload(config), 0, q, 0.01, P.X, P.X.R, legs, true, 0.5);
  const double mass = 52.45 + 16.0 + 5.0;  // the PUMA with link 0, adapter, top plate
  EXPECT_LT((F.f - 0.5 * mass * a).norm(), 1e-9 * mass);
  EXPECT_NEAR(inertia.M_1()(0, 0), 0.5 * mass, 1e-9);
  config.servo.sensor_scale = 1.1;  // as an identification has found
  const Wrench shown =
      RobotInertia(config).update(KnownPayload(config), 0, q, 0.01, P.X, P.X.R, legs, true, 0.5);
  EXPECT_LT((shown.stacked() - 1.1 * F.stacked()).norm(), 1e-9 * mass);
  ControllerConfig published = puma();
  RobotInertia none(published);
  EXPECT_EQ(none.update(KnownPayload(published), 0, q, 0.01, P.X, P.X.R, legs, true, 1.0)
                .stacked()
                .norm(),
            0.0);
}

// What the platform carries is turned as the platform is, what is emulated as the vehicle is.
TEST(RobotInertia, OfAVehicleThatIsTurnedOtherwiseThanThePlatform) {
  ControllerConfig config = puma();
  config.compensation.inertia = config.compensation.observer = true;
  RobotInertia inertia(config);
  const KnownPayload known(config);
  const Geometry& g = config.geometry;
  const JointVector q = JointVector::Zero();
  const Mat6 M_P = spatialMass(lockedRobot(config.payload, q));
  const auto turned = [&](const Mat3& R) {
    Mat6 T = Mat6::Zero();
    T.topLeftCorner<3, 3>() = T.bottomRightCorner<3, 3>() = R;
    return Mat6(T * M_P * T.transpose());
  };
  Mat3 before = Mat3::Identity();
  for (int k = 0; k < 3; ++k) {
    const Mat3 R_IP = rotation({0.05 * k, -0.1, 0.02}), R_EP = rotation({0.4, 0.3 * k, -0.7});
    const BodyMotion P{{R_IP, g.home()}, Vec3::Zero(), Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
    inertia.update(known, k, q, 0.01, P.X, R_EP, legMotion(g, P), true, 1.0);
    EXPECT_LT((inertia.M_1() - turned(R_IP)).norm(), 1e-9 * M_P.norm()) << k;
    const CarriedBody carried = inertia.carried(Vec6::Zero());
    EXPECT_EQ(carried.R_IP, R_EP) << k;
    EXPECT_LT((carried.M_1 - turned(R_EP)).norm(), 1e-9 * M_P.norm()) << k;
    EXPECT_EQ(carried.R_IP_before, k == 0 ? R_EP : before) << k;
    before = R_EP;
  }
}

TEST(StaticLoad, GoesThroughTheSensorsFilterByTheShareOnly) {
  ControllerConfig config = puma();
  config.compensation.inertia = config.compensation.observer = true;
  const Mat3 level = Mat3::Identity(), tilted = rotation({0.3, 0.0, 0.0});
  JointVector q = JointVector::Zero();
  const KnownPayload known(config);
  StaticLoad published(puma()), none(config), all(config);
  for (StaticLoad* load : {&published, &none, &all})
    load->update(known, q, level, 0.01, false, 0.0);
  published.update(known, q, tilted, 0.01, true, 0.0);
  none.update(known, q, tilted, 0.01, true, 0.0);
  all.update(known, q, tilted, 0.01, true, 1.0);
  EXPECT_LT((published.wrench().stacked() - none.wrench().stacked()).norm(), 1e-12);
  EXPECT_GT((published.wrench().f - all.wrench().f).norm(), 1.0);
  EXPECT_EQ(published.counts(), all.counts());  // unfiltered: what the frozen check expects
  for (int n = 0; n < 200; ++n) all.update(known, q, tilted, 0.01, true, 1.0);
  EXPECT_LT((published.wrench().stacked() - all.wrench().stacked()).norm(), 1e-6);
}

// While nobody commands the legs, weight has no past: armed again, it is what it is now.
TEST(StaticLoad, BeginsAnewAtTheWeightOfTheTime) {
  ControllerConfig config = puma();
  config.compensation.inertia = config.compensation.observer = true;
  const Mat3 level = Mat3::Identity(), tilted = rotation({0.3, 0.0, 0.0});
  const JointVector q = JointVector::Zero();
  const KnownPayload known(config);
  StaticLoad again(config), first(config);
  again.update(known, q, level, 0.01, false, 0.0);
  for (int n = 0; n < 50; ++n) again.update(known, q, level, 0.01, true, 1.0);
  for (StaticLoad* load : {&again, &first}) {
    load->update(known, q, tilted, 0.01, false, 0.0);
    load->update(known, q, tilted, 0.01, true, 1.0);
  }
  EXPECT_LT((again.wrench().stacked() - first.wrench().stacked()).norm(), 1e-12);
  EXPECT_LT((again.wrench().stacked() -
             staticWrench(known.payload(), q, tilted, config.gravity).stacked())
                .norm(),
            1e-9);
}

// Each change of the gripper's switch is told once, in its tick; where it stands at first is none.
TEST(KnownPayload, KnowsThatTheGripperMovedByItsSwitch) {
  for (const bool switched : {false, true}) {
    ControllerConfig config = puma();
    config.hand.switched = switched;
    KnownPayload known(config);
    bool before = true;
    for (const bool closed : {true, true, false, false, true, true, true, false}) {
      known.readGripper(kAllSwitchesClosed | (closed ? kGripperClosed : 0U));
      known.update({}, -1);
      EXPECT_EQ(known.gripperMoved(), switched && closed != before);
      before = closed;
    }
  }
}

// A joint angle that is none spoils its own tick, and none after it, whatever is learnt meanwhile.
TEST(StaticLoad, ForgetsAnAngleThatIsNone) {
  ControllerConfig config = puma();
  config.compensation.inertia = config.compensation.observer = true;
  KnownPayload known(config);
  StaticLoad load(config);
  const JointVector q = JointVector::Zero();
  const auto update = [&](const JointVector& at) {
    known.update({}, -1);
    load.update(known, at, Mat3::Identity(), 0.01, true, 1.0);
  };
  load.update(known, q, Mat3::Identity(), 0.01, false, 1.0);
  update(JointVector::Constant(std::numeric_limits<double>::quiet_NaN()));
  known.learn(config.payload.robot);
  update(q);
  EXPECT_TRUE(known.learnt());
  EXPECT_TRUE(load.wrench().stacked().allFinite());
}

TEST(KnownPayload, IsToldAtItsTimeOfItsSegmentAndOfNothingElse) {
  ControllerConfig config = puma();
  const RigidBody box{7.0, Vec3(0.1, 0.0, 0.2), 0.1 * Mat3::Identity()};
  config.told_loads.size = 2;
  config.told_loads.loads[0] = {{1, 30'000'000}, 5, box};
  config.told_loads.loads[1] = {{2, 0}, -1, {}};
  KnownPayload known(config);
  const RobotModel empty = config.payload.robot;
  std::int64_t tick = 100;
  const auto pass = [&](std::int32_t commanded) {
    known.update({tick, 0, 0, 0, 0}, commanded);
    ++tick;
    return known.payload().robot != empty;
  };
  for (const int segment : {-1, 0, 0, 0, 0, 0}) EXPECT_FALSE(pass(segment));
  // The first command that named segment 1 left a tick before: 30 ms after it are three ticks.
  EXPECT_FALSE(pass(1));
  EXPECT_FALSE(pass(1));
  EXPECT_TRUE(pass(1));
  EXPECT_TRUE(known.changed());
  EXPECT_TRUE(pass(1));
  EXPECT_FALSE(known.changed());
  const RigidBody both = combine(empty.link(5).body, {}, box);
  EXPECT_EQ(known.payload().robot.link(5).body, both);
  EXPECT_EQ(known.carried().link(5).body, both);
  EXPECT_EQ(known.payload().robot.base, empty.base);
  EXPECT_FALSE(pass(2));  // released
  EXPECT_FALSE(pass(-1));
  // The program once more. Two ticks were missed after the first command that named segment 1.
  EXPECT_FALSE(pass(0));
  tick += 2;
  known.update({tick, 0, 2, 2, 1}, 1);
  EXPECT_EQ(known.payload().robot.link(5).body, both);
}

TEST(RobotInertia, KnowsALoadAtOnceHoweverLongItKeepsItsBody) {
  ControllerConfig config = puma();
  config.compensation.inertia = config.compensation.observer = true;
  config.compensation.mass_update = 100;
  config.told_loads.size = 1;
  config.told_loads.loads[0] = {{0, 0}, 5, {7.0, Vec3::Zero(), Mat3::Zero()}};
  KnownPayload known(config);
  RobotInertia inertia(config);
  const BodyMotion P{config.geometry.fromHome({}), Vec3::Zero(), Vec3::Zero(), Vec3::Zero(),
                     Vec3::Zero()};
  const LegMotion legs = legMotion(config.geometry, P);
  const auto mass = [&](std::int64_t count, std::int32_t segment) {
    known.update({count, count, 0, 0, 0}, segment);
    inertia.update(known, count, JointVector::Zero(), 0.01, P.X, P.X.R, legs, true, 1.0);
    return inertia.M_1()(0, 0);
  };
  const double empty = mass(0, -1);
  EXPECT_NEAR(mass(1, 0) - empty, 7.0, 1e-9);
  EXPECT_NEAR(mass(2, 0) - empty, 7.0, 1e-9);
}

// Plans

PathPoint<6> moving(const Vec6& x, const Vec6& v) {
  PathPoint<6> p;
  p.x = x;
  p.x_dot = v;
  return p;
}

const PlanSettings kSettings{0.01, {0.05, 0.10, {1.5, 2.5}}};

TEST(MotionPlan, BrakingStopsWhereItsMeanDecelerationSays) {
  const Vec6 v = 0.3 * Vec6::Unit(0) + 0.1 * Vec6::Unit(4);
  const MotionPlan plan = MotionPlan::brake(kSettings, moving(Vec6::Zero(), v), {1.5, 2.5});
  const double time = 0.3 / 1.5;  // translation takes longer than rotation
  EXPECT_EQ(plan.steps(), 20);
  const RecordedPath none;
  EXPECT_LT((plan.at(0, none).x_dot - v).norm(), 1e-12);
  const PathPoint<6> end = plan.at(plan.steps(), none);
  EXPECT_LT((end.x - 0.5 * time * v).norm(), 1e-12);
  EXPECT_EQ(end.x_dot.norm(), 0.0);
  EXPECT_LT((plan.at(1000, none).x - end.x).norm(), 1e-15);
  EXPECT_EQ(MotionPlan::brake(kSettings, moving(Vec6::Ones(), Vec6::Zero()), {1.5, 2.5}).steps(),
            0);
}

TEST(MotionPlan, AGentleMoveKeepsThePeakSpeedsAndAtLeastASecond) {
  const RecordedPath none;
  const Vec6 far = 0.2 * Vec6::Unit(1), turned = 0.3 * Vec6::Unit(5);
  for (const Vec6& target : {far, turned}) {
    const MotionPlan plan =
        MotionPlan::move(kSettings, moving(Vec6::Zero(), Vec6::Zero()), target, 0.0);
    double fastest = 0.0, turning = 0.0;
    for (std::int64_t n = 0; n <= plan.steps(); ++n) {
      fastest = std::max(fastest, plan.at(n, none).x_dot.head<3>().norm());
      turning = std::max(turning, plan.at(n, none).x_dot.tail<3>().norm());
    }
    EXPECT_NEAR(std::max(fastest / 0.05, turning / 0.10), 1.0, 1e-3);
    EXPECT_LT((plan.at(plan.steps(), none).x - target).norm(), 1e-12);
  }
  EXPECT_EQ(
      MotionPlan::move(kSettings, moving(Vec6::Zero(), Vec6::Zero()), 1e-6 * far, 0.0).steps(),
      100);
  EXPECT_EQ(MotionPlan::move(kSettings, moving(Vec6::Zero(), Vec6::Zero()), far, 2.0).steps(), 200);
  // Only the way counts, not where it begins.
  const Vec6 from = Vec6::LinSpaced(0.1, -0.2);
  EXPECT_EQ(MotionPlan::move(kSettings, moving(from, Vec6::Zero()), Vec6(from + far), 0.0).steps(),
            MotionPlan::move(kSettings, moving(Vec6::Zero(), Vec6::Zero()), far, 0.0).steps());
}

TEST(Rehearsal, NamesTheCheckThatAStepByStepWalkMeetsSomePosesATick) {
  const ControllerConfig& c = puma();
  const PathChecks checks(c.safety, c.geometry);
  const Vec6 L = legLengths(c.geometry, c.geometry.fromHome({}));
  const auto failure = [&](const Segment& s) {
    const MotionPlan plan =
        MotionPlan::of({c.periodSeconds(), c.gentle}, s, moving(Vec6::Zero(), Vec6::Zero()));
    Rehearsal rehearsal;
    rehearsal.begin(plan, L);
    std::int64_t ticks = 0;
    for (; rehearsal.underWay(); ++ticks) rehearsal.advance(checks, c.periodSeconds(), c.path);
    const std::int64_t enough = plan.steps() / Rehearsal::kPosesATick + 1;
    EXPECT_LE(ticks, enough);
    if (rehearsal.failure() == Check::kCount) {
      EXPECT_EQ(ticks, enough);
    }
    return rehearsal.failure();
  };
  EXPECT_EQ(failure(test::sine(2, 0.2, 0.5, 4.0)), Check::kCount);
  EXPECT_EQ(failure(test::sine(2, 0.31, 0.1, 10.0)), Check::kMotionLimits);
  EXPECT_EQ(failure(test::sine(2, 0.2, 3.0, 4.0)), Check::kVelocity);
  Segment ramp = test::ramp(0, 0.29, 2.0);
  EXPECT_EQ(failure(ramp), Check::kCount);
  ramp.duration = 0.2;  // the same way, too fast
  EXPECT_EQ(failure(ramp), Check::kVelocity);
}

// Commands

/// `legs` as a SafetyMonitor passes them, or refuses them where they cannot be.
Checked checked(const ControllerConfig& c, const LegMotion& legs, double ahead = 0.0) {
  Proposal p = inverseKinematics(c.geometry, {atRest(Vec6::Zero()), ahead});
  p.legs = legs;
  Sample s = numbered(0);
  s.switches = kAllSwitchesClosed;
  s.adc[kWrenchChannels] = (c.safety.pressure_min + c.safety.pressure_max) / 2;
  s.legs = legCounts(c.legs, legLengths(c.geometry, c.geometry.fromHome({})));
  SampleStream samples(c.period);
  samples.update(s, 0, false, false);
  LegEstimator estimator(c);
  const Vec6& measured = estimator.update(samples, {}, false, LegCommander(c)).L;
  return SafetyMonitor(c.safety, c.geometry, c.periodSeconds())
      .check(p, {{legs.L, measured}, samples, estimator, {}, Oscillation(), false});
}

struct Sender {
  explicit Sender(const ControllerConfig& config) : c(config), commander(config) {}
  void send(const LegMotion& legs, double ahead = 0.0, double share = 1.0) {
    commander.send(checked(c, legs, ahead), 3, share, servo, 0.0);
  }
  ControllerConfig c;
  LegCommander commander;
  ServoObserver servo{c.servo, c.periodSeconds()};
};

LegMotion moving(double L, double L_dot) {
  return {Vec6::Constant(L), Vec6::Constant(L_dot), Vec6::Zero()};
}

TEST(LegCommander, SendsTheCheckedLengthsToTheNearestCount) {
  Sender to(puma());
  LegMotion legs = moving(1.5, 0.1);
  legs.L = Vec6::LinSpaced(1.3, 1.7);
  to.send(legs, to.c.periodSeconds(), 0.0);
  const LegCommand& command = to.commander.command();
  const Vec6 sent = legLengths(to.c.legs, command.counts);
  EXPECT_LE((sent - legs.L).cwiseAbs().maxCoeff(), 0.5 * to.c.legs.scale(0) * (1.0 + 1e-9));
  EXPECT_TRUE(command.engaged);
  EXPECT_EQ(command.segment, 3);
  EXPECT_EQ(command.rest, command.counts);
  EXPECT_EQ(command.ahead, to.c.period);
  EXPECT_EQ(to.commander.expected(1.0), legs.L);  // as published: no lag is taken out
}

TEST(LegCommander, WhatDoesNotPassIsNotSentTheLastCheckedLengthsAreHeld) {
  Sender to(puma());
  to.send(moving(1.5, 0.1));
  const LegCounts before = to.commander.command().counts;
  for (const double bad : {kNan, 2.0, 1.0}) {  // [m] no length, too long, too short
    LegMotion legs = moving(1.5, 0.1);
    legs.L(2) = bad;
    to.send(legs);
    EXPECT_EQ(to.commander.command().counts, before) << bad;
    EXPECT_EQ(to.commander.command().rest, before) << bad;
    EXPECT_EQ(to.commander.legs().L, Vec6::Constant(1.5)) << bad;
    EXPECT_EQ(to.commander.legs().L_dot.norm(), 0.0) << bad;
  }
}

TEST(LegCommander, HoldsTheCheckedLengthsAndNotWhatLedToThem) {
  for (const double ahead : {0.0, puma().periodSeconds()}) {
    ControllerConfig c = puma();
    c.compensation.feed_forward = c.compensation.observer = true;
    Sender to(c);
    to.servo.reset(Vec6::Constant(1.5), 0);
    to.send(moving(1.5, 0.4), ahead);
    const LegCounts rest = legCounts(c.legs, Vec6::Constant(1.5));
    EXPECT_EQ(to.commander.command().rest, rest);
    EXPECT_GT(to.commander.command().counts[0], rest[0] + 100);  // by 0.4 m/s of lag
    to.commander.hold();
    EXPECT_EQ(to.commander.command().counts, rest);
    EXPECT_EQ(to.commander.command().ahead, 0);
    EXPECT_EQ(to.commander.reference(), Vec6::Constant(1.5));
    EXPECT_EQ(to.commander.expected(1.0), Vec6::Constant(1.5));
  }
}

TEST(LegCommander, WithTheLagTakenOutExpectsTheCommandBroughtToNowAndStaysInsideTheLimits) {
  ControllerConfig c = puma();
  c.compensation.feed_forward = true;
  const double T = c.periodSeconds();
  Sender to(c);
  to.send(moving(1.5, 0.1));
  EXPECT_GT(to.commander.reference()(0), 1.5 + 0.1 / c.servo.extend(0));  // by the lag at least
  EXPECT_NEAR(to.commander.expected(1.0)(0), 1.5 + 0.1 * T, 1e-12);
  to.send(moving(1.5, 0.1), T);  // meant for the next tick, which then is now
  EXPECT_NEAR(to.commander.expected(1.0)(0), 1.5, 1e-12);
  to.send(moving(c.safety.leg_max - 1e-4, 0.1));
  EXPECT_EQ(to.commander.reference(), Vec6::Constant(c.safety.leg_max));
  to.send(moving(c.safety.leg_min + 1e-4, -0.1));
  EXPECT_EQ(to.commander.reference(), Vec6::Constant(c.safety.leg_min));
}

TEST(LegCommander, TakesOutWhatTheTransducersWillRound) {
  ControllerConfig c = puma();
  c.compensation.observer = true;
  const double scale = c.servo.readings.scale(0);
  Sender to(c);
  LegMotion legs = moving(1.5, 0.0);
  legs.L = legLengths(c.legs, legCounts(c.legs, legs.L)).array() + 0.3 * scale;
  to.servo.reset(legs.L, 0);
  to.send(legs);
  for (const double share : {0.0, 0.5, 1.0}) {
    to.send(legs, 0.0, share);
    const Vec6 taken = to.commander.reference() - legs.L;
    EXPECT_LT((taken.array() + share * 0.3 * scale).abs().maxCoeff(), 1e-6 * scale) << share;
  }
}

TEST(LegCommander, CarriesWhatRoundingLeavesInAdmittanceControlOnly) {
  ControllerConfig c = puma();
  c.compensation.observer = true;
  for (const double ahead : {0.0, c.periodSeconds()}) {
    Sender to(c);
    double sum = 0.0;
    for (int n = 0; n < 100; ++n) {
      to.send(moving(1.5 + 0.3 * c.legs.scale(0), 0.0), ahead);
      sum += legLengths(c.legs, to.commander.command().counts)(0) - to.commander.reference()(0);
    }
    if (ahead > 0.0)
      EXPECT_LT(std::abs(sum), c.legs.scale(0));  // on average nothing is lost
    else
      EXPECT_GT(std::abs(sum), 10.0 * c.legs.scale(0));
  }
}

TEST(LegCommander, WhatRoundingLeftIsNotSentOnceItRests) {
  ControllerConfig c = puma();
  c.compensation.observer = true;
  Sender to(c);
  const double count = c.legs.scale(0), between = 1.5 + 0.3 * count;
  // 0.3 of a count are owed: with as much once more it would be the next one.
  to.send(moving(between, 0.0), c.periodSeconds());
  to.send(moving(between, 0.0), 0.0);
  EXPECT_EQ(to.commander.command().counts, legCounts(c.legs, to.commander.reference()));
  to.send(moving(between, 0.0), c.periodSeconds());
  to.commander.hold();
  to.send(moving(between, 0.0), c.periodSeconds());
  EXPECT_EQ(to.commander.command().counts, legCounts(c.legs, to.commander.reference()));
  to.send(moving(between, 0.0), c.periodSeconds());  // and while it goes on it is sent
  EXPECT_NE(to.commander.command().counts, legCounts(c.legs, to.commander.reference()));
}

TEST(LegCommander, WhoLetsGoNamesNoSegment) {
  Sender to(puma());
  to.send(moving(1.5, 0.1));
  EXPECT_EQ(to.commander.command().segment, 3);
  to.commander.release({Vec6::Constant(1.4)});
  EXPECT_FALSE(to.commander.command().engaged);
  EXPECT_EQ(to.commander.command().segment, -1);
  EXPECT_EQ(to.commander.command().rest, legCounts(to.c.legs, Vec6::Constant(1.4)));
}

TEST(LegCommander, LegsThatWereHeldNoLongerFeelTheirLastTurn) {
  ControllerConfig c = puma();
  c.compensation.feed_forward = true;
  c.servo.friction.setConstant(3e-4);
  Sender to(c);
  const double period = c.periodSeconds();
  for (int n = 0; n < 3; ++n) to.send(moving(1.5, 0.1), period);  // 3 mm: all of a turn
  to.send(moving(1.5, 0.0), period);
  EXPECT_GT(std::abs(to.commander.reference()(0) - 1.5), 1e-5);  // the seals still settle
  to.commander.hold();
  to.send(moving(1.5, 0.0), period);
  EXPECT_EQ(to.commander.reference(), Vec6::Constant(1.5));
}

/// What an estimator believes of six equal legs, tick by tick; they are told to rest until move().
class Reader {
 public:
  Vec6 read(double L, bool following, std::int64_t between = 0) {
    Sample s = numbered(n_ += 1 + between);
    s.time = s.legs_time = s.wrench_time = (n_ + 1) * c_.period;
    s.legs = legCounts(c_.legs, Vec6::Constant(L));
    samples_.update(s, s.time, following, false);
    return estimator_.update(samples_, {n_, n_, between, between, 0}, following, to_.commander).L;
  }
  /// They are told to move at this speed.
  void move(double L_dot) { to_.send(moving(1.5, L_dot)); }
  double jump() const { return c_.safety.reading_jump; }
  /// [m] that one moved so may have gone further in a tick.
  double reach(double L_dot) const { return c_.safety.reading_speed * c_.periodSeconds() * L_dot; }

 private:
  ControllerConfig c_ = puma();
  std::int64_t n_ = -1;
  SampleStream samples_{c_.period};
  LegEstimator estimator_{c_};
  Sender to_{c_};
};

TEST(LegEstimator, LegsThatDoNotFollowAreBelievedWhereverTheyAre) {
  Reader to;
  to.read(1.5, false);
  EXPECT_NEAR(to.read(1.4, false)(0), 1.4, 1e-4);  // somebody has moved them
  EXPECT_NEAR(to.read(1.4, true)(0), 1.4, 1e-4);
  EXPECT_NEAR(to.read(1.4 + 3.0 * to.jump(), true)(0), 1.4, 1e-4);  // no leg can have
  EXPECT_NEAR(to.read(1.5, false)(0), 1.5, 1e-4);
}

TEST(LegEstimator, TicksThatWerePassedOverAreTimeInWhichLegsMove) {
  for (const std::int64_t between : {0, 4}) {
    Reader to;
    to.read(1.5, false);
    to.move(0.2);
    to.read(1.5, true);
    const double L = 1.5 + to.jump() + 3.0 * to.reach(0.2);
    EXPECT_NEAR(to.read(L, true, between)(0), between > 0 ? L : 1.5, 1e-4) << between;
  }
}

TEST(LegEstimator, KnowsHowFarItsModelIsBehind) {
  const ControllerConfig c = puma();
  Sample s = numbered(0);
  s.time = 5'000'000'000;
  s.legs = legCounts(c.legs, legLengths(c.geometry, c.geometry.fromHome({})));
  SampleStream samples(c.period);
  samples.update(s, s.time, false, false);
  LegEstimator estimator(c);
  estimator.update(samples, {}, false, LegCommander(c));
  EXPECT_NEAR(estimator.age(s.time + 7'000'000), 0.007, 1e-12);
  EXPECT_EQ(estimator.age(s.time - 1), 0.0);
  EXPECT_NEAR(estimator.age(s.time + 1'000'000'000), 5.0 * c.periodSeconds(), 1e-12);
}

// Other memories

TEST(RobotInertia, IsThereFromTheFirstTickOnHoweverSeldomItIsRefreshed) {
  ControllerConfig c = puma();
  c.compensation.inertia = true;
  KnownPayload known(c);
  const Transform X_IP = c.geometry.fromHome({});
  LegMotion legs;
  legs.L = legLengths(c.geometry, X_IP);
  RobotInertia each(c);
  c.compensation.mass_update = 1000;
  RobotInertia seldom(c);
  JointVector q = JointVector::Zero();
  for (const std::int64_t count : {7, 8}) {  // armed, and again after a reset, the robot elsewhere
    q(1) -= 1.0;
    each.update(known, 0, q, 0.01, X_IP, X_IP.R, legs, true, 1.0);
    seldom.update(known, count, q, 0.01, X_IP, X_IP.R, legs, true, 1.0);
    EXPECT_EQ(seldom.M_1(), each.M_1()) << count;
    EXPECT_GT(seldom.M_1()(0, 0), 10.0);
    seldom.update(known, count, q, 0.01, X_IP, X_IP.R, legs, false, 0.0);
  }
}

TEST(Overruns, EveryLimitThatMayBeSetIsKept) {
  for (const int allowed : {0, 63, 64, 65, kMostOverruns}) {
    SafetyLimits limits;
    limits.stall_ticks = 10;
    limits.overruns = allowed;
    Overruns overruns;
    for (std::int64_t tick = 0; tick < allowed; ++tick) overruns.take(tick, 1);
    EXPECT_TRUE(overruns.good(limits, 10'000)) << allowed;
    overruns.take(allowed, 1);
    EXPECT_FALSE(overruns.good(limits, 10'000)) << allowed;
  }
}

TEST(SensorBias, ATareThatIsCancelledOnItsWayLeavesTheBiasAsItWas) {
  const ControllerConfig& c = puma();
  SensorBias bias(c);
  const Vec6 before = bias.counts();
  bias.beginTare();
  Sample s = numbered(0);
  s.adc.fill(100);
  for (int n = 0; n < kCalibrationSamples + 50; ++n) bias.stepTare(s, true, Vec6::Zero());
  ASSERT_GT((bias.counts() - before).norm(), 1.0);  // half way
  bias.cancelTare();
  EXPECT_EQ(bias.counts(), before);
  EXPECT_FALSE(bias.taring());
}

TEST(Rehearsal, LooksAtTheLastPoseWhateverTheStride) {
  // The ramp's last tick alone leaves the workspace.
  const ControllerConfig& c = puma();
  const PathChecks checks(c.safety, c.geometry);
  // 2999 periods: every second one
  const Segment ramp = test::ramp(2, c.safety.translation + 5e-5, 29.99);
  const PathPoint<6> home = atRest(Vec6::Zero());
  Rehearsal rehearsal;
  rehearsal.begin(MotionPlan::of({c.periodSeconds(), c.gentle}, ramp, home),
                  legLengths(c.geometry, c.geometry.fromHome({})));
  for (int tick = 0; rehearsal.underWay() && tick < 100; ++tick)
    rehearsal.advance(checks, c.periodSeconds(), c.path);
  EXPECT_EQ(rehearsal.failure(), Check::kMotionLimits);
}

// However long it lasts: poses that are a whole number of periods apart all look alike.
TEST(Rehearsal, MissesNoSineThatLastsLong) {
  const ControllerConfig& c = puma();
  const PathChecks checks(c.safety, c.geometry);
  const PathPoint<6> home = atRest(Vec6::Zero());
  for (const double duration : {40.0, 400.0, 1000.0, 5000.0, 10000.0})
    for (const double other : {0.05, 0.1, 0.0700001}) {  // [Hz] of its second coordinate
      const auto failure = [&](double amplitude) {
        Segment s = test::sine(2, amplitude, 0.05, duration);
        s.trajectory.motion[0] = AxisMotion::kSine;
        s.trajectory.amplitude(0) = amplitude;
        s.trajectory.frequency(0) = other;
        Rehearsal rehearsal;
        rehearsal.begin(MotionPlan::of({c.periodSeconds(), c.gentle}, s, home),
                        legLengths(c.geometry, c.geometry.fromHome({})));
        for (int tick = 0; rehearsal.underWay(); ++tick) {
          rehearsal.advance(checks, c.periodSeconds(), c.path);
          EXPECT_LT(tick, 2 * Rehearsal::kPoses / Rehearsal::kPosesATick + 1);
        }
        return rehearsal.failure();
      };
      EXPECT_NE(failure(1.0005 * c.safety.translation), Check::kCount) << duration;
      EXPECT_EQ(failure(0.3 * c.safety.translation), Check::kCount) << duration;
    }
}

// Of one parameter and a bias, by hand: Bayes' rule for normal distributions.
TEST(MassBelief, IsSharpenedAsNormalDistributionsAre) {
  constexpr double kOfMass = 0.5, kOfBias = 2.0, kNoise = 0.3, kSeen = 1.7;
  MassBelief belief;
  belief.begin(MassVector::Constant(4, kOfMass), 0.0, kOfBias);
  // Nothing of the masses is in channel 0: what it shows is bias. All that is told counts for 3 %
  // of itself as noise besides.
  MassColumns columns = MassColumns::Zero(6, 4);
  columns(1, 2) = 3.0;
  Vec6 y = Vec6::Zero(), noise = Vec6::Constant(kNoise * kNoise);
  y(0) = y(1) = kSeen;
  belief.learnAtRest(columns, y, noise);
  const double b2 = kOfBias * kOfBias, m2 = 9.0 * kOfMass * kOfMass, n2 = kNoise * kNoise;
  EXPECT_NEAR(belief.bias()(0), kSeen * b2 / (1.0009 * b2 + n2), 1e-12);
  // Channel 1 shows both, by their shares of the variance.
  const double s = 1.0009 * (m2 + b2) + n2;
  EXPECT_NEAR(belief.bias()(1), kSeen * b2 / s, 1e-12);
  EXPECT_NEAR(belief.parameters()(2), kSeen * 3.0 * kOfMass * kOfMass / s, 1e-12);
  EXPECT_NEAR(belief.covariance()(2, 2),
              kOfMass * kOfMass - std::pow(3.0 * kOfMass * kOfMass, 2) / s, 1e-12);
  EXPECT_NEAR(belief.parameters()(0), 0.0, 0.0);
  EXPECT_NEAR(belief.covariance()(0, 0), kOfMass * kOfMass, 1e-15);
  belief.moveBias(Vec6::Unit(0) * 0.25);
  EXPECT_NEAR(belief.bias()(0), kSeen * b2 / (1.0009 * b2 + n2) - 0.25, 1e-12);
  // Begun again it knows nothing.
  belief.begin(MassVector::Constant(4, kOfMass), 0.0, kOfBias);
  EXPECT_TRUE(belief.bias().isZero(0.0));
  EXPECT_TRUE(belief.parameters().isZero(0.0));
}

}  // namespace
}  // namespace ves
