// SPDX-License-Identifier: BSD-3-Clause
//
// Dead band and low-pass of the wrench, and the stability check that knows them.
#include "ves/control/wrench_filter.hpp"

#include <gtest/gtest.h>

#include "support/rig.hpp"
#include "ves/analysis/gate.hpp"

namespace ves {
namespace {

using test::Rig;

Wrench componentOf(int i, double value) { return Wrench::from(Vec6(Vec6::Unit(i) * value)); }

TEST(WrenchFilter, TakesTheBandFromWhatIsBeyondIt) {
  for (int i = 0; i < 6; ++i) {
    WrenchFilterSettings settings;
    settings.dead_band(i) = 2.0;
    WrenchFilter filter(settings, 0.01);
    for (const auto& [in, out] : {std::pair{1.9, 0.0}, {-2.0, 0.0}, {5.0, 3.0}, {-7.5, -5.5}})
      EXPECT_EQ(filter.update(componentOf(i, in)).stacked(), Vec6(Vec6::Unit(i) * out)) << in;
    EXPECT_EQ(filter.update(componentOf((i + 1) % 6, 1.0)).stacked(),
              Vec6(Vec6::Unit((i + 1) % 6)));  // each for itself
    settings.dead_band(i) = 1e-3;
    EXPECT_TRUE(settings.any());
    settings.dead_band(i) = 0.0;
    EXPECT_FALSE(settings.any());
    settings.low_pass(i) = 1e-3;
    EXPECT_TRUE(settings.any());
  }
}

// A first-order system under an input that is held over each period, by its own step response.
TEST(WrenchFilter, IsAFirstOrderLowPass) {
  WrenchFilterSettings settings;
  settings.low_pass << 0.0, 3.0, 0.0, 0.0, 10.0, 0.0;
  WrenchFilter filter(settings, 0.01);
  filter.update({});
  for (int n = 1; n < 40; ++n) {
    const Vec6 out = filter.update(Wrench::from(Vec6(Vec6::Ones()))).stacked();
    EXPECT_NEAR(out(1), 1.0 - std::exp(-2.0 * M_PI * 3.0 * 0.01 * n), 1e-12);
    EXPECT_NEAR(out(4), 1.0 - std::exp(-2.0 * M_PI * 10.0 * 0.01 * n), 1e-12);
    EXPECT_EQ(out(0), 1.0);
  }
}

TEST(WrenchFilter, LosesTheNoiseOfADeadBandOnly) {
  WrenchFilterSettings s;
  s.dead_band(1) = 0.5;
  s.low_pass(2) = 1.0;
  const Mat6 out = WrenchFilter(s, 0.01).noise(Mat6::Constant(2.0));
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) EXPECT_EQ(out(i, j), i == 1 || j == 1 ? 0.0 : 2.0) << i << j;
}

TEST(WrenchFilter, LetsWhatIsNoNumberThroughAndForgetsIt) {
  WrenchFilterSettings settings;
  settings.low_pass.setConstant(1.0);
  settings.dead_band.setConstant(0.5);
  WrenchFilter filter(settings, 0.01);
  filter.update(componentOf(2, 100.0));
  EXPECT_TRUE(std::isnan(filter.update(componentOf(2, NAN)).f.z()));
  EXPECT_EQ(filter.update(componentOf(2, 4.0)).f.z(), 3.5);  // as the first
}

// --- In the loop ---------------------------------------------------------------------------------

// The stability check against what the loop does: over low-passes from fast to slow it lets pass
// what decays in a run, and refuses what grows in one.
TEST(WrenchFilter, IsInTheStabilityCheckAsItIsInTheLoop) {
  int stable = 0, unstable = 0;
  for (const double hz : {20.0, 5.0, 3.0, 1.0, 0.5, 0.2}) {
    const std::string list = "[" + std::to_string(hz) + "," + std::to_string(hz) + "," +
                             std::to_string(hz) + "," + std::to_string(hz) + "," +
                             std::to_string(hz) + "," + std::to_string(hz) + "]";
    const Experiment e = test::experiment(
        "puma_on_table_4_1",
        {"controller.wrench_filter.low_pass_hz=" + list, "gravity_m_per_s2=0",
         "base.mass_diagonal=[30, 30, 30, 4, 4, 4]", "base.damping_diagonal=[6, 6, 6, 1, 1, 1]",
         "base.stiffness_diagonal=[400, 400, 400, 60, 60, 60]", "safety.growth_floor_j=1e6",
         "initial_pose={}",
         "program=[{calibration: {}}, {move: {to: {x_m: 0.005}, duration_s: 2}}, "
         "{admittance: {duration_s: 40}}]"});
    const bool passes = isStable(e.controller, e.plant.task);
    (passes ? stable : unstable)++;
    Rig rig(e);
    rig.run(20);
    rig.tick(Request::kStart);
    double early = 0.0, late = 0.0;
    int n = 0;
    rig.until(
        [&](const TickState& s) {
          if (s.kind == SegmentKind::kAdmittance && s.phase == Phase::kRunning) {
            double& most = ++n < 600 ? early : late;
            if (n < 600 || n > 1400) most = std::max(most, s.motion.x.norm());
          }
          return test::done(s);
        },
        6000);
    const bool grew = rig.state().phase == Phase::kStopped || late > early;
    EXPECT_NE(passes, grew) << hz << " Hz: " << early << " " << late;
  }
  EXPECT_GT(stable, 1);
  EXPECT_GT(unstable, 1);
}

// The band's worth of a push does nothing; the account of energy still sees all of it.
TEST(WrenchFilter, KeepsASmallPushOutOfTheModel) {
  for (const double band : {0.0, 5.0}) {
    const Experiment e = test::experiment(
        "puma_on_table_4_1",
        {"controller.wrench_filter.dead_band_n_or_nm=[" + std::to_string(band) + ", 0, 0, 0, 0, 0]",
         "program=[{calibration: {}}, {admittance: {duration_s: 5}}]", "initial_pose={}"});
    Rig rig(e);
    const Vec6 counts = e.controller.sensor.C_proc.inverse() *
                        transfer(inverse(e.controller.sensor.X_PS), componentOf(0, 3.0)).stacked();
    rig.run(20);
    rig.tick(Request::kStart);
    rig.until([](const TickState& s) { return s.kind == SegmentKind::kAdmittance; });
    rig.disturb([&](Sample& s) {
      for (int i = 0; i < 6; ++i)
        s.adc[static_cast<std::size_t>(i)] += static_cast<std::int32_t>(std::lround(counts(i)));
    });
    double most = 0.0;
    for (int i = 0; i < 300; ++i) most = std::max(most, std::abs(rig.tick().motion.x(0)));
    if (band > 0.0)
      EXPECT_LT(most, 2e-4);
    else
      EXPECT_GT(most, 1.5e-3);
  }
}

}  // namespace
}  // namespace ves
