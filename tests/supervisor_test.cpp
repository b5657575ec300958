// SPDX-License-Identifier: BSD-3-Clause
//
// The phases of testPlatform: what an order, the end of a segment or a failing check leads to.
#include <gtest/gtest.h>

#include "support/rig.hpp"
#include "ves/control/supervisor.hpp"

namespace ves {
namespace {

using test::experiment;
using test::kNan;
using test::numbered;
using test::puma;

/// A supervisor with everything around it.
struct Desk {
  explicit Desk(const ControllerConfig& config)
      : c(config),
        path(c.safety, c.geometry),
        motion(c),
        bias(c),
        share(c.compensation, 0.01),
        carried(c) {
    for (int n = 0; n <= c.arming_samples; ++n) stream.update(numbered(n), 0, false, false);
  }
  Situation now() { return {c, path, tick, stream.freshTicks(), dynamic, M_1, 0.0, L}; }
  Actuation act() { return {motion, bias, stream, share, carried}; }
  TickState order(Request request, const Segment& segment = {}) {
    supervisor.handle({request, segment, {1, tick}}, now(), act());
    return advance();
  }
  TickState advance() {
    supervisor.advance(now(), act());
    if (supervisor.moves()) motion.commit(motion.trajectoryGeneration());
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
  SampleStream stream{10'000'000};
  CompensationShare share;
  KnownPayload carried;
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

TEST(Supervisor, ALoopThatGrowsSlowlyIsLetPassForSoLong) {
  ControllerConfig config = puma();
  config.stability = config.stability_uncompensated = Stability::kStable;
  config.stable_for = config.stable_for_uncompensated = 20.0;
  for (const auto& [duration, refusal] :
       {std::pair{20.0, Refusal::kNone}, {20.01, Refusal::kTooLong}, {kNan, Refusal::kTooLong}}) {
    Desk desk(config);
    desk.arm();
    EXPECT_EQ(desk.order(Request::kRun, test::segment(SegmentKind::kAdmittance, duration)).refusal,
              refusal);
  }
  // What an order began may last longer than that: its loop is not changed to such a one.
  config.compensation.feed_forward = true;
  config.stable_for = HUGE_VAL;
  Desk desk(config);
  desk.arm();
  EXPECT_EQ(desk.order(Request::kRun, test::segment(SegmentKind::kAdmittance, 60.0)).refusal,
            Refusal::kNone);
  EXPECT_EQ(desk.order(Request::kUncompensate).refusal, Refusal::kTooLong);
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

TEST(Supervisor, TheGripperIsToldToOneThatLearnsWhatItHolds) {
  for (const bool learns : {false, true})
    for (const bool tool : {false, true}) {
      ControllerConfig config = puma();
      config.compensation.learns_masses = learns;
      if (!tool) config.hand = {};
      Desk desk(config);
      const bool can = learns && tool;
      EXPECT_EQ(desk.order(Request::kGripper).refusal,
                can ? Refusal::kNotArmed : Refusal::kNotLearning);
      desk.arm();
      EXPECT_EQ(desk.order(Request::kGripper).refusal,
                can ? Refusal::kNone : Refusal::kNotLearning);
      desk.carried.update({}, -1);
      EXPECT_EQ(desk.carried.gripperMoved(), can);
      desk.carried.update({}, -1);
      EXPECT_FALSE(desk.carried.gripperMoved());
    }
}

TEST(Supervisor, ARefusedPathNamesItsCheckAndChangesNothing) {
  Desk desk(puma());
  desk.arm();
  const TickState before = desk.advance();
  TickState after = desk.order(Request::kRun, test::sine(2, 0.4, 0.2, 5.0));
  while (after.refusal == Refusal::kChecking) after = desk.advance();
  EXPECT_EQ(after.refusal, Refusal::kOutside);
  EXPECT_EQ(after.refused_by, Check::kMotionLimits);
  EXPECT_EQ(after.phase, before.phase);
  EXPECT_EQ(desk.motion.motion().x, Vec6::Zero());
}

TEST(Supervisor, APathIsCheckedOverSomeTicksBeforeItBegins) {
  const Segment longest = test::sine(2, 0.1, 0.5, 5.0);  // 501 poses
  const auto asked = [&](Desk& desk) {
    desk.arm();
    const TickState first = desk.order(Request::kRun, longest);
    EXPECT_EQ(first.refusal, Refusal::kChecking);
    EXPECT_EQ(first.phase, Phase::kArmed);
    return first.order.sequence;
  };
  Desk begins(puma());
  asked(begins);
  for (std::int64_t n = 1; n < 501 / Rehearsal::kPosesATick; ++n)
    EXPECT_EQ(begins.advance().phase, Phase::kArmed);
  EXPECT_EQ(begins.advance().phase, Phase::kRunning);

  Desk busy(puma());
  const std::int64_t sequence = asked(busy);
  EXPECT_EQ(busy.order(Request::kRun, longest).refusal, Refusal::kBusy);
  EXPECT_EQ(busy.order(Request::kStart).refusal, Refusal::kBusy);
  EXPECT_EQ(busy.order(Request::kTare).refusal, Refusal::kNone);
  for (int n = 0; n < 6; ++n) busy.advance();
  const TickState answered = busy.advance();  // names the order that it answers
  EXPECT_EQ(answered.order.sequence, sequence);
  EXPECT_EQ(answered.refusal, Refusal::kNone);
  EXPECT_EQ(answered.phase, Phase::kRunning);

  for (const Request request : {Request::kHold, Request::kStop}) {
    Desk dropped(puma());
    const std::int64_t path = asked(dropped), at = dropped.tick;
    // Both are answered, one in a tick.
    const TickState first = dropped.order(request);
    EXPECT_EQ(first.order.sequence, path);
    EXPECT_EQ(first.refusal, Refusal::kOvertaken);
    const TickState second = dropped.advance();
    EXPECT_EQ(second.order.sequence, at);
    EXPECT_EQ(second.refusal, Refusal::kNone);
    for (int n = 0; n < 20; ++n) EXPECT_NE(dropped.advance().phase, Phase::kRunning);
  }

  Desk tripped(puma());
  const std::int64_t lost = asked(tripped);
  tripped.tripped = only(Check::kStale);
  const TickState after = tripped.advance();
  EXPECT_EQ(after.order.sequence, lost);
  EXPECT_EQ(after.refusal, Refusal::kOvertaken);
  for (int n = 0; n < 20; ++n) EXPECT_NE(tripped.advance().phase, Phase::kRunning);
}

TEST(Supervisor, APathOrderedWhileAProgramIsAboutToBeginIsRefused) {
  // Else it would be gone through, and begun, when the program is over.
  Desk desk(puma());
  desk.order(Request::kStart);
  ASSERT_EQ(desk.supervisor.phase(), Phase::kArmed);
  const TickState asked = desk.order(Request::kRun, test::sine(2, 0.1, 0.5, 2.0));
  EXPECT_EQ(asked.refusal, Refusal::kBusy);
  EXPECT_EQ(asked.phase, Phase::kRunning);
}

TEST(Supervisor, AHoldIsAMoveThatBrakes) {
  Desk desk(puma());
  desk.arm();
  desk.order(Request::kRun, test::sine(2, 0.1, 0.5, 0.9));
  for (int n = 0; n < 20; ++n) desk.advance();
  EXPECT_EQ(desk.motion.kind(), SegmentKind::kTrajectory);
  desk.order(Request::kHold);
  EXPECT_EQ(desk.motion.kind(), SegmentKind::kMove);
  for (int n = 0; n < 100; ++n) desk.advance();
  EXPECT_EQ(desk.motion.motion().x_dot, Vec6::Zero());
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
  EXPECT_EQ(state.cause, Check::kCount);
  EXPECT_EQ(state.cause_tick, -1);
  EXPECT_EQ(state.refusal, Refusal::kNone);
  EXPECT_EQ(state.phase, Phase::kDisarmed);
  EXPECT_EQ(state.cause, Check::kCount);
  EXPECT_FALSE(state.latched.any());
  EXPECT_EQ(desk.stream.freshTicks(), 0);
  EXPECT_EQ(desk.order(Request::kReset).refusal, Refusal::kNotStopped);
}

// Nor one that waits for a stream of samples and meets one: releasing a button moves nothing.
TEST(Supervisor, ACauseEndsARequestThatWaits) {
  for (const Request request : {Request::kArm, Request::kStart}) {
    Desk desk(puma());
    desk.tripped = only(Check::kStale);
    desk.advance();
    EXPECT_EQ(desk.order(request).refusal, Refusal::kNone);
    desk.tripped = only(Check::kPanicButton);
    desk.advance();
    desk.tripped = {};
    for (int i = 0; i < 5; ++i) EXPECT_EQ(desk.advance().phase, Phase::kDisarmed);
  }
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
    desk.stream.update(numbered(n), 0, false, false);
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
