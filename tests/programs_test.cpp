// SPDX-License-Identifier: BSD-3-Clause
//
// Exit statuses, messages, files, two processes.
#include "support/programs.hpp"

#include <fcntl.h>

#include <map>
#include <numeric>
#include <set>

#include "ves/evaluation/let_go.hpp"
#include "ves/series/series.hpp"

namespace ves {
namespace {

using test::Output;
using test::sh;
namespace fs = std::filesystem;

class Programs : public test::Programs {};

TEST_F(Programs, LockstepRunLeavesItsFiles) {
  const Output o = run("z_sine --lockstep --seed 3" + out("a"));
  EXPECT_EQ(o.status, 0) << o.text;
  EXPECT_NE(o.text.find("z error"), std::string::npos) << o.text;
  for (const char* file : {"run.lcmlog", "series.csv", "summary.json", "experiment.yaml",
                           "pose.png", "error.png", "legs.png"})
    EXPECT_TRUE(fs::exists(folder_ / "a" / file)) << file;
  const auto s = summary(folder_ / "a");
  EXPECT_EQ(s["seed"], 3);
  EXPECT_EQ(s["ended"], "parked");
  EXPECT_TRUE(s["z_error_max_extending_m"].is_number());
  EXPECT_TRUE(s["real_time_factor"].is_number());
  EXPECT_EQ(s["configuration_hash"].get<std::string>().size(), 16u);
  // The resolved experiment is a scenario like any other.
  EXPECT_EQ(
      run((folder_ / "a/experiment.yaml").string() + " --lockstep --no-plots" + out("b")).status,
      0);
  EXPECT_EQ(commands(folder_ / "a"), commands(folder_ / "b"));
}

TEST_F(Programs, TheReferenceOfKeysIsWhatTheProgramPrints) {
  const Output o = sh(app("keys") + "--markdown");
  ASSERT_EQ(o.status, 0) << o.text;
  std::ifstream in(fs::path(VES_TEST_SOURCE_DIR) / "docs/scenario.md");
  const std::string page((std::istreambuf_iterator<char>(in)), {});
  EXPECT_TRUE(page.ends_with(o.text)) << "docs/scenario.md: ./ves keys --markdown prints its end";
  EXPECT_NE(sh(app("keys") + "controler").text.find("did you mean controller?"), std::string::npos);
  EXPECT_NE(sh(app("keys") + "program.trajectory.z").text.find("counted from home"),
            std::string::npos);
}

TEST_F(Programs, TrippedRunEndsWithOne) {
  const Output o =
      run("z_sine --lockstep --no-plots --set safety.position_error_m=0.03" + out("a"));
  EXPECT_EQ(o.status, 1) << o.text;
  EXPECT_NE(o.text.find("by: position error"), std::string::npos) << o.text;
  EXPECT_EQ(summary(folder_ / "a")["first_cause"], "position error");
  const Output quiet =
      run("z_sine --lockstep --quiet --set safety.position_error_m=0.03" + out("b"));
  EXPECT_EQ(quiet.status, 1);
  EXPECT_EQ(quiet.text.rfind("ves run: stopped by the position error check", 0), 0U) << quiet.text;
  EXPECT_EQ(std::count(quiet.text.begin(), quiet.text.end(), '\n'), 1) << quiet.text;
}

TEST_F(Programs, BadInputIsOneLineAndStatusTwo) {
  const std::string blocked = (folder_ / "file").string();
  std::ofstream(blocked) << "x";
  for (const std::string& arguments :
       {std::string("no_such_scenario --lockstep"), std::string("z_sine --fast"),
        std::string("z_sine --lockstep --set legs.tau_s=nan"), std::string("z_sine --seed -4"),
        std::string("z_sine --seed abc"), std::string("/no/such.yaml --lockstep"),
        std::string("z_sine --lockstep --out " + blocked), std::string("z_sine --url nonsense"),
        std::string("z_sine --lockstep --set program=[]")}) {
    const Output o = run(arguments);
    EXPECT_EQ(o.status, 2) << arguments << ": " << o.text;
    EXPECT_EQ(std::count(o.text.begin(), o.text.end(), '\n'), 1) << arguments << ": " << o.text;
  }
  EXPECT_NE(run("no_such_scenario").text.find("want one of alpha_sine, arm_on_desk"),
            std::string::npos);
  EXPECT_NE(run("z_sin").text.find("did you mean 'z_sine'?"), std::string::npos);
  EXPECT_NE(run("z_sine --lockstp").text.find("did you mean --lockstep?"), std::string::npos);
  EXPECT_NE(test::sh(app("replya")).text.find("did you mean 'replay'?"), std::string::npos);
  EXPECT_NE(test::sh(app("faults") + "F1x").text.find("did you mean 'F"), std::string::npos);
}

TEST_F(Programs, HelpAndProgressFitATerminal) {
  const auto widest = [](const std::string& text) {
    std::size_t most = 0;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) most = std::max(most, line.size());
    return most;
  };
  for (const char* command :
       {"run",           "demo",          "view",          "controller",     "plant",
        "replay",        "collect",       "plot",          "compare",        "keys",
        "srms simulate", "stability map", "identify plan", "identify servo", "sweep",
        "faults",        "platform",      "robot",         "conform",        "on-bus",
        "netft-server",  "report",        "doctor"}) {
    const Output help = test::sh(app(command) + "--help");
    EXPECT_EQ(help.status, 0) << command;
    EXPECT_LE(widest(help.text), 80u) << command << help.text;
  }
  const Output o =
      test::sh(app("run") + "puma_tilt --lockstep --no-plots" + out("a") + " 2>&1 >/dev/null");
  EXPECT_LE(widest(o.text), 80u) << o.text;
  EXPECT_NE(o.text.find("calibration"), std::string::npos) << o.text;
  const Output results = run("puma_on_table_4_1 --lockstep" + out("b"));
  std::istringstream lines(results.text);
  for (std::string line; std::getline(lines, line);)
    EXPECT_TRUE(line.size() <= 80 || line.find(folder_.string()) != std::string::npos) << line;
}

TEST_F(Programs, CtrlCInAPacedRunGoesHome) {
  const Output o = test::sh("timeout --preserve-status -s INT 2 " + app("run") +
                            "z_sine --lockstep --pace 1 --private-bus --no-plots" + out("a"));
  EXPECT_EQ(o.status, 0) << o.text;
  EXPECT_NE(o.text.find("returning"), std::string::npos) << o.text;
  const auto s = summary(folder_ / "a");
  EXPECT_EQ(s["ended"], "parked");
  EXPECT_NE(s["ended_early"].get<std::string>().find("a stop was requested"), std::string::npos);
}

TEST_F(Programs, ARunThatIsThereIsKept) {
  ASSERT_EQ(run("ramp --lockstep --no-plots" + out("a")).status, 0);
  const std::string before = test::readText((folder_ / "a/summary.json").string());
  const Output o = run("ramp --seed 5 --lockstep --no-plots" + out("a"));
  EXPECT_EQ(o.status, 2);
  EXPECT_NE(o.text.find("run.lcmlog is there already, want another or --overwrite"),
            std::string::npos);
  EXPECT_EQ(test::readText((folder_ / "a/summary.json").string()), before);
  EXPECT_EQ(run("ramp --seed 5 --lockstep --no-plots --overwrite" + out("a")).status, 0);
  EXPECT_NE(test::readText((folder_ / "a/summary.json").string()), before);
}

// What a command is told to write takes the place of nothing but its like: not of the log that it
// reads, nor of somebody's file.
TEST_F(Programs, WhatIsSomethingElseIsKept) {
  ASSERT_EQ(run("ramp --lockstep --no-plots --quiet" + out("a")).status, 0);
  const std::string log = file("a/run.lcmlog"), text = file("text");
  std::ofstream(text) << "precious\n";
  const std::string recorded = test::readText(log);
  const std::string in = file("a") + " ";
  const std::pair<std::string, const char*> writers[] = {
      {app("collect") + in + "--out ", ".csv"},
      {app("collect") + in + "--parquet ", ".parquet"},
      {app("collect") + in + "--mcap ", ".mcap"},
      {app("view") + in + "--html ", ".html"},
      {app("view") + in + "--svg ", ".svg"},
      {app("compare") + in + in + "--html ", ".html"},
      {app("view") + in + "--to 0.1 --video ", ".mp4"},
      {app("srms") + "simulate free_decay --out ", ".csv"}};
  for (const std::string& before : {log, text})
    for (const auto& [command, ending] : writers) {
      const std::string there = file("there") + ending;
      fs::copy_file(before, there, fs::copy_options::overwrite_existing);
      expectRefusal(command + there, "something else is there already");
      EXPECT_EQ(test::readText(there), test::readText(before)) << command;
    }
  expectRefusal(app("collect") + in + "--out " + log, "something else is there already");
  EXPECT_EQ(test::readText(log), recorded);
  for (const char* name : {"x.csv", "x.html"})  // its like
    for (int i = 0; i < 2; ++i)
      EXPECT_EQ(test::sh(std::string(name).ends_with("csv")
                             ? app("collect") + file("a") + " --out " + file(name)
                             : app("view") + file("a") + " --html " + file(name))
                    .status,
                0)
          << name;
  std::filesystem::create_directory(folder_ / "b");
  for (const char* name : {"belief.yaml", "masses.yaml", "summary.json", "series.csv"}) {
    std::filesystem::rename(text, file("b/") + name);
    for (const char* command : {"run", "commission"})
      expectRefusal(app(command) + "puma_on_table_4_1 --lockstep --quiet" + out("b"),
                    std::string(name) + " is there already, want another or --overwrite");
    std::filesystem::rename(file("b/") + name, text);
  }
}

// Nothing that is asked for is dropped in silence.
TEST_F(Programs, WhatAnOptionMeansNothingForIsRefused) {
  ASSERT_EQ(run("ramp --lockstep --no-plots --quiet" + out("a")).status, 0);
  const std::string log = file("a") + " ", to = file("x");
  const std::pair<std::string, const char*> rows[] = {
      {"collect " + log + "--mcap " + to + ".mcap --select z_", "--select: means nothing"},
      {"collect " + log + "--mcap " + to + ".mcap --rate 10", "--rate: means nothing"},
      {"collect " + log + "--list --from 1", "--from: means nothing"},
      {"collect " + log + "--join it", "--join: means nothing"},
      {"collect --follow --mcap " + to + ".mcap --scenario ramp", "--scenario: means nothing"},
      {"collect " + log + "--parquet " + to + ".csv", "ends in .parquet"},
      {"view " + log + "--look top", "--look: means nothing"},
      {"view --from 3", "--from: means nothing"},
      {"view --rate 10", "--rate: means nothing"},
      {"view " + log + "--join it", "--join: means nothing"},
      {"view " + log + "--html " + to + ".html --port 9000", "--port: means nothing"},
      {"view " + log + "--png " + to + ".png --rate 5", "--rate: means nothing"},
      {"view " + log + "--html " + to + ".svg", "ends in .html"},
      {"compare " + log + log + "--html " + to, "ends in .html"},
      {"keys legs --schema", "section: means nothing"},
      {"run ramp --lockstep --private-bus", "--private-bus: means nothing"},
      {"run ramp --lockstep --join it", "--join: means nothing"},
      {"demo --lockstep --realtime", "--realtime: means nothing"},
      {"commission puma_tilt --lockstep --url udpm://239.255.76.67:7667", "--url: means nothing"},
      {"run ramp --lockstep --overwrite", "--overwrite requires --out"},
      {"plant ramp --lockstep --realtime", "--realtime: means nothing"},
      {"controller ramp --no-menu --no-plots", "--no-plots: means nothing"},
      {"controller ramp --no-menu --start", "--start excludes --no-menu"},
      {"controller ramp --no-plots </dev/null", "--no-plots: means nothing without a terminal"},
      {"controller ramp --do home --log " + to, "--log: means nothing with the menu"},
      {"controller ramp --do home --flight " + to, "--flight: means nothing with the menu"},
      {"run ramp --seed 1 --set seed=2", "--seed: beside --set seed="},
      {"srms modes deck", "has no modes"},
      {"conform ramp --set 'program=[{move: {}}]'", "--set program: means nothing"},
      {"accept z_sine --lockstep --tests steps --slow 0.001", "--slow: means nothing"},
      {"accept z_sine --lockstep --tests passes --amplitudes 0.5", "--amplitudes: means nothing"},
      {"faults F14 --lockstep", "F14: is of real processes"},
      {"faults F22 --set legs.K_P=2", "F22: is about the table's own machine"},
      {"faults --kill 5 --list", "--list: means nothing"},
      {"faults F3 --soak 10", "names: means nothing"},
      {"faults --list --markdown", "--markdown: means nothing"},
      {"faults --lockstep --seed 3", "--seed: means nothing"},
      {"sweep ramp --vary legs.K_P=1,2 --seed 9", "--seed: means nothing"},
      {"sweep ramp --vary legs.K_P=1,2 --set legs.K_P=3", "--set legs.K_P: is another one"},
      {"sweep ramp --runs 2 --set seed=3", "--set seed: is another one"},
      {"stability map free_decay --x mass=0.1:4 --y mass=0.2:3", "--y mass=0.2:3: is that of --x"},
      {"replay " + log + "--with ''", "--with: is empty"},
      {"run ramp --lockstep --out ''", "--out: is empty"}};
  for (const auto& [arguments, says] : rows) expectRefusal(app("") + arguments, says);
  for (const char* extra : {"--version x", "man x", "completion x", "help run x", "help nothing"})
    EXPECT_EQ(test::sh(app("") + extra).status, 2) << extra;
  EXPECT_EQ(test::sh(app("help") + "run").text, test::sh(app("run") + "--help").text);
}

TEST_F(Programs, TheNewestRunHasAName) {
  const std::string here = "cd '" + folder_.string() + "' && ";
  const Output none = test::sh(here + app("replay") + "newest");
  EXPECT_EQ(none.status, 2);
  EXPECT_NE(none.text.find("newest: there is no run in ves-runs"), std::string::npos) << none.text;
  for (const char* name : {"ramp", "z_sine"})
    ASSERT_EQ(test::sh(here + app("run") + name + " --lockstep --no-plots").status, 0);
  const auto table = [&](const std::string& log) {
    return test::sh(here + app("collect") + log + " --select z_ --rate 1").text;
  };
  EXPECT_EQ(table("newest"), table("ves-runs/z_sine-*"));
  EXPECT_NE(table("newest"), table("ves-runs/ramp-*"));
}

TEST_F(Programs, RunAloneNamesWhatThereIs) {
  const Output o = run("");
  EXPECT_EQ(o.status, 2);
  for (const auto& entry : fs::directory_iterator(test::configDir() + "/scenarios"))
    EXPECT_NE(o.text.find("  " + entry.path().stem().string() + " "), std::string::npos)
        << entry.path();
}

TEST_F(Programs, ARobotMayBeNamedAsInConfig) {
  EXPECT_EQ(sh(app("robot") + "puma560").status, 0);
  EXPECT_NE(sh(app("robot") + "puma56").text.find("did you mean 'puma560'?"), std::string::npos);
}

TEST_F(Programs, AFolderStandsForTheLogInIt) {
  EXPECT_EQ(run("z_sine --lockstep --no-plots" + out("a")).status, 0);
  const std::string folder = " '" + (folder_ / "a").string() + "'";
  const std::string svg = (folder_ / "x.svg").string();
  EXPECT_EQ(sh(app("replay") + folder + " --check").status, 0);
  EXPECT_EQ(sh(app("collect") + folder + " --list").status, 0);
  EXPECT_EQ(sh(app("plot") + folder + " --select z_actual --out " + svg).status, 0);
  EXPECT_EQ(sh(app("view") + folder + " --svg " + svg + " --from 2 --to 3").status, 0);
  const Output png = sh(app("plot") + folder + " --select z_actual --out x.png");
  EXPECT_EQ(png.status, 2);
  EXPECT_NE(png.text.find("want a name that ends in .svg"), std::string::npos) << png.text;
}

TEST_F(Programs, HelpIsNoError) {
  for (const char* name : {"run", "demo", "controller", "plant"}) {
    const Output o = sh(app(name) + "--help");
    EXPECT_EQ(o.status, 0);
    EXPECT_NE(o.text.find("Usage"), std::string::npos) << o.text;
  }
}

TEST_F(Programs, TwoProcessesInLockstepCommandWhatOneDoes) {
  EXPECT_EQ(run("puma_on_table_4_1 --lockstep --no-plots" + out("one")).status, 0);
  const Output o =
      run("puma_on_table_4_1 --lockstep --two-processes --private-bus --no-plots" + out("two"));
  EXPECT_EQ(o.status, 0) << o.text;
  const auto one = commands(folder_ / "one"), two = commands(folder_ / "two");
  EXPECT_GT(one.size(), 1900u);
  EXPECT_EQ(one, two);
}

TEST_F(Programs, RealTimeRunOfTwoProcesses) {
  untilNothingIsLost([&] {
    const Output o = run("z_sine --private-bus --no-plots " + patient() + " --set '" +
                         kShortProgram + "'" + out("a"));
    EXPECT_EQ(o.status, 0) << o.text;
    return (folder_ / "a/run.lcmlog").string();
  });
  const auto s = summary(folder_ / "a");
  EXPECT_EQ(s["ended"], "parked");
  EXPECT_NEAR(s["z_peak_to_peak_m"].get<double>(), 0.04, 1e-3);
  EXPECT_TRUE(s.contains("wake_up_late_median_s"));

  // The table has them beside their ticks, and nothing where there are none.
  const Series series = readSeries((folder_ / "a/run.lcmlog").string());
  EXPECT_NEAR(s["simulated_s"].get<double>(),
              0.01 * static_cast<double>(series.rows.back().state.header.sequence + 1), 1e-9);
  const std::vector<Column> table = columns(series.experiment);
  const auto late =
      std::find_if(table.begin(), table.end(), [](const Column& c) { return c.name == "late_s"; });
  ASSERT_NE(late, table.end());
  EXPECT_TRUE(series.rows.back().has_timing);
  EXPECT_EQ(series.rows.front().t, 0.0);
  for (const Row& row : series.rows) {
    if (row.has_timing)
      EXPECT_EQ(late->value(row), 1e-9 * static_cast<double>(row.timing.late_ns));
    else
      EXPECT_TRUE(std::isnan(late->value(row)));
  }
  Row without = series.rows.back();
  without.has_timing = false;
  EXPECT_TRUE(std::isnan(late->value(without)));

  // The times of every tick add up, as the message's description says.
  LogReader reader((folder_ / "a/run.lcmlog").string());
  std::map<std::int64_t, sample_t> samples;
  std::map<std::int64_t, state_t> states;
  std::vector<timing_t> timings;
  for (LogEvent event; reader.next(event);) {
    const auto size = static_cast<std::uint32_t>(event.data.size());
    if (event.channel == channel::kTiming)
      timings.push_back(*decode<timing_t>(event.data.data(), size));
    if (event.channel == channel::kSample) {
      const auto m = *decode<sample_t>(event.data.data(), size);
      samples[m.header.sequence] = m;
    }
    if (event.channel == channel::kState) {
      const auto m = *decode<state_t>(event.data.data(), size);
      states[m.header.sequence] = m;
    }
  }
  ASSERT_GT(timings.size(), 300U);
  std::int64_t missed = 0;
  for (const timing_t& t : timings) {
    EXPECT_EQ(t.receive_ns + t.tick_ns + t.send_ns, t.compute_ns);
    EXPECT_EQ(t.sample_to_command_ns, t.sample_age_ns + t.compute_ns);
    for (const std::int64_t one : {t.late_ns, t.receive_ns, t.tick_ns, t.send_ns, t.tell_ns})
      EXPECT_GE(one, 0);
    EXPECT_EQ(t.missed, t.missed_ran_long + t.missed_woke_late);
    // One process' clock is the other's.
    EXPECT_EQ(t.clock_offset_ns, 0);
    // Of the ticks so far each is in each histogram once; those that were skipped are in none.
    // (Some of these messages may be lost.)
    const auto all = [](const std::int32_t(&bins)[20]) {
      return std::accumulate(std::begin(bins), std::end(bins), std::int64_t{0});
    };
    const std::int64_t count = all(t.late);
    EXPECT_EQ(all(t.compute), count);
    EXPECT_EQ(all(t.sample_age), count);
    EXPECT_EQ(all(t.sample_to_command), count);
    EXPECT_EQ(t.header.sequence, count - 1 + t.missed);
    EXPECT_GE(t.missed, missed);
    missed = t.missed;
    const auto state = states.find(t.header.sequence);
    ASSERT_NE(state, states.end());
    const auto sample = samples.find(state->second.sample_sequence);
    ASSERT_NE(sample, samples.end());
    const sample_t& m = sample->second;
    EXPECT_EQ(t.legs_age_ns - t.sample_age_ns, m.header.time_ns - m.legs_time_ns);
    EXPECT_EQ(t.wrench_age_ns - t.sample_age_ns, m.header.time_ns - m.wrench_time_ns);
    EXPECT_EQ(t.joints_age_ns - t.sample_age_ns, m.header.time_ns - m.joints_time_ns);
    EXPECT_GE(t.sample_age_ns, 0);
    EXPECT_EQ(t.samples_malformed + t.samples_out_of_range + t.samples_of_another + t.samples_old +
                  t.messages_forged + t.messages_replayed,
              0);
  }
}

// The example of a flight controller: in Python, in a process of its own, over the bus.
TEST_F(Programs, AFlightControllerHoldsASatelliteThatTurns) {
  enterPrivateBus();
  double most = 0.0;  // [rad]
  untilNothingIsLost([&] {
    Process pilot = python("apps/examples/attitude.py", {"--foresight", "2"});
    const Output o =
        run("satellite_jets --no-plots " + patient() +
            " --set 'program=[{calibration: {}}, {admittance: {duration_s: 8}}]'" + out("a"));
    EXPECT_EQ(o.status, 0) << o.text;
    EXPECT_EQ(pilot.wait(), 0);
    return (folder_ / "a/run.lcmlog").string();
  });
  const Series series = readSeries((folder_ / "a/run.lcmlog").string());
  for (const Row& row : series.rows)
    if (inAdmittance(row.state))
      most = std::max(most, Vec6::Map(row.state.x).tail<3>().cwiseAbs().maxCoeff());
  // Left alone it turns by 4.8 degrees about x.
  EXPECT_LT(most, 2.5 * kDegree);
  EXPECT_GT(letGoOf(series).firings().size(), 3U);
  EXPECT_LT(summary(folder_ / "a")["emulation_error_attitude_share"].get<double>(), 0.01);
}

TEST_F(Programs, ARunWhoseLogFindsNoRoomGoesHomeAndSaysWhatIsLost) {
  const Output o = sh("ulimit -f 800; " + app("run") + "z_sine --private-bus --no-plots " +
                      patient() + " --set '" + kShortProgram + "'" + out("a"));
  EXPECT_EQ(o.status, 2) << o.text;
  const std::string log = (folder_ / "a/run.lcmlog").string();
  const std::string warning =
      "warning: " + log + ": File too large; events of the log are being lost, the run goes on";
  const std::size_t once = o.text.find(warning);
  EXPECT_NE(once, std::string::npos) << o.text;
  EXPECT_EQ(o.text.find("events of the log are being lost", once + warning.size()),
            std::string::npos)
      << o.text;
  EXPECT_NE(o.text.find("parked"), std::string::npos) << o.text;
  // Of every tick a sample, a state, a command and a truth: what is not there was lost.
  const auto s = summary(folder_ / "a");
  const auto lost = s["log_events_lost"].get<std::int64_t>();
  EXPECT_EQ(s["log_trouble"], "File too large");
  EXPECT_NE(o.text.find(fmt::format("run.lcmlog: File too large: {} events of the log lost", lost)),
            std::string::npos)
      << o.text;
  std::int64_t states = 0;
  LogReader reader(log);
  for (LogEvent event; reader.next(event);) states += event.channel == channel::kState;
  const auto ticks = s["ticks"].get<std::int64_t>();
  EXPECT_LT(states, ticks);
  EXPECT_GE(lost, 3 * (ticks - states));  // a few may not have come at all
}

TEST_F(Programs, ARunNamesTheFilesThatItLeaves) {
  for (const char* scenario : {"ramp", "contact_rebound_puma"}) {
    const Output o = run(std::string(scenario) + " --lockstep" + out(scenario));
    ASSERT_EQ(o.status, 0) << o.text;
    std::set<std::string> named, left;
    const std::size_t folder = o.text.find(std::string("/") + scenario + "\n");
    ASSERT_NE(folder, std::string::npos) << o.text;
    std::istringstream words(o.text.substr(o.text.find('\n', folder)));
    for (std::string word; words >> word && word != "see";)
      named.insert(word.substr(0, word.find(',')));
    for (const auto& entry : fs::directory_iterator(folder_ / scenario))
      left.insert(entry.path().filename());
    EXPECT_EQ(named, left) << o.text;
    EXPECT_EQ(left.count("contacts.csv") == 1, std::string(scenario) == "contact_rebound_puma");
  }
}

TEST_F(Programs, AStopLeavesItsLastSecondsAsALog) {
  const Output o = run(
      "z_sine --private-bus --no-plots " + patient() + out("a") +
      " --set 'program=[{trajectory: {duration_s: 8, z: {sine: {amplitude_m: 0.05, frequency_hz: "
      "0.5}}}, faults: [{at_s: 6, duration_s: 2, fault: floor_mat}]}]'");
  EXPECT_EQ(o.status, 1) << o.text;
  EXPECT_EQ(summary(folder_ / "a")["first_cause"], "floor mat");
  std::string record;
  for (const auto& entry : fs::directory_iterator(folder_ / "a"))
    if (entry.path().filename().string().rfind("flight-", 0) == 0) record = entry.path();
  ASSERT_FALSE(record.empty());
  const std::string rows = (folder_ / "rows.csv").string();
  const Output o2 = sh(app("collect") + record + " --select phase --out " + rows);
  EXPECT_EQ(o2.status, 0) << o2.text;
  EXPECT_EQ(o2.text, "");
  std::ifstream csv(rows);
  EXPECT_EQ(std::count(std::istreambuf_iterator<char>(csv), {}, '\n'), 501);  // 5 s, and the header
}

TEST_F(Programs, ReplayRefusesWhatIsNoLog) {
  std::ofstream(folder_ / "empty").close();
  std::ofstream(folder_ / "text") << "this is not an event log, by its first byte";
  for (const char* name : {"empty", "text", "none", ""}) {
    const Output o = sh(app("replay") + (folder_ / name).string() + " --check");
    EXPECT_EQ(o.status, 2) << o.text;
    EXPECT_EQ(std::count(o.text.begin(), o.text.end(), '\n'), 1) << o.text;
  }
}

TEST_F(Programs, LcmLoggerBesideARunReplaysToo) {
  ASSERT_EQ(sh("command -v lcm-logger").status, 0) << "liblcm-bin is not installed";
  enterPrivateBus();
  Bus bus(kDefaultUrl);
  std::int64_t sequence = -1;
  bus.subscribe({channel::kSample}, [&](const std::string&, const void* data, std::uint32_t size) {
    if (const auto m = decode<sample_t>(data, size)) sequence = m->header.sequence;
  });
  untilNothingIsLost([&] {
    const std::string file = (folder_ / "beside.lcmlog").string();
    fs::remove(file);
    Process logger("/usr/bin/lcm-logger",
                   {"--quiet", std::string("--lcm-url=") + kDefaultUrl, file});
    // The logger hears us once its file grows.
    for (int i = 0; i < 500 && (!fs::exists(file) || fs::file_size(file) == 0); ++i) {
      bus.publish("VES_HELLO", sample_t{});
      bus.wait(20);
    }
    sequence = -1;
    Process plant = start("plant", {"z_sine"});
    while (sequence < 10 && bus.wait(5000)) {
    }
    Process controller = start("controller", {"--start", "z_sine", "--set", kShortProgram});
    EXPECT_EQ(controller.wait(), 0);
    plant.signal(SIGTERM);
    EXPECT_EQ(plant.wait(), 0);
    logger.signal(SIGINT);
    logger.wait();
    return file;
  });
}

TEST_F(Programs, AnMcapFileIsWrittenDuringARun) {
  enterPrivateBus();
  const std::string file = (folder_ / "live.mcap").string();
  Process follow = start("collect", {"--follow", "--mcap", file});
  Process run = start("run", {"z_sine", "--no-plots", "--quiet", "--set", kShortProgram, "--out",
                              (folder_ / "run").string()});
  EXPECT_EQ(run.wait(), 0);
  EXPECT_EQ(follow.wait(), 0);
  std::ifstream in(file, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  const std::string magic("\x89MCAP0\r\n", 8);
  ASSERT_GT(bytes.size(), 10'000u);
  EXPECT_EQ(bytes.substr(0, 8), magic);
  EXPECT_EQ(bytes.substr(bytes.size() - 8), magic);  // it has its index
  EXPECT_NE(bytes.find("/ves/state"), std::string::npos);
  EXPECT_NE(bytes.find("configuration_hash"), std::string::npos);
}

TEST_F(Programs, ThoseWhoNameAPrivateBusAreOnOneNetworkAndNobodyElse) {
  setenv("XDG_RUNTIME_DIR", folder_.c_str(), 1);
  const std::string network = "readlink /proc/self/ns/net";
  const auto on = [&](const std::string& name, const std::string& command) {
    const Output o = sh(app("on-bus") + name + " " + command);
    EXPECT_EQ(o.status, 0) << o.text;
    return o.text;
  };
  const std::string outside = sh(network).text;
  // While the first is there: its network, for all of that name.
  Process first(
      std::string(VES_TEST_APP_DIR) + "/ves",
      {"on-bus", "a", "sh", "-c",
       network + " > " + (folder_ / "first").string() + ".new; mv " + (folder_ / "first").string() +
           ".new " + (folder_ / "first").string() + "; exec sleep 60"});
  while (!fs::exists(folder_ / "first") && first.running()) usleep(10'000);
  std::string there;
  std::getline(std::ifstream(folder_ / "first"), there);
  EXPECT_NE(there + "\n", outside);
  EXPECT_EQ(on("a", network), there + "\n");
  EXPECT_EQ(on("a", network), there + "\n");
  EXPECT_NE(on("b", network), there + "\n");
  // Its network is gone with the last of them. Held open, its number is not given to another.
  std::string process;
  std::ifstream(folder_ / "ves" / "a") >> process;
  const int held = ::open(("/proc/" + process + "/ns/net").c_str(), O_RDONLY);
  ASSERT_GE(held, 0);
  first.signal(SIGKILL);
  first.wait();
  EXPECT_NE(on("a", network), there + "\n");
  close(held);
  // Whose number somebody in another network has now is not here.
  std::ofstream(folder_ / "ves" / "c") << getpid() << " 1\n";
  EXPECT_NE(on("c", network), outside);
  EXPECT_EQ(sh(app("on-bus") + "../a true").status, 2);
  fs::permissions(folder_ / "ves", fs::perms::all);
  const Output open = sh(app("on-bus") + "a true");
  EXPECT_EQ(open.status, 2);
  EXPECT_NE(open.text.find("only this user"), std::string::npos) << open.text;
  unsetenv("XDG_RUNTIME_DIR");
}

TEST_F(Programs, SecondControllerRefusesToArmAndTheFirstGoesOn) {
  enterPrivateBus();
  Bus bus(kDefaultUrl);
  std::int64_t engaged = 0;
  std::set<std::int64_t> commanders;
  Phase phase = Phase::kDisarmed;
  std::int64_t first_source = 0;
  bus.subscribe({channel::kLegCommand},
                [&](const std::string&, const void* data, std::uint32_t size) {
                  const auto m = decode<leg_command_t>(data, size);
                  if (!m || !m->engaged) return;
                  ++engaged;
                  commanders.insert(m->header.source);
                  if (first_source == 0) first_source = m->header.source;
                });
  bus.subscribe({channel::kState}, [&](const std::string&, const void* data, std::uint32_t size) {
    const auto m = decode<state_t>(data, size);
    if (m && m->header.source == first_source) phase = static_cast<Phase>(m->phase);
  });
  // Nothing on the platform: where a process sleeps, a robot that is jolted saturates the sensor.
  const std::vector<std::string> start_now = {
      "--start", "z_sine", "--set", "program=[{calibration: {}},{trajectory: {duration_s: 60}}]"};
  Process plant = start("plant", {"z_sine"});
  Process first = start("controller", start_now);
  while (engaged < 50 && bus.wait(10'000)) {
  }
  ASSERT_GE(engaged, 50);
  Process second = start("controller", start_now);
  // It gives up after five seconds disarmed; listen meanwhile.
  while (second.running()) bus.wait(100);
  EXPECT_EQ(second.wait(), 1);
  EXPECT_EQ(commanders.size(), 1u);
  EXPECT_EQ(phase, Phase::kRunning);
  // Ctrl-C: home, parked, status 0.
  first.signal(SIGINT);
  EXPECT_EQ(first.wait(), 0);
  bus.drain();
  EXPECT_EQ(phase, Phase::kParked);
}

TEST_F(Programs, AnMcapFileThatCannotBeWrittenIsOneLine) {
  ASSERT_EQ(run("ramp --lockstep --no-plots" + out("a")).status, 0);
  const Output log =
      sh(app("collect") + (folder_ / "a/run.lcmlog").string() + " --mcap /nonexistent/x.mcap");
  EXPECT_EQ(log.status, 2) << log.text;
  // Of a run on the bus too: what a callback throws ends in a line, and not the process.
  const fs::path script = folder_ / "follow.sh";
  std::ofstream(script) << app("controller") << "z_sine --no-menu & c=$!\n"
                        << app("plant") << "z_sine & p=$!\n"
                        << app("collect") << "--follow --mcap /nonexistent/x.mcap\n"
                        << "s=$?; kill $c $p; exit $s\n";
  const Output follow = sh(app("on-bus") + "mcap_test bash " + script.string());
  EXPECT_EQ(follow.status, 2) << follow.text;
  EXPECT_NE(follow.text.find("/nonexistent/x.mcap"), std::string::npos) << follow.text;
}

TEST_F(Programs, ALogWithEveryEventTwiceIsARunOnce) {
  ASSERT_EQ(run("ramp --lockstep --no-plots" + out("a")).status, 0);
  const std::string once = (folder_ / "a/run.lcmlog").string(),
                    twice = (folder_ / "twice.lcmlog").string();
  {
    LogReader reader(once);
    LogWriter writer(twice);
    LogEvent event;
    while (reader.next(event))
      for (int k = 0; k < 2; ++k)
        writer.write(event.channel, event.data.data(), static_cast<std::int64_t>(event.data.size()),
                     0);  // by a recorder whose clock stands
  }
  const std::string a = (folder_ / "a.csv").string(), b = (folder_ / "b.csv").string();
  EXPECT_EQ(sh(app("collect") + once + " --out " + a).status, 0);
  const Output o = sh(app("collect") + twice + " --out " + b);
  EXPECT_EQ(o.status, 0) << o.text;
  EXPECT_NE(o.text.find("events stand there twice"), std::string::npos) << o.text;
  EXPECT_EQ(sh("cmp " + a + " " + b).status, 0);
  // The same messages in MCAP, by the run's own time.
  const std::string ma = (folder_ / "a.mcap").string(), mb = (folder_ / "b.mcap").string();
  EXPECT_EQ(sh(app("collect") + once + " --mcap " + ma).status, 0);
  EXPECT_EQ(sh(app("collect") + twice + " --mcap " + mb).status, 0);
  EXPECT_EQ(fs::file_size(ma), fs::file_size(mb));
}

}  // namespace
}  // namespace ves
