// SPDX-License-Identifier: BSD-3-Clause
//
// ves run: one scenario, from start to its folder of results.
#include <fmt/format.h>

#include "commands.hpp"
#include "runner.hpp"

namespace ves::app {

namespace {

/// What there is to run, a line each.
[[noreturn]] void listScenarios() {
  const std::filesystem::path folder = configFolder() / "scenarios";
  for (const std::string& name : namesIn(folder)) {
    const Value document = loadDocument(folder / (name + ".yaml"));
    const Value* about = document.find("description");
    fmt::print("  {:<24}{}\n", name, about ? about->text : "");
  }
  std::fflush(stdout);  // whatever comes after it comes behind it
  throw InputError("which scenario? One of these, or a path to a .yaml file");
}

}  // namespace

int runCommand(int argc, char** argv) {
  CLI::App cli(
      "Runs a scenario: in real time as two processes on the bus, or with --lockstep as fast "
      "as possible. Leaves run.lcmlog, summary.json, series.csv and plots.",
      "ves run");
  RunnerOptions options;
  options.addExperiment(cli);
  cli.get_option("scenario")->required(false);
  options.addForce(cli);
  options.addBus(cli);
  options.addPace(cli);
  options.addOut(cli);
  cli.add_flag("--two-processes", options.two_processes, "in lockstep too, over the bus");
  options.addQuiet(cli);
  options.addView(cli);
  cli.add_flag("!--no-plots", options.plots, "leave the plots out");
  return run(cli, argc, argv, [&] {
    if (options.scenario.empty()) listScenarios();
    return runExperiment(cli, options);
  });
}

}  // namespace ves::app
