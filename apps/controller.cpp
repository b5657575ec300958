// SPDX-License-Identifier: BSD-3-Clause
//
// ves controller: testPlatform, with its menu or as a process that takes its orders from the bus.
#include <fmt/format.h>
#include <unistd.h>

#include "commands.hpp"
#include "print.hpp"
#include "runner.hpp"
#include "ves/console/console.hpp"

namespace ves::app {
namespace {

struct ControllerOptions : RunnerOptions {
  std::vector<std::string> commands;
  bool no_menu = false;
  bool plant = false;
};

/// One process, no terminal.
int serve(ControllerOptions& options) {
  options.enterBus();
  catchSignals();
  Experiment experiment = options.load();
  if (options.verbose) printWarnings(experiment, true);
  if (options.process.start) {
    warnOfInstability(experiment);
  } else {
    const std::string why = applyStabilityCheck(experiment);
    if (!why.empty()) fmt::print(stderr, "ves controller: {}\n", why);
  }
  const RunResult result = runController(experiment, options.process, [](const TickState&) {
    return stop_requested ? Order{Request::kStop, {}, {}} : Order();
  });
  if (result.good()) return kDone;
  if (const std::string why = whyNot(result); !why.empty())
    fmt::print(stderr, "ves controller: {}\n", why);
  return kTripped;
}

/// The calibration of an earlier session, when it fits and none was named.
std::filesystem::path findCalibration(ControllerOptions& options) {
  const std::filesystem::path kept = "ves-runs/calibration.yaml";
  std::error_code error;
  const BeliefFiles& named = options.belief;
  if (!named.calibration.empty() || !named.belief.empty() || !std::filesystem::exists(kept, error))
    return kept;
  const Value document = loadDocument(kept);
  const CalibrationRecord record = readCalibration(Section(document, ""));
  if (record.setup == options.load().source.calibrated())
    options.belief.calibration = kept;
  else
    fmt::print(stderr, "warning: {} is of another sensor, robot, masses or gravity: not used\n",
               kept.string());
  return kept;
}

int console(ControllerOptions& options) {
  ConsoleOptions console;
  console.calibration = findCalibration(options);
  if (!options.belief.calibration.empty()) console.calibration = options.belief.calibration;
  console.commands = options.commands;
  console.stop = [] { return stop_requested != 0; };
  Experiment experiment = options.load();
  printWarnings(experiment, options.verbose);
  const std::string why = applyStabilityCheck(experiment);
  if (!why.empty()) fmt::print(stderr, "warning: {}\n", why);
  catchSignals();
  prepareBus(options, options.plant);
  console.launch = prepareFolder(options, experiment);
  console.launch.plant = options.plant;
  fmt::print("{}: {}\n", experiment.name, experiment.description);
  bool failed = false;
  const RunResult result = runConsole(experiment, console, failed);
  fmt::print("{}", writeResults(console.launch.scenario.parent_path(), result, options.plots));
  return failed ? kTripped : statusOf(result);
}

}  // namespace

int controllerCommand(int argc, char** argv) {
  CLI::App cli(
      "The controller (testPlatform). On a terminal, or with --do: its menu, over a controller "
      "process that it starts and records. Otherwise that process alone, which takes orders from "
      "the bus (VES_OPERATOR) and moves nothing without one.",
      "ves controller");
  ControllerOptions options;
  options.addExperiment(cli);
  options.addForce(cli);
  options.addBus(cli);
  options.addOut(cli);
  cli.add_option(
         "--do", options.commands,
         "a line of the menu, as 'trajectory 3 z sine 200 0.5'; again for the next, which waits "
         "until it is over, unless it ends in & ('admittance 10 &'); then home")
      ->allow_extra_args(false);
  cli.add_flag("--plant", options.plant, "start a plant too");
  cli.add_flag("--start", options.process.start, "run the scenario's program at once; no menu");
  cli.add_flag("--no-menu", options.no_menu, "wait for orders from the bus")
      ->excludes(cli.get_option("--start"));
  cli.add_option("--log", options.process.log,
                 "record samples, states and commands (--lockstep, no menu)");
  cli.add_option("--flight", options.process.flight,
                 "folder for the last 5 s before a stop, as a log of their own (no menu)");
  cli.add_flag("!--no-plots", options.plots, "leave the plots out");
  return run(cli, argc, argv, [&] {
    const bool alone = options.no_menu || options.process.start || options.process.lockstep;
    // Lines of the menu may come through a pipe; without a word of them it is the process alone.
    const bool session = options.plant || !options.out.empty() || !options.commands.empty();
    const bool menu = !alone && (session || isatty(STDIN_FILENO));
    const auto want = [&](const char* option, const char* instead) {
      const char* where = menu    ? "with the menu"
                          : alone ? "with --no-menu, --start or --lockstep"
                                  : "without a terminal, --do or --plant";
      refuse(cli, {option}, fmt::format("{}; {}", where, instead));
    };
    if (menu) {
      want("--log", "want --out FOLDER, where run.lcmlog will be");
      want("--flight", "run.lcmlog has all of it");
    } else {
      want("--do", "want orders over the bus");
      want("--out", "want --log FILE, or ves run");
      want("--plant", "want ves plant beside it, or ves run");
      want("--no-plots", "it draws none");
    }
    if (options.process.lockstep)
      refuse(cli, {"--realtime"}, "beside --lockstep, which waits on no clock");
    return menu ? console(options) : serve(options);
  });
}

}  // namespace ves::app
