// SPDX-License-Identifier: BSD-3-Clause
//
// Thrusters of a vehicle that floats, fired by orders.
#include <gtest/gtest.h>

#include <unistd.h>

#include <filesystem>
#include <map>
#include <random>

#include "support/followed.hpp"
#include "support/rig.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/run/replay.hpp"
#include "ves/run/run.hpp"
#include "ves/series/series.hpp"

namespace ves {
namespace {

using test::experiment;
using test::Rig;
using test::segment;

Order fire(const std::map<int, double>& on) {
  Order order;
  order.request = Request::kThrust;
  for (const auto& [thruster, seconds] : on) order.thrust(thruster) = seconds;
  return order;
}

/// Two thrusters off the centre, and one that its schedule fires too.
FreeBodyModel satellite() {
  FreeBodyModel out;
  out.body_P = {80.0, Vec3(0.1, 0.0, -0.5), Vec3(10.0, 20.0, 25.0).asDiagonal()};
  out.w_IP_I = {0.02, -0.01, 0.03};
  out.propulsion.size = 3;
  out.propulsion.thrusters[0] = {{0.6, 0.0, -0.5}, {0.0, 3.0, 0.0}};
  out.propulsion.thrusters[1] = {{0.0, 0.4, -0.2}, {2.0, 0.0, -1.0}};
  out.propulsion.thrusters[2] = {{0.0, 0.0, -1.0}, {0.0, -2.0, 1.0}};
  out.propulsion.thrusters[2].firings[0] = {2.0, 3.0};
  out.propulsion.thrusters[2].size = 1;
  return out;
}

// An order is a firing of the schedule that begins with its step.
TEST(Thrust, ByOrdersIsThatOfASchedule) {
  const FreeBodyModel vehicle = satellite();
  const std::vector<std::pair<int, std::map<int, double>>> orders = {
      {50, {{0, 0.505}}},
      {120, {{0, 0.3}, {1, 1.0}}},
      {140, {{0, 0.004}}},  // in place of what is left: it has been on for 0.2 s
      {170, {{1, 1.0}}},    // and longer
      {250, {{2, 1.2}}}};   // half of it is on already
  FreeBodyModel scheduled = vehicle;
  const auto add = [&](std::size_t thruster, double from, double until) {
    Thruster& one = scheduled.propulsion.thrusters[thruster];
    one.firings[static_cast<std::size_t>(one.size++)] = {from, until};
  };
  add(0, 0.5, 1.005);
  add(0, 1.2, 1.404);
  add(1, 1.2, 2.7);
  scheduled.propulsion.thrusters[2].firings[0] = {2.0, 3.7};

  FreeBody ordered(vehicle, 0.01), planned(scheduled, 0.01);
  ordered.reset(Vec6::Zero());
  planned.reset(Vec6::Zero());
  auto next = orders.begin();
  for (int n = 0; n < 500; ++n) {
    if (next != orders.end() && next->first == n) {
      EXPECT_EQ(ordered.fire(fire(next->second).thrust), Refusal::kNone);
      ++next;
    }
    ordered.step(Wrench{});
    planned.step(Wrench{});
    ASSERT_NEAR((ordered.motion().x - planned.motion().x).norm(), 0.0, 1e-12) << n;
    ASSERT_EQ(ordered.thrust().on, planned.thrust().on) << n;
  }
  // Free space as well, of the firings that there were.
  Interaction by_orders, by_schedule;
  by_orders.vehicle = vehicle;
  by_orders.firings = {{0, {0.5, 1.005}}, {0, {1.2, 1.404}}, {1, {1.2, 2.7}}, {2, {2.5, 3.7}}};
  by_schedule.vehicle = scheduled;
  InteractionOptions options;
  options.duration = 5'000'000'000;
  const auto a = simulate(by_orders, options), b = simulate(by_schedule, options);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) ASSERT_LT((a[i].x - b[i].x).norm(), 1e-9) << i;
  EXPECT_GT((a.back().x - a.front().x).norm(), 0.1);
  // And a vehicle that is let go anew has forgotten them.
  ordered.fire(fire({{1, 5.0}}).thrust);
  ordered.reset(Vec6::Zero());
  ordered.step(Wrench{});
  EXPECT_EQ(ordered.thrust().on, 0U);
  EXPECT_TRUE(ordered.thrust().left.isZero(0.0));
}

TEST(Thrust, IsRefusedForAReason) {
  const std::string jets =
      "base.free.thrusters=[{at_m: [0.6, 0, -0.6], force_n: [0, 2, 0], least_on_s: 0.05}]";
  Rig rig(experiment("satellite_hold", {jets}));
  const auto give = [&](const std::map<int, double>& on) { return rig.give(fire(on)).refusal; };
  EXPECT_EQ(give({{0, 0.1}}), Refusal::kNotArmed);
  rig.arm();
  EXPECT_EQ(give({{0, 0.1}}), Refusal::kNotEmulated);
  rig.order(Request::kRun, segment(SegmentKind::kCalibration));
  rig.until(Phase::kArmed);
  rig.order(Request::kRun, segment(SegmentKind::kAdmittance, 20.0));
  ASSERT_EQ(rig.run(20).kind, SegmentKind::kAdmittance);
  EXPECT_EQ(give({{1, 0.1}}), Refusal::kNoSuchPart);
  EXPECT_EQ(give({{0, 0.04}}), Refusal::kTooShort);
  EXPECT_EQ(rig.tick().thrust.on, 0U);
  EXPECT_EQ(give({{0, 0.05}}), Refusal::kNone);
  EXPECT_EQ(rig.state().thrust.on, 1U);
  EXPECT_NEAR(rig.state().thrust.left(0), 0.05, 1e-12);
  rig.run(10);
  EXPECT_EQ(rig.state().thrust.on, 0U);
  rig.tick(Request::kHold);
  rig.until(Phase::kArmed);
  EXPECT_EQ(give({{0, 0.1}}), Refusal::kNotEmulated);

  Rig modal(experiment("free_decay"));
  modal.arm();
  modal.order(Request::kRun, segment(SegmentKind::kCalibration));
  modal.until(Phase::kArmed);
  modal.order(Request::kRun, segment(SegmentKind::kAdmittance, 20.0));
  modal.run(20);
  EXPECT_EQ(modal.give(fire({{0, 0.1}})).refusal, Refusal::kNoSuchPart);
}

// A body that floats has a mass, and neither springs nor dampers.
TEST(Thrust, AVehicleWithoutSpringsTakesNone) {
  Rig rig(experiment("satellite_puma"));
  rig.arm();
  const auto give = [&](const VehicleFactors& to) {
    Order order;
    order.request = Request::kVehicle;
    order.vehicle = {to, 1.0};
    order.verdict = {Stability::kStable, Stability::kStable};
    return rig.give(order).refusal;
  };
  EXPECT_EQ(give({0.0, 2.0, 0.0}), Refusal::kNoSuchPart);
  EXPECT_EQ(give({0.0, 0.0, 2.0}), Refusal::kNoSuchPart);
  EXPECT_EQ(rig.tick().vehicle, VehicleFactors());
  EXPECT_EQ(give({2.0, 1.0, 1.0}), Refusal::kNone);
  EXPECT_EQ(rig.tick().vehicle.mass, 2.0);
}

// Orders at random, beside a schedule and an attitude hold: free space knows them from the log, the
// platform goes as it does, and the log replays to the last bit.
TEST(Thrust, ByOrdersMovesThePlatformAsFreeSpaceHasIt) {
  for (const bool flies : {false, true}) {
    const std::string log =
        (std::filesystem::temp_directory_path() / ("ves_thrust_" + std::to_string(getpid())))
            .string();
    const Experiment e = experiment(
        "satellite_hold",
        {"base.free.thrusters=[{at_m: [0.6, 0, -0.6], force_n: [0, 2, 0], firings_s: [[3.5, 4]]}, "
         "{at_m: [-0.6, 0, -0.6], force_n: [0, -2, 0]}, {at_m: [0, 0, -1], force_n: [4, 0, 3]}]",
         "sensor.noise=false", flies ? "controller.moving_frame.enabled=true" : "seed=1"});
    int given = 0;
    {
      LogWriter writer(log);
      std::mt19937 dice(3);
      const auto operate = [&](const TickState& s) -> Order {
        if (s.kind != SegmentKind::kAdmittance || dice() % 60 != 0) return {};
        ++given;
        const auto thruster = static_cast<int>(dice() % 3);
        return fire({{thruster, 0.01 + 0.001 * static_cast<double>(dice() % 200)}});
      };
      ASSERT_TRUE(runLockstep(e, &writer, operate).good());
    }
    ASSERT_GT(given, 10);
    const Series series = readSeries(log);
    EXPECT_GT(letGoOf(series).firings().size(), 8U);
    const auto both = emulation(series);
    ASSERT_TRUE(both);
    test::expectFollowed(series, both->base);
    const Distance off = distance(both->platform, both->base), moved = travel(both->base);
    EXPECT_GT(moved.rms_position, 5e-3);
    EXPECT_LT(off.rms_position, 5e-3 * moved.rms_position);
    EXPECT_LT(off.rms_attitude, 5e-3 * moved.rms_attitude);
    const ReplayResult again = replay(log, {}, {});
    EXPECT_EQ(again.different, 0);
    std::filesystem::remove(log);
  }
}

}  // namespace
}  // namespace ves
