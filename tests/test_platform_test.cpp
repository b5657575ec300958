// SPDX-License-Identifier: BSD-3-Clause
//
// testPlatform on a machine that goes exactly where it is told.
#include <gtest/gtest.h>

#include <limits>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/control/test_platform.hpp"

namespace ves {
namespace {

using test::experiment;
using test::kNan;
using test::segment;

/// A controller on a machine that goes exactly where it is told, at once.
class Bench {
 public:
  explicit Bench(const std::string& scenario, const std::vector<std::string>& set = {},
                 const Pose& found = {{0.01, -0.02, -0.05}, {0.02, 0.0, 0.01}})
      : Bench(experiment(scenario, set), found) {}
  Bench(const Experiment& e, const Pose& found) : e_(e), platform_(e_.controller) {
    const Geometry& g = e_.controller.geometry;
    in_.sample.legs = legCounts(e_.controller.legs, legLengths(g, g.fromHome(found)));
    in_.sample.q = e_.plant.task.initial_joints;
    in_.sample.switches = kAllSwitchesClosed;
    in_.sample.adc[6] = (e_.controller.safety.pressure_min + e_.controller.safety.pressure_max) / 2;
    in_.order.request = Request::kStart;
  }
  const TickState& tick() {
    Sample& s = in_.sample;
    s.time = s.legs_time = s.wrench_time = s.joints_time = ++s.sequence * 10'000'000;
    s.adc[0] ^= 1;  // alive
    const TickState& state = platform_.tick(in_);
    ++in_.tick;
    in_.order.request = Request::kNone;
    if (state.command.engaged) in_.sample.legs = state.command.counts;
    return state;
  }
  const TickState& tickUntil(Phase phase) {
    const TickState* state = &tick();
    for (int i = 0; i < 5000 && state->phase != phase; ++i) state = &tick();
    return *state;
  }
  TickInput& in() { return in_; }
  const Experiment& experimentUsed() const { return e_; }

 private:
  Experiment e_;
  TestPlatform platform_;
  TickInput in_;
};

TEST(TestPlatform, OnlyAWatchPassesTicksOver) {
  Bench bench("sensor_drift");
  constexpr std::int64_t kInterval = 180'000, kLook = 100;  // [tick]
  std::int64_t watched = 0;
  for (int i = 0; i < 3000 && watched < 150; ++i) {
    const TickState& s = bench.tick();
    const bool watches = s.kind == SegmentKind::kMonitor;
    EXPECT_EQ(s.idle, watches && watched >= kLook - 1 ? kInterval - watched - 1 : 0) << watched;
    watched += watches;
  }
  ASSERT_EQ(watched, 150);
  bench.in().order.request = Request::kStop;  // in the middle of what it would pass over
  for (int i = 0; i < 20; ++i) {
    const TickState& s = bench.tick();
    EXPECT_NE(s.kind, SegmentKind::kMonitor) << i;
    EXPECT_EQ(s.idle, 0) << i;
  }
}

TEST(TestPlatform, FirstCommandIsTheMeasuredPose) {
  Bench bench("z_sine");
  const LegCounts found = bench.in().sample.legs;
  for (int i = 0; i < 100; ++i) {
    const TickState& state = bench.tick();
    if (!state.command.engaged) continue;
    EXPECT_EQ(state.phase, Phase::kArmed);
    for (std::size_t k = 0; k < kLegs; ++k)
      EXPECT_LE(std::abs(state.command.counts[k] - found[k]), 1);
    return;
  }
  FAIL() << "never armed";
}

TEST(TestPlatform, ArmsOnlyAfterAFreshStream) {
  Bench bench("z_sine");
  for (int i = 0; i < 50; ++i) {
    if (i % 5 == 0) --bench.in().sample.sequence;  // every fifth sample is the one before
    EXPECT_EQ(bench.tick().phase, Phase::kDisarmed);
  }
  for (int i = 0; i < 11; ++i) bench.tick();
  EXPECT_EQ(bench.tick().phase, Phase::kRunning);
}

TEST(TestPlatform, RefusesToArmBesideAnotherController) {
  Bench bench("z_sine");
  for (int i = 0; i < 50; ++i) {
    bench.in().conflicting_node = i % 2 == 0;
    bench.tick();
  }
  bench.in().conflicting_node = true;
  const TickState& state = bench.tick();
  EXPECT_EQ(state.phase, Phase::kDisarmed);
  EXPECT_TRUE(state.tripped.has(Check::kConflictingNode));
}

TEST(TestPlatform, ComesHomeGentlyAndParks) {
  Bench bench("ramp");
  const TickState& state = bench.tickUntil(Phase::kParked);
  EXPECT_EQ(state.phase, Phase::kParked);
  EXPECT_EQ(state.motion.x.norm(), 0.0);
  EXPECT_EQ(state.motion.x_dot.norm(), 0.0);
}

TEST(TestPlatform, StopRequestComesHomeWithoutAJump) {
  Bench bench("z_sine");
  while (bench.tick().segment < 1) {
  }
  for (int i = 0; i < 180; ++i) bench.tick();  // in full swing
  const double rate = bench.tick().motion.x_dot(2);
  EXPECT_GT(std::abs(rate), 0.2);
  bench.in().order.request = Request::kStop;
  const Vec6 before = bench.tick().motion.x_dot;
  EXPECT_NEAR(before(2), rate, 0.05);
  EXPECT_EQ(bench.tickUntil(Phase::kParked).phase, Phase::kParked);
}

struct Fault {
  const char* name;
  Check check;
  void (*inject)(TickInput&);
};
std::ostream& operator<<(std::ostream& out, const Fault& fault) { return out << fault.name; }

class Trips : public testing::TestWithParam<Fault> {};

TEST_P(Trips, LatchesAndHoldsTheLastCheckedLengths) {
  Bench bench("puma_tilt");
  bench.tickUntil(Phase::kRunning);
  for (int i = 0; i < 400; ++i) bench.tick();
  const LegCounts last = bench.tick().command.counts;
  GetParam().inject(bench.in());
  const TickState& state = bench.tick();
  EXPECT_EQ(state.phase, Phase::kStopped);
  EXPECT_EQ(state.cause, GetParam().check);
  EXPECT_EQ(state.cause_tick, state.tick);
  EXPECT_EQ(state.command.counts, last);
  EXPECT_TRUE(state.command.engaged);
  // The cause goes away; the stop stays.
  bench.in().sample.switches = kAllSwitchesClosed;
  bench.in().sample.q = bench.experimentUsed().plant.task.initial_joints;
  bench.in().conflicting_node = false;
  for (int i = 0; i < 100; ++i) {
    bench.in().sample.legs = last;
    EXPECT_EQ(bench.tick().command.counts, last);
  }
  EXPECT_EQ(bench.tick().phase, Phase::kStopped);
  EXPECT_EQ(bench.tick().cause, GetParam().check);
}

INSTANTIATE_TEST_SUITE_P(
    Faults, Trips,
    testing::Values(
        Fault{"panic_button", Check::kPanicButton,
              [](TickInput& in) { in.sample.switches &= ~kPanicButtonClosed; }},
        Fault{"floor_mat", Check::kFloorMat,
              [](TickInput& in) { in.sample.switches &= ~kFloorMatClosed; }},
        Fault{"joint_angle_nan", Check::kFinite, [](TickInput& in) { in.sample.q(2) = kNan; }},
        Fault{"joint_angle_infinite", Check::kFinite,
              [](TickInput& in) { in.sample.q(0) = std::numeric_limits<double>::infinity(); }},
        Fault{"second_controller", Check::kConflictingNode,
              [](TickInput& in) { in.conflicting_node = true; }}),
    [](const auto& test) { return std::string(test.param.name); });

struct Crossing {
  const char* name;
  Check check;
  const char* scenario;
  const char* limit;  // that the program crosses, and no other
  const char* program = nullptr;
};
std::ostream& operator<<(std::ostream& out, const Crossing& crossing) {
  return out << crossing.name;
}

class Limits : public testing::TestWithParam<Crossing> {};

TEST_P(Limits, StopTheProgramThatCrossesThem) {
  const Crossing& c = GetParam();
  std::vector<std::string> set;
  if (c.program) set.push_back(c.program);
  // Such a program is refused when it is read: the limit comes afterwards.
  EXPECT_NE(test::refusal([&] {
              std::vector<std::string> both = set;
              both.emplace_back(c.limit);
              experiment(c.scenario, both);
            }).find(fmt::format("the {} check would stop the run", name(c.check))),
            std::string::npos);
  Experiment e = experiment(c.scenario, set);
  e.controller.safety = experiment(c.scenario, {c.limit, "program=[{move: {}}]"}).controller.safety;
  Bench bench(e, Pose{});
  LegCounts last{};
  const TickState* state = nullptr;
  for (int i = 0; i < 3000; ++i) {
    state = &bench.tick();
    if (state->phase == Phase::kStopped || state->phase == Phase::kParked) break;
    last = state->command.counts;
  }
  ASSERT_EQ(state->phase, Phase::kStopped);
  EXPECT_EQ(state->cause, c.check) << name(state->cause);
  EXPECT_EQ(state->tripped.bits(), 1u << static_cast<unsigned>(c.check));  // it alone
  EXPECT_EQ(state->command.counts, last);
}

INSTANTIATE_TEST_SUITE_P(
    Checks, Limits,
    testing::Values(
        Crossing{"motion", Check::kMotionLimits, "z_sine", "safety.translation_m=0.1"},
        Crossing{"actuator_long", Check::kActuatorLimits, "z_sine", "safety.leg_max_m=1.6"},
        Crossing{"actuator_short", Check::kActuatorLimits, "z_sine", "safety.leg_min_m=1.45"},
        Crossing{"joint", Check::kJointLimits, "alpha_sine", "safety.joint_cone_deg=10"},
        // Legs hardly approach each other in one coordinate: 0.1529 m at 30 degrees, 0.1531 m at
        // home.
        Crossing{"collide", Check::kCollide, "alpha_sine", "safety.leg_clearance_m=0.1530",
                 "program=[{trajectory: {duration_s: 4, alpha: {ramp: {to_deg: 29.9}}}}]"},
        Crossing{"velocity", Check::kVelocity, "z_sine", "safety.leg_velocity_m_per_s=0.3"},
        Crossing{"flow", Check::kFlow, "z_sine", "safety.flow_l_per_s=0.3"}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(TestPlatform, SilenceTripsAfterTheAllowedAge) {
  Bench bench("puma_tilt");
  bench.tickUntil(Phase::kRunning);
  const int allowed = bench.experimentUsed().controller.safety.stale_ticks;
  for (int i = 1; i <= allowed; ++i) {
    --bench.in().sample.sequence;
    EXPECT_EQ(bench.tick().phase, Phase::kRunning) << i;
  }
  --bench.in().sample.sequence;
  const TickState& state = bench.tick();
  EXPECT_EQ(state.cause, Check::kStale);
  EXPECT_EQ(bench.tickUntil(Phase::kStopped).phase, Phase::kStopped);
}

TEST(TestPlatform, NoJointAngleEverReachesACommandAsNan) {
  // Disarmed, arming, in a move, calibrating, in admittance control: at each moment anew, because a
  // run is frozen by its first such sample.
  for (const int moment : {0, 5, 11, 12, 40, 200, 400, 700}) {
    Bench bench("puma_on_table_4_1");
    for (int i = 0; i < moment; ++i) bench.tick();
    const TickState before = bench.tick();
    bench.in().sample.q(2) = kNan;
    for (int i = 0; i < 3; ++i) {
      const TickState& state = bench.tick();
      ASSERT_TRUE(state.motion.x.allFinite()) << moment;
      ASSERT_TRUE(state.legs.L.allFinite()) << moment;
      if (!before.command.engaged) {
        ASSERT_FALSE(state.command.engaged) << moment;
      } else {
        ASSERT_EQ(state.phase, Phase::kStopped) << moment;
        ASSERT_EQ(state.command.counts, before.command.counts) << moment;
      }
    }
  }
}

TEST(TestPlatform, AfterALongStallItLetsGoOfLegsThatWentHomeAlone) {
  // z_sine's platform, raised; its legs have patience for a second and take two to go home.
  const Experiment e =
      experiment("z_sine", {"legs.watchdog.park_after_s=1", "legs.watchdog.park_time_s=2"});
  for (const int missed : {50, 98, 99, 400}) {
    test::Rig rig(e);
    rig.arm();
    Segment up = segment(SegmentKind::kMove);
    up.target.p.z() = 0.1;
    rig.order(Request::kRun, up);
    rig.until(Phase::kArmed);
    rig.run(100);
    const Vec6 raised = rig.state().legs.L;
    rig.in().tick += missed;
    rig.plant().advance(rig.in().tick * test::kTick);
    rig.plant().sample();
    const Vec6 found = rig.plant().truth().legs.L;
    const bool alone = missed + 1 >= 100;
    EXPECT_EQ((found - raised).norm() > 1e-3, missed == 400) << missed;
    rig.tick();
    EXPECT_EQ(rig.state().latched.has(Check::kLeftAlone), alone) << missed;
    rig.run(200);
    EXPECT_EQ(rig.state().phase, Phase::kStopped);
    EXPECT_EQ(rig.state().command.engaged, !alone) << missed;
    // Nothing leaps: they stay where they were found.
    rig.plant().sample();
    const Vec6 moved = rig.plant().truth().legs.L - (alone ? found : raised);
    EXPECT_LT(moved.cwiseAbs().maxCoeff(), 1e-3) << missed;
    rig.tick(Request::kReset);
    rig.arm();
    rig.run(50);
    rig.plant().sample();
    EXPECT_EQ(rig.state().phase, Phase::kArmed);
    EXPECT_LT((rig.plant().truth().legs.L - (alone ? found : raised)).cwiseAbs().maxCoeff(), 1e-3);
  }
}

TEST(TestPlatform, AfterAResetNothingMovesWithoutANewOrderInWhicheverTickTheTripCame) {
  const Experiment e = experiment("z_sine");
  for (const Request request : {Request::kStart, Request::kArm})
    for (int tick = 0; tick < 25; ++tick) {
      test::Rig rig(e);
      rig.run(8);  // it arms two or three ticks later
      rig.tick(request);
      rig.run(tick);
      rig.disturb([](Sample& s) { s.switches = 0; });
      rig.tick();
      rig.disturb([](Sample&) {});
      rig.run(20);
      if (rig.state().phase == Phase::kStopped) rig.tick(Request::kReset);
      rig.run(300);
      EXPECT_EQ(rig.state().phase, Phase::kDisarmed) << name(request) << " " << tick;
      EXPECT_FALSE(rig.state().command.engaged) << name(request) << " " << tick;
    }
}

}  // namespace
}  // namespace ves
