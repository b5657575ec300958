// SPDX-License-Identifier: BSD-3-Clause
//
// testPlatform's menu: orders, calibration, tare, the way out of a stop, the long look at the
// sensor.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <filesystem>

#include "support/obedient_machine.hpp"
#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/bus/channels.hpp"
#include "ves/contract/plausible.hpp"
#include "ves/evaluation/drift_samples.hpp"
#include "ves/run/replay.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

using test::experiment;
using test::Rig;
using test::segment;
using test::sine;

TEST(Orders, NothingMovesWithoutOne) {
  Rig rig(experiment("z_sine"));
  for (int i = 0; i < 500; ++i) ASSERT_FALSE(rig.tick().command.engaged);
  EXPECT_EQ(rig.state().phase, Phase::kDisarmed);
}

TEST(Orders, WhatIsNoneIsNotLetIn) {
  for (const Request request : {Request::kNone, Request::kOvertaken, Request::kCount}) {
    Order order;
    order.request = request;
    order.id.sequence = 0;
    EXPECT_FALSE(plausible(order)) << static_cast<int>(request);
  }
  Order arm;
  arm.request = Request::kArm;
  arm.id.sequence = 0;
  EXPECT_TRUE(plausible(arm));
  arm.id.sequence = -1;
  EXPECT_FALSE(plausible(arm));
}

TEST(Orders, ArmingHoldsTheMeasuredPoseUntilTold) {
  Rig rig(experiment("puma_on_table_4_1"));
  const Vec6 measured = rig.arm().measured.stacked();
  EXPECT_EQ(rig.state().motion.x, measured);
  EXPECT_EQ(rig.run(300).motion.x, measured);
  EXPECT_EQ(rig.state().phase, Phase::kArmed);
  EXPECT_EQ(rig.order(Request::kRun, sine(2, 0.02, 0.5, 2.0)).phase, Phase::kRunning);
  EXPECT_EQ(rig.until(Phase::kArmed).phase, Phase::kArmed);
  EXPECT_EQ(rig.tick(Request::kStop).phase, Phase::kReturning);
  EXPECT_EQ(rig.until(Phase::kParked).phase, Phase::kParked);
  EXPECT_EQ(rig.state().motion.x.norm(), 0.0);
}

TEST(Orders, AProgramUnderAttendanceEndsHoldingAtHome) {
  Rig rig(experiment("ramp"));
  rig.arm();
  rig.tick(Request::kStart);
  EXPECT_EQ(rig.until(Phase::kReturning).phase, Phase::kReturning);
  EXPECT_EQ(rig.until(Phase::kArmed).phase, Phase::kArmed);
  EXPECT_EQ(rig.state().motion.x.norm(), 0.0);
  EXPECT_EQ(rig.state().segment, -1);
}

TEST(Orders, AreRefusedForAReason) {
  Rig rig(experiment("z_sine"));
  rig.run(20);
  for (Request r : {Request::kRun, Request::kHold, Request::kTare})
    EXPECT_EQ(rig.tick(r).refusal, Refusal::kNotArmed) << name(r);
  EXPECT_EQ(rig.tick(Request::kReset).refusal, Refusal::kNotStopped);
  rig.arm();
  EXPECT_EQ(rig.tick(Request::kArm).refusal, Refusal::kArmed);
  rig.order(Request::kRun, sine(2, 0.05, 0.5, 4.0));
  EXPECT_EQ(rig.order(Request::kRun, segment(SegmentKind::kCalibration)).refusal, Refusal::kBusy);
  EXPECT_EQ(rig.tick(Request::kStart).refusal, Refusal::kBusy);
  EXPECT_EQ(rig.state().kind, SegmentKind::kTrajectory);
  rig.disturb([](Sample& s) { s.switches = 0; });
  EXPECT_EQ(rig.tick().phase, Phase::kStopped);
  for (Request r : {Request::kArm, Request::kStart, Request::kRun, Request::kHold})
    EXPECT_EQ(rig.tick(r).refusal, Refusal::kNotArmed) << name(r);
  EXPECT_EQ(rig.state().phase, Phase::kStopped);
}

TEST(Orders, AHoldTakesArmingBack) {
  Rig rig(experiment("z_sine"));
  EXPECT_EQ(rig.tick(Request::kArm).refusal, Refusal::kNone);
  ASSERT_EQ(rig.state().phase, Phase::kDisarmed);
  EXPECT_EQ(rig.tick(Request::kHold).refusal, Refusal::kNone);
  EXPECT_EQ(rig.run(100).phase, Phase::kDisarmed);
  EXPECT_EQ(rig.tick(Request::kHold).refusal, Refusal::kNotArmed);
}

// A segment that was ordered and ends at rest, and one that goes on: nothing is emulated after it.
TEST(Orders, ThrustersFireWhileTheVehicleIsEmulatedOnly) {
  Order fire;
  fire.request = Request::kThrust;
  fire.thrust(1) = 0.5;
  for (const bool moves : {false, true}) {
    Rig rig(experiment("satellite_jets", {"base.free.rate_deg_per_s=[0, 0, 0]",
                                          fmt::format("base.free.velocity_m_per_s=[{}, 0, 0]",
                                                      moves ? 0.005 : 0.0)}));
    rig.arm();
    rig.order(Request::kRun, segment(SegmentKind::kCalibration));
    rig.until(Phase::kArmed);
    EXPECT_EQ(rig.give(fire).refusal, Refusal::kNotEmulated);
    rig.order(Request::kRun, segment(SegmentKind::kAdmittance, 1.0));
    for (int i = 0; i < 20; ++i) EXPECT_TRUE(rig.tick().thrust.left.isZero(0.0)) << i;  // no order
    rig.until(Phase::kArmed);
    EXPECT_EQ(rig.give(fire).refusal, Refusal::kNotEmulated) << moves;
    rig.order(Request::kRun, segment(SegmentKind::kAdmittance, 1.0));
    EXPECT_EQ(rig.give(fire).refusal, Refusal::kNone);
    EXPECT_GT(rig.tick().thrust.left(1), 0.4);
  }
}

// What is said of a vehicle is of one that is emulated.
TEST(Orders, NothingIsSaidOfAVehicleThatIsGone) {
  Rig rig(
      experiment("satellite_puma",
                 {"base.free.velocity_m_per_s=[0.05, 0, 0]",
                  "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 6.08}}]"}));
  rig.tick(Request::kStart);
  double least = 1.0;
  bool after = false;
  while (!test::done(rig.tick())) {
    const TickState& s = rig.state();
    if (s.kind == SegmentKind::kAdmittance) {
      least = std::min(least, s.envelope_scale);
    } else {
      after = after || least < 1.0;
      EXPECT_EQ(s.envelope_scale, 1.0) << s.tick;
      EXPECT_EQ(s.passivity_damping, 0.0) << s.tick;
    }
  }
  EXPECT_LT(least, 1.0);
  EXPECT_TRUE(after);
}

// Also where what was commanded was meant for the tick to come.
TEST(Orders, AFreezeHoldsWhatIsDesired) {
  Rig rig(experiment("satellite_puma", {"base.free.velocity_m_per_s=[0.005, 0, 0]"}));
  rig.arm();
  rig.order(Request::kRun, segment(SegmentKind::kCalibration));
  rig.until(Phase::kArmed);
  rig.order(Request::kRun, segment(SegmentKind::kAdmittance, 10.0));
  rig.run(100);
  ASSERT_GT((rig.state().motion.x - rig.state().desired).norm(), 1e-5);
  rig.disturb([](Sample& s) { s.switches = 0; });
  EXPECT_EQ(rig.tick().phase, Phase::kStopped);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(rig.tick().desired, rig.state().motion.x);
}

TEST(Orders, HoldBrakesAlongTheMotionAndStaysThere) {
  Rig rig(experiment("z_sine"));
  rig.arm();
  rig.order(Request::kRun, sine(2, 0.2, 0.5, 4.0));
  rig.run(200);  // upwards through the middle
  Vec6 v = rig.state().motion.x_dot;
  ASSERT_GT(v(2), 0.6);
  double x = rig.tick(Request::kHold).motion.x(2);
  for (; rig.state().phase == Phase::kRunning; rig.tick()) {
    EXPECT_GE(rig.state().motion.x_dot(2), -1e-12);       // never back
    EXPECT_LE(rig.state().motion.x_dot(2), v(2) + 0.05);  // a quintic from this rate
    EXPECT_GE(rig.state().motion.x(2), x - 1e-12);
    x = rig.state().motion.x(2);
  }
  EXPECT_EQ(rig.state().phase, Phase::kArmed);
  x = rig.state().motion.x(2);
  EXPECT_EQ(rig.run(200).motion.x(2), x);
}

TEST(Orders, AResetWaitsForTheCauseAndNothingMovesByItself) {
  Rig rig(experiment("z_sine"));
  rig.arm();
  rig.order(Request::kRun, sine(2, 0.1, 0.5, 4.0));
  rig.run(150);
  rig.disturb([](Sample& s) { s.switches = kFloorMatClosed; });
  EXPECT_EQ(rig.tick().cause, Check::kPanicButton);
  rig.run(50);
  EXPECT_EQ(rig.tick(Request::kReset).refusal, Refusal::kCauseRemains);
  rig.disturb(nullptr);
  rig.run(5);
  EXPECT_EQ(rig.state().phase, Phase::kStopped);
  EXPECT_EQ(rig.tick(Request::kReset).phase, Phase::kDisarmed);
  EXPECT_EQ(rig.state().cause, Check::kCount);
  EXPECT_FALSE(rig.state().latched.any());
  EXPECT_EQ(rig.run(500).phase, Phase::kDisarmed);
  const Vec6 measured = rig.arm().measured.stacked();
  EXPECT_EQ(rig.state().motion.x, measured);
}

TEST(Orders, ReleasingAButtonMovesNothing) {
  Rig rig(experiment("z_sine"));
  rig.run(20);
  rig.disturb([](Sample& s) { s.switches = kFloorMatClosed; });
  rig.run(2);
  EXPECT_EQ(rig.tick(Request::kStart).refusal, Refusal::kCauseRemains);
  rig.disturb(nullptr);
  EXPECT_EQ(rig.run(300).phase, Phase::kDisarmed);
  // Ordered just before it is pressed, while the stream is still young.
  Rig young(experiment("z_sine"));
  young.run(2);
  EXPECT_EQ(young.tick(Request::kStart).refusal, Refusal::kNone);
  young.disturb([](Sample& s) { s.switches = 0; });
  young.run(2);
  young.disturb(nullptr);
  EXPECT_EQ(young.run(300).phase, Phase::kDisarmed);
}

TEST(Orders, ASegmentThatEndsInMotionBrakes) {
  const Experiment e = experiment("z_sine");
  for (const Segment& s : {sine(2, 0.2, 0.5, 4.0), sine(0, 0.1, 1.0, 2.0)}) {
    Rig rig(e);
    rig.arm();
    rig.order(Request::kRun, s);
    rig.run(2);
    Vec6 last = rig.state().motion.x_dot;
    rig.until([&](const TickState& now) {
      // No more than the sine itself asks for, or gentle braking with a quintic's peak.
      EXPECT_LT((now.motion.x_dot - last).norm(), 0.06) << now.tick;
      last = now.motion.x_dot;
      return now.phase == Phase::kArmed;
    });
    EXPECT_EQ(rig.state().phase, Phase::kArmed);
    EXPECT_EQ(rig.state().motion.x_dot.norm(), 0.0);
  }
}

TEST(Orders, ARefusedCalibrationOfBeforeDoesNotEndALaterProgram) {
  const Experiment e = experiment("ramp", {"controller.still.deviation_counts=0.001"});
  Rig rig(e);
  rig.arm();
  rig.order(Request::kRun, segment(SegmentKind::kCalibration));
  rig.until(Phase::kArmed);
  ASSERT_EQ(rig.state().calibration, CalibrationStatus::kRefused);
  rig.tick(Request::kStart);
  int last = -1;
  rig.until([&](const TickState& s) {
    if (s.phase == Phase::kRunning) last = s.segment;
    return s.phase == Phase::kReturning;
  });
  EXPECT_EQ(last, e.controller.program.size - 1);
  EXPECT_FALSE(rig.state().aborted);
}

TEST(Orders, AWatchInRealTimeIsNoOverrun) {
  // Nothing is passed over there: every tick comes.
  Rig rig(experiment("z_sine"));
  rig.arm();
  rig.order(Request::kRun, sine(2, 0.1, 0.5, 2.0));
  rig.until(Phase::kArmed);
  Segment watch = segment(SegmentKind::kMonitor, 20.0);
  watch.interval = 60.0;
  rig.order(Request::kRun, watch);
  // The plant has gone ahead by a whole interval and stands; its clock goes on all the same.
  std::int64_t later = 0;
  rig.disturb([&](Sample& s) {
    later += 10'000'000;
    for (std::int64_t* time : {&s.time, &s.legs_time, &s.wrench_time, &s.joints_time})
      *time += later;
  });
  for (int i = 0; i < 500; ++i) {
    rig.in().tick -= rig.state().idle;
    ASSERT_EQ(rig.tick().phase, Phase::kRunning) << name(rig.state().cause);
  }
}

// --- Logs of orders ------------------------------------------------------------------------------

TEST(Orders, AreInTheLogAndReplayExactly) {
  const std::string log =
      (fs::temp_directory_path() / ("ves_orders_" + std::to_string(getpid()))).string();
  const std::string without = log + "_without";
  {
    LogWriter writer(log);
    std::int64_t n = 0;
    const auto operate = [&](const TickState& state) -> Order {
      ++n;
      if (n == 1) return {Request::kArm, {}, {}};
      if (n == 100) return {Request::kRun, segment(SegmentKind::kCalibration), {}};
      if (n == 150) return {Request::kRun, sine(0, 0.1, 1.0, 1.0), {}};  // refused: busy
      if (n == 400) return {Request::kRun, sine(2, 0.05, 0.5, 3.0), {}};
      if (n == 500) return {Request::kTare, {}, {}};
      if (n == 600) return {Request::kHold, {}, {}};
      if (n == 700) return {Request::kRun, segment(SegmentKind::kAdmittance, 2.0), {}};
      if (n > 700 && state.phase == Phase::kArmed) return {Request::kStop, {}, {}};
      return {};
    };
    const RunResult result =
        runLockstep(experiment("puma_on_table_4_1"), &writer, operate, Request::kNone);
    EXPECT_TRUE(result.good());
  }
  const ReplayResult r = replay(log, {}, nullptr);
  EXPECT_GT(r.ticks, 900);
  EXPECT_EQ(r.different, 0);
  {
    LogReader reader(log);
    LogWriter writer(without);
    LogEvent event;
    while (reader.next(event))
      if (event.channel != channel::kOperator)
        writer.write(event.channel, event.data.data(), static_cast<std::int64_t>(event.data.size()),
                     event.time_us * 1000);
  }
  EXPECT_NE(test::refusal([&] {
              replay(without, {}, nullptr);
            }).find("followed order 0, which is not in this log"),
            std::string::npos);
  // Of a log that began after its configuration was announced, with the same one named.
  {
    LogReader reader(log);
    LogWriter writer(without);
    LogEvent event;
    while (reader.next(event))
      if (event.channel != channel::kExperiment)
        writer.write(event.channel, event.data.data(), static_cast<std::int64_t>(event.data.size()),
                     event.time_us * 1000);
  }
  EXPECT_NE(test::refusal([&] { replay(without, {}, nullptr); }).find("--with names one"),
            std::string::npos);
  const Experiment named = experiment("puma_on_table_4_1");
  ReplayOptions with;
  with.with = &named;
  EXPECT_EQ(replay(without, with, nullptr).different, 0);
  fs::remove(log);
  fs::remove(without);
}

// --- The long look at the sensor -----------------------------------------------------------------

TEST(Watch, SixtyFiveHoursFollowTheTemperature) {
  // 4.1.2: a bias of drift times the temperature beside it; 131 looks, 30 minutes apart.
  const Experiment e = experiment("sensor_drift");
  const RecordedRun run = recordLockstep(e);
  EXPECT_TRUE(run.result.good());
  EXPECT_NEAR(run.result.simulated, 234001.0, 10.0);
  const std::vector<DriftSample> looks = driftSamples(run.series);
  ASSERT_EQ(looks.size(), 131u);
  std::vector<int> samples(looks.size());
  std::int64_t begun = -1;
  for (const Row& row : run.series.rows) {
    if (row.state.kind != static_cast<int>(SegmentKind::kMonitor)) continue;
    if (begun < 0) begun = row.state.header.sequence;
    ++samples.at(static_cast<std::size_t>((row.state.header.sequence - begun) / 180'000));
  }
  const Mat6 C = e.controller.sensor.C_proc;
  const double t0 = looks[0].t;
  for (std::size_t i = 0; i < looks.size(); ++i) {
    const DriftSample& l = looks[i];
    EXPECT_EQ(samples[i], 100);
    EXPECT_NEAR(l.t - t0, 1800.0 * static_cast<double>(i), 1e-6);
    const double warmer = 1.25 * std::sin(2.0 * M_PI * l.t / 86400.0);
    EXPECT_NEAR(l.temperature, e.plant.climate.mean + warmer, 0.01) << i;
    const Vec6 counts = e.plant.sensor.drift / e.plant.sensor.volts_per_count * warmer;
    const Wrench drift = transfer(e.controller.sensor.X_PS, Wrench::from(C * counts));
    // Two means of 100 correlated samples, each within 4 standard errors of 0.9 counts.
    const double z = 4.0 * 0.9 * M_SQRT2 * std::abs(C(2, 2)) + 0.05;
    EXPECT_NEAR(l.wrench(2) - looks[0].wrench(2), drift.f.z(), 2.0 * z) << l.t - t0;
  }
}

struct Named {
  const char* name;
  Order order;
};
const std::vector<Named>& everyOrder() {
  static const std::vector<Named> all = [] {
    std::vector<Named> out;
    for (int i = 1; i < static_cast<int>(Request::kCount); ++i) {
      const auto request = static_cast<Request>(i);
      if (request == Request::kRun) continue;
      Order order{request, {}, {}};
      if (request == Request::kVehicle) {
        order.vehicle.to.mass = 2.0;
        order.vehicle.over = 0.5;
        order.verdict = {Stability::kStable, Stability::kStable};
      }
      if (request == Request::kThrust) order.thrust(0) = 0.1;
      out.push_back({name(request).data(), order});
    }
    Segment move = segment(SegmentKind::kMove, 3.0);  // gone through over some ticks
    move.target.p = {0.02, 0.0, 0.03};
    Segment watch = segment(SegmentKind::kMonitor, 3.0);
    watch.interval = 1.0;
    out.push_back({"move", {Request::kRun, move, {}}});
    out.push_back({"trajectory", {Request::kRun, sine(2, 0.02, 0.7, 3.0), {}}});
    out.push_back({"admittance", {Request::kRun, segment(SegmentKind::kAdmittance, 3.0), {}}});
    out.push_back({"calibration", {Request::kRun, segment(SegmentKind::kCalibration), {}}});
    out.push_back({"monitor", {Request::kRun, watch, {}}});
    return out;
  }();
  return all;
}

#ifdef VES_SANITIZE
constexpr int kPairs = 7;  // one in so many
#else
constexpr int kPairs = 1;
#endif

class OrdersInPhase : public testing::TestWithParam<int> {};

// Any two orders, whatever is under way: each is answered, nothing jumps, and a hold ends it.
TEST_P(OrdersInPhase, AreAnsweredWithoutAJumpAndAHoldEndsThem) {
  const Named& under_way = everyOrder()[static_cast<std::size_t>(GetParam())];
  static const Experiment e = experiment("puma_on_table_4_1", test::kCompensated);
  int pair = 0;
  for (const int since : {1, 60})
    for (const Named& one : everyOrder())
      for (const Named& two : everyOrder()) {
        if (pair++ % kPairs != 0) continue;
        SCOPED_TRACE(testing::Message() << under_way.name << ", " << since << " ticks later "
                                        << one.name << ", then " << two.name);
        test::ObedientMachine machine(e);
        machine.rest(11);
        machine.order(Request::kArm);
        machine.rest(12);
        std::vector<std::int64_t> open;
        Vec6 x = machine.first().motion.x, v = machine.first().motion.x_dot;
        bool loose = false;  // where the legs are not ours the pose is the measured one
        bool held = false;   // it rests since a hold
        const auto tick = [&] {
          machine.tick(Vec6::Unit(0) * 10.0);
          const TickState& s = machine.first();
          if (s.refusal != Refusal::kChecking) std::erase(open, s.order.sequence);
          ASSERT_EQ(s.cause, Check::kCount) << name(s.cause);
          ASSERT_TRUE(s.motion.x.allFinite());
          if (s.command.engaged && !loose) {
            ASSERT_LT((s.motion.x_dot - v).norm(), 0.1) << "tick " << s.tick;
            ASSERT_LT((s.motion.x - x - 0.005 * (s.motion.x_dot + v)).norm(), 5e-4)
                << "tick " << s.tick;
          }
          const bool alone = s.request == Request::kNone || s.request == Request::kHold;
          if (held && alone) {
            ASSERT_TRUE(s.motion.x_dot.isZero(0.0)) << "tick " << s.tick;
          }
          const bool obeyed = s.request == Request::kHold && s.refusal == Refusal::kNone;
          held = (held || obeyed) && alone && s.motion.x_dot.isZero(0.0);
          loose = !s.command.engaged;
          x = s.motion.x;
          v = s.motion.x_dot;
        };
        open.push_back(machine.give(under_way.order));
        for (int n = 0; n < 1 + since && !HasFatalFailure(); ++n) tick();
        open.push_back(machine.give(one.order));
        if (!HasFatalFailure()) tick();
        open.push_back(machine.give(two.order));
        for (int n = 0; n < 30 && !HasFatalFailure(); ++n) tick();
        open.push_back(machine.give({Request::kHold, {}, {}}));
        for (int n = 0; n < 120 && !HasFatalFailure(); ++n) tick();
        if (HasFatalFailure()) return;
        EXPECT_TRUE(open.empty()) << open.front();
        const TickState& s = machine.first();
        EXPECT_TRUE(s.phase == Phase::kArmed || s.phase == Phase::kParked ||
                    s.phase == Phase::kReturning)
            << name(s.phase);
        if (s.phase == Phase::kArmed) {
          EXPECT_TRUE(s.motion.x_dot.isZero(0.0));
        }
      }
}

INSTANTIATE_TEST_SUITE_P(Every, OrdersInPhase,
                         testing::Range(0, static_cast<int>(everyOrder().size())),
                         [](const auto& test) {
                           return std::string(
                               everyOrder()[static_cast<std::size_t>(test.param)].name);
                         });

// Any segment after any other, which most end at speed.
TEST(Program, ASegmentGoesOnFromWhereTheOneBeforeItWas) {
  const char* const kinds[] = {
      "{move: {to: {x_m: 0.03, gamma_deg: 2}, duration_s: 1.5}}",
      "{trajectory: {duration_s: 0.7, z: {sine: {amplitude_m: 0.03, frequency_hz: 0.7}}}}",
      "{trajectory: {duration_s: 0.7, y: {ramp: {to_m: 0.01}}}}",
      "{admittance: {duration_s: 0.5}}",
      "{monitor: {duration_s: 1, interval_s: 1}}",
      "{calibration: {}}",
      ("{path: {rows_m_deg: [[0, 0, 0, 0, 0, 0], [0, 0, 0.0002, 0, 0, 0], [0, 0, 0.0008, 0, 0, 0], "
       "[0, 0, 0.0018, 0, 0, 0]]}}")};
  for (const char* one : kinds)
    for (const char* two : kinds) {
      const std::string first = one;  // a recorded path begins where it says, and there is one
      if (std::string(two).find("path") != std::string::npos &&
          first.find("monitor") == std::string::npos &&
          first.find("calibration") == std::string::npos)
        continue;
      SCOPED_TRACE(std::string(one) + ", " + two);
      test::ObedientMachine machine(
          experiment("puma_on_table_4_1", {std::string("program=[") + one + ", " + two + "]"}));
      machine.rest(20);
      machine.order(Request::kStart);
      bool ran = false, ours = false;
      Vec6 x = Vec6::Zero(), v = Vec6::Zero();
      for (int n = 0; n < 1500 && machine.first().phase != Phase::kParked; ++n) {
        machine.tick(Vec6::Unit(2) * 30.0);
        const TickState& s = machine.first();
        ASSERT_EQ(s.cause, Check::kCount) << name(s.cause);
        ASSERT_FALSE(s.aborted);
        if (ours) {
          // A sine sets out from rest at 0.03 * 2 pi 0.7 m/s.
          ASSERT_LT((s.motion.x_dot - v).norm(), 0.14) << "tick " << s.tick;
          ASSERT_LT((s.motion.x - x - 0.005 * (s.motion.x_dot + v)).norm(), 7e-4)
              << "tick " << s.tick;
        }
        ours = s.command.engaged;
        ran = ran || s.segment == 1;
        x = s.motion.x;
        v = s.motion.x_dot;
      }
      EXPECT_TRUE(ran);
      EXPECT_EQ(machine.first().phase, Phase::kParked);
      EXPECT_EQ(machine.first().calibration == CalibrationStatus::kDone,
                (first + two).find("calibration") != std::string::npos);
      EXPECT_TRUE(x.isZero(0.0));
    }
}

}  // namespace
}  // namespace ves
