// SPDX-License-Identifier: BSD-3-Clause
//
// The parts of a tick, each alone.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/rig.hpp"
#include "ves/control/robot_load.hpp"
#include "ves/control/safety_monitor.hpp"
#include "ves/control/sensor_bias.hpp"
#include "ves/control/supervisor.hpp"

namespace ves {
namespace {

using test::experiment;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

const ControllerConfig& puma() {
  static const ControllerConfig config = experiment("puma_on_table_4_1").controller;
  return config;
}

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

Sample numbered(std::int64_t sequence) {
  Sample s;
  s.sequence = sequence;
  return s;
}

TEST(SampleStream, AgesUntilANewSampleComes) {
  SampleStream stream;
  stream.update(numbered(-1), false, false);
  EXPECT_FALSE(stream.fresh());  // nothing was received yet
  stream.update(numbered(0), false, false);
  EXPECT_TRUE(stream.fresh());
  stream.update(numbered(0), true, false);
  stream.update(numbered(0), true, false);
  EXPECT_EQ(stream.age(), 2);
  EXPECT_EQ(stream.ageBefore(), 1);
  stream.update(numbered(1), true, false);
  EXPECT_EQ(stream.age(), 0);
  EXPECT_EQ(stream.ageBefore(), 2);
}

TEST(SampleStream, AnOlderSampleIsNoneOnlyWhileEngaged) {
  SampleStream stream;
  stream.update(numbered(7), true, false);
  stream.update(numbered(3), true, false);
  EXPECT_EQ(stream.sample().sequence, 7);
  stream.update(numbered(3), false, false);  // a machine that began anew
  EXPECT_EQ(stream.sample().sequence, 3);
  EXPECT_FALSE(stream.fresh());
  stream.update(numbered(4), false, false);
  EXPECT_TRUE(stream.fresh());
}

TEST(SampleStream, FreshTicksCountInARowAndWithoutAConflict) {
  SampleStream stream;
  for (int n = 0; n < 5; ++n) stream.update(numbered(n), false, false);
  EXPECT_EQ(stream.freshTicks(), 5);
  stream.update(numbered(5), false, true);
  EXPECT_EQ(stream.freshTicks(), 0);
  stream.update(numbered(6), false, false);
  stream.update(numbered(6), false, false);
  EXPECT_EQ(stream.freshTicks(), 0);
  stream.update(numbered(7), false, false);
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

TEST(SensorBias, ACalibrationThatSucceedsSetsBiasDeviationAndError) {
  SensorBias bias(puma());
  bias.beginCalibration();
  for (int n = 0; n < kCalibrationSamples; ++n)
    bias.calibrate(reading(100 + (n % 2 ? 3 : -3), n), true, Vec6::Constant(10.0));
  EXPECT_EQ(bias.calibration().status(), Calibration::Status::kDone);
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
  EXPECT_EQ(inertia.update(0, q, P.X, legs, false, 1.0).stacked().norm(), 0.0);  // not engaged
  const Wrench F = inertia.update(0, q, P.X, legs, true, 0.5);
  const double mass = 52.45 + 16.0 + 5.0;  // the PUMA with link 0, adapter, top plate
  EXPECT_LT((F.f - 0.5 * mass * a).norm(), 1e-9 * mass);
  EXPECT_NEAR(inertia.M_1()(0, 0), 0.5 * mass, 1e-9);
  ControllerConfig published = puma();
  RobotInertia none(published);
  EXPECT_EQ(none.update(0, q, P.X, legs, true, 1.0).stacked().norm(), 0.0);
}

TEST(StaticLoad, GoesThroughTheSensorsFilterByTheShareOnly) {
  ControllerConfig config = puma();
  config.compensation.inertia = config.compensation.observer = true;
  const Mat3 level = Mat3::Identity(), tilted = rotation({0.3, 0.0, 0.0});
  JointVector q = JointVector::Zero();
  StaticLoad published(puma()), none(config), all(config);
  for (StaticLoad* load : {&published, &none, &all}) load->update(q, level, false, 0.0);
  published.update(q, tilted, true, 0.0);
  none.update(q, tilted, true, 0.0);
  all.update(q, tilted, true, 1.0);
  EXPECT_LT((published.wrench().stacked() - none.wrench().stacked()).norm(), 1e-12);
  EXPECT_GT((published.wrench().f - all.wrench().f).norm(), 1.0);
  EXPECT_EQ(published.counts(), all.counts());  // unfiltered: what the frozen check expects
  for (int n = 0; n < 200; ++n) all.update(q, tilted, true, 1.0);
  EXPECT_LT((published.wrench().stacked() - all.wrench().stacked()).norm(), 1e-6);
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
}

TEST(MotionPlan, FirstFailureNamesTheCheckThatAStepByStepWalkMeets) {
  const ControllerConfig& c = puma();
  const PathChecks checks(c.safety, c.geometry);
  const Vec6 L = legLengths(c.geometry, c.geometry.fromHome({}));
  const auto failure = [&](const Segment& s) {
    const MotionPlan plan =
        MotionPlan::of({c.periodSeconds(), c.gentle}, s, moving(Vec6::Zero(), Vec6::Zero()));
    return firstFailure(plan, checks, L, c.periodSeconds(), c.path);
  };
  EXPECT_EQ(failure(test::sine(2, 0.2, 0.5, 4.0)), Check::kCount);
  EXPECT_EQ(failure(test::sine(2, 0.31, 0.1, 10.0)), Check::kMotionLimits);
  EXPECT_EQ(failure(test::sine(2, 0.2, 3.0, 4.0)), Check::kVelocity);
  Segment ramp = test::segment(SegmentKind::kTrajectory, 2.0);
  ramp.trajectory[0] = {AxisMotion::kRamp, 0.29, 0.0, 0.0};
  EXPECT_EQ(failure(ramp), Check::kCount);
  ramp.duration = 0.2;  // the same way, too fast
  EXPECT_EQ(failure(ramp), Check::kVelocity);
}

// Commands

TEST(LegCommander, SendsTheCheckedLengthsToTheNearestCount) {
  const ControllerConfig& c = puma();
  LegCommander commander(c);
  const ServoObserver servo(c.servo, c.periodSeconds());
  LegMotion legs;
  legs.L = Vec6::LinSpaced(1.3, 1.7);
  legs.L_dot = Vec6::Constant(0.1);
  commander.command(legs, true, 3, 0.0, 0.0, servo);
  const Vec6 sent = legLengths(c.legs, commander.command().counts);
  EXPECT_LE((sent - legs.L).cwiseAbs().maxCoeff(), 0.5 * c.legs.scale(0) * (1.0 + 1e-9));
  EXPECT_TRUE(commander.command().engaged);
  EXPECT_EQ(commander.command().segment, 3);
  EXPECT_EQ(commander.expected(0.0, 1.0), legs.L);  // as published: no lag is taken out

  const LegCounts before = commander.command().counts;
  legs.L(2) = kNan;
  commander.command(legs, true, 3, 0.0, 0.0, servo);
  EXPECT_EQ(commander.command().counts, before);
  commander.hold();
  EXPECT_EQ(commander.legs().L_dot.norm(), 0.0);
}

TEST(LegCommander, WithTheLagTakenOutExpectsTheCommandBroughtToNowAndStaysInsideTheLimits) {
  ControllerConfig c = puma();
  c.compensation.feed_forward = true;
  LegCommander commander(c);
  const ServoObserver servo(c.servo, c.periodSeconds());
  LegMotion legs;
  legs.L = Vec6::Constant(1.5);
  legs.L_dot = Vec6::Constant(0.1);
  commander.command(legs, true, 0, 0.0, 1.0, servo);
  EXPECT_GT(commander.reference()(0), 1.5 + 0.1 / c.servo.extend(0));  // ahead by the lag at least
  EXPECT_NEAR(commander.expected(0.0, 1.0)(0), 1.5 + 0.1 * c.periodSeconds(), 1e-12);
  EXPECT_NEAR(commander.expected(c.periodSeconds(), 1.0)(0), 1.5, 1e-12);
  legs.L = Vec6::Constant(c.safety.leg_max - 1e-4);
  commander.command(legs, true, 0, 0.0, 1.0, servo);
  EXPECT_EQ(commander.reference(), Vec6::Constant(c.safety.leg_max));
  legs.L = Vec6::Constant(c.safety.leg_min + 1e-4);
  legs.L_dot = Vec6::Constant(-0.1);
  commander.command(legs, true, 0, 0.0, 1.0, servo);
  EXPECT_EQ(commander.reference(), Vec6::Constant(c.safety.leg_min));
}

TEST(LegCommander, CarriesWhatRoundingLeavesInAdmittanceControlOnly) {
  ControllerConfig c = puma();
  c.compensation.observer = true;
  const ServoObserver servo(c.servo, c.periodSeconds());
  for (const double lead : {0.0, c.periodSeconds()}) {
    LegCommander commander(c);
    LegMotion legs;
    legs.L = Vec6::Constant(1.5 + 0.3 * c.legs.scale(0));
    double sum = 0.0;
    for (int n = 0; n < 100; ++n) {
      commander.command(legs, true, 0, lead, 1.0, servo);
      sum += legLengths(c.legs, commander.command().counts)(0) - commander.reference()(0);
    }
    if (lead > 0.0)
      EXPECT_LT(std::abs(sum), c.legs.scale(0));  // on average nothing is lost
    else
      EXPECT_GT(std::abs(sum), 10.0 * c.legs.scale(0));
  }
}

// Monitors

TEST(Overruns, OneStallOrTooManyInASecondAndNoMoreAfterIt) {
  SafetyLimits limits;
  limits.stall_ticks = 3;
  limits.overruns = 2;
  Overruns overruns;
  overruns.take(10, 3);
  EXPECT_TRUE(overruns.good(limits, 100));
  overruns.take(20, 4);  // one stall too long
  EXPECT_FALSE(overruns.good(limits, 100));
  overruns.take(21, 0);
  EXPECT_TRUE(overruns.good(limits, 100));
  overruns.take(30, 1);  // the third in a second
  EXPECT_FALSE(overruns.good(limits, 100));
  overruns.take(110, 0);  // the first is 100 ticks ago: still within the second
  EXPECT_FALSE(overruns.good(limits, 100));
  overruns.take(111, 0);
  EXPECT_TRUE(overruns.good(limits, 100));
}

TEST(Oscillation, NeedsGrowthInEveryWindowAboveItsFloorWhileTheRobotStands) {
  SafetyLimits limits;
  limits.growing_windows = 4;
  const double floor = 0.05, period = 0.01;
  const auto windows = [&](double first, double factor, int n, double moved = 0.0) {
    Oscillation o;
    JointVector q = JointVector::Zero();
    double energy = first;
    for (int w = 0; w < n; ++w, energy *= factor)
      for (int i = 0; i < 50; ++i) {
        q(0) += moved;
        o.take(energy, false, q, 1e-3, period, floor);
      }
    return o.good(limits);
  };
  EXPECT_FALSE(windows(1.0, 1.3, 6));
  EXPECT_TRUE(windows(1.0, 1.3, 4));         // the first window has none before it
  EXPECT_TRUE(windows(1.0, 1.15, 20));       // grows, but by less than a fifth
  EXPECT_TRUE(windows(1e-6, 1.3, 20));       // below the floor
  EXPECT_TRUE(windows(1.0, 1.3, 6, 2e-3));   // the robot moves: that is where the energy is from
  EXPECT_FALSE(windows(1.0, 1.3, 6, 1e-6));  // as good as standing
}

TEST(Oscillation, SwingingOnAgainstTheEnvelopeCountsAsGrowth) {
  SafetyLimits limits;
  limits.growing_windows = 4;
  Oscillation o;
  for (int i = 0; i < 4 * 50 + 1; ++i)
    o.take(1.0, i % 50 == 7, JointVector::Zero(), 1e-3, 0.01, 0.05);
  EXPECT_FALSE(o.good(limits));
  o.reset();
  EXPECT_TRUE(o.good(limits));
}

TEST(FrozenSensor, TripsWhenTheWeightTurnsUnderEqualReadings) {
  SafetyLimits limits;
  limits.frozen_samples = 3;
  limits.frozen_counts = 50.0;
  FrozenSensor sensor;
  AdcCounts adc{};
  sensor.take(adc, Vec6::Zero());
  for (int n = 0; n < 10; ++n) sensor.take(adc, Vec6::Zero());
  EXPECT_TRUE(sensor.good(limits));  // nothing should have changed
  sensor.take(adc, 51.0 * Vec6::Unit(3));
  EXPECT_FALSE(sensor.good(limits));
  adc[6] += 1;  // the pressure is no part of it
  sensor.take(adc, 51.0 * Vec6::Unit(3));
  EXPECT_FALSE(sensor.good(limits));
  adc[2] += 1;
  sensor.take(adc, 51.0 * Vec6::Unit(3));
  EXPECT_TRUE(sensor.good(limits));
}

TEST(LegReadings, AllowsWhatALegCanDoAndOneErrorInARow) {
  LegReadings readings;
  const Vec6 at = Vec6::Constant(1.5), still = Vec6::Zero();
  readings.take(at, still, 0.01, 0.002);
  EXPECT_EQ(readings.take(Vec6(at + 0.0019 * Vec6::Unit(0)), still, 0.01, 0.002)(0), 1.5019);
  const Vec6 jumped = at + 0.01 * Vec6::Unit(4);
  EXPECT_NE(readings.take(jumped, still, 0.01, 0.002), jumped);
  EXPECT_TRUE(readings.good());
  EXPECT_NE(readings.take(jumped, still, 0.01, 0.002), jumped);
  EXPECT_FALSE(readings.good());
  readings.reset();
  EXPECT_EQ(readings.take(jumped, still, 0.01, 0.002), jumped);
  EXPECT_TRUE(readings.good());
  // A leg that was told 0.4 m/s may come 6 mm further in 10 ms, beside the jump.
  EXPECT_EQ(readings.take(Vec6(jumped + 0.0079 * Vec6::Unit(1)), Vec6::Constant(0.4), 0.01, 0.002),
            Vec6(jumped + 0.0079 * Vec6::Unit(1)));
  EXPECT_NE(readings.take(Vec6(jumped + 0.0165 * Vec6::Unit(1)), Vec6::Constant(0.4), 0.01, 0.002),
            Vec6(jumped + 0.0165 * Vec6::Unit(1)));
}

// Decisions

/// A supervisor with everything around it.
struct Desk {
  explicit Desk(const ControllerConfig& config)
      : c(config), path(c.safety, c.geometry), motion(c), bias(c), share(c.compensation, 0.01) {
    for (int n = 0; n <= c.arming_samples; ++n) stream.update(numbered(n), false, false);
  }
  Situation now() { return {c, path, tick, stream.freshTicks(), dynamic, M_1, L}; }
  Actuation act() { return {motion, bias, stream, share}; }
  TickState order(Request request, const Segment& segment = {}) {
    supervisor.handle({request, segment, {1, tick}}, now(), act());
    return advance();
  }
  TickState advance() {
    supervisor.advance(now(), act());
    if (supervisor.moves()) motion.commit(motion.trajectoryGeneration(), false);
    supervisor.trip(tripped, now(), act());
    ++tick;
    TickState state;
    supervisor.report(state);
    return state;
  }
  void arm() {
    order(Request::kArm);
    advance();
  }

  ControllerConfig c;
  PathChecks path;
  MotionGenerator motion;
  SensorBias bias;
  SampleStream stream;
  CompensationShare share;
  Supervisor supervisor;
  Wrench dynamic;
  Mat6 M_1 = Mat6::Zero();
  Vec6 L = legLengths(c.geometry, c.geometry.fromHome({}));
  Tripped tripped;
  std::int64_t tick = 0;
};

Tripped only(Check check) {
  Tripped t;
  t.require(check, false);
  return t;
}

TEST(Supervisor, AdmittanceControlNeedsAVerdictAndALightSensor) {
  const Segment admittance = test::segment(SegmentKind::kAdmittance, 5.0);
  const std::pair<Stability, Refusal> cases[] = {{Stability::kUnknown, Refusal::kUnassessed},
                                                 {Stability::kUnstable, Refusal::kUnstable},
                                                 {Stability::kStable, Refusal::kNone},
                                                 {Stability::kForced, Refusal::kNone}};
  for (const auto& [stability, refusal] : cases) {
    ControllerConfig config = puma();
    config.stability = config.stability_uncompensated = stability;
    Desk desk(config);
    desk.arm();
    EXPECT_EQ(desk.order(Request::kRun, admittance).refusal, refusal);
    EXPECT_EQ(desk.supervisor.phase(), refusal == Refusal::kNone ? Phase::kRunning : Phase::kArmed);
  }
  for (const bool moment : {false, true}) {
    const SafetyLimits& limits = puma().safety;
    const double most = moment ? limits.start_moment : limits.start_force;
    for (const double share : {0.999, 1.001}) {
      Desk desk(puma());
      desk.arm();
      (moment ? desk.dynamic.n : desk.dynamic.f) = share * most * Vec3(0.6, 0.0, -0.8);
      const bool light = share < 1.0;
      EXPECT_EQ(desk.order(Request::kRun, admittance).refusal,
                light ? Refusal::kNone : Refusal::kLoaded);
    }
    Desk desk(puma());
    desk.arm();
    (moment ? desk.dynamic.n : desk.dynamic.f).x() = kNan;
    EXPECT_EQ(desk.order(Request::kRun, admittance).refusal, Refusal::kLoaded);
  }
}

TEST(Supervisor, TheVerdictIsOfTheLoopAsItIsCompensated) {
  ControllerConfig config = puma();
  config.compensation.feed_forward = true;
  config.stability = Stability::kStable;
  config.stability_uncompensated = Stability::kUnstable;
  Desk desk(config);
  desk.arm();
  EXPECT_EQ(desk.order(Request::kUncompensate).refusal, Refusal::kNone);  // nothing runs
  const Segment admittance = test::segment(SegmentKind::kAdmittance, 5.0);
  EXPECT_EQ(desk.order(Request::kRun, admittance).refusal, Refusal::kUnstable);
  EXPECT_EQ(desk.order(Request::kCompensate).refusal, Refusal::kNone);
  EXPECT_EQ(desk.order(Request::kRun, admittance).refusal, Refusal::kNone);
  EXPECT_EQ(desk.order(Request::kUncompensate).refusal, Refusal::kUnstable);
  EXPECT_TRUE(desk.share.wanted());
}

TEST(Supervisor, ARefusedPathNamesItsCheckAndChangesNothing) {
  Desk desk(puma());
  desk.arm();
  const TickState before = desk.advance();
  const TickState after = desk.order(Request::kRun, test::sine(2, 0.4, 0.2, 5.0));
  EXPECT_EQ(after.refusal, Refusal::kOutside);
  EXPECT_EQ(after.refused_by, Check::kMotionLimits);
  EXPECT_EQ(after.phase, before.phase);
  EXPECT_EQ(desk.motion.motion().x, Vec6::Zero());
}

TEST(Supervisor, ASecondTripOfATickIsLatchedAndTheFirstCauseStays) {
  Desk desk(puma());
  desk.arm();
  desk.order(Request::kRun, test::sine(2, 0.1, 0.5, 5.0));
  for (int n = 0; n < 30; ++n) desk.advance();
  desk.tripped = only(Check::kStale);
  TickState state = desk.advance();
  EXPECT_EQ(state.phase, Phase::kStopping);
  EXPECT_EQ(state.cause, Check::kStale);
  desk.supervisor.tripStopping(only(Check::kPressure), desk.act());  // does not freeze
  EXPECT_EQ(desk.supervisor.phase(), Phase::kStopping);
  desk.supervisor.tripStopping(only(Check::kCollide), desk.act());
  desk.supervisor.report(state);
  EXPECT_EQ(state.phase, Phase::kStopped);
  EXPECT_TRUE(state.latched.has(Check::kCollide));
  EXPECT_FALSE(state.latched.has(Check::kPressure));
  EXPECT_EQ(state.cause, Check::kStale);
}

TEST(Supervisor, ATripEndsATareAndAStopLastsUntilAResetWithoutACause) {
  Desk desk(puma());
  desk.arm();
  desk.order(Request::kTare);
  EXPECT_TRUE(desk.bias.taring());
  EXPECT_EQ(desk.order(Request::kTare).refusal, Refusal::kBusy);
  desk.tripped = only(Check::kPanicButton);
  EXPECT_EQ(desk.advance().phase, Phase::kStopped);
  EXPECT_FALSE(desk.bias.taring());
  EXPECT_EQ(desk.order(Request::kReset).refusal, Refusal::kCauseRemains);
  EXPECT_EQ(desk.order(Request::kArm).refusal, Refusal::kNotArmed);
  EXPECT_EQ(desk.order(Request::kHold).refusal, Refusal::kNotArmed);
  desk.tripped = {};
  desk.advance();
  const TickState state = desk.order(Request::kReset);
  EXPECT_EQ(state.refusal, Refusal::kNone);
  EXPECT_EQ(state.phase, Phase::kDisarmed);
  EXPECT_EQ(state.cause, Check::kCount);
  EXPECT_FALSE(state.latched.any());
  EXPECT_EQ(desk.stream.freshTicks(), 0);
  EXPECT_EQ(desk.order(Request::kReset).refusal, Refusal::kNotStopped);
}

TEST(Supervisor, ARequestToArmDoesNotOutliveACause) {
  Desk desk(puma());
  desk.tripped = only(Check::kPanicButton);
  desk.advance();
  EXPECT_EQ(desk.order(Request::kArm).refusal, Refusal::kCauseRemains);
  desk.tripped = {};
  desk.advance();
  desk.advance();
  EXPECT_EQ(desk.supervisor.phase(), Phase::kDisarmed);
  desk.tripped = only(Check::kStale);  // a stream that has not begun is no cause
  desk.advance();
  EXPECT_EQ(desk.order(Request::kArm).refusal, Refusal::kNone);
  EXPECT_EQ(desk.supervisor.phase(), Phase::kDisarmed);
  desk.tripped = {};
  desk.advance();
  desk.advance();
  EXPECT_EQ(desk.supervisor.phase(), Phase::kArmed);
}

TEST(Supervisor, ACauseThatComesWhileTheStreamIsAwaitedDropsTheRequest) {
  Desk desk(puma());
  desk.stream.restart();
  EXPECT_EQ(desk.order(Request::kArm).refusal, Refusal::kNone);
  desk.tripped = only(Check::kPanicButton);
  desk.advance();
  desk.tripped = {};
  desk.advance();
  desk.advance();
  for (int n = 100; n <= 100 + desk.c.arming_samples; ++n)
    desk.stream.update(numbered(n), false, false);
  desk.advance();
  EXPECT_EQ(desk.supervisor.phase(), Phase::kDisarmed);
}

TEST(Supervisor, AStopBrakesFromMotionAndFreezesAtOnceFromRest) {
  Desk desk(puma());
  desk.arm();
  desk.tripped = only(Check::kPressure);
  EXPECT_EQ(desk.advance().phase, Phase::kStopped);  // nothing to brake

  Desk swinging(puma());
  swinging.arm();
  swinging.order(Request::kRun, test::sine(2, 0.1, 0.5, 5.0));
  for (int n = 0; n < 10; ++n) swinging.advance();
  swinging.tripped = only(Check::kPressure);
  EXPECT_EQ(swinging.advance().phase, Phase::kStopping);
  int ticks = 0;
  while (swinging.advance().phase == Phase::kStopping && ticks < 100) ++ticks;
  EXPECT_EQ(swinging.supervisor.phase(), Phase::kStopped);
  EXPECT_EQ(swinging.motion.motion().x_dot.norm(), 0.0);
}

}  // namespace
}  // namespace ves
