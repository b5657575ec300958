// SPDX-License-Identifier: BSD-3-Clause
//
// The control path and the plant's stepping never touch the heap, whatever the tick does.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "support/malloc_guard.hpp"
#include "support/rig.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

using test::experiment;

TEST(MallocGuard, CountsAnAllocation) {  // the test that the others can fail
  test::MallocGuard guard;
  std::unique_ptr<int> p(new int(1));
  EXPECT_GE(guard.count(), 1);
}

constexpr const char* kCompensated =
    "controller.compensation={feed_forward: true, observer: true, inertia: true, "
    "mass_update_ticks: 3, ramp_s: 0.5, reading_jitter_s: 0.001, adaptation: true, "
    "adaptation_limit: 1.25, forgetting_s: 60, wrench: aided, learns_masses: true, "
    "gate_deviations: 4.5, "
    "gate_hold_s: 0.1, timing_error_s: 0.0005, gain_error: 0.05, mass_error: 0.05}";

class NoHeap : public testing::TestWithParam<const char*> {};

void expectNoHeap(const Experiment& e) {
  TestPlatform platform(e.controller);
  plant::Plant plant(e.plant);
  TickInput in;
  in.order.request = Request::kStart;
  const TickState* state = nullptr;
  test::MallocGuard guard;
  for (; in.tick < 6000 && !(state && test::done(*state)); ++in.tick) {
    in.time = in.tick * e.controller.period;
    in.sample = plant.sample();
    state = &platform.tick(in);
    plant.command(state->command);
    plant.advance((in.tick + 1) * e.controller.period);
  }
  const std::int64_t calls = guard.count();
  EXPECT_EQ(calls, 0);
  EXPECT_EQ(state->phase, Phase::kParked);
}

TEST_P(NoHeap, FromArmingToParking) {
  for (const char* base :
       {"seed=1", kCompensated, "sensor.readings_per_tick=4", "legs.model=hydraulic",
        "base={mass_diagonal: [500,500,500,250,250,250], damping_diagonal: "
        "[500,400,300,200,100,90], stiffness_diagonal: [1500,2500,4000,1500,1000,2000]}"})
    expectNoHeap(experiment(GetParam(), {base, "base.weight=removed"}));
}

TEST(NoHeapOnAShip, FromArmingToParking) { expectNoHeap(experiment("ship_arm")); }

TEST(NoHeapInFlight, WhileMassesAreLearnt) {
  expectNoHeap(experiment(
      "satellite_tumbling",
      {"controller.compensation.learns_masses=true", "plant_mismatch={mass: 1.05}",
       "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 12}, robot: [{at_s: 1, "
       "duration_s: 2, joint: joint_1, to_deg_or_m: 40}, {at_s: 5, gripper: true}]}]"}));
}

TEST(NoHeapInFlight, FromArmingToParking) {
  expectNoHeap(
      experiment("servicer_capture",
                 {"controller.moving_frame.enabled=true", "base.free.velocity_m_per_s=[3, 0, 0]",
                  "environment.target.velocity_m_per_s=[2.98, 0, 0]"}));
}

TEST(NoHeapInFlight, WhileThrustersFireByOrders) {
  const Experiment e = experiment("satellite_hold");
  Lockstep loop(e.controller, e.plant);
  Order fire{Request::kThrust, {}, {}};
  fire.thrust(0) = 0.1;
  loop.step({Request::kStart, {}, {}});
  while (loop.step().kind != SegmentKind::kAdmittance) {
  }
  unsigned fired = 0;
  test::MallocGuard guard;
  for (int i = 0; i < 300; ++i) fired |= loop.step(i % 30 == 10 ? fire : Order{}).thrust.on;
  const std::int64_t calls = guard.count();
  EXPECT_EQ(calls, 0);
  EXPECT_TRUE(fired & 1U);
}

/// Every kind of order, taken and refused: their paths are gone through inside the tick.
TEST(NoHeapInOrders, ThroughEveryOrder) {
  Lockstep loop(experiment("puma_on_table_4_1", {kCompensated}).controller,
                experiment("puma_on_table_4_1").plant);
  const auto order = [](Request request, const Segment& segment = {}) {
    return Order{request, segment, {}};
  };
  Order another = order(Request::kVehicle);
  another.vehicle = {{2.0, 0.0, 0.5}, 1.0};
  another.verdict = {Stability::kStable, Stability::kStable};
  const Order orders[] = {order(Request::kArm),
                          order(Request::kRun, test::segment(SegmentKind::kCalibration)),
                          order(Request::kTare),
                          order(Request::kRun, test::sine(2, 0.05, 0.5, 1.0)),
                          order(Request::kHold),
                          order(Request::kRun, test::sine(2, 0.4, 0.5, 5.0)),  // refused: outside
                          order(Request::kRun, test::segment(SegmentKind::kMove)),
                          order(Request::kRun, test::segment(SegmentKind::kAdmittance, 1.0)),
                          another,
                          order(Request::kUncompensate),
                          order(Request::kCompensate),
                          order(Request::kGripper),
                          order(Request::kReset),  // refused: not stopped
                          order(Request::kRun, test::segment(SegmentKind::kMonitor, 1.0)),
                          order(Request::kStart),
                          order(Request::kStop)};
  for (int i = 0; i < 20; ++i) loop.step();
  int ran = 0, refused = 0;
  test::MallocGuard guard;
  for (const Order& one : orders) {
    loop.step(one);
    for (int i = 0; i < 250; ++i) ran += loop.step().kind != SegmentKind::kCount;
    refused += loop.state().refusal != Refusal::kNone;
  }
  const std::int64_t calls = guard.count();
  EXPECT_EQ(calls, 0);
  EXPECT_GT(ran, 500);
  EXPECT_GE(refused, 2);
}

TEST_P(NoHeap, ThroughATripAndTheHold) {
  const Experiment e = experiment(GetParam());
  TestPlatform platform(e.controller);
  plant::Plant plant(e.plant);
  TickInput in;
  in.order.request = Request::kStart;
  bool done = false;
  test::MallocGuard guard;
  for (; in.tick < 600; ++in.tick) {
    in.sample = plant.sample();
    if (in.tick > 300) in.sample.q(0) = NAN;
    if (in.tick > 350) in.sample.legs[2] = 0;
    const TickState& state = platform.tick(in);
    done = test::done(state);
    plant.command(state.command);
    plant.advance((in.tick + 1) * e.controller.period);
  }
  const std::int64_t calls = guard.count();
  EXPECT_EQ(calls, 0);
  EXPECT_TRUE(done);
}

/// The loops of both processes in real time, the bus between them: from the handshake on.
TEST(NoHeapOverTheBus, InThePeriodicPathsOfBothProcesses) {
  enterPrivateBus();
  // A loaded machine may sleep through samples; this is not about that.
  const Experiment e =
      experiment("free_decay", {"program=[{calibration: {}}, {admittance: {duration_s: 1}}]",
                                "safety.stale_ticks=1000", "safety.stall_ticks=1000",
                                "safety.overruns_per_second=1000",
                                "safety.position_error_still_m=0.1", "safety.reading_jump_m=1"});
  constexpr int kSettled = 20;  // [-] turns of the loop
  std::atomic<bool> stop = false;
  std::int64_t plant_calls = -1, plant_turns = 0;
  std::thread plant([&] {
    std::optional<test::MallocGuard> guard;
    runPlant(e, {}, [&] {
      if (++plant_turns == kSettled) guard.emplace();
      if (guard) plant_calls = guard->count();
      return stop.load();
    });
  });
  std::int64_t calls = -1, turns = 0;
  {
    std::optional<test::MallocGuard> guard;
    ProcessOptions options;
    options.start = true;
    const RunResult result = runController(e, options, [&](const TickState& state) {
      if (state.count >= 0 && ++turns == kSettled) guard.emplace();
      if (guard) calls = guard->count();
      return Order();
    });
    EXPECT_EQ(result.phase, Phase::kParked);
  }
  stop = true;
  plant.join();
  EXPECT_GT(turns, 100);
  EXPECT_GT(plant_turns, 500);
  EXPECT_EQ(calls, 0);
  EXPECT_EQ(plant_calls, 0);
}

INSTANTIATE_TEST_SUITE_P(Scenarios, NoHeap,
                         testing::Values("puma_on_table_4_1", "free_decay", "ramp", "alpha_sine",
                                         "satellite_hold", "ship_arm", "deck_puma"),
                         [](const auto& test) { return std::string(test.param); });

}  // namespace
}  // namespace ves
