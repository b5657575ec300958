// SPDX-License-Identifier: BSD-3-Clause
//
// What has been used goes like what is new: a second time of everything, on one object.
#include <gtest/gtest.h>

#include <functional>

#include "support/obedient_machine.hpp"

namespace ves {
namespace {

using test::experiment;
using test::segment;

struct Case {
  const char* name;
  const char* scenario;
  std::vector<std::string> set;
};
std::ostream& operator<<(std::ostream& out, const Case& one) { return out << one.name; }
const std::vector<std::string> kBare = {
    "controller.compensation.feed_forward=false", "controller.compensation.observer=false",
    "controller.compensation.inertia=false", "controller.compensation.wrench=raw"};

/// What an identification says of legs with friction, and of valves that overlap.
std::vector<std::string> rubbing() {
  const auto all = [](const std::string& key, const std::string& value) {
    std::string text = key + ": [" + value;
    for (int i = 1; i < kLegs; ++i) text += ", " + value;
    return text + "], ";
  };
  std::string servo;
  for (const auto& [key, value] : {std::pair{"extend_per_s", "17.4"},
                                   {"retract_per_s", "11.35"},
                                   {"tau_s", "0.0064"},
                                   {"delay_s", "0.002"},
                                   {"opening_m", "-1e-4"},
                                   {"friction_m", "3e-4"}})
    servo += all(key, value) + all(std::string(key) + "_deviation", "1e-5");
  std::vector<std::string> out = test::kCompensated;
  out.push_back("servo={date: \"2026-11-21T07:40:12Z\", " + servo + "}");
  return out;
}

class SecondTime : public testing::TestWithParam<Case> {
 protected:
  test::ObedientMachine machine_{experiment(GetParam().scenario, GetParam().set)};

  /// Four seconds of admittance control: a push, joints that swing, another push. It ends while
  /// they swing.
  void emulate(const std::function<void()>& look = [] {}) {
    machine_.order(Request::kRun, segment(SegmentKind::kAdmittance, 10.0));
    const Vec6 from = machine_.first().motion.x;
    double moved = 0.0;
    for (int n = 0; n < 420 && !HasFatalFailure(); ++n) {
      Vec6 force = Vec6::Zero();
      if (n >= 20 && n < 60) force << 30.0, -20.0, 15.0, 4.0, -3.0, 2.0;
      if (n >= 250 && n < 270) force << -40.0, 10.0, 5.0, -2.0, 6.0, 1.0;
      machine_.tick(force, 0.01 * (1.0 - std::cos(2.0 * M_PI * 0.01 * n)));
      moved = std::max(moved, (machine_.first().motion.x - from).cwiseAbs().maxCoeff());
      SCOPED_TRACE(testing::Message() << "tick " << n);
      look();
    }
    EXPECT_GT(moved, 1e-3);  // [m | rad]
  }
  /// But for what the forward kinematics leave of where they began, and where the servos' model was
  /// told they were.
  void expectSame() const {
    const TickState &used = machine_.first(), &fresh = machine_.last();
    ASSERT_EQ(used.cause, Check::kCount) << name(used.cause);
    ASSERT_EQ(used.phase, fresh.phase);
    ASSERT_EQ(used.kind, fresh.kind);
    ASSERT_EQ(used.calibration, fresh.calibration);
    ASSERT_LT((used.motion.x - fresh.motion.x).norm(), 1e-8);
    ASSERT_LT((used.motion.x_dot - fresh.motion.x_dot).norm(), 1e-6);
    ASSERT_LT((used.desired - fresh.desired).norm(), 1e-8);
    ASSERT_LT((used.dynamic.stacked() - fresh.dynamic.stacked()).norm(), 1e-3);
    ASSERT_LT((used.inertial.stacked() - fresh.inertial.stacked()).norm(), 1e-3);
    ASSERT_LT((used.reaction.stacked() - fresh.reaction.stacked()).norm(), 1e-4);
    ASSERT_EQ(used.withholds, fresh.withholds);
    ASSERT_LT((used.bias - fresh.bias).norm(), 1e-6);
    ASSERT_LT((used.reference - fresh.reference).norm(), 1e-8);
    ASSERT_EQ(used.compensation_share, fresh.compensation_share);
    ASSERT_NEAR(used.envelope_scale, fresh.envelope_scale, 1e-6);
    ASSERT_NEAR(used.passivity_damping, fresh.passivity_damping, 1e-6);
    if (used.phase != Phase::kRunning) return;  // the account of the last time can still be read
    ASSERT_NEAR(used.energy_put_in, fresh.energy_put_in, 1e-6);
    ASSERT_NEAR(used.energy_paid, fresh.energy_paid, 1e-6);
    ASSERT_EQ(used.vehicle, fresh.vehicle);
    ASSERT_NEAR(used.vehicle_energy, fresh.vehicle_energy, 1e-6);
  }
};

TEST_P(SecondTime, OfAControllerThatTrippedIsAsANewOnesFirst) {
  machine_.rest(20);
  machine_.order(Request::kArm);
  machine_.rest(300);
  emulate();
  machine_.order(Request::kTare);
  machine_.rest(20);
  machine_.open(kAllSwitchesClosed & ~1u);
  machine_.tick();
  machine_.until(Phase::kStopped);
  machine_.open(kAllSwitchesClosed);
  machine_.rest(50);
  machine_.order(Request::kReset);
  machine_.add();
  machine_.rest(100);
  machine_.order(Request::kArm);
  for (int n = 0; n < 300 && !HasFatalFailure(); ++n) {
    machine_.tick();
    expectSame();
  }
  emulate([&] { expectSame(); });
}

INSTANTIATE_TEST_SUITE_P(
    OfEveryKind, SecondTime,
    testing::Values(Case{"published", "puma_on_table_4_1", kBare},
                    Case{"compensated", "puma_on_table_4_1", test::kCompensated},
                    Case{"rubbing", "puma_on_table_4_1", rubbing()},
                    Case{"passive",
                         "puma_on_table_4_1",
                         {"controller.passivity.enabled=true", "controller.passivity.reserve_j=0"}},
                    Case{"filtered",
                         "puma_on_table_4_1",
                         {"controller.wrench_filter.dead_band_n_or_nm=[1,1,1,0.1,0.1,0.1]",
                          "controller.wrench_filter.low_pass_hz=[5,5,5,5,5,5]"}},
                    Case{"shuttle", "srms_low_hover_puma", {}},
                    Case{"satellite", "satellite_puma", {}}, Case{"ship", "ship_arm", {}}));

// What a vehicle that floats has of a force is the force times the time, however seldom its samples
// come.
TEST(Samples, CarryTheTimeThatTheyWereWaitedFor) {
  const auto speed = [](int every) {
    test::ObedientMachine machine(
        experiment("satellite_puma", {"controller.compensation.wrench=raw", "safety.stale_ticks=6",
                                      "base=!replace {free: {mass_kg: 500, center_m: [0, 0, 0], "
                                      "inertia_kg_m2: [900, 900, 900, 0, 0, 0]}}"}));
    machine.rest(20);
    machine.order(Request::kArm);
    machine.rest(300);
    machine.order(Request::kRun, segment(SegmentKind::kAdmittance, 10.0));
    machine.sampleEvery(every);
    for (int n = 0; n < 240; ++n) machine.tick(Vec6::Unit(1) * 15.0);
    EXPECT_EQ(machine.first().cause, Check::kCount) << name(machine.first().cause);
    return machine.first().motion.x_dot(1);
  };
  const double one = speed(1);
  EXPECT_GT(one, 0.05);  // 36 N s on 500 kg and a robot
  for (const int every : {2, 3, 4}) EXPECT_NEAR(speed(every), one, 0.02 * one) << every;
}

}  // namespace
}  // namespace ves
