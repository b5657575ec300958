// SPDX-License-Identifier: BSD-3-Clause
//
// From a machine that nobody has told about to a belief, and what that is worth.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "support/programs.hpp"
#include "support/rig.hpp"
#include "ves/evaluation/summary.hpp"
#include "ves/identification/scenario.hpp"
#include "ves/plant/nominal_servo.hpp"
#include "ves/validation/commissioning.hpp"

namespace ves {
namespace {

const std::vector<std::string> kCompensated = {
    "controller.compensation.feed_forward=true", "controller.compensation.observer=true",
    "controller.compensation.inertia=true", "sensor.readings_per_tick=4"};

std::vector<std::string> with(std::vector<std::string> sets, const std::string& one) {
  sets.push_back(one);
  return sets;
}

class Commission : public test::Programs {
 protected:
  static std::string scenario(const std::string& name) {
    return test::configDir() + "/scenarios/" + name + ".yaml";
  }
  /// Of the base in free space, by chapter 3's simulation, which knows the machine.
  static double errorOf(Experiment e) {
    e.controller.stability = Stability::kForced;
    const RecordedRun run = recordLockstep(e);
    EXPECT_TRUE(run.result.good());
    const auto summary = summarise(run.series, run.result);
    return std::max(summary["emulation_error_position_share"].get<double>(),
                    summary["emulation_error_attitude_share"].get<double>());
  }
};

TEST_F(Commission, FindsAMachineThatNobodyHasToldAbout) {
  for (const std::string name : {"puma_on_table_4_1", "doss_on_table_4_1"}) {
    const std::vector<std::string> sets =
        with(kCompensated,
             "plant_mismatch={mass: 1.1, center: 1.05, gain_extend: 1.08, gain_retract: 0.95}");
    const Experiment told = loadExperiment(scenario(name), sets);
    const CommissioningOptions options;
    const Commissioning c = commissioningOf(told, options);
    const RecordedRun run = recordLockstep(c.experiment);
    ASSERT_TRUE(run.result.good());
    EXPECT_LE(run.result.simulated, options.seconds + 2.0) << name;
    const Commissioned found = commissioned(run.series, c);

    ASSERT_TRUE(found.masses) << found.no_masses;
    const SeparableCombinations& combinations = found.masses->combinations;
    const Eigen::VectorXd off =
        (combinations.C * massParameters(carried(told.plant.payload)) - found.masses->estimate.beta)
            .cwiseQuotient(found.masses->estimate.standard_deviation);
    EXPECT_LT(off.cwiseAbs().maxCoeff(), 5.0) << name << "\n" << off;
    ASSERT_TRUE(found.servo) << found.no_servo;
    const ServoModel truly =
        plant::nominalServo(told.plant.leg_slave, told.plant.actuator, told.plant.transducer);
    for (int i = 0; i < kLegs; ++i) {
      EXPECT_NEAR(found.servo->legs.servo.extend(i), truly.extend(i), 0.01 * truly.extend(i));
      EXPECT_NEAR(found.servo->legs.servo.retract(i), truly.retract(i), 0.01 * truly.retract(i));
    }

    std::ofstream(file("belief.yaml")) << beliefOf(found, told, "found");
    const Experiment believing =
        loadExperiment(scenario(name), sets, {.belief = file("belief.yaml")});
    const double before = errorOf(told), after = errorOf(believing);
    EXPECT_GT(before, 0.05) << name;
    EXPECT_LT(after, 0.005) << name;
    const auto forecast = forecastError(told, believing, found);
    ASSERT_TRUE(forecast);
    EXPECT_NEAR(std::max(forecast->told.position, forecast->told.attitude), before, 0.1 * before);
    EXPECT_LT(after, 2.0 * std::max(forecast->off.position, forecast->off.attitude)) << name;
  }
}

// A bias that was found beside the weight keeps apart from it; a calibration takes it as told.
TEST_F(Commission, ItsBiasNeedsNoCalibrationAfterwards) {
  const std::vector<std::string> sets = {"plant_mismatch={mass: 1.1}", "sensor.noise=false",
                                         "program=[{move: {}}, {trajectory: {duration_s: 2}}]"};
  const Experiment told = loadExperiment(scenario("puma_on_table_4_1"), sets);
  const Commissioning c = commissioningOf(told, {});
  const RecordedRun run = recordLockstep(c.experiment);
  std::ofstream(file("belief.yaml")) << beliefOf(commissioned(run.series, c), told, "");
  const Experiment believing =
      loadExperiment(scenario("puma_on_table_4_1"), sets, {.belief = file("belief.yaml")});
  const RecordedRun after = recordLockstep(believing);
  const Row& row = after.series.rows[after.series.rows.size() / 2];
  EXPECT_LT(Vec3::Map(row.state.dynamic).norm(), 1.0);      // [N] of 772
  EXPECT_LT(Vec3::Map(row.state.dynamic + 3).norm(), 0.5);  // [N m]
}

TEST_F(Commission, FindsHowFarValvesAreOpenAtNullAndWhatSealsTake) {
  // An E at null lets through what a current does: the D/A's volts and amperes of a count.
  const std::vector<std::string> hydraulic = with(kCompensated, "legs.model=hydraulic");
#ifdef VES_SANITIZE  // each takes half a minute there
  const std::vector<double> openings = {0.3};
#else
  const std::vector<double> openings = {0.3, 0.0, -0.2};
#endif
  for (const double open_ma : openings) {
    const std::vector<std::string> sets =
        with(hydraulic, fmt::format("legs.hydraulic.valve_opening_ma={}", open_ma));
    const Experiment told = loadExperiment(scenario("puma_on_table_4_1"), sets);
    const Commissioning c = commissioningOf(told, {});
    const Commissioned found = commissioned(recordLockstep(c.experiment).series, c);
    ASSERT_TRUE(found.servo);
    const Vec6& opening = found.servo->legs.servo.opening;
    if (open_ma == 0.0) {
      EXPECT_TRUE(opening.isZero(0.0));
      continue;
    }
    if (open_ma < 0.0) {
      EXPECT_LT(opening.maxCoeff(), 0.0);
      continue;
    }
    const double ma_per_metre = 4.0 * (10.0 / 32768.0) * 8500.0 / 256.0 * 363.6 / 0.0254,
                 truth = open_ma / ma_per_metre;
    EXPECT_NEAR(opening.mean(), truth, 0.35 * truth) << open_ma;
    // What the pressure feedback answers friction with, times how long it does: what a leg hangs
    // behind by. Lag and gains take some of it.
    const ServoModel& servo = found.servo->legs.servo;
    const double seals = 1.5 * 150.0 / 11.4e-4 * 1e-6 / ma_per_metre;
    EXPECT_NEAR(servo.friction.mean() * servo.friction_time, seals * 0.03, 0.5 * seals * 0.03);
    // Believed, they are worth two thirds of the error.
    std::ofstream(file("belief.yaml")) << beliefOf(found, told, "");
    const Experiment believing =
        loadExperiment(scenario("puma_on_table_4_1"), sets, {.belief = file("belief.yaml")});
    EXPECT_LT(errorOf(believing), 0.4 * errorOf(told));
    Experiment smooth = believing;
    smooth.controller.servo.friction.setZero();
    EXPECT_LT(errorOf(believing), 0.85 * errorOf(smooth));
  }
}

TEST_F(Commission, WithoutWeightFindsTheServosAlone) {
  const Experiment told =
      test::experiment("puma_on_table_4_1", {"gravity_m_per_s2=0", "plant_mismatch={tau: 1.3}"});
  const Commissioning c = commissioningOf(told, {});
  EXPECT_FALSE(c.plan);
  const RecordedRun run = recordLockstep(c.experiment);
  const Commissioned found = commissioned(run.series, c);
  EXPECT_FALSE(found.masses);
  EXPECT_NE(found.no_masses.find("gravity_m_per_s2"), std::string::npos);
  ASSERT_TRUE(found.servo);
  EXPECT_NEAR(found.servo->legs.servo.tau(0), told.plant.actuator.tau,
              5.0 * found.servo->legs.deviation.tau(0));
}

// A program that went home early says why, whoever ran it.
TEST_F(Commission, SaysWhyItEndedEarly) {
  const std::string shaky = "--lockstep --set controller.still.deviation_counts=1e-3 ";
  const test::Output o =
      test::sh(app("commission") + "puma_on_table_4_1 " + shaky + "--quiet" + out("c"));
  EXPECT_EQ(o.status, 1);
  EXPECT_EQ(o.text.rfind("ves commission: the calibration was refused: ", 0), 0u) << o.text;
  EXPECT_NE(o.text.find("controller.still.deviation_counts"), std::string::npos) << o.text;
  EXPECT_EQ(std::count(o.text.begin(), o.text.end(), '\n'), 1) << o.text;

  const test::Output calibration = run("puma_on_table_4_1 --no-plots --quiet " + shaky + out("r"));
  EXPECT_EQ(calibration.text.rfind("ves run: the calibration was refused: ", 0), 0u)
      << calibration.text;
  const test::Output segment =
      run("satellite_puma --no-plots --quiet --lockstep --set 'program=[{admittance: {duration_s: "
          "1}}]'" +
          out("s"));
  EXPECT_EQ(segment.status, 1);
  EXPECT_EQ(segment.text.rfind("ves run: a segment of the program was refused: ", 0), 0u)
      << segment.text;
}

TEST_F(Commission, LeavesAPageAndABeliefThatRunTakes) {
  const test::Output o =
      test::sh(app("commission") + "puma_on_table_4_1 --lockstep --seed 4" + out("c"));
  ASSERT_EQ(o.status, 0) << o.text;
  for (const char* name : {"belief.yaml", "commission.html", "run.lcmlog", "summary.json"})
    EXPECT_TRUE(std::filesystem::exists(folder_ / "c" / name)) << name;
  EXPECT_NE(o.text.find("--belief " + file("c/belief.yaml")), std::string::npos) << o.text;
  EXPECT_EQ(
      run("puma_on_table_4_1 --lockstep --no-plots --belief " + file("c/belief.yaml") + out("r"))
          .status,
      0);
  // Of another robot nothing of it holds.
  expectRefusal(
      app("run") + "doss_on_table_4_1 --lockstep --belief " + file("c/belief.yaml") + out("x"),
      "calibration.setup");
  std::ofstream(file("odd.yaml")) << "servos: {tau_s: 1}\n";
  expectRefusal(app("run") + "puma_on_table_4_1 --lockstep --belief " + file("odd.yaml") + out("x"),
                "servos");
  expectRefusal(app("commission") + "puma_on_table_4_1 --lockstep --seconds nan", "--seconds");
  expectRefusal(app("commission") + "puma_on_table_4_1 --lockstep --accuracy 0", "--accuracy");
}

}  // namespace
}  // namespace ves
