// SPDX-License-Identifier: BSD-3-Clause
//
// testPlatform's menu and its words; a calibration kept; controllers that come and go.
#include <fmt/format.h>

#include <sstream>

#include "support/programs.hpp"
#include "support/refusal.hpp"
#include "support/robots.hpp"
#include "ves/console/command.hpp"
#include "ves/console/form.hpp"
#include "ves/faults/bus_observer.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

using test::Output;
using test::sh;
namespace fs = std::filesystem;

const Experiment& puma() {
  static const Experiment e =
      loadExperiment(test::configDir() + "/scenarios/puma_on_table_4_1.yaml");
  return e;
}

// --- Words ---------------------------------------------------------------------------------------

TEST(Command, AWordItsBeginningOrItsNumber) {
  for (std::size_t i = 0; i < menu().size(); ++i) {
    EXPECT_EQ(parseVerb(menu()[i].word), menu()[i].verb);
    EXPECT_EQ(parseVerb(std::to_string(i + 1)), menu()[i].verb);
  }
  EXPECT_EQ(parseVerb("ad"), Verb::kAdmittance);
  EXPECT_EQ(parseVerb("tr"), Verb::kTrajectory);
}

TEST(Command, TrajectoryTakesEachCoordinateInMillimetresAndDegrees) {
  const Command c = parseCommand("trajectory 3 z sine 200 0.5 gamma ramp -6", puma());
  EXPECT_EQ(c.order.request, Request::kRun);
  const Segment& s = c.order.segment;
  EXPECT_EQ(s.kind, SegmentKind::kTrajectory);
  EXPECT_EQ(s.duration, 3.0);
  EXPECT_EQ(s.trajectory.motion[2], AxisMotion::kSine);
  EXPECT_NEAR(s.trajectory.amplitude(2), 0.2, 1e-15);
  EXPECT_EQ(s.trajectory.frequency(2), 0.5);
  EXPECT_EQ(s.trajectory.motion[5], AxisMotion::kRamp);
  EXPECT_NEAR(s.trajectory.final(5), -6.0 * M_PI / 180.0, 1e-15);
  for (std::size_t i : {0u, 1u, 3u, 4u}) EXPECT_EQ(s.trajectory.motion[i], AxisMotion::kHold);
}

TEST(Command, ThrustersAreThoseOfTheVehicle) {
  const Experiment hold = loadExperiment(test::configDir() + "/scenarios/satellite_hold.yaml");
  const Command one = parseCommand("thrust 0.5 0", hold);
  EXPECT_EQ(one.order.request, Request::kThrust);
  EXPECT_EQ(one.order.thrust, ThrustOrder(0.5 * ThrustOrder::Unit(0)));
  const auto said = [&](const std::string& line, const Experiment& e) {
    return test::refusal([&] { parseCommand(line, e); });
  };
  EXPECT_NE(said("thrust 0.5 1", hold).find("thruster: '1', want a number in [0, 0]"),
            std::string::npos);
  EXPECT_NE(said("thrust 0.5 0 0", hold).find("thruster 0: given twice"), std::string::npos);
  EXPECT_NE(said("thrust 0 0", hold).find("seconds: '0'"), std::string::npos);
  EXPECT_NE(said("thrust 1", hold).find("thruster: missing"), std::string::npos);
  EXPECT_NE(said("thrust 1 0", puma()).find("the vehicle has no thrusters"), std::string::npos);
}

TEST(Command, MoveRobotAndCollect) {
  const Command v = parseCommand("vehicle in 2 stiffness 3 mass 0.5", puma());
  EXPECT_EQ(v.order.request, Request::kVehicle);
  EXPECT_EQ(v.order.vehicle.to, (VehicleFactors{0.5, 0.0, 3.0}));
  EXPECT_EQ(v.order.vehicle.over, 2.0);
  const Command m = parseCommand("move in 4 x 50 beta 4", puma());
  EXPECT_EQ(m.order.segment.kind, SegmentKind::kMove);
  EXPECT_EQ(m.order.segment.duration, 4.0);
  EXPECT_NEAR(m.order.segment.target.p.x(), 0.05, 1e-15);
  EXPECT_NEAR(m.order.segment.target.rpy.y(), 4.0 * M_PI / 180.0, 1e-15);
  const Command r = parseCommand("robot joint_2 -30 1.5", puma());
  EXPECT_EQ(std::get<RobotMove>(r.robot).joint, 1);
  EXPECT_NEAR(std::get<RobotMove>(r.robot).target, -M_PI / 6.0, 1e-12);
  const auto t = std::get<ToolOrder>(parseCommand("tool by 10 -20 30 4 inertial", puma()).robot);
  EXPECT_TRUE(t.by);
  EXPECT_EQ(t.in, ToolOrder::Frame::kInertial);
  EXPECT_LT((*t.position - Vec3(0.01, -0.02, 0.03)).norm(), 1e-15);
  EXPECT_EQ(t.duration, 4.0);
  EXPECT_FALSE(t.rpy);
  const auto load = std::get<HandOrder>(parseCommand("grasp 2.5 0 0 100", puma()).robot);
  EXPECT_EQ(load.body_T.mass, 2.5);
  EXPECT_NEAR(load.body_T.p_BoBcm_B.z(), 0.1, 1e-15);
  EXPECT_TRUE(std::holds_alternative<Release>(parseCommand("release", puma()).robot));
  const auto push =
      std::get<PushOrder>(parseCommand("push tool 20 0 -5 0.2 0 0 100", puma()).robot);
  EXPECT_EQ(push, (PushOrder{PushOrder::On::kTool, Vec3(0, 0, 0.1), Vec3(20, 0, -5), 0.2}));
  EXPECT_EQ(std::get<PushOrder>(parseCommand("push platform 1 2 3 4", puma()).robot),
            (PushOrder{PushOrder::On::kPlatform, Vec3::Zero(), Vec3(1, 2, 3), 4.0}));
  const Command c = parseCommand("collect a.csv 5 20 z_ leg1", puma());
  EXPECT_EQ(c.collection.file, "a.csv");
  EXPECT_EQ(c.collection.rate, 20.0);
  EXPECT_EQ(c.collection.select, (std::vector<std::string>{"z_", "leg1"}));
}

struct BadLine {
  const char* line;
  const char* said;
};
std::ostream& operator<<(std::ostream& out, const BadLine& b) { return out << b.line; }

class BadLines : public testing::TestWithParam<BadLine> {};

TEST_P(BadLines, AreRefusedByName) {
  const std::string said = test::refusal([] { parseCommand(GetParam().line, puma()); });
  EXPECT_NE(said.find(GetParam().said), std::string::npos) << said;
}

INSTANTIATE_TEST_SUITE_P(
    Lines, BadLines,
    testing::Values(
        BadLine{"", "command: missing"}, BadLine{"fly", "'fly', want one of arm, program"},
        BadLine{"c", "'c' is calibration or collect"}, BadLine{"0", "'0', want one of"},
        BadLine{"99", "'99', want one of"}, BadLine{"admittance", "seconds: missing"},
        BadLine{"admittance nan", "seconds: 'nan', want a number in [0.01, 100000] s"},
        BadLine{"admittance 1e9", "want a number"}, BadLine{"admittance 3 4", "one word too many"},
        BadLine{"move 4 x 50", "(move [in SECONDS] [COORDINATE TO]...)"},
        BadLine{"hold 3", "'3': one word too many (hold takes no more)"},
        BadLine{"vehicle in 2", "nothing to change"},
        BadLine{"vehicle mass 0", "mass: '0', want a number in [0.01, 100] times"},
        BadLine{"vehicle mass 2 mass 3", "mass: given twice"},
        BadLine{"vehicle weight 2", "'weight', want mass, damping, stiffness or in"},
        BadLine{"trajectory 3 z", "z: ramp or sine: missing"},
        BadLine{"trajectory 3 w sine 1 1", "'w', want one of x, y, z, alpha, beta, gamma"},
        BadLine{"trajectory 3 z jump 1", "z: 'jump', want ramp or sine"},
        BadLine{"trajectory 3 z sine 306 1", "[-305, 305] mm"},
        BadLine{"trajectory 3 alpha ramp 31", "[-30, 30] deg"},
        BadLine{"trajectory 3 z ramp 1 z ramp 2", "z: given twice"},
        BadLine{"trajectory 3 z sine 10 0x10", "want a number in [0, 50] Hz"},
        BadLine{"move x", "x: missing"},
        BadLine{"move in 0.05 x 1", "in: '0.05', want a number in [0.1, 100000] s"},
        BadLine{"robot joint_7 1 1", "'joint_7', want one of"},
        BadLine{"robot joint_1 1e3 1", "joint_1: '1e3', want a number in [-160, 160] deg"},
        BadLine{"tool by 10 0 0 2 moon", "'moon', want one of robot, platform, inertial"},
        BadLine{"push 1 2 3 4", "'1', want one of platform, tool, target"},
        BadLine{"push tool 1 2 3 0", "seconds: '0', want a number in [0.001, 60] s"},
        BadLine{"push tool 150 150 0 1", "a push of 212.1 N, want at most 200 N"},
        BadLine{"push target 1 2 3 4", "there is no target"}, BadLine{"collect", "file: missing"},
        BadLine{"arm now", "'now': one word too many"}));

// --- Forms ---------------------------------------------------------------------------------------

/// A form filled by these lines; what was said meanwhile goes to `said`.
std::optional<std::string> filled(const std::string& word, std::vector<std::string> lines,
                                  std::string* said = nullptr) {
  std::reverse(lines.begin(), lines.end());
  const auto next = [&](const std::string&) -> std::optional<std::string> {
    if (lines.empty()) return {};
    const std::string line = lines.back();
    lines.pop_back();
    return line;
  };
  const auto say = [&](const std::string& text) {
    if (said) *said += text;
  };
  return fillForm(word, puma(), {next, say, [](int) { return "0"; }});
}

TEST(Forms, MakeTheCommandLineThatCouldHaveBeenTyped) {
  EXPECT_EQ(filled("admittance", {""}), "admittance 10");
  EXPECT_EQ(filled("trajectory", {" 2 ", "", "", "sine", "30", "0.5", "ramp", "5", "", ""}),
            "trajectory 2 z sine 30 0.5 alpha ramp 5");
  EXPECT_EQ(filled("arm", {}), "arm");
  const auto line = filled("move", {"1", "2", "3", "4", "5", "6"});
  EXPECT_EQ(line, "move x 1 y 2 z 3 alpha 4 beta 5 gamma 6");
  EXPECT_EQ(parseCommand(*line, puma()).order.segment.target.p.x(), 0.001);
}

TEST(Forms, AskAgainForWhatIsOutOfRange) {
  std::string said;
  EXPECT_EQ(filled("admittance", {"ten", "-1", "nan", "7"}, &said), "admittance 7");
  EXPECT_NE(said.find("'nan', want a number in"), std::string::npos) << said;
}

TEST(Forms, HoldAndStopAreObeyedAndBackLeaves) {  // wherever the form stands
  for (std::size_t n = 0; n < 6; ++n) {
    const auto left = [&](const std::string& word) {
      std::vector<std::string> lines(n, "");
      lines.push_back(word);
      return filled("trajectory", lines);
    };
    EXPECT_EQ(left("hold"), "hold");
    EXPECT_EQ(left(" stop "), "stop");
    EXPECT_EQ(left("back"), "");
    EXPECT_EQ(left("\033"), "");
  }
  EXPECT_FALSE(filled("move", {"1"}));  // the input ended
}

// --- A session -----------------------------------------------------------------------------------

class Console : public test::Programs {
 protected:
  std::string session(const std::string& commands, const std::string& more = "") {
    return "cd " + folder_.string() + "; " + app("controller") +
           "puma_on_table_4_1 --plant --private-bus --no-plots " + patient() + " " + commands +
           more;
  }
};

/// One column of a CSV file by its name, by the tick of the row.
std::map<long, std::string> column(const fs::path& file, const std::string& name) {
  std::ifstream in(file);
  std::string line, cell;
  std::vector<std::string> names;
  std::map<long, std::string> out;
  while (std::getline(in, line)) {
    std::vector<std::string> cells;
    std::istringstream row(line);
    while (std::getline(row, cell, ',')) cells.push_back(cell);
    if (names.empty()) {
      names = cells;
      continue;
    }
    const auto at = [&](const std::string& n) {
      return cells.at(
          static_cast<std::size_t>(std::find(names.begin(), names.end(), n) - names.begin()));
    };
    out[std::stol(at("tick"))] = at(name);
  }
  return out;
}

TEST_F(Console, AScriptCalibratesMovesCollectsAndParks) {
  const Output o =
      sh(session("--do arm --do calibration --do 'collect c.csv 1 100 tick fz leg2' "
                 "--do 'trajectory 1.5 z sine 20 1' --out a"));
  EXPECT_EQ(o.status, 0) << o.text;
  EXPECT_NE(o.text.find("kept in ves-runs/calibration.yaml"), std::string::npos) << o.text;
  EXPECT_EQ(summary(folder_ / "a")["ended"], "parked");

  // The same variables come out of the log.
  const Output later = sh("cd " + folder_.string() + "; " + app("collect") +
                          "a/run.lcmlog --select tick fz leg2 --out later.csv");
  EXPECT_EQ(later.status, 0) << later.text;
  const auto live = column(folder_ / "c.csv", "leg2_measured_m");
  const auto logged = column(folder_ / "later.csv", "leg2_measured_m");
  EXPECT_GT(live.size(), 80u);
  for (const auto& [tick, value] : live) {
    ASSERT_TRUE(logged.count(tick)) << tick;
    EXPECT_EQ(logged.at(tick), value) << tick;
  }
  // The calibration serves the next session, until the sensor is another one, or it is old.
  const fs::path kept = folder_ / "ves-runs/calibration.yaml";
  const Experiment with =
      loadExperiment(test::configDir() + "/scenarios/puma_on_table_4_1.yaml", {}, {.calibration = kept});
  ASSERT_TRUE(with.source.calibration);
  EXPECT_EQ(with.controller.bias, with.source.calibration->bias);
  EXPECT_LT(age(*with.source.calibration), 1.0);
  EXPECT_NE(test::refusal([&] {
              loadExperiment(test::configDir() + "/scenarios/z_sine.yaml", {}, {.calibration = kept});
            }).find("calibration.yaml:4: calibration.setup: "),
            std::string::npos);
  CalibrationRecord old = *with.source.calibration;
  old.date -= 5 * 3600;
  std::ofstream(kept) << write(old);
  const Output next = sh(session("--do 'wait 0.1' --out b"));
  EXPECT_NE(next.text.find("5.0 h old"), std::string::npos) << next.text;
  EXPECT_EQ(next.status, 0) << next.text;
}

TEST_F(Console, AScriptRunsTheScenariosProgramToItsEnd) {
  const Output o = sh("cd " + folder_.string() + "; " + app("controller") +
                      "z_sine --plant --private-bus --no-plots " + patient() + " --set '" +
                      kShortProgram + "' --do program --do 'move x 5' --out a");
  EXPECT_EQ(o.status, 0) << o.text;
  EXPECT_NE(o.text.find("running: trajectory (2 of 2)"), std::string::npos) << o.text;
  EXPECT_NE(o.text.find("holding  x +5.0"), std::string::npos) << o.text;
  EXPECT_EQ(summary(folder_ / "a")["ended"], "parked");
}

TEST_F(Console, AScriptStopsAtWhatIsRefused) {
  const Output o = sh(session("--do 'admittance 1' --do 'move x 10' --out a"));
  EXPECT_EQ(o.status, 1) << o.text;
  EXPECT_NE(o.text.find("not taken: the legs are not armed"), std::string::npos) << o.text;
  EXPECT_EQ(o.text.find("> move x 10"), std::string::npos) << o.text;
  EXPECT_NE(o.text.find("left out: move x 10"), std::string::npos) << o.text;
  EXPECT_EQ(sh(session("--do 'admittance 1' --out b") + " 2>&1 >/dev/null").text,
            "not taken: the legs are not armed; arm first\n");
}

TEST_F(Console, AScriptKnowsWhetherTheRobotObeys) {
  const Output taken = sh(session("--do 'robot joint_1 5 1' --do 'release' --out a"));
  EXPECT_EQ(taken.status, 1) << taken.text;  // there is nothing in hand
  EXPECT_NE(taken.text.find("> release\n"), std::string::npos) << taken.text;
  EXPECT_NE(taken.text.find("the robot does not do that; the plant says why"), std::string::npos)
      << taken.text;
  EXPECT_EQ(taken.text.find("does not answer"), std::string::npos) << taken.text;
  // A motion is over before the next line: the joint is where it was sent.
  const auto q = column(folder_ / "a/series.csv", "tick");
  EXPECT_GT(q.size(), 95u) << taken.text;
  // Nobody has asked it to arm, and it has ended when it was told to.
  EXPECT_EQ(taken.text.find("never armed"), std::string::npos) << taken.text;
  EXPECT_EQ(taken.text.find("ended early"), std::string::npos) << taken.text;
  const Output fast = sh(session("--do 'robot joint_1 90 0.5' --do 'wait 1' --out b"));
  EXPECT_EQ(fast.status, 1) << fast.text;
  EXPECT_NE(fast.text.find("joint 'joint_1' would move at"), std::string::npos) << fast.text;
  EXPECT_NE(fast.text.find("left out: wait 1"), std::string::npos) << fast.text;
}

TEST_F(Console, AScriptDoesNotWaitForWhatEndsInAnAmpersand) {
  const Output o = sh(session("--do arm --do 'move in 2 x 20 &' --do 'wait 0.3' --do hold --out a"));
  EXPECT_EQ(o.status, 0) << o.text;
  const auto request = column(folder_ / "a/series.csv", "request");
  const auto phase = column(folder_ / "a/series.csv", "phase");
  const auto hold = std::find_if(request.begin(), request.end(),
                                 [](const auto& row) { return row.second == "hold"; });
  ASSERT_NE(hold, request.end());
  EXPECT_EQ(phase.at(hold->first - 1), "running");
  // The last of them is over before the session is.
  const Output last = sh(session("--do arm --do 'move in 1 x 20&' --out b"));
  EXPECT_EQ(last.status, 0) << last.text;
  EXPECT_NE(last.text.find("holding  x +20.0"), std::string::npos) << last.text;
  EXPECT_EQ(last.text.find("ended early"), std::string::npos) << last.text;
}

TEST_F(Console, AQuitWaitsForNoCollection) {
  const Output o = sh(session("--do 'collect c.csv 20' --do quit --do status --out a"));
  EXPECT_EQ(o.status, 0) << o.text;
  EXPECT_NE(o.text.find("left out: status"), std::string::npos) << o.text;
  EXPECT_LT(summary(folder_ / "a")["simulated_s"].get<double>(), 15.0);  // 20 s are not collected
}

TEST_F(Console, BadInputIsSaidBeforeAnythingStarts) {
  for (const char* bad : {"--do 'trajectory 3 z sine 400 1'", "--do fly", "--do arm --start",
                          "--calibration none.yaml --do arm"}) {
    const Output o = sh(session(bad));
    EXPECT_EQ(o.status, 2) << o.text;
    EXPECT_EQ(o.text.find("VES_"), std::string::npos);
    EXPECT_FALSE(fs::exists(folder_ / "ves-runs/calibration.yaml"));
  }
}

// --- Controllers come and go ---------------------------------------------------------------------

TEST_F(Console, AKilledControllerLeavesTheLegsWhereTheyAreAndItsSuccessorWaits) {
  enterPrivateBus();
  BusObserver w;
  Process plant = start("plant", {"z_sine"});
  {
    Process first = start("controller", {"z_sine", "--start"});
    ASSERT_TRUE(w.until([&] { return w.phase() == Phase::kRunning && w.engaged > 250; }));
    first.signal(SIGKILL);
    EXPECT_EQ(first.wait(), -SIGKILL);
  }
  ASSERT_TRUE(w.rests());
  const Vec6 held = w.legs;
  const std::int64_t dead = w.controller, engaged = w.engaged;
  Process second = start("controller", {"z_sine", "--no-menu"});
  ASSERT_TRUE(w.until([&] { return w.controller != dead; }));
  const std::int64_t states = w.states;
  ASSERT_TRUE(w.until([&] { return w.states > states + 200; }));
  EXPECT_EQ(w.phase(), Phase::kDisarmed);
  EXPECT_EQ(w.engaged, engaged);
  EXPECT_LT((w.legs - held).cwiseAbs().maxCoeff(), 0.2e-3);  // counts of 0.07 mm
  second.signal(SIGINT);
  EXPECT_EQ(second.wait(), 0);
}

TEST_F(Console, OrdersOverTheBusAreForOneController) {
  enterPrivateBus();
  BusObserver w;
  Process plant = start("plant", {"z_sine"});
  Process controller = start("controller", {"z_sine", "--no-menu"});
  ASSERT_TRUE(w.until([&] { return w.states > 20; }));
  const Identity me = Identity::draw();
  const auto order = [&](Request request, std::int64_t to, std::int64_t sequence) {
    w.bus.publish(channel::kOperator, toMessage({request, {}, {}, to}, header(me, sequence, 0)));
  };
  // As a played log would: meant for a controller that is no more.
  order(Request::kArm, w.controller + 1, 0);
  std::int64_t states = w.states;
  ASSERT_TRUE(w.until([&] { return w.states > states + 50; }));
  EXPECT_EQ(w.phase(), Phase::kDisarmed);
  ASSERT_TRUE(w.until([&] {
    order(Request::kArm, w.controller, 1);  // again and again: it counts once
    return w.phase() == Phase::kArmed;
  }));
  order(Request::kStop, w.controller, 2);
  while (controller.running()) w.bus.wait(20);
  EXPECT_EQ(controller.wait(), 0);
}

TEST_F(Console, LcmLogplayerPlaysSamplesIntoALiveController) {
  ASSERT_EQ(sh("command -v lcm-logplayer").status, 0) << "liblcm-bin is not installed";
  enterPrivateBus();
  const Output recorded = sh(app("run") + "z_sine --no-plots " + patient() + " --set '" +
                             kShortProgram + "'" + out("a"));
  ASSERT_EQ(recorded.status, 0) << recorded.text;
  BusObserver w;
  Process controller = start("controller", {"z_sine", "--start", "--set", kShortProgram});
  Process player("/usr/bin/lcm-logplayer",
                 {"--regexp", "VES_SAMPLE", (folder_ / "a/run.lcmlog").string()});
  // The recorded legs do what this controller asks, a little earlier or later: it follows, and
  // arms, moves and comes home as it did then.
  EXPECT_TRUE(w.until([&] { return w.phase() == Phase::kRunning; }));
  while (controller.running()) w.bus.wait(20);
  w.bus.drain();
  EXPECT_NE(w.phase(), Phase::kDisarmed);
  player.signal(SIGTERM);
  player.wait();
}

TEST(Commands, EveryWordThatTheMenuAdvertisesIsUnderstood) {
  for (const Item& item : menu()) EXPECT_EQ(parseVerb(item.word), item.verb);
  for (const char* word : {"hold", "stop"}) {  // which act at once
    const Command command = parseCommand(word, puma());
    EXPECT_EQ(name(command.order.request), word);
  }
}

TEST_F(Console, AStopComesHomeAndEndsTheSession) {
  const Output o = sh(session("--do arm --do 'move x 10' --do stop --do 'move x 20' --out a"));
  EXPECT_EQ(o.status, 0) << o.text;
  EXPECT_NE(o.text.find("parked, legs at home"), std::string::npos) << o.text;
  EXPECT_EQ(o.text.find("x +20"), std::string::npos) << o.text;
  EXPECT_NE(o.text.find("left out: move x 20"), std::string::npos) << o.text;
  EXPECT_EQ(summary(folder_ / "a")["ended"], "parked");
}

TEST_F(Console, LinesOfTheMenuMayComeThroughAPipe) {
  const std::string whole = "cd " + folder_.string() +
                            "; printf 'arm\nmove x 10\nwait 2\nstop\n' | ( " + app("controller") +
                            "z_sine --plant --private-bus --no-plots " + patient() + " --out a )";
  const std::string piped = "bash -c \"" + whole + "\"";
  const Output o = sh(piped);
  EXPECT_EQ(o.status, 0) << o.text;
  EXPECT_NE(o.text.find("holding  x +10.0"), std::string::npos) << o.text;
  EXPECT_NE(o.text.find("parked, legs at home"), std::string::npos) << o.text;
}

TEST_F(Console, WhatTheBareProcessCannotDoIsRefused) {
  for (const char* options :
       {"--start --out a", "--no-menu --plant", "--start --lockstep --out a"}) {
    const Output o = sh("cd " + folder_.string() + "; " + app("controller") + "z_sine " + options);
    EXPECT_EQ(o.status, 2) << options << o.text;
    EXPECT_NE(o.text.find("want "), std::string::npos) << o.text;
    EXPECT_FALSE(fs::exists(folder_ / "a")) << options;
  }
}

TEST_F(Console, AControllerThatMayWriteNoMoreBringsThePlatformHome) {
  enterPrivateBus();
  // SIGXFSZ ends a process that has not said otherwise, in the middle of the motion.
  const Output o = sh("cd " + folder_.string() + "; ulimit -f 40; " + app("controller") +
                      "z_sine --lockstep --start --log a.lcmlog & controller=$!; " + app("plant") +
                      "z_sine --lockstep & wait $controller; status=$?; "
                      "kill $!; exit $status");
  EXPECT_EQ(o.status, 0) << o.text;
}

TEST_F(Console, AControllerThatWasSuspendedStopsAndTheLegsStay) {
  enterPrivateBus();
  BusObserver w;
  const std::string patience = "legs.watchdog.park_after_s=2";
  Process plant = start("plant", {"z_sine", "--set", patience});
  Process controller = start("controller", {"z_sine", "--start", "--set", patience});
  ASSERT_TRUE(w.until([&] { return w.phase() == Phase::kRunning && w.engaged > 250; }));
  controller.signal(SIGTSTP);
  ASSERT_TRUE(w.rests());
  const Vec6 held = w.legs;
  const auto off = [&] { return (w.legs - held).cwiseAbs().maxCoeff(); };
  ASSERT_TRUE(w.until([&] { return off() > 1e-3; }));  // on their way home, alone
  controller.signal(SIGCONT);
  ASSERT_TRUE(w.until([&] { return w.phase() == Phase::kStopped; }));
  EXPECT_EQ(w.cause(), Check::kLeftAlone);
  const Vec6 found = w.legs;
  ASSERT_TRUE(w.rests());
  EXPECT_LT((w.legs - found).cwiseAbs().maxCoeff(), 2e-3);  // it lets go of them
  controller.signal(SIGHUP);
  EXPECT_EQ(controller.wait(), 1);
}

}  // namespace
}  // namespace ves
