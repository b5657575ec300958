// SPDX-License-Identifier: BSD-3-Clause
//
// Files that a person gets wrong: one clear line each, whatever is in them.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/config/calibration.hpp"
#include "ves/config/document.hpp"
#include "ves/config/masses.hpp"
#include "ves/config/servo.hpp"
#include "ves/config/urdf.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

using test::refusal;

std::string parsed(const std::string& text) {
  return refusal([&] { parseDocument(text, "a.yaml"); });
}

// `from` and `urdf` of a file that an override names, and of the file that that one names.
TEST(Document, AnOverrideMayNameAFileOfManyKeys) {
  for (const std::string name : {"puma560", "doss", "desk_arm"}) {
    const std::string file = test::configDir() + "/robots/" + name + ".yaml";
    Value v = parseDocument("robot: {urdf_text: old, lock: {a: 1}}", "a.yaml");
    applyOverride(v, "robot.from=" + file);
    const Value whole = loadDocument(file), &robot = *v.find("robot");
    EXPECT_GT(whole.keys.size(), 4u);
    for (const std::string& key : whole.keys) {
      ASSERT_NE(robot.find(key), nullptr) << key;
      EXPECT_EQ(emit(*robot.find(key)), emit(*whole.find(key))) << key;
    }
    EXPECT_NE(robot.find("lock"), nullptr);
    EXPECT_EQ(loadRobot(file, {}).robot.model.joints, name == "doss"      ? 7
                                                      : name == "puma560" ? 6
                                                                          : 3)
        << name;
  }
}

TEST(Document, IsUtf8) {
  EXPECT_EQ(parsed("a: gr\xc3\xbc\xc3\x9f \xe2\x82\xac \xf0\x9f\xa6\xbe\n"), "");
  for (const char* bad : {"\xff", "\xc3", "\xc0\xaf", "\xe0\x80\x80", "\xed\xa0\x80",
                          "\xf5\x80\x80\x80", "\x80", "\xe2\x82"}) {
    const std::string said = parsed(std::string("a: 1\nb: ") + bad + "\n");
    EXPECT_EQ(said.find("a.yaml:2: byte 0x"), 0u) << said;
  }
}

TEST(Document, HasNoControlCharacters) {
  EXPECT_EQ(parsed("a:\t1\r\nb: 2\n"), "");
  for (const char bad : {'\0', '\x01', '\x08', '\x0b', '\x1b', '\x1f'})
    EXPECT_EQ(parsed(std::string("a: 1\nb: 2") + bad + "c\n").find("a.yaml:2: byte 0x"), 0u)
        << static_cast<int>(bad);
}

TEST(Document, IsOneDocument) {
  EXPECT_EQ(parsed("# a comment\n---\na: 1\n"), "");
  EXPECT_EQ(parsed("a: |\n  text\n  --- more\n"), "");
  EXPECT_NE(parsed("a: 1\n---\nb: 2\n").find("a.yaml:2: a second YAML document"),
            std::string::npos);
}

TEST(Document, IsNoDeeperThanAPersonThinks) {
  const auto nested = [](int depth, const std::string& open, const std::string& close) {
    std::string text = "a: ";
    for (int i = 0; i < depth; ++i) text += open;
    text += "{b: 1}";
    for (int i = 0; i < depth; ++i) text += close;
    return parsed(text + "\n");
  };
  const std::pair<const char*, const char*> kinds[] = {{"[", "]"}, {"{c: ", "}"}, {"{<<: ", "}"}};
  for (const auto& [open, close] : kinds) {
    EXPECT_EQ(nested(13, open, close), "") << open;
    EXPECT_NE(nested(17, open, close).find("nested deeper than"), std::string::npos) << open;
  }
}

TEST(Document, HasNoMoreKeysThanAPersonWrites) {
  std::string text;
  for (int i = 0; i < 1001; ++i) text += fmt::format("k{}: 1\n", i);
  EXPECT_NE(parsed(text).find("more than 1000 keys"), std::string::npos);
}

TEST(Document, ASlipInAKeyIsNamedAsOne) {
  const Value value = parseDocument("amplitude_mm: 3\n", "a.yaml");
  Section s(value, "sine");
  EXPECT_EQ(refusal([&] { s.number("amplitude_m", 0.0, 1.0); }),
            "a.yaml:1: sine.amplitude_mm: unknown key, did you mean amplitude_m?");
}

TEST(Overrides, ReachIntoListsAndReplaceBlocks) {
  Value v = parseDocument("p: [{a: 1}, {b: {c: 2}}]\nq: {x: 1, y: 2}\n", "a.yaml");
  applyOverride(v, "p.1.b.c=7");
  EXPECT_EQ(v.find("p")->children[1].find("b")->find("c")->text, "7");
  applyOverride(v, "p[0]=3");
  EXPECT_EQ(v.find("p")->children[0].text, "3");
  applyOverride(v, "q.z=5");
  EXPECT_EQ(v.find("q")->keys.size(), 3u);
  for (const char* bad : {"p.2.a=1", "p.x=1", "p.-1=1", "p.1x=1"})
    EXPECT_NE(refusal([&] { applyOverride(v, bad); }).find("want the number of an entry, 0 to 1"),
              std::string::npos)
        << bad;
}

class Files : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("ves_document_" + std::to_string(getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string put(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  fs::path folder_;
};

TEST_F(Files, ABlockMayReplaceAnInheritedOne) {
  put("base.yaml", "base: {mass: 1, damping: 2}\n");
  const auto keys = [&](const std::string& text) {
    return loadDocument(put("mine.yaml", "from: base.yaml\n" + text)).find("base")->keys;
  };
  EXPECT_EQ(keys("base: {modes: 3}\n"), (std::vector<std::string>{"mass", "damping", "modes"}));
  EXPECT_EQ(keys("base: !replace {modes: 3}\n"), std::vector<std::string>{"modes"});
  put("other.yaml", "stiffness: 1\n");
  const std::vector<std::string> other = {"stiffness", "modes"};
  EXPECT_EQ(keys("base: {from: other.yaml, modes: 3}\n"), other);
  EXPECT_EQ(keys("base: !replace {from: other.yaml, modes: 3}\n"), other);
}

const char* const kBrick =
    "<robot name=\"brick\"><link name=\"base\"><inertial><mass value=\"20\"/><origin xyz=\"0 0 "
    "0.2\"/><inertia ixx=\"0.5\" ixy=\"0\" ixz=\"0\" iyy=\"0.5\" iyz=\"0\" izz=\"0.3\"/></inertial>"
    "</link></robot>\n";

TEST_F(Files, ARobotComesByItsFile) {
  const auto with = [](const std::string& set) {
    return refusal([&] { test::unassessed("puma_on_table_4_1", {set}); });
  };
  EXPECT_EQ(with("robot.urdf=" + test::configDir() + "/robots/puma560.urdf"), "");
  EXPECT_NE(with("robot.urdf=none.urdf").find("none.urdf: no such file"), std::string::npos);
  const std::string file =
      put("none.yaml",
          "from: " + test::configDir() + "/scenarios/z_sine.yaml\nrobot: {mount_m: [0, 0, 0]}\n");
  EXPECT_EQ(refusal([&] { loadExperiment(file); }),
            file + ":2: robot.urdf: missing, want the robot's URDF file");
}

TEST_F(Files, ARobotMayBeARigidPayload) {
  put("brick.urdf", kBrick);
  const std::string robot =
      "robot: {urdf: brick.urdf, adapter_position_m: [0, 0, 0.1], adapter: {mass_kg: 16, size_m: "
      "[0.5, 0.5, 0.02]}, mount_m: [0, 0, 0.01], mount_rpy_deg: [0, 0, 0]";
  const auto scenario = [&](const std::string& more) {
    return put("brick.yaml", "from: " + test::configDir() + "/scenarios/free_decay.yaml\n" + robot +
                                 more + "}\n");
  };
  const Experiment e = loadExperiment(
      scenario(""), {"controller.stability=forced", "controller.stability_uncompensated=forced"});
  EXPECT_EQ(e.controller.payload.robot.joints, 0);
  EXPECT_DOUBLE_EQ(e.controller.payload.robot.base.mass, 20.0);
  test::Rig rig(e);
  rig.tick(Request::kStart);
  EXPECT_EQ(rig.until(test::done).phase, Phase::kParked);
  EXPECT_NE(refusal([&] {
              loadExperiment(scenario(", joints_deg_or_m: [1]"));
            }).find("has no joint that moves"),
            std::string::npos);
  EXPECT_EQ(refusal([&] { loadExperiment(scenario(", joints_deg_or_m: []")); }), "");
}

TEST(Yaml, MergeKeysAreMergedInPlace) {
  Value v = parseDocument(
      "a: &a {x: 1, y: 2}\nb: &b {z: 3}\none: {<<: *a, y: 5}\nmany: {y: 7, <<: [*b, *a]}\n",
      "f.yaml");
  const auto at = [&](const char* map, const char* key) { return v.find(map)->find(key)->text; };
  EXPECT_EQ(at("one", "x") + at("one", "y"), "15");
  EXPECT_EQ(at("many", "x") + at("many", "y") + at("many", "z"), "173");
  EXPECT_FALSE(v.find("one")->find("<<"));
  EXPECT_NE(refusal([] { parseDocument("a: {<<: 3}", "f.yaml"); }).find("f.yaml:1: <<: want a map"),
            std::string::npos);
}

TEST(Yaml, ATabThatIndentsIsNamed) {
  EXPECT_NE(refusal([] {
              parseDocument("a: 1\nlegs:\n\tK_P: 8000\n", "f.yaml");
            }).find("a tab indents line 3, want blanks"),
            std::string::npos);
}

TEST_F(Files, ArePathsWhateverTheirNames) {
  fs::create_directories(folder_ / "cell: #1");
  // Content decides, not the ending.
  for (const char* name : {"a: b.urdf", "[r].URDF", "r.xml", "cell: #1/r"})
    EXPECT_EQ(loadRobot(put(name, kBrick), {}).robot.model.base.mass, 20.0) << name;
  EXPECT_EQ(loadRobot(put("robot", "urdf: r.xml\n"), {}).robot.model.base.mass, 20.0);
  EXPECT_NE(test::refusal([&] {
              loadRobot(put("robot", "urdf: r.xml\ncolour: red\n"), {});
            }).find("robot:2: robot.colour: unknown key"),
            std::string::npos);
  const std::string puma = test::configDir() + "/robots/puma560.urdf";
  for (const char* set : {"joints=[joint_1]", "robot.joints=[joint_1]"})
    EXPECT_EQ(loadRobot(puma, {set}).robot.model.joints, 1) << set;
  EXPECT_NE(
      test::refusal([&] { loadRobot("nowhere.urdf", {}); }).find("nowhere.urdf: no such file"),
      std::string::npos);
  const fs::path scenario = put("s.yml", "name: s\n");
  EXPECT_EQ(findFile("scenario", scenario.string(), folder_), scenario);
}

TEST(Yaml, ANameThatNoFolderCanHaveIsRefused) {
  EXPECT_NE(refusal([] {
              loadExperiment(test::configDir() + "/scenarios/z_sine.yaml",
                             {"name=" + std::string(101, 'x')});
            }).find("name: has 101 letters, want at most 100"),
            std::string::npos);
}

TEST(UrdfLimits, WhatIsMonstrousIsRefusedInOneLine) {
  const auto said = [](const std::string& text) {
    return refusal([&] { loadUrdf(text, "r.urdf"); });
  };
  ASSERT_EQ(said(kBrick), "");
  const auto with = [](const std::string& what, const std::string& by) {
    std::string text = kBrick;
    return text.replace(text.find(what), what.size(), by);
  };
  EXPECT_NE(said(with("mass value=\"20\"", "mass value=\"1e308\"")).find("want a number in [0"),
            std::string::npos);
  EXPECT_NE(said(with("0 0 0.2", "0 0 1e308")).find("lengths within 1000 m"), std::string::npos);
  EXPECT_NE(said(with("ixx=\"0.5\"", "ixx=\"1e308\"")).find("inertia"), std::string::npos);
  std::string deep, wide = "<robot name=\"r\"";
  for (int i = 0; i < 20'000; ++i) deep += "<a>";
  for (int i = 0; i < 60'000; ++i) wide += fmt::format(" a{}=\"\"", i);
  EXPECT_NE(said("<robot name=\"r\">" + deep).find("nested deeper than 64"), std::string::npos);
  EXPECT_NE(said(wide + "/>").find("has no link"), std::string::npos);
}

/// Numbers of which no two are alike.
class Distinct {
 public:
  double next() { return value_ += 1.0 / 1024.0; }
  template <int n>
  Eigen::Matrix<double, n, 1> vector() {
    Eigen::Matrix<double, n, 1> v;
    for (double& one : v.reshaped()) one = next();
    return v;
  }

 private:
  double value_ = 0.5;
};

/// What stands under a key of a file that was saved.
std::vector<double> standing(const Value& file, const std::string& key) {
  std::vector<double> out;
  const Value* value = file.find(key);
  if (!value) return out;
  if (value->kind == Value::Kind::kScalar) out.push_back(std::stod(value->text));
  for (const Value& item : value->children) out.push_back(std::stod(item.text));
  return out;
}
std::vector<double> numbers(const Eigen::Ref<const Eigen::VectorXd>& v) {
  return {v.data(), v.data() + v.size()};
}

TEST(SavedFiles, HoldEveryFieldUnderItsOwnName) {
  Distinct some;
  constexpr std::int64_t kDate = 1'764'489'600;  // 2025-11-30T08:00:00Z
  {
    const CalibrationRecord r{
        kDate, "0123abcd", some.next(), some.vector<6>(), some.vector<6>(), some.vector<6>()};
    const Value file = parseDocument(write(r), "calibration.yaml");
    EXPECT_EQ(file.find("date")->text, "2025-11-30T08:00:00Z");
    EXPECT_EQ(file.find("setup")->text, r.setup);
    EXPECT_EQ(standing(file, "temperature_c"), std::vector<double>{r.temperature});
    EXPECT_EQ(standing(file, "bias_count"), numbers(r.bias));
    EXPECT_EQ(standing(file, "deviation_count"), numbers(r.deviation));
    EXPECT_EQ(standing(file, "standard_error_count"), numbers(r.standard_error));
    const CalibrationRecord back = readCalibration(Section(file, ""));
    EXPECT_EQ(back.date, r.date);
    EXPECT_EQ(back.setup, r.setup);
    EXPECT_EQ(back.temperature, r.temperature);
    EXPECT_EQ(back.bias, r.bias);
    EXPECT_EQ(back.deviation, r.deviation);
    EXPECT_EQ(back.standard_error, r.standard_error);
  }
  {
    MassRecord r{kDate, "4567ef", {}, 0.0};
    for (int i = 0; i < 3; ++i) r.bodies.push_back({some.next(), some.vector<3>()});
    for (const double deviation : {0.0, 0.125}) {
      r.deviation = deviation;
      const std::string text = write(r, "first line\n\nthird line");
      EXPECT_EQ(text.rfind("# first line\n#\n# third line\n", 0), 0U) << text;
      const Value file = parseDocument(text, "masses.yaml");
      EXPECT_EQ(file.find("date")->text, "2025-11-30T08:00:00Z");
      EXPECT_EQ(file.find("kinematics")->text, r.kinematics);
      EXPECT_EQ(standing(file, "deviation"),
                deviation > 0.0 ? std::vector<double>{deviation} : std::vector<double>());
      const MassRecord back = readMasses(Section(file, ""));
      EXPECT_EQ(back.date, r.date);
      EXPECT_EQ(back.kinematics, r.kinematics);
      EXPECT_EQ(back.deviation, deviation);
      const std::vector<Value>& bodies = file.find("bodies")->children;
      ASSERT_EQ(bodies.size(), r.bodies.size());
      ASSERT_EQ(back.bodies.size(), r.bodies.size());
      for (std::size_t i = 0; i < bodies.size(); ++i) {
        EXPECT_EQ(standing(bodies[i], "mass_kg"), std::vector<double>{r.bodies[i].mass});
        EXPECT_EQ(standing(bodies[i], "moment_kg_m"), numbers(r.bodies[i].moment));
        EXPECT_EQ(back.bodies[i].mass, r.bodies[i].mass);
        EXPECT_EQ(back.bodies[i].moment, r.bodies[i].moment);
      }
    }
  }
  {
    struct PerLeg {
      const char* key;
      Vec6 ServoModel::*value;
      double scale;
    };
    struct One {
      const char* key;
      double ServoModel::*value;
      double scale;
    };
    const PerLeg legs[] = {
        {"extend_per_s", &ServoModel::extend, 20.0}, {"retract_per_s", &ServoModel::retract, 10.0},
        {"tau_s", &ServoModel::tau, 0.01},           {"delay_s", &ServoModel::delay, 1e-3},
        {"opening_m", &ServoModel::opening, 2e-4},   {"friction_m", &ServoModel::friction, 1e-4}};
    const One sensor[] = {{"sensor_delay_s", &ServoModel::sensor_delay, 1e-3},
                          {"sensor_scale", &ServoModel::sensor_scale, 1.0}};
    const One rubbing[] = {{"friction_s", &ServoModel::friction_time, 0.05},
                           {"friction_way_m", &ServoModel::friction_way, 1e-4}};
    ServoRecord r;
    r.date = kDate;
    for (const PerLeg& one : legs) {
      r.servo.*one.value = one.scale * some.vector<6>();
      r.deviation.*one.value = 0.01 * one.scale * some.vector<6>();
    }
    for (const One& one : sensor) {
      r.servo.*one.value = one.scale * some.next();
      r.deviation.*one.value = 0.01 * one.scale * some.next();
    }
    for (const One& one : rubbing) r.servo.*one.value = one.scale * some.next();
    const Value file = parseDocument(write(r), "servo.yaml");
    EXPECT_EQ(file.find("date")->text, "2025-11-30T08:00:00Z");
    const ServoRecord back = readServo(Section(file, ""));
    EXPECT_EQ(back.date, r.date);
    const ServoModel nominal, model = withRecord(nominal, back);
    for (const PerLeg& one : legs) {
      const std::string deviation = std::string(one.key) + "_deviation";
      EXPECT_EQ(standing(file, one.key), numbers(r.servo.*one.value)) << one.key;
      EXPECT_EQ(standing(file, deviation), numbers(r.deviation.*one.value)) << one.key;
      EXPECT_EQ(back.servo.*one.value, r.servo.*one.value) << one.key;
      EXPECT_EQ(back.deviation.*one.value, r.deviation.*one.value) << one.key;
      EXPECT_EQ(model.*one.value, r.servo.*one.value) << one.key;
    }
    const auto single = [&](const One& one) {
      EXPECT_EQ(standing(file, one.key), std::vector<double>{r.servo.*one.value}) << one.key;
      EXPECT_EQ(back.servo.*one.value, r.servo.*one.value) << one.key;
      EXPECT_EQ(model.*one.value, r.servo.*one.value) << one.key;
    };
    for (const One& one : rubbing) single(one);
    for (const One& one : sensor) {
      single(one);
      EXPECT_EQ(standing(file, std::string(one.key) + "_deviation"),
                std::vector<double>{r.deviation.*one.value})
          << one.key;
      EXPECT_EQ(back.deviation.*one.value, r.deviation.*one.value) << one.key;
    }
  }
}

}  // namespace
}  // namespace ves
