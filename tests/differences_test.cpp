// SPDX-License-Identifier: BSD-3-Clause
//
// What two runs differ in.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <cmath>

#include "support/rig.hpp"
#include "ves/evaluation/comparison.hpp"
#include "ves/evaluation/differences.hpp"
#include "ves/evaluation/evidence.hpp"
#include "ves/evaluation/summary.hpp"
#include "ves/run/run.hpp"
#include "ves/series/series.hpp"

namespace ves {
namespace {

Experiment ramp(const std::vector<std::string>& set = {}) {
  std::vector<std::string> all = {
      "program=[{move: {}}, {trajectory: {duration_s: 1, z: {ramp: {to_m: 0.02}}}}]"};
  all.insert(all.end(), set.begin(), set.end());
  return test::experiment("puma_on_table_4_1", all);
}

std::string text(const std::vector<KeyDifference>& differences) {
  std::string out;
  for (const KeyDifference& one : differences) {
    out += one.key;
    for (const std::string& value : one.values) out += " " + value;
    out += "\n";
  }
  return out;
}

// A freeze holds the pose before the one that failed: that one is what is told.
TEST(Evidence, IsOfThePoseThatFailed) {
  const Experiment e = ramp();
  Row row{};
  row.state.x[0] = 0.3049;
  row.state.x_dot[0] = 0.05;  // [m/s] 0.5 mm in a tick
  EXPECT_EQ(evidence(Check::kMotionLimits, row, e),
            "x at 305.4 mm, want at most 305.0 (safety.translation_m)");
  row.state.x_dot[0] = 0.0;
  EXPECT_EQ(evidence(Check::kVelocity, row, e), "safety.leg_velocity_m_per_s 0.75");
  EXPECT_EQ(evidence(Check::kCount, row, e), "");
}

TEST(Evidence, NamesTheWorstAndItsKey) {
  const Experiment e = ramp();
  const SafetyLimits& l = e.controller.safety;
  Row row{};
  // A leg is outside by its length, whichever it is; straight up all are as long.
  row.state.x[2] = 0.9;
  const double up = legLengths(e.controller.geometry,
                               e.controller.geometry.fromHome({{0.0, 0.0, 0.9}, Vec3::Zero()}))(0);
  EXPECT_EQ(evidence(Check::kActuatorLimits, row, e),
            fmt::format("leg 1 at {:.4f} m, want [{}, {}] (safety.leg_min_m, leg_max_m)", up,
                        l.leg_min, l.leg_max));
  // Rolled it is another leg that is out of its range, and the text says so.
  row = {};
  row.state.x[4] = 0.9;
  const Vec6 L = legLengths(e.controller.geometry,
                            e.controller.geometry.fromHome({Vec3::Zero(), {0.0, 0.9, 0.0}}));
  int out = 0;
  while (L(out) >= l.leg_min && L(out) <= l.leg_max) ++out;
  ASSERT_LT(out, 6);
  EXPECT_EQ(evidence(Check::kActuatorLimits, row, e).substr(0, 5), fmt::format("leg {}", out + 1));
  row = {};
  row.state.x[4] = -0.6;
  EXPECT_EQ(evidence(Check::kMotionLimits, row, e).substr(0, 18), "beta at -34.4 deg,");
  row = {};
  for (int i = 0; i < 6; ++i) row.state.leg[i] = row.state.leg_measured[i] = 1.5;
  row.state.leg_measured[3] = 1.45;
  row.state.leg_measured[1] = 1.53;
  EXPECT_EQ(evidence(Check::kPositionError, row, e).substr(0, 34),
            "leg 4 is 50.0 mm from its command ");
  row.has_sample = true;
  row.sample.adc[4] = 32767;
  EXPECT_EQ(evidence(Check::kSensorSaturated, row, e).substr(0, 26), "channel my at 32767 counts");
  row.sample.adc[6] = static_cast<int>(1.0 / e.plant.sensor.volts_per_count);
  EXPECT_EQ(evidence(Check::kPressure, row, e).substr(0, 7), "1.00 V,");
}

TEST(Summary, HasEachNumberOfARunUnderItsOwnName) {
  Series series;
  series.experiment = ramp();
  RunResult result;
  result.ticks = 11;
  result.simulated = 12.5;
  result.wall = 2.5;
  result.phase = Phase::kStopped;
  result.cause = Check::kVelocity;
  result.cause_tick = 13;
  result.lost = 14;
  result.log_lost = 15;
  result.log_trouble = "no room";
  result.malformed = 16;
  const auto out = summarise(series, result);
  EXPECT_EQ(out.at("ticks"), 11);
  EXPECT_EQ(out.at("simulated_s"), 12.5);
  EXPECT_EQ(out.at("wall_s"), 2.5);
  EXPECT_EQ(out.at("real_time_factor"), 5.0);
  EXPECT_EQ(out.at("ended"), "stopped");
  EXPECT_EQ(out.at("first_cause"), "velocity");
  EXPECT_EQ(out.at("first_cause_tick"), 13);
  EXPECT_EQ(out.at("messages_lost"), 14);
  EXPECT_EQ(out.at("log_events_lost"), 15);
  EXPECT_EQ(out.at("log_trouble"), "no room");
  EXPECT_EQ(out.at("messages_malformed"), 16);
  EXPECT_EQ(out.at("seed"), series.experiment.plant.seed);
  EXPECT_EQ(out.at("configuration_hash"), series.experiment.source.hash());
  result.wall = 0.0;
  EXPECT_EQ(summarise(series, result).at("real_time_factor"), 0.0);
}

// Whatever the numbers are: the table shows each in the unit beside it.
TEST(Summary, TheTableShowsItsNumbersInTheUnitsBesideThem) {
  const Experiment e = test::experiment(
      "puma_on_table_4_1",
      {"program=[{calibration: {}}, {admittance: {duration_s: 4}, robot: [{at_s: 0.5, duration_s: "
       "1, joint: joint_1, to_deg_or_m: 20}]}, {trajectory: {duration_s: 2, z: {ramp: {to_m: "
       "0.02}}}}]",
       "controller.passivity.enabled=true"});
  const RecordedRun run = recordLockstep(e);
  nlohmann::ordered_json s = summarise(run.series, run.result);
  const std::pair<const char*, double> numbers[] = {{"messages_lost", 14},
                                                    {"log_events_lost", 15},
                                                    {"messages_malformed", 16},
                                                    {"tracking_delay_s", 0.0123},
                                                    {"tracking_rms", 0.0456},
                                                    {"tracking_paei_amplitude", 1.2345},
                                                    {"tracking_paei_phase_rad", M_PI / 9.0},
                                                    {"tracking_fdb_amplitude", 1.3456},
                                                    {"tracking_fdb_phase_rad", M_PI / 12.0},
                                                    {"energy_put_in_j", -0.0021},
                                                    {"energy_put_in_max_j", 0.0032},
                                                    {"energy_paid_j", 0.0043},
                                                    {"dynamic_force_max_moving_n", 54.321},
                                                    {"dynamic_moment_max_moving_nm", 65.432},
                                                    {"tool_displacement_max_m", 0.0765},
                                                    {"tool_displacement_rms_m", 0.0543},
                                                    {"tool_error_rms_m", 0.0011},
                                                    {"tool_error_max_m", 0.0022}};
  s["log_trouble"] = "no room";
  for (const auto& [key, value] : numbers) {
    ASSERT_TRUE(s.contains(key)) << key;
    if (s[key].is_number_float())
      s[key] = value;
    else
      s[key] = static_cast<int>(value);
  }
  const std::string text = table(s);
  for (const char* shown :
       {"14 messages were lost", "no room: 15 events of the log lost", "16 malformed messages",
        "late by 12.3 ms; rms 4.56 %, amplitude 1.2345, phase 20.00 deg (PAEI; by frequencies "
        "1.3456, 15.00 deg)",
        "put in -2.100 mJ, 3.200 at most; 4.300 mJ damped away",
        "carried 76.500 mm off by the base (54.300 rms); off by 1.100 mm rms, 2.200 mm at most",
        "moving  at most   54.321 N,   65.432 N m"})
    EXPECT_NE(text.find(shown), std::string::npos) << shown << "\n" << text;
}

TEST(Evidence, OfACalibrationNamesWhatMovedByHowMuchAndTheKey) {
  Experiment e = ramp();
  e.controller.stillness = {3, 0.004, 25.0, 1500.0};
  const auto said = [&](StillnessViolation violation, int index, double amount) {
    state_t s{};
    s.violation = static_cast<decltype(s.violation)>(violation);
    s.violation_index = index;
    s.violation_amount = amount;
    return stillnessViolation(s, e);
  };
  EXPECT_EQ(said(StillnessViolation::kLeg, 2, 7.0),
            "leg 3 moved by 7 counts (3 allowed: controller.still.leg_counts)");
  EXPECT_EQ(said(StillnessViolation::kJoint, 1, 0.0123),
            "joint_2 moved by 0.0123 rad (0.004 allowed: controller.still.joint_rad_or_m)");
  EXPECT_EQ(said(StillnessViolation::kJoint, 7, 0.0123).substr(0, 7), "joint 8");
  EXPECT_EQ(said(StillnessViolation::kChannel, 4, 31.25),
            "my scatters by 31.2 counts (25 allowed: controller.still.deviation_counts): something "
            "shakes it");
  EXPECT_EQ(said(StillnessViolation::kBias, 0, 1600.0).substr(0, 79),
            "fx would have a bias of 1600 counts (1500 allowed: controller.still.bias_v): it");
  e.robot.joint_names.resize(1);
  EXPECT_EQ(said(StillnessViolation::kJoint, 1, 0.0123).substr(0, 7), "joint 2");
}

TEST(Summary, TheTableShowsFiveContactsBesideThoseInFreeSpace) {
  Series series;
  series.experiment = ramp();
  nlohmann::ordered_json s = summarise(series, RunResult());
  s["contacts"] = 7;
  s["contacts_free_space"] = 6;
  s["contact_list"] = nlohmann::ordered_json::array();
  for (int k = 0; k < 7; ++k)
    s["contact_list"].push_back({{"began_s", 1.0 + k},
                                 {"duration_s", 0.0251},
                                 {"peak_n", 12.346},
                                 {"restitution", 0.98765},
                                 {"free_space_began_s", 1.5 + k},
                                 {"free_space_duration_s", 0.0262},
                                 {"free_space_peak_n", 11.234},
                                 {"free_space_restitution", nullptr}});
  const std::string text = table(s);
  EXPECT_NE(text.find("contact  7 in the run, 6 on the base in free space"), std::string::npos);
  EXPECT_NE(
      text.find("1: after 1.00 (1.50) s for 25.1 (26.2) ms, peak 12.35 (11.23) N, restitution "
                "0.9877 (-)"),
      std::string::npos)
      << text;
  EXPECT_NE(text.find("5: after 5.00"), std::string::npos);
  EXPECT_EQ(text.find("6: after"), std::string::npos);
}

// What the emulation gave and what was damped away are those of the last tick of it.
TEST(Summary, EnergiesAreThoseOfTheLastTickAndTheMost) {
  for (const bool passive : {true, false}) {
    RecordedRun run = recordLockstep(test::experiment(
        "puma_on_table_4_1", {"program=[{calibration: {}}, {admittance: {duration_s: 0.5}}]",
                              fmt::format("controller.passivity.enabled={}", passive)}));
    double n = 0.0;
    for (Row& row : run.series.rows) {
      row.state.energy_put_in = n < 5.0 ? 100.0 + n : n;
      row.state.energy_paid = 2.0 * n;
      n += inAdmittance(row.state) ? 1.0 : 0.0;
    }
    ASSERT_GT(n, 20.0);
    const auto s = summarise(run.series, run.result);
    EXPECT_EQ(s.at("energy_put_in_j"), n - 1.0);
    EXPECT_EQ(s.at("energy_put_in_max_j"), 104.0);
    EXPECT_EQ(s.contains("energy_paid_j"), passive);
    if (passive) {
      EXPECT_EQ(s.at("energy_paid_j"), 2.0 * (n - 1.0));
    }
  }
}

// Of a base that swings along x alone: where else the platform stands is no motion of it.
TEST(Emulation, AnAmplitudeIsFromWhereTheBaseIsAtRest) {
  const Experiment e = test::experiment(
      "ramp", {"base=!replace {modes: {frequency_hz: [0.3], damping_ratio: [0.02], "
               "generalized_mass: [1], shapes: [[0.05], [0], [0], [0], [0], [0]], "
               "platform_rpy_deg: [0, 0, 0]}, keep_modes: 1}"});
  Motion base;
  for (const double swing : {0.01, -0.02, 0.015}) {
    base.t.push_back(0.01 * static_cast<double>(base.t.size()));
    base.x.push_back((Vec6() << swing, 0.0, 0.03, 0.0, -0.1, 0.0).finished());
    base.x_dot.push_back(Vec6::Zero());
  }
  const Amplitude a = amplitude(e, base);
  EXPECT_NEAR(a.position, 0.02, 1e-12);
  EXPECT_NEAR(a.attitude, 0.0, 1e-12);
}

TEST(Differences, NameTheLeavesThatWereChanged) {
  const Experiment a = ramp(), b = ramp({"seed=9", "robot.joints_deg_or_m=[0, -80, 90, 0, 0, 0]"}),
                   c = ramp({"safety.translation_m=0.3"});
  EXPECT_EQ(text(configurationDifferences({&a, &a})), "");
  EXPECT_EQ(text(configurationDifferences({&a, &b})),
            "seed 1 9\nrobot.joints_deg_or_m[1] -90 -80\n");
  EXPECT_EQ(configurationDifferences({&a, &b, &c}).size(), 3u);
  // Long texts are told apart, not shown.
  Experiment d = a;
  d.source.document.find("robot")->find("urdf_text")->text += " ";
  const auto of_urdf = configurationDifferences({&a, &d});
  ASSERT_EQ(of_urdf.size(), 1u);
  EXPECT_EQ(of_urdf[0].key, "robot.urdf_text");
  EXPECT_LT(of_urdf[0].values[0].size(), 60u);
}

TEST(Differences, OfWhatCameOfRuns) {
  ReferenceMotions references;
  const auto summary = [&](const Experiment& e) {
    const RecordedRun run = recordLockstep(e);
    return summarise(run.series, resultOf(run.series), references);
  };
  const auto first = summary(ramp());
  EXPECT_EQ(text(summaryDifferences({first, summary(ramp())})), "");
  const auto other = summary(
      ramp({"program=[{move: {}}, {trajectory: {duration_s: 1, z: {ramp: {to_m: 0.03}}}}]"}));
  const auto differences = summaryDifferences({first, other});
  const auto at =
      std::find_if(differences.begin(), differences.end(),
                   [](const KeyDifference& one) { return one.key == "z_peak_to_peak_m"; });
  ASSERT_NE(at, differences.end());
  EXPECT_NEAR(std::stod(at->values[0]), 0.02, 1e-3);
  EXPECT_NEAR(std::stod(at->values[1]), 0.03, 1e-3);
}

TEST(Differences, ALogTellsHowItsRunEnded) {
  for (const Experiment& e :
       {ramp(),
        ramp({"program=[{trajectory: {duration_s: 2}, faults: [{at_s: 0.5, duration_s: 1, "
              "fault: floor_mat}]}]"}),
        ramp({"program=[{move: {}}, {admittance: {duration_s: 1}}]"})}) {
    const RecordedRun run = recordLockstep(e);
    const RunResult told = resultOf(run.series);
    EXPECT_EQ(told.phase, run.result.phase);
    EXPECT_EQ(told.cause, run.result.cause);
    EXPECT_EQ(told.cause_tick, run.result.cause_tick);
    EXPECT_EQ(told.aborted, run.result.aborted);
    EXPECT_EQ(told.ticks, run.result.ticks);
    EXPECT_NEAR(told.simulated, run.result.simulated, 1e-9);
  }
}

}  // namespace
}  // namespace ves
