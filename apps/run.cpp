// SPDX-License-Identifier: BSD-3-Clause
//
// ves run: one scenario, from start to its folder of results.
#include "commands.hpp"
#include "runner.hpp"

namespace ves::app {

namespace {

/// What there is to run, a line each.
[[noreturn]] void listScenarios() {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(configFolder() / "scenarios", error))
    if (entry.path().extension() == ".yaml") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const std::filesystem::path& file : files) {
    const Value document = loadDocument(file);
    const Value* about = document.find("description");
    fmt::print("  {:<24}{}\n", file.stem().string(), about ? about->text : "");
  }
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
  options.addOut(cli);
  cli.add_flag("--two-processes", options.two_processes, "in lockstep too, over the bus");
  options.addQuiet(cli);
  options.addView(cli);
  cli.add_flag("!--no-plots", options.plots, "leave the plots out");
  return run(cli, argc, argv, [&] {
    if (options.scenario.empty()) listScenarios();
    return runExperiment(options);
  });
}

}  // namespace ves::app
