// SPDX-License-Identifier: BSD-3-Clause
//
// ves accept: what a motion platform does, coordinate by coordinate.
#include <fmt/format.h>

#include "commands.hpp"
#include "outputs.hpp"
#include "print.hpp"
#include "runner.hpp"
#include "ves/acceptance/acceptance.hpp"
#include "ves/config/calibration.hpp"
#include "ves/core/build.hpp"
#include "ves/core/coordinates.hpp"

namespace ves::app {
namespace {

struct Wanted {
  AcceptanceOptions tests;
  std::vector<std::string> coordinates, parts;
  std::string limits, command;
  bool moves = false;
};

std::vector<int> coordinatesOf(const std::vector<std::string>& names) {
  std::vector<int> out;
  for (int i = 0; i < 6; ++i)
    if (names.empty() || std::find(names.begin(), names.end(), coordinate(i).name) != names.end())
      out.push_back(i);
  return out;
}

std::vector<std::string> conditionsOf(const RunnerOptions& options, const Wanted& wanted,
                                      const Experiment& e, double seconds) {
  const std::string how =
      wanted.moves
          ? "the machine on " + options.process.url
          : fmt::format("simulated on {} legs, in {}", e.plant.hydraulic ? "hydraulic" : "ideal",
                        options.process.lockstep ? "lockstep" : "real time");
  const Compensation& c = e.controller.compensation;
  std::string compensation;
  for (const auto& [on, name] : {std::pair(c.feed_forward, "feed_forward"),
                                 {c.observer, "observer"},
                                 {c.adaptation, "adaptation"}})
    if (on) compensation += fmt::format("{}{}", compensation.empty() ? "" : ", ", name);
  const double load =
      compositeBody(carried(e.controller.payload), e.plant.task.initial_joints).mass;
  return {
      fmt::format("Machine: {}, {}; {:.0f} s of its time; compensation: {}.", e.name, how, seconds,
                  compensation.empty() ? "none" : compensation),
      fmt::format("On the force sensor stand {:.1f} kg, as believed; the robot does not move. "
                  "Accelerations are what that load weighs more or less, by the sensor; a wrong "
                  "belief scales them, and cancels in ratios.",
                  load),
      fmt::format("Told is where the platform should be at each tick of {:g} ms; done is what the "
                  "six transducers say, by forward kinematics. What they cannot see, as the play "
                  "of joints beyond them and their own errors, is not in it.",
                  1e3 * e.controller.periodSeconds()),
      fmt::format("Largest amplitude at each frequency: {:g} % of what travel, the legs' commanded "
                  "speed and the sensor's range allow. Measures after AGARD-AR-144; every interval "
                  "is 95 %.",
                  100.0 * wanted.tests.share)};
}

/// A limit that nothing of what is asked for measures is known before anything moves.
void requireMeasured(const AcceptanceLimit& limit, const Wanted& wanted) {
  const auto has = [](const std::vector<std::string>& asked, const std::string& one) {
    return asked.empty() || std::find(asked.begin(), asked.end(), one) != asked.end();
  };
  const auto refuse = [&](const std::string& one, const char* option) {
    throw InputError(fmt::format("--limits {}: '{}' is not measured without {} among {}",
                                 wanted.limits, limit.text, one, option));
  };
  for (const std::string& one : limit.of)
    if (!one.starts_with("leg_") && !has(wanted.coordinates, one)) refuse(one, "--coordinates");
  const std::string part = partOf(limit.quantity);
  if (!part.empty() && !has(wanted.parts, part)) refuse(part, "--tests");
}

int accept(RunnerOptions& options, Wanted& wanted) {
  if (wanted.moves && options.process.lockstep)
    throw InputError("--move: a machine on the bus keeps its own time, want no --lockstep");
  const Experiment scenario = options.load();
  printWarnings(scenario, options.verbose);
  const std::vector<AcceptanceLimit> limits =
      wanted.limits.empty() ? std::vector<AcceptanceLimit>() : readLimits(wanted.limits);
  for (const AcceptanceLimit& limit : limits) requireMeasured(limit, wanted);
  std::vector<AcceptanceTest> tests;
  double seconds = 0.0;
  for (const int i : coordinatesOf(wanted.coordinates)) {
    tests.push_back(acceptanceTest(scenario, i, wanted.tests));
    seconds += tests.back().seconds;
  }
  if (!options.quiet) {
    fmt::print("about {:.0f} s of the machine's time\n", seconds);
    std::fflush(stdout);
  }
  const std::filesystem::path folder =
      options.out.empty()
          ? claimNewFolder(fmt::format("ves-runs/accept_{}-{:%Y%m%d-%H%M%S}", scenario.name,
                                       fmt::localtime(std::time(nullptr))))
          : claimFolder(options.out);
  if (!options.overwrite) requireWithout(folder, options.out, {"accept.csv", "accept.html"});

  std::vector<CoordinateResult> found;
  std::string stopped;
  seconds = 0.0;
  for (const AcceptanceTest& test : tests) {
    options.out = (folder / coordinate(test.coordinate).name).string();
    if (!options.quiet) {
      fmt::print("  {}, {:.0f} s\n", coordinate(test.coordinate).name, test.seconds);
      std::fflush(stdout);
    }
    LaunchOptions launch = prepareFolder(options, test.experiment);
    launch.plant = !wanted.moves;
    const RunResult result = execute(options, test.experiment, launch, false);
    statusOf(result);  // a recording with holes tells nothing
    seconds += result.simulated;
    found.push_back(measurementsOf(readSeries(launch.process.log), test));
    if (!result.good()) {
      stopped = fmt::format("{}: {}", coordinate(test.coordinate).name,
                            whyNot(result, launch.process.log));
      break;
    }
  }

  const std::vector<AcceptanceVerdict> verdicts = judge(limits, found);
  std::vector<std::string> conditions = conditionsOf(options, wanted, scenario, seconds);
  if (!stopped.empty()) conditions.push_back("Not to its end: " + stopped + ".");
  writeFile(folder / "accept.csv", acceptanceCsv(found));
  writeFile(folder / "accept.html",
            acceptancePage(tests, found, verdicts, conditions, wanted.command)
                .html("Acceptance of " + scenario.name,
                      fmt::format("{}; {}", dateText(std::time(nullptr)), describeBuild())));
  if (!options.quiet) {
    const auto print = [](const Table& t) { printTable(t.title, t.header, t.rows); };
    print(acceptanceSummary(found));
    for (const CoordinateResult& one : found)
      for (const std::string& missing : one.missing) fmt::print("  not measured: {}\n", missing);
    if (!verdicts.empty()) print(verdictTable(verdicts));
    fmt::print("the page: {}\n", (folder / "accept.html").string());
  }
  std::fflush(stdout);
  if (!stopped.empty()) {
    fmt::print(stderr, "ves accept: {}; the coordinates after it were not moved\n", stopped);
    return kTripped;
  }
  const bool kept = std::all_of(verdicts.begin(), verdicts.end(), [](const AcceptanceVerdict& v) {
    return v.is == AcceptanceVerdict::Is::kKept;
  });
  return kept ? kDone : kTripped;
}

}  // namespace

int acceptCommand(int argc, char** argv) {
  CLI::App cli(
      "Moves a platform one coordinate after the other and measures it as AGARD-AR-144 does: "
      "describing functions, crosstalk, noise and harmonics of the acceleration, hysteresis, lag, "
      "threshold, noise at rest, each with its 95 % interval. Leaves accept.html and accept.csv. "
      "Without --move it is the scenario's simulated machine. Status 1 where a limit of --limits "
      "is not shown to be kept.",
      "ves accept");
  RunnerOptions options;
  Wanted wanted;
  options.addExperiment(cli);
  options.addBus(cli);
  options.addOut(cli);
  options.addQuiet(cli);
  cli.add_flag("--move", wanted.moves,
               "the machine on the bus, as its controller: clear the space about it");
  cli.add_option("--limits", wanted.limits, "a YAML file of limits (docs/acceptance.md)");
  std::vector<std::string> names;
  for (const Coordinate& c : kCoordinates) names.emplace_back(c.name);
  cli.add_option("--coordinates", wanted.coordinates, "x, y, z, alpha, beta, gamma; all by default")
      ->delimiter(',')
      ->check(CLI::IsMember(names));
  cli.add_option("--tests", wanted.parts, "sines, passes, steps; all by default")
      ->delimiter(',')
      ->check(CLI::IsMember({"sines", "passes", "steps"}));
  cli.add_option("--frequencies", wanted.tests.frequencies, "of the sines [Hz], rising")
      ->delimiter(',')
      ->check(inRange(0.02, 20.0))
      ->expected(1, 12)
      ->capture_default_str();
  cli.add_option("--amplitudes", wanted.tests.amplitudes,
                 "[-] of the largest at each frequency, falling")
      ->delimiter(',')
      ->check(inRange(0.01, 1.0))
      ->expected(1, 3)
      ->capture_default_str();
  cli.add_option("--share", wanted.tests.share, "[-] of what the machine allows, at most")
      ->check(inRange(0.01, 0.9))
      ->capture_default_str();
  cli.add_option("--step", wanted.tests.step, "of acceleration, for the threshold [m/s^2]")
      ->check(inRange(0.005, 2.0))
      ->capture_default_str();
  cli.add_option("--slow", wanted.tests.slow, "pace of the passes for the hysteresis [m/s]")
      ->check(inRange(1e-4, 0.01))
      ->capture_default_str();
  wanted.command = "./ves accept";
  for (int i = 1; i < argc; ++i) wanted.command += " " + asTyped(argv[i]);
  return run(cli, argc, argv, [&] {
    const auto rising = [](const std::vector<double>& all, double sign) {
      for (std::size_t i = 1; i < all.size(); ++i)
        if (!(sign * (all[i] - all[i - 1]) > 0.0)) return false;
      return true;
    };
    if (!rising(wanted.tests.frequencies, 1.0))
      throw InputError("--frequencies: want each above the one before");
    if (!rising(wanted.tests.amplitudes, -1.0))
      throw InputError("--amplitudes: want each below the one before");
    const auto asked = [&](const char* part) {
      return wanted.parts.empty() ||
             std::find(wanted.parts.begin(), wanted.parts.end(), part) != wanted.parts.end();
    };
    wanted.tests.sines = asked("sines");
    wanted.tests.passes = asked("passes");
    wanted.tests.steps = asked("steps");
    if (!wanted.tests.sines)
      refuse(cli, {"--frequencies", "--amplitudes"}, "without sines among --tests");
    if (!wanted.tests.passes) refuse(cli, {"--slow"}, "without passes among --tests");
    if (!wanted.tests.steps) refuse(cli, {"--step"}, "without steps among --tests");
    options.requireUsed(cli);
    return accept(options, wanted);
  });
}

}  // namespace ves::app
