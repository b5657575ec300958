// SPDX-License-Identifier: BSD-3-Clause
//
// ves commission: from a machine that nobody has told about to one belief file.
#include <fmt/format.h>

#include "commands.hpp"
#include "print.hpp"
#include "runner.hpp"
#include "ves/core/build.hpp"
#include "ves/validation/commissioning.hpp"
#include "ves/validation/page.hpp"

namespace ves::app {
namespace {

int commission(RunnerOptions& options, const CommissioningOptions& wanted) {
  const Experiment scenario = options.load();
  printWarnings(scenario, options.verbose);
  const Commissioning c = commissioningOf(scenario, wanted);
  if (!options.quiet) {
    if (c.plan)
      fmt::print("{} attitudes with {} poses of the robot each", c.plan->attitudes.size(),
                 c.plan->attitudes.front().q.size());
    else
      fmt::print("no poses: {}", c.no_plan);
    fmt::print("; about {:.0f} s\n", c.seconds);
    std::fflush(stdout);
  }
  LaunchOptions launch = prepareFolder(options, c.experiment);
  const std::filesystem::path folder = launch.scenario.parent_path();
  const RunResult result = execute(options, c.experiment, launch);
  writeResults(folder, result, false);
  if (!result.good()) {
    fmt::print(stderr, "ves commission: {}; nothing is believed of it\n",
               whyNot(result, launch.process.log));
    return kTripped;
  }

  const Series series = readSeries((folder / "run.lcmlog").string());
  const Commissioned found = commissioned(series, c);
  const std::filesystem::path file = folder / "belief.yaml";
  writeFile(file, beliefOf(found, scenario,
                           fmt::format("What the machine of {} has been found to be, by ves "
                                       "commission.\nFor --belief.",
                                       scenario.name)));
  options.belief.belief = file;  // what would be refused is refused now
  const Experiment believing = options.load();
  const std::vector<Table> tables =
      tablesOf(series, c, found, forecastError(scenario, believing, found));
  std::string use = fmt::format("{} run {}", frontDoor(), asTyped(options.scenario));
  for (const std::string& one : options.overrides) use += " --set " + asTyped(one);
  use += fmt::format("{} --belief {}", options.process.lockstep ? " --lockstep" : "",
                     asTyped(file.lexically_normal().string()));
  Page page;
  page.section("To use it");
  page.text(use);
  for (const Table& table : tables) {
    page.section(table.title);
    if (!table.rows.empty()) page.table(table.header, table.rows);
    if (!table.note.empty()) page.text(table.note);
  }
  writeFile(folder / "commission.html",
            page.html("Commissioning of " + scenario.name,
                      fmt::format("{:.0f} s of the machine's time, {}; {}", result.simulated,
                                  dateText(std::time(nullptr)), describeBuild())));
  if (!options.quiet) {
    for (const Table& table : tables) {
      printTable(table.title, table.header, table.rows);
      if (!table.note.empty()) fmt::print("  {}\n\n", table.note);
    }
    fmt::print("{:.0f} s of the machine's time; the page: {}\n{}\n", result.simulated,
               (folder / "commission.html").string(), use);
  }
  std::fflush(stdout);
  for (const RangeUse& one : found.ranges)
    if (one.used > RangeUse::kRoom)
      fmt::print(stderr, "warning: {} uses {:.0f} % of its range, want at most {:.0f} %\n",
                 one.name, 100.0 * one.used, 100.0 * RangeUse::kRoom);
  return statusOf(result);
}

}  // namespace

int commissionCommand(int argc, char** argv) {
  CLI::App cli(
      "Moves a machine that nobody has told about, and finds out: sensor's bias, robot's masses, "
      "servos, timing, and how much room the ranges leave. Leaves belief.yaml for --belief, and "
      "commission.html. The robot goes through its whole range: clear the space about it.",
      "ves commission");
  RunnerOptions options;
  CommissioningOptions wanted;
  double accuracy = 100.0 * wanted.accuracy;
  options.addExperiment(cli);
  options.addBus(cli);
  options.addOut(cli);
  options.addQuiet(cli);
  cli.add_option("--seconds", wanted.seconds, "of the machine's time, at most")
      ->check(inRange(30.0, 3600.0))
      ->capture_default_str();
  cli.add_option("--accuracy", accuracy,
                 "of the weight's wrench [%]; fewer poses where that is met")
      ->check(inRange(1e-4, 10.0))
      ->capture_default_str();
  cli.add_option("--joint-speed", wanted.poses.speed, "mean, of the robot's joints [deg/s | cm/s]")
      ->check(inRange(0.1, 1000.0))
      ->capture_default_str();
  return run(cli, argc, argv, [&] {
    options.requireUsed(cli);
    wanted.accuracy = accuracy / 100.0;
    return commission(options, wanted);
  });
}

}  // namespace ves::app
