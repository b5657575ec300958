// SPDX-License-Identifier: BSD-3-Clause
//
// What leaves the controller, where the legs come to rest when nothing more does, and how one
// motion goes over into the next: laws 1 to 4 of docs/safety.md, each kind of compensation.
#include <gtest/gtest.h>

#include <cmath>

#include "support/rig.hpp"

namespace ves {
namespace {

using test::experiment;
using test::Rig;

const std::vector<std::string> kFeedForward = {"controller.compensation.feed_forward=true"};
const std::vector<std::string> kAdaptive = {
    "controller.compensation.feed_forward=true", "controller.compensation.observer=true",
    "controller.compensation.inertia=true", "controller.compensation.adaptation=true",
    "controller.compensation.wrench=aided"};

const std::vector<std::string> kNoBias = {"sensor.noise=false", "sensor.bias_v=[0,0,0,0,0,0]"};
const std::vector<std::pair<const char*, std::vector<std::string>>> kCompensations = {
    {"as published", {}},
    {"feed-forward", kFeedForward},
    {"compensated", test::kCompensated},
    {"adapting, aided", kAdaptive}};

enum class End { kFreeze, kControlledStop, kKilled };

/// z, in the middle of a sine, at its largest speed: then the end. The largest excursion [m] beyond
/// the last checked lengths, and where the legs rest from them.
struct Rest {
  double beyond = 0.0, off = 0.0;  // [m]
};
Rest stopAt(End end, double speed, const std::vector<std::string>& set) {
  Rig rig(experiment("z_sine", set));
  rig.arm();
  rig.run(100);  // the compensation is in
  const double frequency = speed / (2.0 * M_PI * 0.15);
  rig.order(Request::kRun, test::sine(2, 0.15, frequency, 20.0));
  rig.run(static_cast<int>(std::lround(100.0 / frequency)));
  Vec6 checked = rig.state().legs.L;
  if (end == End::kFreeze) rig.disturb([](Sample& s) { s.switches = 0; });
  if (end == End::kControlledStop) {
    rig.disturb([](Sample& s) { s.adc[kWrenchChannels] = 0; });
    rig.until(Phase::kStopped);
    checked = rig.state().legs.L;
  }
  Rest rest;
  for (int tick = 0; tick < 200; ++tick) {
    if (end == End::kKilled)
      rig.plant().advance(rig.plant().time() + test::kTick);
    else
      rig.tick();
    rig.plant().sample();
    rest.beyond = std::max(rest.beyond, (rig.plant().truth().legs.L - checked).maxCoeff());
  }
  rest.off = (rig.plant().truth().legs.L - checked).cwiseAbs().maxCoeff();
  if (end != End::kKilled) {
    EXPECT_EQ(rig.state().motion.x_dot.norm() + rig.state().legs.L_dot.norm(), 0.0);
  }
  return rest;
}

TEST(Stopped, LegsComeToRestAtTheLastCheckedLengthsWhateverIsCompensated) {
  const double count = experiment("z_sine").plant.transducer.scale;
  for (const End end : {End::kFreeze, End::kControlledStop, End::kKilled})
    for (const double speed : {0.2, 0.4, 0.6})
      for (const auto& [name, set] : kCompensations) {
        const Rest rest = stopAt(end, speed, set);
        SCOPED_TRACE(fmt::format("{} at {} m/s, end {}: {:.2f} mm beyond", name, speed,
                                 static_cast<int>(end), rest.beyond * 1e3));
        EXPECT_LT(rest.off, 2.0 * count);  // 0.14 mm
        // The way until it is noticed (a tick, or three of silence and one), and 8 ms of the
        // servo's own: valve, LegSlave.
        const double noticed = end == End::kFreeze ? 0.010 : end == End::kKilled ? 0.040 : 0.0;
        EXPECT_LT(rest.beyond, 2.0 * count + (0.008 + noticed) * speed);
      }
}

/// Admittance control that is under way at about `speed` [m/s] in x: an oscillator of 100 kg.
struct Emulating {
  Emulating(double speed, const std::vector<std::string>& set)
      : e(experiment("free_decay", set,
                     {kNoBias[0], kNoBias[1], "controller.gentle_speed_m_per_s=0.5",
                      "base.stiffness_diagonal=[1500, 1500, 1500, 1500, 1000, 2000]",
                      "base.damping_diagonal=[20, 20, 20, 10, 10, 10]",
                      "base.mass_diagonal=[100, 100, 100, 40, 40, 40]"})),
        rig(e) {
    rig.arm();
    rig.run(100);
    const double w = std::sqrt(15.0);
    Segment away = test::segment(SegmentKind::kMove);
    away.target.p.x() = speed / w;
    rig.order(Request::kRun, away);
    rig.until(Phase::kArmed);
    rig.run(100);
    rig.order(Request::kRun, test::segment(SegmentKind::kAdmittance, 30.0));
    rig.run(static_cast<int>(std::lround(100.0 * M_PI / 2.0 / w)));  // through the middle
  }
  Experiment e;
  Rig rig;
};

TEST(AfterAdmittance, TheMotionGoesOnWhereAndWhenItWas) {
  for (const double speed : {0.1, 0.3, 0.5})
    for (const auto& [name, set] : kCompensations)
      for (const Request then : {Request::kHold, Request::kStop, Request::kNone}) {
        SCOPED_TRACE(fmt::format("{} at {} m/s, then {}", name, speed, ves::name(then)));
        Emulating on(speed, set);
        TickState before = on.rig.state();
        ASSERT_NEAR(std::abs(before.motion.x_dot(0)), speed, 0.15 * speed);
        const double T = on.e.controller.periodSeconds();
        const double a = 1.5 * on.e.controller.stop_braking.translation + 15.0 * speed;  // [m/s^2]
        double rate = before.motion.x_dot(0);  // at the instant of `desired`, to a period
        double worst = 0.0;                    // [m] tracking
        if (then == Request::kNone) on.rig.disturb([](Sample& s) { s.adc[kWrenchChannels] = 0; });
        on.rig.tick(then);
        for (int n = 0; n < 60; ++n) {
          const TickState& s = on.rig.state();
          // A period's step, to what the acceleration changes within one.
          EXPECT_NEAR(s.desired(0) - before.desired(0), T * rate, a * T * T) << n;
          EXPECT_LE(std::abs(s.motion.x_dot(0) - before.motion.x_dot(0)), 1.1 * a * T) << n;
          rate = s.desired == s.motion.x ? s.motion.x_dot(0) : before.motion.x_dot(0);
          before = s;
          worst = std::max(worst, std::abs(on.rig.plant().truth().x.p.x() - s.desired(0)));
          on.rig.tick();
        }
        EXPECT_LT(before.motion.x_dot.norm(), 0.5 * speed);
        if (set == test::kCompensated || set == kFeedForward) {
          EXPECT_LT(worst, 0.2e-3 + 2.5e-3 * speed) << "tracking";
        }
      }
}

TEST(Admittance, BeginsWithoutAPauseWhateverShareOfTheCompensationIsIn) {
  for (const int ticks : {0, 5, 25, 200}) {  // after arming: the ramp takes 50
    const Experiment e = experiment(
        "free_decay", test::kCompensated,
        {kNoBias[0], kNoBias[1], "initial_pose={x_m: 0.03}", "controller.compensation.ramp_s=0.5"});
    Rig rig(e);
    rig.arm();
    rig.run(ticks);
    const double share = rig.state().compensation_share;
    rig.order(Request::kRun, test::segment(SegmentKind::kAdmittance, 5.0));
    ASSERT_EQ(rig.state().kind, SegmentKind::kAdmittance);
    // From rest at 30 mm the base swings home: each step longer than the one before.
    double x = rig.state().motion.x(0), step = 0.0;
    for (int n = 0; n < 8; ++n) {
      const TickState& s = rig.tick();
      const double now = s.motion.x(0) - x;
      EXPECT_LE(now, step + 1e-9) << "share " << share << ", tick " << n;
      step = now;
      x = s.motion.x(0);
    }
    EXPECT_LT(step, 0.0);
  }
}

// What the legs do when nobody commands

constexpr std::int64_t kMs = 1'000'000;  // [ns]
constexpr Watchdog kTimes{30 * kMs, 1000 * kMs, 2000 * kMs};
constexpr LegCounts kHome = {1000, 1000, 1000, 1000, 1000, 1000};

LegCounts all(std::int32_t count) {
  LegCounts out;
  out.fill(count);
  return out;
}
LegCommand command(std::int32_t counts, std::int32_t rest, bool park = true) {
  LegCommand out;
  out.engaged = true;
  out.counts = all(counts);
  out.rest = all(rest);
  out.park = park;
  return out;
}

TEST(LegWatchdog, FollowsThenRestsAtTheCheckedLengthsThenGoesHome) {
  LegWatchdog legs(kTimes, all(2000), kHome);
  EXPECT_EQ(legs.reference(5000 * kMs), all(2000));  // nobody has ever commanded
  legs.take(command(3100, 3000), 0);
  EXPECT_EQ(legs.reference(0), all(3100));
  EXPECT_EQ(legs.reference(29 * kMs), all(3100));
  EXPECT_EQ(legs.reference(30 * kMs), all(3000));
  EXPECT_EQ(legs.reference(999 * kMs), all(3000));
  EXPECT_FALSE(legs.parking());
  EXPECT_EQ(legs.reference(2000 * kMs), all(2000));  // half way
  EXPECT_TRUE(legs.parking());
  EXPECT_EQ(legs.reference(9000 * kMs), kHome);
}

TEST(LegWatchdog, StaysWhereTheLastCommandSaidSoOrALoopWasOpened) {
  LegWatchdog told(kTimes, all(2000), kHome);
  told.take(command(3100, 3000, false), 0);
  EXPECT_EQ(told.reference(9000 * kMs), all(3000));
  LegWatchdog opened(kTimes, all(2000), kHome);
  opened.take(command(3100, 3000), 0);
  EXPECT_EQ(opened.reference(2000 * kMs), all(2000));
  opened.loopOpened();
  for (const std::int64_t t : {2001, 3000, 9000}) EXPECT_EQ(opened.reference(t * kMs), all(2000));
  EXPECT_FALSE(opened.parking());
}

TEST(LegWatchdog, ACommandThatDoesNotEngageEndsAHomecomingWhereItIs) {
  LegWatchdog legs(kTimes, all(2000), kHome);
  legs.take(command(3100, 3000), 0);
  EXPECT_EQ(legs.reference(2000 * kMs), all(2000));
  legs.take({}, 2000 * kMs);
  EXPECT_FALSE(legs.parking());
  LegCounts before = all(2000);
  for (std::int64_t t = 2000; t <= 3000; t += 10) EXPECT_EQ(legs.reference(t * kMs), before);
  // Silent again: home from there, with no leap.
  for (std::int64_t t = 3000; t <= 5100; t += 10) {
    const LegCounts now = legs.reference(t * kMs);
    EXPECT_LE(std::abs(now[0] - before[0]), 6) << t;
    before = now;
  }
  EXPECT_EQ(before, kHome);
}

TEST(LegWatchdog, ASecondSilenceIsAsTheFirst) {
  for (const bool park : {true, false}) {
    LegWatchdog used(kTimes, all(2000), kHome), fresh(kTimes, all(2000), kHome);
    used.take(command(2500, 2400), 0);
    used.reference(2000 * kMs);
    ASSERT_TRUE(used.parking());
    for (LegWatchdog* one : {&used, &fresh}) one->take(command(3100, 3000, park), 4000 * kMs);
    for (std::int64_t t = 4000; t <= 9000; t += 10) {
      ASSERT_EQ(used.reference(t * kMs), fresh.reference(t * kMs)) << t << park;
      ASSERT_EQ(used.parking(), fresh.parking()) << t << park;
    }
  }
}

TEST(LegWatchdog, WhoIsNoLongerEngagedStaysAtTheCheckedLengths) {
  LegWatchdog legs(kTimes, all(2000), kHome);
  legs.take(command(3100, 3000), 0);
  legs.take({}, 5 * kMs);
  EXPECT_EQ(legs.reference(5 * kMs), all(3000));
}

// An operator's order does not end what the program began

TEST(Plant, AnOperatorsHoldEndsNoFaultAndHoldsNoTargetAgain) {
  const Experiment e = experiment(
      "z_sine", {"program=[{trajectory: {duration_s: 20, z: {sine: {amplitude_m: 0.05, "
                 "frequency_hz: 0.5}}}, faults: [{at_s: 1, duration_s: 100, fault: pressure, "
                 "volts: 2.9}]}]"});
  Rig rig(e);
  rig.run(20);
  rig.tick(Request::kStart);
  rig.until(Phase::kRunning);
  rig.run(120);
  Sample seen;
  rig.disturb([&](Sample& s) { seen = s; });
  rig.tick();
  const std::int32_t faulty = seen.adc[kWrenchChannels];
  rig.tick(Request::kHold);
  rig.run(50);
  EXPECT_EQ(seen.adc[kWrenchChannels], faulty);
}

}  // namespace
}  // namespace ves
