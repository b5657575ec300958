// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "support/refusal.hpp"
#include "support/robots.hpp"
#include "ves/config/experiment.hpp"
#include "ves/config/keys.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

fs::path scenarios() { return fs::path(test::configDir()) / "scenarios"; }

using test::refusal;

TEST(Config, WhatFloatsInTheWorldIsInTheVehiclesOrbit) {
  const Experiment e =
      test::experiment("servicer_capture", {"base.free.orbital_rate_deg_per_s=0.5"});
  const Environment& environment = e.plant.task.world->environment;
  EXPECT_DOUBLE_EQ(environment.orbit.rate, 0.5 * kDegree);
  EXPECT_EQ(environment.p_IO_I, e.plant.geometry.home());
  EXPECT_EQ(std::get<FreeBodyModel>(e.controller.vehicle.kind).orbit, environment.orbit);
}

TEST(Config, EveryScenarioLoads) {
  int count = 0;
  for (const auto& entry : fs::directory_iterator(scenarios())) {
    const Experiment e = loadExperiment(entry.path());
    EXPECT_EQ(e.name, entry.path().stem());
    EXPECT_GT(e.source.substitutes, 0);
    ++count;
  }
  EXPECT_GE(count, 7);
}

// Else a controller of 1 kHz would find no new sample in half of its ticks, and never arm.
TEST(Config, AMachineSamplesTwiceInEveryTick) {
  const auto of = [](const char* period) {
    return test::experiment("z_sine", {std::string("controller.period_ns=") + period})
        .machine.period;
  };
  EXPECT_EQ(of("10000000"), 2'000'000);
  EXPECT_EQ(of("1000000"), 500'000);
}

// A reader that asks for one more key fails here until config/keys.yaml says what it means, and a
// sentence about a key that nobody asks for fails, too.
TEST(Config, EveryKeyHasASentenceAndEverySentenceAKey) {
  const KeyMeaning root = keyMeanings(test::configDir());
  int count = 0;
  walkKeys(root, [&](const KeyMeaning& key) {
    ++count;
    EXPECT_FALSE(key.sentence.empty()) << key.path << ": config/keys.yaml says nothing of it";
    const bool written_by_ves =
        key.path == "calibration" || key.path == "masses" || key.path == "servo";
    const bool asked = key.asked.kinds != 0 || key.path == "reality" || written_by_ves;
    EXPECT_TRUE(asked) << key.path << ": no scenario and no example has it, or no reader";
  });
  EXPECT_GT(count, 300);
}

TEST(Config, ABoundThatDependsOnOtherKeysIsNone) {
  AskedKey key;
  key.take(AskedKey::kNumber, 0.0, 1.0);
  key.take(AskedKey::kNumber, 0.0, 2.0);
  EXPECT_EQ(typeOfKey(key), "number, at least 0");
  EXPECT_EQ(unitOfKey("mass_kg"), "kg");
  EXPECT_EQ(unitOfKey("gain_extend_in_per_s_per_ma"), "in/s/mA");
  EXPECT_EQ(unitOfKey("mass"), "");
}

TEST(Config, ABeginningIsMeantRatherThanAnotherWord) {
  EXPECT_NE(refusal([] {
              loadExperiment(scenarios() / "z_sine.yaml", {"gravity=0"});
            }).find("did you mean gravity_m_per_s2?"),
            std::string::npos);
}

TEST(Config, AScenarioHasNoOtherOnesTitle) {
  const fs::path file =
      fs::temp_directory_path() / ("ves_title_" + std::to_string(getpid()) + ".yaml");
  const std::string from = "from: " + (scenarios() / "puma_on_table_4_1.yaml").string() + "\n";
  const auto titleOf = [&](const std::string& text) {
    std::ofstream(file) << from << text;
    return loadExperiment(file).description;
  };
  EXPECT_EQ(titleOf("name: mine\n"), "mine");
  EXPECT_EQ(titleOf("name: mine\ndescription: My own.\n"), "My own.");
  EXPECT_EQ(titleOf("seed: 3\n"),
            loadExperiment(scenarios() / "puma_on_table_4_1.yaml").description);
  fs::remove(file);
}

TEST(Config, ResolvedTextReadsBackToTheSameExperiment) {
  for (const auto& entry : fs::directory_iterator(scenarios())) {
    const Experiment e = loadExperiment(entry.path());
    const Experiment back = parseExperiment(e.source.resolved(), "resolved");
    EXPECT_EQ(back.source.resolved(), e.source.resolved());
    EXPECT_EQ(back.source.hash(), e.source.hash());
    EXPECT_EQ(back.controller.sensor.C_proc, e.controller.sensor.C_proc);
    EXPECT_EQ(back.controller.program.size, e.controller.program.size);
    EXPECT_EQ(back.robot.joint_names, e.robot.joint_names);
  }
}

TEST(Config, EveryMachineNumberIsTheReportsOrTagged) {
  // Keys whose untagged numbers are in the report, or are a choice of the experiment.
  const std::set<std::string> report = {"schema",
                                        "seed",
                                        "gravity_m_per_s2",
                                        "period_ns",
                                        "K_P",
                                        "K_D",
                                        "gain_extend_in_per_s_per_ma",
                                        "gain_retract_in_per_s_per_ma",
                                        "tau_s",
                                        "counts_per_in",
                                        "enabled",
                                        "feed_forward",
                                        "observer",
                                        "inertia",
                                        "adaptation",
                                        "wrench",
                                        "learns_masses",
                                        "filters",
                                        "model",
                                        "dead_band_n_or_nm",
                                        "low_pass_hz",
                                        "steady_in_contact",
                                        "legs",
                                        "force_sensor",
                                        "robot",
                                        "switches",
                                        "filter_cutoff_rad_per_s",
                                        "cutoff_hz",
                                        "readings_per_tick",
                                        "noise",
                                        "swing_c",
                                        "period_h",
                                        "rising_h",
                                        "name",
                                        "axis",
                                        "elements",
                                        "damping_ratio",
                                        "platform_rpy_deg",
                                        "translation_m",
                                        "rotation_deg",
                                        "mass_diagonal",
                                        "damping_diagonal",
                                        "stiffness_diagonal"};
  const std::function<void(const Value&, const std::string&, bool)> check =
      [&](const Value& value, const std::string& key, bool tagged) {
        tagged = tagged || !value.tag.empty();
        if (value.kind == Value::Kind::kScalar) {
          EXPECT_TRUE(tagged || report.count(key)) << key << " has no tag";
        }
        for (std::size_t i = 0; i < value.children.size(); ++i)
          check(value.children[i], value.kind == Value::Kind::kMap ? value.keys[i] : key, tagged);
      };
  for (const char* file : {"ves.yaml", "arms/srms.yaml"})
    check(loadDocument(fs::path(test::configDir()) / file), "", false);
}

TEST(Config, ABaseTooFastToStepWithABodyIsRefusedOnlyWithOne) {
  const auto load = [](const std::string& stiffness, const char* inertia) {
    return loadExperiment(test::configDir() + "/scenarios/free_decay.yaml",
                          {"base.stiffness_diagonal=[" + stiffness + ",2500,4000,1500,1000,2000]",
                           "controller.compensation.observer=true",
                           std::string("controller.compensation.inertia=") + inertia});
  };
  EXPECT_EQ(test::refusal([&] { load("1e9", "false"); }), "");
  EXPECT_EQ(test::refusal([&] { load("1e8", "true"); }), "");
  EXPECT_NE(test::refusal([&] {
              load("1e12", "true");
            }).find("base: with the inertia compensated its fastest mode, 4.472e+04 rad/s"),
            std::string::npos)
      << test::refusal([&] { load("1e12", "true"); });
}

TEST(Config, ReadingsFillTheControllersPeriodToWholeNanoseconds) {
  const auto load = [](const std::string& set, const std::string& period = "10000000") {
    return loadExperiment(test::configDir() + "/scenarios/free_decay.yaml",
                          {set, "controller.period_ns=" + period});
  };
  const Experiment once = load("sensor.readings_per_tick=1");
  EXPECT_EQ(once.plant.sensor_window, 0);
  EXPECT_EQ(once.controller.servo.sensor_window, 0.0);
  const Experiment mean = load("sensor.readings_per_tick=4");
  EXPECT_EQ(mean.plant.sensor_readings, 4);
  EXPECT_EQ(mean.plant.sensor_window, mean.controller.period);
  EXPECT_EQ(mean.controller.servo.sensor_window, mean.controller.periodSeconds());
  // 75 Hz, the report's own: each part has a middle, and their sum is short by nanoseconds.
  for (const auto& [readings, period] : {std::pair{4, 13'333'333}, {3, 10'000'000}}) {
    const Experiment e =
        load(fmt::format("sensor.readings_per_tick={}", readings), std::to_string(period));
    EXPECT_EQ(e.plant.sensor_window % (2 * readings), 0);
    EXPECT_LE(e.plant.sensor_window, period);
    EXPECT_GT(e.plant.sensor_window, period - 2 * readings);
    EXPECT_EQ(e.controller.servo.sensor_window, 1e-9 * static_cast<double>(e.plant.sensor_window));
  }
  EXPECT_NE(test::refusal([&] { load("sensor.readings_per_tick=0"); }).find("want"),
            std::string::npos);
}

TEST(Config, APlantMismatchChangesTheMachineAndNotWhatTheControllerBelieves) {
  const auto load = [](const std::string& set) {
    return loadExperiment(test::configDir() + "/scenarios/puma_tilt.yaml", {set});
  };
  const Experiment right = load("seed=1");
  const Experiment off = load(
      "plant_mismatch={gain_extend: 1.1, gain_retract: 0.9, tau: 1.2, mass: 1.05, center: 1.3, "
      "sensor_cutoff: 0.95}");
  EXPECT_DOUBLE_EQ(off.plant.actuator.gain_extend, 1.1 * right.plant.actuator.gain_extend);
  EXPECT_DOUBLE_EQ(off.plant.actuator.gain_retract, 0.9 * right.plant.actuator.gain_retract);
  EXPECT_DOUBLE_EQ(off.plant.actuator.tau, 1.2 * right.plant.actuator.tau);
  EXPECT_DOUBLE_EQ(off.plant.sensor.cutoff, 0.95 * right.plant.sensor.cutoff);
  const RigidBody &heavy = off.plant.payload.robot.link(1).body,
                  &link = right.plant.payload.robot.link(1).body;
  EXPECT_DOUBLE_EQ(heavy.mass, 1.05 * link.mass);
  EXPECT_LT((heavy.p_BoBcm_B - 1.3 * link.p_BoBcm_B).norm(), 1e-12);
  EXPECT_EQ(off.controller.payload, right.controller.payload);
  EXPECT_EQ(off.controller.servo.extend, right.controller.servo.extend);
  EXPECT_EQ(off.controller.servo.tau, right.controller.servo.tau);
  EXPECT_EQ(off.controller.servo.sensor_cutoff, right.controller.servo.sensor_cutoff);
}

TEST(Config, AnotherBaseReplacesTheMachinesOwn) {
  const auto base = [](const std::string& value) {
    return linearised(
        loadExperiment(scenarios() / "free_decay.yaml", {"base=" + value}).controller.vehicle);
  };
  const ModalModel modes = base(
      "{modes: {frequency_hz: [0.5, 1], damping_ratio: [0.02, 0.02], generalized_mass: [1, 1], "
      "shapes: [[1, 0], [0, 1], [0, "
      "0], "
      "[0, 0], [0, 0], [0, 0]]}}");
  EXPECT_EQ(modes.Phi.cols(), 2);
  EXPECT_NEAR(modes.stiffness(0), M_PI * M_PI, 1e-12);
  EXPECT_NEAR(modes.damping(1, 1), 2 * 0.02 * 2 * M_PI, 1e-12);
  const std::string full =
      "[[2, 1, 0, 0, 0, 0], [1, 2, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0], [0, 0, 0, "
      "0, 1, "
      "0], [0, 0, 0, 0, 0, 1]]";
  EXPECT_EQ(base("{mass: " + full + ", damping: " + full + ", stiffness: " + full + "}").Phi.cols(),
            6);
}

// --- Bad input: one line with file, line, key and what is allowed --------------------------------

struct Bad {
  const char* name;
  const char* scenario;
  const char* override;
  const char* says;  // must be in the message
};
std::ostream& operator<<(std::ostream& out, const Bad& bad) { return out << bad.name; }

TEST(Config, WhereRealLegsStandIsKnownOnceTheyHaveMoved) {
  const auto load = [](const std::string& program) {
    loadExperiment(scenarios() / "z_sine.yaml", {"machine.legs=external", "program=" + program});
  };
  EXPECT_NO_THROW(load("[{move: {duration_s: 0.1, to: {z_m: 0.2}}}]"));
  for (const char* known : {"[{move: {}}, {move: {duration_s: 0.1, to: {z_m: 0.2}}}]",
                            "[{move: {duration_s: 60, to: {z_m: 0.5}}}]"})
    EXPECT_THROW(load(known), WouldStop) << known;
}

class BadValue : public testing::TestWithParam<Bad> {};

TEST_P(BadValue, IsRefusedByName) {
  const Bad& bad = GetParam();
  const std::string message = refusal(
      [&] { loadExperiment(scenarios() / (std::string(bad.scenario) + ".yaml"), {bad.override}); });
  EXPECT_NE(message.find(bad.says), std::string::npos) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
}

INSTANTIATE_TEST_SUITE_P(
    Values, BadValue,
    testing::Values(
        Bad{"unknown_key", "z_sine", "legs.tau_ms=6.4", "legs.tau_ms: unknown key"},
        Bad{"hint", "z_sine", "legs.filter=none", "legs.filter: unknown key"},
        Bad{"modes_not_normalised", "z_sine",
            "base={modes: {frequency_hz: [1], damping_ratio: [0], generalized_mass: [2.5], shapes: "
            "[[1], [0], [0], [0], [0], [0]]}}",
            "base.modes.generalized_mass: mode 1 has 2.5, want 1"},
        Bad{"modes_of_another_shape", "z_sine",
            "base={modes: {frequency_hz: [1, 2], damping_ratio: [0, 0], generalized_mass: [1, 1], "
            "shapes: [[1, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]}}",
            "base.modes.shapes"},
        Bad{"pose_beyond_joint", "srms_unberth_puma", "base.arm.pose_deg.elbow_pitch=10",
            "base.arm.pose_deg.elbow_pitch: '10', want a number in [-161, 2.4]"},
        Bad{"no_such_joint", "srms_unberth_puma", "base.arm.pose_deg.knee=10",
            "base.arm.pose_deg.knee: unknown key"},
        Bad{"payload_without_inertia", "srms_unberth_puma", "base.arm.payload={mass_kg: 50}",
            "base.arm.payload.inertia_kg_m2"},
        Bad{"payload_that_cannot_be", "srms_unberth_puma",
            "base.arm.payload={mass_kg: 50, inertia_kg_m2: [1, 1, -1, 0, 0, 0]}",
            "base.arm.payload.inertia_kg_m2: smallest principal moment -1"},
        Bad{"modes_that_move_nothing", "z_sine",
            "base={modes: {frequency_hz: [1, 2], damping_ratio: [0, 0], generalized_mass: [1, 1], "
            "shapes: [[1, 0], [0, 0], [0, 0], [0, 0], [0, 0], [0, 0]]}}",
            "base.modes.shapes: column 2 is zero"},
        Bad{"range_backwards", "srms_unberth_puma",
            "base={arm: {damping_ratio: 0, stiffness_scale: 1, pose_deg: {a: 0}, chain: [{joint: "
            "{name: a, axis: [1, 0, 0], stiffness_nm_per_rad: 1, range_deg: [90, -90]}}]}}",
            "range_deg: [90, -90], want lower <= upper"},
        Bad{"one_name_for_two_joints", "srms_unberth_puma",
            "base={arm: {damping_ratio: 0, stiffness_scale: 1, pose_deg: {a: 0}, chain: [{joint: "
            "{name: a, axis: [1, 0, 0], stiffness_nm_per_rad: 1, range_deg: [-90, 90]}}, {joint: "
            "{name: a, axis: [0, 1, 0], stiffness_nm_per_rad: 1, range_deg: [-90, 90]}}]}}",
            "'a' is the name of another joint too"},
        Bad{"too_many_elements", "srms_unberth_puma",
            "base={arm: {damping_ratio: 0, stiffness_scale: 1, pose_deg: {}, chain: [{beam: {to_m: "
            "[1, 0, 0], EI_n_m2: 1, GJ_n_m2: 1, EA_n: 1, mass_kg: 1, radius_m: 0, elements: 100}}, "
            "{beam: {to_m: [1, 0, 0], EI_n_m2: 1, GJ_n_m2: 1, EA_n: 1, mass_kg: 1, radius_m: 0, "
            "elements: 1}}]}}",
            "606 degrees of freedom up to here, want at most 600"},
        Bad{"path_of_five", "z_sine", "program=[{path: {rows_m_deg: [[0, 0, 0, 0, 0]]}}]",
            "rows_m_deg[0]: has 5 entries, want 6"},
        Bad{"weight_in_space", "ship_arm", "gravity_m_per_s2=0",
            "base.weight: felt, and gravity_m_per_s2 is 0"},
        Bad{"weight_learnt", "ship_arm", "controller.compensation.learns_masses=true",
            "base.weight: felt: masses that are learnt move it"},
        Bad{"weight_unknown", "puma_on_table_4_1", "base.weight=felt",
            "base.weight: felt: the robot's is known with its inertia"},
        Bad{"weight_of_what_floats", "satellite_puma", "base.weight=felt",
            "base.weight: felt, and there are no springs to give way"},
        Bad{"weight_without_springs", "deck_puma", "base.weight=felt",
            "base.weight: felt, and there are no springs to give way"},
        Bad{"robot_in_its_segment", "puma_tilt",
            "program=[{move: {}}, {admittance: {duration_s: 3, robot: []}}]",
            "program[1].admittance.robot: stands beside admittance, not in it"},
        Bad{"row_that_is_none", "satellite_jets", "base.free.thrusters[0].firings_s=[1, 3]",
            "firings_s[0]: is a single value, want a list of 2 numbers"},
        Bad{"joint_too_fast", "puma_tilt",
            "program=[{calibration: {}, robot: [{at_s: 0, joint: joint_1, to_deg_or_m: 90, "
            "duration_s: 1}]}]",
            "joint 'joint_1' would move at up to 168.8 deg/s, want at most 110: 1.534 s or more"},
        Bad{"key_of_a_file", "puma_tilt", "robot.colour=red",
            "unknown key, known here: adapter, adapter_position_m, encoders, gripper_switch, "
            "joints, joints_deg_or_m, lock, mount_m, mount_rpy_deg, tip, urdf"},
        Bad{"path_of_nothing", "z_sine", "program=[{path: {rows_m_deg: []}}]",
            "rows_m_deg: want one or more rows of 6 numbers"},
        Bad{"admittance_of_a_slip", "z_sine", "program=[{admittance: {duration_s: 5, lasts: 1}}]",
            "lasts: unknown key"},
        Bad{"path_of_a_slip", "z_sine",
            "program=[{path: {rows_m_deg: [[0, 0, 0, 0, 0, 0]], rows_m: 1}}]",
            "rows_m: unknown key"},
        Bad{"path_that_leaps", "z_sine",
            "program=[{path: {rows_m_deg: [[0, 0, 0, 0, 0, 0], [0, 0, 0.001, 0, 0, 0], [0, 0, "
            "0.05, 0, 0, 0]]}}]",
            "program[0].path.rows_m_deg: row 3: the velocity check would stop the run"},
        Bad{"path_in_millimetres", "z_sine",
            "program=[{path: {rows_m_deg: [[0, 0, 400, 0, 0, 0]]}}]",
            "rows_m_deg: row 1: the motion limits check would stop the run"},
        Bad{"path_from_elsewhere", "z_sine",
            "program=[{move: {to: {z_m: 0.1}}}, {calibration: {}}, {path: {rows_m_deg: [[0, 0, 0, "
            "0, "
            "0, 0]]}}]",
            "program[2].path.rows_m_deg: begins elsewhere than the segment before it ends"},
        Bad{"two_paths", "z_sine",
            "program=[{path: {rows_m_deg: [[0, 0, 0, 0, 0, 0]]}}, {path: {rows_m_deg: [[0, 0, 0, "
            "0, 0, 0]]}}]",
            "is the second path"},
        Bad{"masses_of_another", "puma_tilt",
            "masses={date: 2026-01-01T00:00:00Z, kinematics: 12, bodies: [{mass_kg: 1, "
            "moment_kg_m: [0, 0, 0]}]}",
            "masses.kinematics: 12 is of another robot"},
        Bad{"too_many_modes", "srms_unberth_puma", "base.keep_modes=133",
            "base.keep_modes: '133', want a whole number in [1, 132]"},
        Bad{"massless_part", "srms_unberth_puma",
            "base={arm: {damping_ratio: 0, stiffness_scale: 1, pose_deg: {}, chain: [{beam: {to_m: "
            "[1, 0, 0], EI_n_m2: 1, GJ_n_m2: 1, EA_n: 1, mass_kg: 0, radius_m: 0, elements: 1}}]}}",
            "base.arm.chain: a part that can move has no mass"},
        Bad{"hanging_platform", "z_sine", "gravity_m_per_s2=[0, 1.7, 9.66]",
            "gravity_m_per_s2: [0, 1.7, 9.66] points up"},
        Bad{"move_out_of_the_workspace", "z_sine", "program=[{move: {}}, {move: {to: {z_m: 0.5}}}]",
            "program[1].move: the motion limits check would stop the run; want a target nearer"},
        Bad{"hasty_move", "z_sine", "program=[{move: {duration_s: 0.1, to: {z_m: 0.2}}}]",
            "program[0].move: the velocity check would stop the run"},
        Bad{"move_from_nobody_knows_where", "z_sine",
            "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 1}}, {move: {to: "
            "{alpha_deg: 60}}}]",
            "program[3].move: the motion limits check would stop the run"},
        Bad{"sine_out_of_the_workspace", "z_sine",
            "program=[{move: {}}, {trajectory: {duration_s: 4, z: {ramp: {to_m: 0.1}}}}, "
            "{trajectory: {duration_s: 9, z: {sine: {amplitude_m: 0.25, frequency_hz: 0.1}}}}]",
            "program[2].trajectory: the motion limits check would stop the run; want less of it"},
        Bad{"wide_tilt", "puma_on_table_4_1",
            "program=[{move: {}}, {calibration: {}}, {excite: {tilt_deg: 45, duration_s: 20}}]",
            "program[2].excite.tilt_deg: the motion limits check would stop the run"},
        Bad{"two_signs", "z_sine", "gravity_m_per_s2=+-1",
            "gravity_m_per_s2: '+-1', want a number in [0, 100]"},
        Bad{"nan", "z_sine", "legs.tau_s=nan", "legs.tau_s: 'nan', want a number in [1e-06, 1]"},
        Bad{"infinite", "z_sine", "platform.home_height_m=inf", "platform.home_height_m: 'inf'"},
        Bad{"with_unit", "z_sine", "legs.tau_s=6.4 ms", "legs.tau_s: '6.4 ms', want a number"},
        Bad{"typo", "z_sine", "legs.tau_s=0.0o64", "legs.tau_s: '0.0o64'"},
        Bad{"negative_tau", "z_sine", "legs.tau_s=-1", "legs.tau_s: '-1'"},
        Bad{"zero_period", "z_sine", "controller.period_ns=0", "want a whole number in [1000000,"},
        Bad{"period_not_whole", "z_sine", "controller.period_ns=1e7", "want a whole number"},
        Bad{"short_vector", "z_sine", "sensor.gain=[1000, 1000]", "has 2 entries, want 6"},
        Bad{"scalar_for_vector", "z_sine", "sensor.gain=1000", "want a list of 6 numbers"},
        Bad{"map_for_number", "z_sine", "legs.tau_s={a: 1}", "is a map, want a number"},
        Bad{"wrong_rows", "z_sine", "sensor.sensitivity_uv_per_v=[[1]]", "want 6 rows of 6"},
        Bad{"singular_sensor", "z_sine", "sensor.excitation_v=0", "sensor.excitation_v: '0'"},
        Bad{"indefinite_mass", "z_sine", "base.mass_diagonal=[500, 500, 500, 250, 250, -1]",
            "base.mass_diagonal: smallest eigenvalue -1, want all above 0"},
        Bad{"zero_mass", "z_sine", "base.mass_diagonal=[500, 500, 500, 250, 250, 0]",
            "positive definite"},
        Bad{"negative_stiffness", "z_sine", "base.stiffness_diagonal=[-1, 0, 0, 0, 0, 0]",
            "base.stiffness_diagonal: smallest eigenvalue -1, want none below 0"},
        Bad{"negative_damping", "z_sine", "base.damping_diagonal=[0, 0, 0, 0, 0, -5]",
            "positive semidefinite"},
        Bad{"choice", "z_sine", "legs.filters=all",
            "legs.filters: 'all', want one of none, outputs"},
        Bad{"body_without_mass", "z_sine",
            "base=!replace {free: {mass_kg: 0, inertia_kg_m2: [1, 1, 1, 0, 0, 0]}}",
            "base.free.mass_kg: no mass, want more than 0"},
        Bad{"body_without_inertia", "z_sine",
            "base=!replace {free: {mass_kg: 5, inertia_kg_m2: [1, 1, 0, 0, 0, 0]}}",
            "base.free.inertia_kg_m2: principal moments of 0, 1 and 1 kg m^2 about the centre of "
            "mass: want all above 0"},
        Bad{"body_of_no_shape", "z_sine",
            "base=!replace {free: {mass_kg: 5, inertia_kg_m2: [1, 1, 3, 0, 0, 0]}}",
            "no body's, want none above the sum of the others"},
        Bad{"inertia_less_than_its_mass_has", "z_sine",
            "base=!replace {free: {mass_kg: 5, center_m: [0, 0, 1], inertia_kg_m2: [4, 6, 2, 0, 0, "
            "0], inertia_about_m: [0, 0, 0]}}",
            "base.free.inertia_kg_m2: principal moments of -1, 1 and 2 kg m^2"},
        Bad{"mass_twice", "z_sine",
            "base.mass=[[9,0,0,0,0,0],[0,9,0,0,0,0],[0,0,9,0,0,0],[0,0,0,9,0,0],[0,0,0,0,9,0],[0,0,"
            "0,0,0,9]]",
            "base.mass: stands beside mass_diagonal, want one of them"},
        Bad{"stiffness_twice", "z_sine",
            "base.stiffness=[[9,0,0,0,0,0],[0,9,0,0,0,0],[0,0,9,0,0,0],[0,0,0,9,0,0],[0,0,0,0,9,0],"
            "[0,0,0,0,0,9]]",
            "base.stiffness: stands beside stiffness_diagonal, want one of them"},
        Bad{"two_kinds_of_base", "satellite_puma", "base.mass_diagonal=[500,500,500,250,250,250]",
            "base.mass_diagonal: stands beside free, want a base of one kind"},
        Bad{"millimetres_for_metres", "z_sine",
            "program=[{trajectory: {duration_s: 1, z: {sine: {amplitude_m: 200, frequency_hz: "
            "1}}}}]",
            "amplitude_m: '200', want a number in [-5, 5]"},
        Bad{"thruster_without_force", "satellite_hold",
            "base.free.thrusters=[{at_m: [0, 0, 0], force_n: [0, 0, 0], firings_s: [[1, 2]]}]",
            "base.free.thrusters[0].force_n: no force"},
        Bad{"firing_that_ends_first", "satellite_hold",
            "base.free.thrusters=[{at_m: [0, 0, 0], force_n: [0, 1, 0], firings_s: [[2, 1]]}]",
            "base.free.thrusters[0].firings_s: [2, 1], want each to end after it begins"},
        Bad{"firings_that_overlap", "satellite_hold",
            "base.free.thrusters=[{at_m: [0, 0, 0], force_n: [0, 1, 0], firings_s: [[1, 2], [1.5, "
            "3]]}]",
            "[1.5, 3], want each"},
        Bad{"firing_too_short", "satellite_hold",
            "base.free.thrusters=[{at_m: [0, 0, 0], force_n: [0, 1, 0], least_on_s: 0.5, "
            "firings_s: [[1, 1.1]]}]",
            "[1, 1.1] is shorter than least_on_s of 0.5"},
        Bad{"firing_after_the_end", "satellite_hold",
            "base.free.thrusters=[{at_m: [0, 0, 0], force_n: [0, 1, 0], firings_s: [[1, 2], [100, "
            "101]]}]",
            "base.free.thrusters: number 0, firings_s: begins at 100 s, when admittance control "
            "has "
            "ended after 14 s"},
        Bad{"wheel_after_the_end", "satellite_hold",
            "base.free.wheels=[{axis: [0, 0, 1], most_nms: 1, torques_s_nm: [[14, 15, 1]]}]",
            "base.free.wheels: number 0, torques_s_nm: begins at 14 s"},
        Bad{"wheel_without_axis", "satellite_hold",
            "base.free.wheels=[{axis: [0, 0, 0], most_nms: 1, torques_s_nm: [[1, 2, 1]]}]",
            "base.free.wheels[0].axis: no direction"},
        Bad{"wheel_that_is_full", "satellite_hold",
            "base.free.wheels=[{axis: [0, 0, 1], most_nms: 1.5, torques_s_nm: [[1, 2, 1], [3, 4, "
            "1]]}]",
            "after 4 s the wheel has -2 N m s, want at most most_nms of 1.5"},
        Bad{"wheel_torque_that_ends_first", "satellite_hold",
            "base.free.wheels=[{axis: [0, 0, 1], most_nms: 9, torques_s_nm: [[2, 1, 1]]}]",
            "[2, 1, 1], want each to end after it begins"},
        Bad{"hold_without_torque", "satellite_hold", "base.free.attitude_hold.torque_nm=[0, 0, 0]",
            "base.free.attitude_hold.torque_nm: none, want one about some axis"},
        Bad{"hold_without_a_band", "satellite_hold", "base.free.attitude_hold.dead_band_deg=0",
            "base.free.attitude_hold.dead_band_deg"},
        Bad{"fast_without_a_laboratory_that_flies", "satellite_puma",
            "base.free.velocity_m_per_s=[0, 2, 0]",
            "base.free: velocity_m_per_s: faster than 1 m/s, which no platform follows"},
        Bad{"laboratory_that_flies_along_with_modes", "ship_arm",
            "controller.moving_frame.enabled=true",
            "controller.moving_frame.enabled: this base stays where it is"},
        Bad{"laboratory_that_flies_by_a_raw_wrench", "satellite_tumbling",
            "controller.compensation.wrench=raw",
            "controller.moving_frame.enabled: what the laboratory does to the robot"},
        Bad{"laboratory_in_more_than_the_workspace", "satellite_tumbling",
            "controller.moving_frame.share=1.1", "controller.moving_frame.share: '1.1'"},
        Bad{"laboratory_that_does_not_follow", "satellite_tumbling",
            "controller.moving_frame.acceleration_m_per_s2=0",
            "controller.moving_frame.acceleration_m_per_s2: '0'"},
        Bad{"push_in_a_laboratory_that_flies", "satellite_tumbling",
            "program=!replace [{admittance: {duration_s: 5}, robot: [{at_s: 1, push: {on: "
            "platform, force_n: [5, 0, 0]}, duration_s: 1}]}]",
            "controller.moving_frame.enabled: a push is in the laboratory's axes"},
        Bad{"modes_of_a_body", "z_sine",
            "base=!replace {free: {mass_kg: 5, inertia_kg_m2: [1, 1, 1, 0, 0, 0]}, keep_modes: 2}",
            "base.keep_modes"},
        Bad{"inertia_without_observer", "z_sine", "controller.compensation.inertia=true",
            "controller.compensation.inertia: needs the observer, want 'observer: true'"},
        Bad{"adaptation_without_observer", "z_sine", "controller.compensation.adaptation=true",
            "controller.compensation.adaptation: needs the observer, want 'observer: true'"},
        Bad{"learning_without_a_model", "z_sine", "controller.compensation.learns_masses=true",
            "controller.compensation.learns_masses: needs the robot's model beside the sensor, "
            "want 'wrench: aided'"},
        Bad{"gripper_without_learning", "puma_on_table_4_1",
            "program=[{move: {}}, {admittance: {duration_s: 9}, robot: [{at_s: 1, gripper: "
            "true}]}]",
            "gripper: what it holds is to be learnt, want 'learns_masses: true' in "
            "controller.compensation"},
        Bad{"aided_without_inertia", "z_sine", "controller.compensation.wrench=aided",
            "'aided' needs the robot's inertia taken out, want 'inertia: true'"},
        Bad{"wrench_choice", "z_sine", "controller.compensation.wrench=clean",
            "controller.compensation.wrench: 'clean', want one of raw, aided"},
        Bad{"flag", "z_sine", "sensor.noise=yes", "sensor.noise: 'yes', want one of true, false"},
        Bad{"stroke_outside_transducer", "z_sine", "legs.offset_m=1.3", "14-bit transducer"},
        Bad{"stroke_beyond_transducer", "z_sine", "legs.counts_per_in=700",
            "legs.counts_per_in: the stroke of 0.6500 m takes more than 14 bits, want at most 640"},
        Bad{"leg_too_long_at_home", "z_sine", "safety.leg_max_m=1.5",
            "safety.leg_max_m: leg 1 is 1.5277 m at home, want [1.2200, 1.5000] around it"},
        Bad{"legs_too_near_at_home", "z_sine", "safety.leg_clearance_m=0.5",
            "safety.leg_clearance_m: legs 1 and 6 are 0.1531 m apart"},
        Bad{"leg_too_flat_at_home", "z_sine", "safety.plate_angle_deg=80",
            "safety.plate_angle_deg: leg 1 stands at 62."},
        Bad{"badly_conditioned_at_home", "z_sine", "safety.condition_number=1.2",
            "safety.condition_number: it is 1.31 at home"},
        Bad{"platform_below_base", "arm_on_desk", "platform.home_height_m=0.01",
            "platform.home_height_m: leg 2 stands at 0.0 deg"},
        Bad{"four_coordinates_a_joint", "z_sine",
            "platform.base_joints_m=[[1,0,0,0],[0,1,0,0],[0,0,1,0],[1,0,0,0],[0,1,0,0],[0,0,1,0]]",
            "platform.base_joints_m: has 4 coordinates a joint, want x, y or x, y, z"},
        Bad{"derived_elsewhere", "z_sine", "legs.tau_s=derived", "legs.tau_s: 'derived', want"},
        Bad{"derived_out_of_range", "arm_on_desk", "platform.home_height_m=0.02",
            "safety.rotation_deg: inside of the workspace, at alpha -12 deg, the platform is near "
            "singular"},
        Bad{"joints_numbered_one_off", "arm_on_desk",
            "platform.platform_joints_m=[[0.040148,0.044589],[0.018541,0.057063],[-0.058689,0."
            "012475],[-0.058689,-0.012475],[0.018541,-0.057063],[0.040148,-0.044589]]",
            "the platform is near singular"},
        Bad{"legs_that_cross", "arm_on_desk", "platform.home_height_m=9.5",
            "platform.platform_joints_m: at home legs 1 and 6 cross: their axes are 25 mm apart"},
        Bad{"platform_in_inches", "arm_on_desk",  // the desk's own, times 39.37
            "platform={base_joints_m: "
            "[[3.85,-0.82],[3.85,0.82],[-1.22,3.74],[-2.63,2.93],[-2.63,-2."
            "93],[-1.22,-3.74]], platform_joints_m: [[1.58,-1.76],[1.58,1.76],[0.73,2.25],[-2.31,0."
            "49],[-2.31,-0.49],[0.73,-2.25]], home_height_m: 5.51}",
            "are the platform's lengths in inches or mm, and not in m?"},
        Bad{"initial_pose_out_of_reach", "z_sine", "initial_pose.z_m=0.9",
            "initial_pose: takes leg 1 to 2.3"},
        Bad{"joint_outside_limits", "puma_tilt", "robot.joints_deg_or_m=[0, 90, 0, 0, 0, 0]",
            "joint 'joint_2' at 90, want [-225, 45] deg"},
        Bad{"joint_count", "puma_tilt", "robot.joints_deg_or_m=[0]", "has 1 entries, want 6"},
        Bad{"no_such_section", "z_sine", "robots.urdf_text=x", "robots: unknown key"},
        Bad{"empty_program", "z_sine", "program=[]", "program: has 0 segments"},
        Bad{"unknown_segment", "z_sine", "program=[{dance: {}}]", "program[0].dance: unknown"},
        Bad{"unknown_fault", "z_sine",
            "program=[{trajectory: {duration_s: 1}, faults: [{at_s: 0, duration_s: 1, fault: "
            "gremlin}]}]",
            "'gremlin', want one of wrench_frozen"},
        Bad{"encoders_without_a_joint", "puma_tilt",
            "robot.encoders={counts_per_turn: [4096, 4096]}",
            "robot.encoders.counts_per_turn: has 2 entries, want 6"},
        Bad{"encoders_of_few_counts", "puma_tilt", "robot.encoders={counts_per_turn: 4}",
            "robot.encoders.counts_per_turn: "},
        Bad{"excite_with_events", "puma_tilt",
            "program=[{excite: {tilt_deg: 4, duration_s: 9}, robot: [{at_s: 0, duration_s: 1, "
            "joint: joint_1, to_deg_or_m: 1}]}]",
            "program[0].excite: has events beside it, want it alone"},
        Bad{"excite_without_angle", "z_sine", "program=[{excite: {duration_s: 9}}]",
            "program[0].excite.tilt_deg: missing"},
        Bad{"two_kinds", "z_sine", "program=[{move: {}, calibration: {}}]",
            "want only one of them"},
        Bad{"sine_without_frequency", "z_sine",
            "program=[{trajectory: {duration_s: 1, x: {sine: {amplitude_m: 0.1}}}}]",
            "program[0].trajectory.x.sine.frequency_hz: missing"},
        Bad{"angle_in_metres", "z_sine",
            "program=[{trajectory: {duration_s: 1, alpha: {ramp: {to_m: 0.1}}}}]",
            "to_deg: missing"},
        Bad{"robot_event_without_robot", "z_sine",
            "program=[{move: {}, robot: [{at_s: 0, duration_s: 1, joint: a, to_deg_or_m: 1}]}]",
            "there is no robot"},
        Bad{"unknown_joint", "puma_tilt",
            "program=[{move: {}, robot: [{at_s: 0, duration_s: 1, joint: elbow, to_deg_or_m: 1}]}]",
            "joint: 'elbow', want one of joint_1, joint_2"},
        Bad{"name_is_a_path", "z_sine", "name=../up", "name: want letters"},
        Bad{"schema", "z_sine", "schema=2", "schema: '2'"},
        Bad{"override_without_value", "z_sine", "seed", "--set seed: want key.path=value"},
        Bad{"tag", "z_sine", "seed=!guess 4", "tag !guess"}),
    [](const auto& test) { return std::string(test.param.name); });

class BadFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() /
              ("ves_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) +
               std::to_string(getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  std::string load(const std::string& text) {
    const fs::path file = write("a.yaml", text);
    return refusal([&] { loadExperiment(file); });
  }
  fs::path folder_;
};

TEST_F(BadFile, NamesFileAndLine) {
  const std::string base = "from: " + (fs::path(test::configDir()) / "ves.yaml").string() + "\n";
  EXPECT_EQ(load(base + "name: a\ndescription: b\nprogram:\n  - move: {}\nlegs:\n  tau_s: 7\n"),
            (folder_ / "a.yaml").string() + ":7: legs.tau_s: '7', want a number in [1e-06, 1]");
  EXPECT_EQ(load(base + "name: a\ndescription: b\nprogram:\n  - move: {}\nsede: 3\n")
                .rfind((folder_ / "a.yaml").string() + ":6: sede: unknown key", 0),
            0u);
}

TEST_F(BadFile, AsymmetryNamesTheEntries) {
  const std::string scenario = (scenarios() / "z_sine.yaml").string();
  std::string rows;
  for (int i = 0; i < 6; ++i) {
    rows += "    - [";
    for (int j = 0; j < 6; ++j)
      rows += std::string(j ? ", " : "") + (i == j ? "500" : i == 0 && j == 1 ? "1" : "0");
    rows += "]\n";
  }
  const std::string machine = test::readText(test::configDir() + "/ves.yaml");
  const std::string text = machine.substr(0, machine.find("base:\n")) + "base:\n  mass:\n" + rows +
                           "  damping_diagonal: [0, 0, 0, 0, 0, 0]\n"
                           "  stiffness_diagonal: [0, 0, 0, 0, 0, 0]\n"
                           "initial_pose: {}\nname: a\ndescription: b\nprogram: [{move: {}}]\n";
  EXPECT_NE(load(text).find("base.mass: not symmetric: entry [1][0] is 0, [0][1] is 1"),
            std::string::npos)
      << load(text);
}

TEST_F(BadFile, SaysWhatIsNotYaml) {
  EXPECT_NE(load("a: [1, 2\nb: 3\n").find("not YAML"), std::string::npos);
  EXPECT_NE(load("- 1\n- 2\n").find("want a map of keys"), std::string::npos);
  EXPECT_NE(load("").find("want a map of keys"), std::string::npos);
  EXPECT_NE(load("a: 1\na: 2\n").find("a: given twice"), std::string::npos);
  EXPECT_NE(refusal([&] { loadExperiment(folder_ / "none.yaml"); }).find("no such file"),
            std::string::npos);
  EXPECT_NE(refusal([&] { loadExperiment(folder_); }).find("not a file"), std::string::npos);
}

TEST_F(BadFile, StopsAtFilesThatNameEachOther) {
  write("b.yaml", "from: a.yaml\n");
  EXPECT_NE(load("from: b.yaml\n").find("in a circle"), std::string::npos);
}

TEST_F(BadFile, StopsAtAliasesThatMultiply) {
  std::string text = "a0: &a0 [1,1,1,1,1,1,1,1,1,1]\n";
  for (int i = 1; i < 8; ++i) {
    text += fmt::format("a{}: &a{} [", i, i);
    for (int k = 0; k < 10; ++k) text += fmt::format("{}*a{}", k ? "," : "", i - 1);
    text += "]\n";
  }
  EXPECT_NE(load(text).find("more than"), std::string::npos);
}

// --- URDF ----------------------------------------------------------------------------------------

std::string link(const std::string& name, const std::string& inertia = "0.1") {
  return "<link name=\"" + name + "\">\n<inertial><mass value=\"1\"/><inertia ixx=\"" + inertia +
         "\" iyy=\"0.1\" izz=\"0.1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>\n";
}
std::string joint(const std::string& name, const std::string& parent, const std::string& child,
                  const std::string& type = "revolute") {
  return "<joint name=\"" + name + "\" type=\"" + type + "\">\n<parent link=\"" + parent +
         "\"/><child link=\"" + child +
         "\"/><axis xyz=\"0 0 1\"/>"
         "<limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>\n";
}
std::string urdf(const std::string& body) {
  return "<?xml version=\"1.0\"?>\n<robot name=\"r\">\n" + body + "</robot>\n";
}
std::string urdfRefusal(const std::string& text) {
  return refusal([&] { loadUrdf(text, "r.urdf"); });
}

TEST(Urdf, AcceptsAnySerialArm) {
  const UrdfRobot robot = loadUrdf(
      urdf(link("a") + link("b") + link("c") + link("tool") + joint("j1", "a", "b", "prismatic") +
           joint("j2", "b", "c", "continuous") + joint("f", "c", "tool", "fixed")),
      "r.urdf");
  EXPECT_EQ(robot.model.joints, 2);
  EXPECT_EQ(robot.model.link(0).type, JointType::kPrismatic);
  EXPECT_EQ(robot.model.link(1).type, JointType::kRevolute);
  EXPECT_DOUBLE_EQ(robot.model.link(1).body.mass, 2.0);  // the tool is counted in
  EXPECT_TRUE(robot.warnings.empty());
}

TEST(Urdf, WarnsAboutALinkThatMovesWithoutMass) {
  const UrdfRobot robot =
      loadUrdf(urdf(link("a") + "<link name=\"b\"/>\n" + joint("j1", "a", "b")), "r.urdf");
  ASSERT_EQ(robot.warnings.size(), 1u);
  EXPECT_EQ(robot.warnings[0], "r.urdf:5: link 'b' moves and has no mass");
}

TEST(Urdf, WarnsAboutInertiasThatNoRigidBodyHas) {
  const UrdfRobot puma = test::robot("puma560");
  ASSERT_EQ(puma.warnings.size(), 2u);
  for (const char* what : {"puma560.urdf:", "link 'link_1'", "and 1 more: link 'link_3'"})
    EXPECT_NE(puma.warnings[0].find(what), std::string::npos) << puma.warnings[0];
  // As the report has it, too.
  EXPECT_NE(puma.warnings[1].find("link 'link_0': its inertia is that of a point"),
            std::string::npos)
      << puma.warnings[1];
  EXPECT_NE(test::robot("doss").warnings[0].find("link 'link_3'"), std::string::npos);
}

TEST(Urdf, RefusesWithFileLineAndName) {
  EXPECT_NE(urdfRefusal(urdf(link("a") + link("b") + joint("j1", "a", "gone"))).find("gone"),
            std::string::npos);
  EXPECT_NE(urdfRefusal(urdf(link("a") + link("b") + joint("j1", "a", "b") + joint("j2", "b", "a")))
                .find("r.urdf:"),
            std::string::npos);  // cyclic
  EXPECT_NE(urdfRefusal(urdf(link("a") + link("b") + joint("j1", "a", "b", "planar")))
                .find("not supported"),
            std::string::npos);
  EXPECT_NE(urdfRefusal(urdf(link("a") + link("b", "-0.1") + joint("j1", "a", "b")))
                .find("principal moment"),
            std::string::npos);
  EXPECT_NE(urdfRefusal(urdf(link("a") + link("b", "nan") + joint("j1", "a", "b"))), "");
  EXPECT_NE(urdfRefusal("not xml").find("r.urdf:1"), std::string::npos);
  EXPECT_NE(urdfRefusal(""), "");
  for (const std::string& text : {std::string("not xml"), urdf(""), urdf(link("a") + link("b"))})
    EXPECT_EQ(urdfRefusal(text).find('\n'), std::string::npos);
}

TEST(Config, TheOldNameOfPlantMismatchDoesNotApplyTwice) {
  const auto load = [](const std::vector<std::string>& set) {
    return loadExperiment(test::configDir() + "/scenarios/z_sine.yaml", set);
  };
  EXPECT_NE(test::refusal([&] {
              load({"reality={gain_extend: 0.5}", "plant_mismatch={gain_extend: 0.5}"});
            }).find("want one of them"),
            std::string::npos);
  EXPECT_EQ(load({"reality={gain_extend: 0.5}"}).plant.actuator.gain_extend,
            load({"plant_mismatch={gain_extend: 0.5}"}).plant.actuator.gain_extend);
}

// Tilts there and back about x and y, in equal times, that end at home.
TEST(Config, AnExcitationIsFiveMoves) {
  const Experiment e =
      loadExperiment(test::configDir() + "/scenarios/z_sine.yaml",
                     {"program=[{calibration: {}}, {excite: {tilt_deg: 4, duration_s: 9}}]"});
  const Program& program = e.controller.program;
  ASSERT_EQ(program.size, 6);
  Vec6 sum = Vec6::Zero(), most = Vec6::Zero();
  for (std::size_t i = 1; i < 6; ++i) {
    const Segment& move = program.segments[i];
    EXPECT_EQ(move.kind, SegmentKind::kMove);
    EXPECT_NEAR(move.duration, 9.0 / 5.0, 1e-12);
    sum += move.target.stacked();
    most = most.cwiseMax(move.target.stacked().cwiseAbs());
  }
  EXPECT_TRUE(sum.isZero(0.0));
  EXPECT_TRUE(most.isApprox((Vec6() << 0, 0, 0, 4, 4, 0).finished() * M_PI / 180.0));
  EXPECT_TRUE(program.segments[5].target.stacked().isZero(0.0));
}

TEST(Config, HydraulicLegsThatCannotBeAreRefused) {
  const auto said = [](std::vector<std::string> set) {
    set.push_back("legs.model=hydraulic");
    return refusal([&] { loadExperiment(scenarios() / "z_sine.yaml", set); });
  };
  EXPECT_EQ(said({}), "");
  const std::pair<std::vector<std::string>, std::string> bad[] = {
      {{"legs.filters=outputs"}, "legs.filters: are of ideal legs, want none"},
      {{"machine.legs=external"}, "legs.model: is hydraulic, want ideal"},
      {{"legs.hydraulic.supply_mpa=0.1"}, "legs.hydraulic: no areas give the leg's two gains"},
      {{"legs.hydraulic.gains_at_ma=1", "legs.hydraulic.valve_opening_ma=-2"},
       "legs.hydraulic.gains_at_ma: is within the valve's overlap"},
      {{"legs.hydraulic.breakaway_n=100"},
       "legs.hydraulic.breakaway_n: '100', want a number in [150,"},
      {{"legs.hydraulic=three_way"}, "legs.hydraulic"}};
  for (const auto& [set, part] : bad) {
    EXPECT_NE(said(set).find(part), std::string::npos) << said(set);
    EXPECT_EQ(said(set).find('\n'), std::string::npos) << said(set);
  }
}

TEST(Config, SubstitutesOfLegsThatAreNotThereAreNotCounted) {
  const std::string text = test::readText(test::configDir() + "/ves.yaml");
  const std::size_t begin = text.find("\n  hydraulic:"), end = text.find("\n  watchdog:");
  ASSERT_LT(begin, end);
  int tagged = 0;  // numbers
  for (std::size_t at = begin; (at = text.find("!substitute", at + 1)) < end;) {
    const std::string value = text.substr(at, text.find_first_of("#\n", at) - at);
    tagged += 1 + static_cast<int>(std::count(value.begin(), value.end(), ','));  // of a vector
  }
  EXPECT_GT(tagged, 20);
  EXPECT_EQ(test::experiment("z_sine", {"legs.model=hydraulic"}).source.substitutes -
                test::experiment("z_sine").source.substitutes,
            tagged);
}

TEST(Config, FaultsOfCylindersAreOfHydraulicLegs) {
  const auto said = [](const std::string& fault, const std::string& model) {
    return refusal([&] {
      loadExperiment(
          scenarios() / "z_sine.yaml",
          {"legs.model=" + model,
           "program=[{move: {}, faults: [{at_s: 0, duration_s: 1, fault: " + fault + "}]}]"});
    });
  };
  for (const char* fault :
       {"supply_falls, share: 0.3", "leg_leaks, which: 2, l_per_min_mpa: 1",
        "air_in_oil, which: 6, share: 0.1", "leg_sticks, which: 1, newtons: 900",
        "seal_worn, which: 3, l_per_min_mpa: 0.5"}) {
    EXPECT_EQ(said(fault, "hydraulic"), "") << fault;
    EXPECT_NE(said(fault, "ideal").find("want legs.model: hydraulic"), std::string::npos) << fault;
  }
  EXPECT_EQ(said("valve_stuck, which: 1", "hydraulic"), "");
  EXPECT_NE(said("air_in_oil, which: 6, share: 0", "hydraulic").find("share: '0', want"),
            std::string::npos);
  EXPECT_NE(said("air_in_oil, which: 7, share: 0.5", "hydraulic").find("which: '7', want"),
            std::string::npos);
}

TEST(Config, WhatGivesWayIsToldOrFollowsFromTheSimulatedLegs) {
  const auto resonance = [](const std::vector<std::string>& set) {
    return loadExperiment(scenarios() / "z_sine.yaml", set).controller.resonance;
  };
  EXPECT_EQ(resonance({}).frequency, 0.0);
  const Resonance derived = resonance({"legs.model=hydraulic"});
  EXPECT_GT(derived.frequency, 0.0);
  EXPECT_GT(derived.feedback, 0.0);
  // What the plant is beside the belief is nobody's to know.
  const Resonance off = resonance({"legs.model=hydraulic", "plant_mismatch={gain_extend: 1.1}"});
  EXPECT_EQ(off.frequency, derived.frequency);
  EXPECT_EQ(off.feedback, derived.feedback);
  const Resonance told = resonance({"machine.legs=external", "machine.resonance.lowest_hz=15",
                                    "machine.resonance.damping_ratio=0.05",
                                    "machine.resonance.turning_gain=1.2"});
  EXPECT_EQ(told.turning, 1.2);
  EXPECT_NEAR(told.frequency, 2.0 * M_PI * 15.0, 1e-9);
  EXPECT_EQ(told.damping, 0.05);
  EXPECT_NE(refusal([&] {
              resonance({"machine.resonance.lowest_hz=15"});
            }).find("machine.resonance.damping_ratio"),
            std::string::npos);
  for (const char* unused :
       {"machine.resonance.damping_ratio=0.05", "machine.resonance.pressure_feedback_per_s=50"})
    EXPECT_NE(refusal([&] { resonance({unused}); }).find("machine.resonance.lowest_hz"),
              std::string::npos)
        << unused;
}

// Of more moves than a program holds, none is lost in silence.
TEST(Config, ExcitationsThatFillAProgramAreRefused) {
  std::string program;
  for (int i = 0; i < kMaxSegments / 5 + 1; ++i)
    program += fmt::format("{}{{excite: {{tilt_deg: 4, duration_s: 9}}}}", i > 0 ? ", " : "");
  const std::string said = test::refusal([&] {
    loadExperiment(test::configDir() + "/scenarios/z_sine.yaml",
                   {fmt::format("program=[{}]", program)});
  });
  EXPECT_NE(said.find(fmt::format("has more than {} segments", kMaxSegments)), std::string::npos)
      << said;
}

TEST(Config, LoadsAreToldInTheOrderOfTheirTimes) {
  // Released after it was grasped, and told sooner.
  const Experiment e = loadExperiment(test::configDir() + "/scenarios/puma_on_table_4_1.yaml",
                                      {"program=[{admittance: {duration_s: 14}, robot: [{at_s: 1, "
                                       "grasp: {mass_kg: 2, center_m: [0, 0, 0], "
                                       "inertia_kg_m2: [0.01, 0.01, 0.01, 0, 0, 0], told_after_s: "
                                       "5}}, {at_s: 3, release: {told_after_s: 0.5}}]}]"});
  const ToldLoads& told = e.controller.told_loads;
  ASSERT_EQ(told.size, 2);
  EXPECT_EQ(told.loads[0].cue.after, 3'500'000'000);
  EXPECT_EQ(told.loads[0].body.mass, 0.0);
  EXPECT_EQ(told.loads[1].cue.after, 6'000'000'000);
}

TEST(Config, WhatDecidesAboutSafetyIsAKey) {
  const SafetyLimits l =
      test::experiment("z_sine", {"safety.reading_speed=2.5", "safety.speed_memory_s=0.7",
                                  "safety.reading_patience=3", "safety.growth_window_s=0.25",
                                  "safety.window_growth=1.75", "safety.tool_singularity=0.125"})
          .controller.safety;
  EXPECT_EQ(l.reading_speed, 2.5);
  EXPECT_EQ(l.speed_memory, 0.7);
  EXPECT_EQ(l.reading_patience, 3);
  EXPECT_EQ(l.window, 0.25);
  EXPECT_EQ(l.window_growth, 1.75);
  EXPECT_EQ(l.tool_singularity, 0.125);
}

// A key's unit is in its name; the programs reckon in SI. Each with a value of its own, so that
// none stands in another's place.
TEST(Config, EveryNumberArrivesInItsPlaceInSi) {
  struct Row {
    const char* set;
    double value;
    std::function<double(const Experiment&)> is;
  };
  const auto arrive = [](const char* scenario, std::vector<std::string> more,
                         const std::vector<Row>& rows) {
    for (const Row& row : rows) more.push_back(row.set);
    const Experiment e = test::experiment(scenario, more);
    for (const Row& row : rows)
      EXPECT_NEAR(row.is(e), row.value, 1e-12 * std::abs(row.value)) << row.set;
  };
  constexpr double kTurn = 2.0 * M_PI, kDeg = M_PI / 180.0, kInch = 0.0254;
  const auto c = [](auto of) { return [of](const Experiment& e) { return of(e.controller); }; };
  const auto p = [](auto of) { return [of](const Experiment& e) { return of(e.plant); }; };
  arrive(
      "z_sine", {},
      {{"controller.gentle_speed_m_per_s=0.07", 0.07, c([](auto& x) { return x.gentle.speed; })},
       {"controller.gentle_rotation_deg_per_s=11", 11 * kDeg,
        c([](auto& x) { return x.gentle.rotation; })},
       {"controller.gentle_braking_m_per_s2=0.33", 0.33,
        c([](auto& x) { return x.gentle.braking.translation; })},
       {"controller.gentle_rotation_braking_deg_per_s2=44", 44 * kDeg,
        c([](auto& x) { return x.gentle.braking.rotation; })},
       {"controller.stop_braking_m_per_s2=4.5", 4.5,
        c([](auto& x) { return x.stop_braking.translation; })},
       {"controller.stop_rotation_braking_deg_per_s2=456", 456 * kDeg,
        c([](auto& x) { return x.stop_braking.rotation; })},
       {"controller.tare_ramp_s=1.7", 1.7, c([](auto& x) { return x.tare_ramp; })},
       {"controller.compensation.ramp_s=1.9", 1.9, c([](auto& x) { return x.compensation.ramp; })},
       {"controller.compensation.reading_jitter_s=0.0004", 0.0004,
        c([](auto& x) { return x.compensation.jitter; })},
       {"controller.compensation.forgetting_s=23", 23,
        c([](auto& x) { return x.compensation.forgetting; })},
       {"controller.compensation.gate_deviations=5.5", 5.5,
        c([](auto& x) { return x.compensation.gate; })},
       {"controller.compensation.gate_hold_s=0.21", 0.21,
        c([](auto& x) { return x.compensation.gate_hold; })},
       {"controller.compensation.timing_error_s=0.0006", 0.0006,
        c([](auto& x) { return x.compensation.timing_error; })},
       {"controller.compensation.gain_error=0.06", 0.06,
        c([](auto& x) { return x.compensation.gain_error; })},
       {"controller.compensation.mass_error=0.07", 0.07,
        c([](auto& x) { return x.compensation.mass_error; })},
       {"controller.passivity.reserve_j=0.002", 0.002,
        c([](auto& x) { return x.passivity.reserve; })},
       {"controller.passivity.damping_per_s=9", 9, c([](auto& x) { return x.passivity.damping; })},
       {"controller.moving_frame.share=0.4", 0.4, c([](auto& x) { return x.moving_frame.share; })},
       {"controller.moving_frame.acceleration_m_per_s2=0.03", 0.03,
        c([](auto& x) { return x.moving_frame.acceleration; })},
       {"controller.moving_frame.acceleration_deg_per_s2=0.7", 0.7 * kDeg,
        c([](auto& x) { return x.moving_frame.angular_acceleration; })},
       {"controller.still.leg_counts=3", 3, c([](auto& x) { return x.stillness.leg_counts; })},
       {"controller.still.joint_rad_or_m=0.002", 0.002,
        c([](auto& x) { return x.stillness.joint; })},
       {"controller.still.deviation_counts=31", 31,
        c([](auto& x) { return x.stillness.deviation; })},
       {"controller.still.bias_v=0.8", 0.8 / 4e-4, c([](auto& x) { return x.stillness.bias; })},
       {"sensor.volts_per_count=4.0e-4", 4e-4, p([](auto& x) { return x.sensor.volts_per_count; })},
       {"sensor.cutoff_hz=19", 19 * kTurn, c([](auto& x) { return x.servo.sensor_cutoff; })},
       {"sensor.excitation_v=9", 9, p([](auto& x) { return x.sensor.excitation; })},
       {"sensor.temperature.mean_c=21", 21, p([](auto& x) { return x.climate.mean; })},
       {"sensor.temperature.swing_c=3.5", 3.5, p([](auto& x) { return x.climate.swing; })},
       {"sensor.temperature.period_h=23", 23 * 3600.0, p([](auto& x) { return x.climate.period; })},
       {"sensor.temperature.rising_h=8", 8 * 3600.0, p([](auto& x) { return x.climate.rising; })},
       {"legs.gain_extend_in_per_s_per_ma=1.1", 1.1 * kInch / 1e-3,
        p([](auto& x) { return x.actuator.gain_extend; })},
       {"legs.gain_retract_in_per_s_per_ma=0.7", 0.7 * kInch / 1e-3,
        p([](auto& x) { return x.actuator.gain_retract; })},
       {"legs.tau_s=0.012", 0.012, p([](auto& x) { return x.actuator.tau; })},
       {"legs.counts_per_in=420", kInch / 420, p([](auto& x) { return x.transducer.scale; })},
       {"legs.watchdog.hold_after_ticks=4", 4 * 10'000'000,
        p([](auto& x) { return static_cast<double>(x.watchdog.hold_after); })},
       {"legs.watchdog.park_after_s=11", 11e9,
        p([](auto& x) { return static_cast<double>(x.watchdog.park_after); })},
       {"legs.watchdog.park_time_s=21", 21e9,
        p([](auto& x) { return static_cast<double>(x.watchdog.park_time); })}});
  const auto leg = [&](auto of) { return p([of](auto& x) { return of(x.hydraulic->leg); }); };
  arrive(
      "z_sine", {"legs.model=hydraulic"},
      {{"legs.hydraulic.supply_mpa=10.1", 10.1e6, leg([](auto& x) { return x.oil.supply; })},
       {"legs.hydraulic.bore_area_cm2=11.5", 11.5e-4, leg([](auto& x) { return x.cylinder.bore; })},
       {"legs.hydraulic.bulk_modulus_mpa=1300", 1.3e9,
        leg([](auto& x) { return x.oil.bulk_modulus; })},
       {"legs.hydraulic.hose_volume_cm3=21", 21e-6, leg([](auto& x) { return x.oil.hoses; })},
       {"legs.hydraulic.leak_l_per_min_mpa=0.02", 0.02 * 1e-3 / 60 / 1e6,
        leg([](auto& x) { return x.oil.leak; })},
       {"legs.hydraulic.valve_hz=61", 61 * kTurn, leg([](auto& x) { return x.valve.frequency; })},
       {"legs.hydraulic.valve_damping=0.89", 0.89, leg([](auto& x) { return x.valve.damping; })},
       {"legs.hydraulic.valve_limit_ma=39", 0.039, leg([](auto& x) { return x.valve.limit; })},
       {"legs.hydraulic.valve_opening_ma=0.2", 2e-4, leg([](auto& x) { return x.valve.opening; })},
       {"legs.hydraulic.pressure_feedback_ma_per_mpa=1.4", 1.4e-9,
        leg([](auto& x) { return x.valve.feedback; })},
       {"legs.hydraulic.pressure_feedback_s=0.04", 0.04,
        leg([](auto& x) { return x.valve.feedback_time; })},
       {"legs.hydraulic.coulomb_n=160", 160, leg([](auto& x) { return x.seals.coulomb; })},
       {"legs.hydraulic.breakaway_n=230", 230, leg([](auto& x) { return x.seals.breakaway; })},
       {"legs.hydraulic.stribeck_m_per_s=0.02", 0.02,
        leg([](auto& x) { return x.seals.stribeck; })},
       {"legs.hydraulic.viscous_n_s_per_m=1100", 1100,
        leg([](auto& x) { return x.seals.viscous; })},
       {"legs.hydraulic.presliding_m=25.0e-6", 160 / 25e-6,
        leg([](auto& x) { return x.seals.bristle; })},
       {"legs.hydraulic.presliding_n_s_per_m=3100", 3100,
        leg([](auto& x) { return x.seals.bristle_damping; })},
       {"legs.hydraulic.stop_n_per_m=2.1e7", 2.1e7, leg([](auto& x) { return x.cylinder.stop; })},
       {"legs.hydraulic.stop_n_s_per_m=2.2e4", 2.2e4,
        leg([](auto& x) { return x.cylinder.stop_damping; })},
       {"legs.hydraulic.play_m=0.0001", 1e-4, leg([](auto& x) { return x.cylinder.play; })},
       {"legs.hydraulic.play_closes_at_n=55", 55, leg([](auto& x) { return x.cylinder.seating; })},
       {"legs.hydraulic.plate.mass_kg=121", 121,
        p([](auto& x) { return x.hydraulic->plate_P.mass; })},
       {"legs.hydraulic.reading_noise_m=1.0e-5", 1e-5,
        p([](auto& x) { return x.hydraulic->reading.noise; })},
       {"legs.hydraulic.reading_hysteresis_m=2.0e-5", 2e-5,
        p([](auto& x) { return x.hydraulic->reading.hysteresis; })}});
  // What a machine's mismatch scales, and that alone.
  const auto seals = [](const Experiment& e) { return e.plant.hydraulic->leg.seals; };
  const Experiment told = test::experiment("z_sine", {"legs.model=hydraulic"}),
                   other = test::experiment(
                       "z_sine", {"legs.model=hydraulic", "plant_mismatch={friction: 1.5}"});
  EXPECT_EQ(seals(other).coulomb, 1.5 * seals(told).coulomb);
  EXPECT_EQ(seals(other).breakaway, 1.5 * seals(told).breakaway);
  EXPECT_EQ(seals(other).bristle, 1.5 * seals(told).bristle);
  EXPECT_EQ(seals(other).bristle_damping, seals(told).bristle_damping);
  EXPECT_EQ(seals(other).viscous, seals(told).viscous);
  const std::string encoders =
      "robot.encoders={counts_per_turn: 4096, play_deg_or_m: 0.2, noise_deg_or_m: 0.03, rate_hz: "
      "50}";
  arrive("puma_on_table_4_1", {encoders, "robot.mount_rpy_deg=[0, 0, 30]"},
         {{"controller.still.joint_rad_or_m=1.0e-4", kTurn / 4096 + 8 * 0.03 * kDeg,
           c([](auto& x) { return x.stillness.joint; })},
          {"seed=3", kTurn / 4096, p([](auto& x) { return x.joints.count(1); })},
          {"seed=3", 0.2 * kDeg, p([](auto& x) { return x.joints.play(1); })},
          {"seed=3", 0.03 * kDeg, p([](auto& x) { return x.joints.noise(1); })},
          {"seed=3", 0.02, c([](auto& x) { return x.joints.interval; })},
          // Uniform over a count, and over the play, beside the noise.
          {"seed=3",
           std::sqrt((std::pow(kTurn / 4096, 2) + std::pow(0.2 * kDeg, 2)) / 12.0 +
                     std::pow(0.03 * kDeg, 2)),
           c([](auto& x) { return x.joints.deviation(1); })},
          {"seed=3", std::sin(30 * kDeg), c([](auto& x) { return x.payload.X_RL0.R(1, 0); })}});
}

TEST(Config, ALimitsUnitIsInItsKey) {
  SafetyLimits l;
  constexpr double kVoltsPerCount = 3e-4;
  std::apply(
      [&](const auto&... limit) {
        const auto look = [&](std::string key, double unit) {
          const auto ends = [&](const char* with) { return key.ends_with(with); };
          const double want = key.find("_deg") != std::string::npos     ? M_PI / 180.0
                              : ends("_v")                              ? 1.0 / kVoltsPerCount
                              : key.find("_cm2") != std::string::npos   ? 1e-4
                              : key.find("_l_per") != std::string::npos ? 1e-3
                                                                        : 1.0;
          EXPECT_DOUBLE_EQ(unit, want) << key;
        };
        (look(limit.key, limit.unit), ...);
      },
      limitTable(l, kVoltsPerCount));
}

// Huygens and Steiner, by hand.
TEST(Config, AnInertiaAboutAnotherPointIsThatOfTheSameBody) {
  const auto body = [](const std::string& inertia) {
    const Experiment e = test::experiment(
        "satellite_puma",
        {"base=!replace {free: {mass_kg: 100, center_m: [0.1, -0.2, 0.3], " + inertia + "}}"});
    return std::get<FreeBodyModel>(e.controller.vehicle.kind).body_P;
  };
  const RigidBody about_center = body("inertia_kg_m2: [50, 60, 70, 1, 2, 3]");
  // From the point (0.2, 0.2, -0.1) the centre is at (-0.1, -0.4, 0.4): 100 kg times its squares
  // are 1, 16 and 16 kg m^2.
  const RigidBody about_point =
      body("inertia_about_m: [0.2, 0.2, -0.1], inertia_kg_m2: [82, 77, 87, -3, 6, 19]");
  EXPECT_LT((about_point.I_Bcm_B - about_center.I_Bcm_B).norm(), 1e-12);
  EXPECT_EQ(about_point.p_BoBcm_B, about_center.p_BoBcm_B);
}

// A base is what its modes are, in whatever order they are told.
TEST(Config, ModesAreKeptSoftestFirst) {
  const auto modes = [](const char* frequencies, const char* ratios, const char* shapes) {
    const Experiment e = test::experiment(
        "z_sine", {fmt::format("base=!replace {{modes: {{frequency_hz: {}, damping_ratio: {}, "
                               "generalized_mass: [1, 1, 1], shapes: [{}, [0, 0, 0], [0, 0, 0], "
                               "[0, 0, 0], [0, 0, 0], [0, 0, 0]]}}, keep_modes: 2}}",
                               frequencies, ratios, shapes)});
    return std::get<ModalModel>(e.controller.vehicle.kind);
  };
  const ModalModel a = modes("[1, 2, 3]", "[0.1, 0.2, 0.3]", "[0.01, 0.02, 0.03]"),
                   b = modes("[2, 3, 1]", "[0.2, 0.3, 0.1]", "[0.02, 0.03, 0.01]");
  ASSERT_EQ(b.stiffness.size(), 2);
  EXPECT_DOUBLE_EQ(b.stiffness(0), std::pow(2.0 * M_PI, 2));
  EXPECT_DOUBLE_EQ(b.stiffness(1), std::pow(4.0 * M_PI, 2));
  EXPECT_DOUBLE_EQ(b.damping(1, 1), 2.0 * 0.2 * 4.0 * M_PI);
  EXPECT_EQ(b.Phi.row(0), Eigen::RowVector2d(0.01, 0.02));
  EXPECT_EQ(a.Phi, b.Phi);
  EXPECT_EQ(a.damping, b.damping);
}

// 0.3 - 0.2 is less than 0.1 in binary.
TEST(Config, AFiringMayBeAsShortAsItsThrusterFires) {
  const auto refused = [](const char* firing) {
    return test::refusal([&] {
      test::experiment("satellite_hold",
                       {fmt::format("base.free.thrusters=[{{at_m: [0, 0, 0], force_n: [0, 1, 0], "
                                    "least_on_s: 0.1, firings_s: [{}]}}]",
                                    firing)});
    });
  };
  EXPECT_EQ(refused("[0.2, 0.3]"), "");
  EXPECT_NE(refused("[0.2, 0.2999]").find("is shorter than least_on_s"), std::string::npos);
}

// The servo model remembers the commands of twelve periods.
TEST(Config, AServosDelayIsWithinWhatIsRemembered) {
  const auto refused = [](double delay) {
    return test::refusal([&] {
      const auto six = [](double x) { return fmt::format("[{0}, {0}, {0}, {0}, {0}, {0}]", x); };
      test::experiment("z_sine",
                       {"controller.period_ns=5000000",
                        fmt::format("servo={{date: 2026-01-01T00:00:00Z, extend_per_s: {0}, "
                                    "extend_per_s_deviation: {1}, "
                                    "retract_per_s: {0}, retract_per_s_deviation: {1}, tau_s: {2}, "
                                    "tau_s_deviation: {1}, delay_s: {3}, delay_s_deviation: {1}}}",
                                    six(20.0), six(0.001), six(0.0064), six(delay))});
    });
  };
  EXPECT_EQ(refused(0.0599), "");
  EXPECT_NE(refused(0.0601).find("want at most 0.06 s: 12 periods"), std::string::npos)
      << refused(0.0601);
}

TEST(Config, AnExcitationIsProposedWhereTheBeliefIsWideAndNothingElseTells) {
  const auto proposed = [](std::vector<std::string> set) {
    set.insert(set.end(), test::kCompensated.begin(), test::kCompensated.end());
    set.insert(set.end(), {"controller.compensation.wrench=aided", "sensor.readings_per_tick=4"});
    const Experiment e = test::experiment("puma_on_table_4_1", set);
    const auto& says = e.source.notes;
    const auto& warns = e.source.warnings;
    const auto has = [](const std::vector<std::string>& lines) {
      return std::any_of(lines.begin(), lines.end(), [](const std::string& line) {
        return line.find("excite") != std::string::npos;
      });
    };
    return has(says) || has(warns);
  };
  EXPECT_TRUE(proposed({"controller.compensation.learns_masses=true"}));
  EXPECT_FALSE(proposed(
      {"controller.compensation.learns_masses=true", "controller.compensation.mass_error=0.01"}));
  EXPECT_FALSE(proposed({"controller.compensation.learns_masses=false"}));
}

}  // namespace
}  // namespace ves
