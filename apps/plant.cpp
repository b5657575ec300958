// SPDX-License-Identifier: BSD-3-Clause
//
// ves plant: everything that was metal, as a process of its own.
#include "commands.hpp"
#include "options.hpp"
#include "print.hpp"

namespace ves::app {

int plantCommand(int argc, char** argv) {
  CLI::App cli(
      "The machine as a process: legs, platform, robot, sensor; simulated, or as the scenario's "
      "`machine` says. Runs until Ctrl-C.",
      "ves plant");
  Options options;
  options.addExperiment(cli);
  options.addBus(cli);
  options.addPace(cli);
  return run(cli, argc, argv, [&] {
    const Experiment experiment = options.load();
    if (options.process.lockstep)
      refuse(cli, {"--realtime"}, "beside --lockstep, which waits on no clock");
    if (options.verbose) printWarnings(experiment, true);
    options.enterBus();
    catchSignals();
    runPlant(experiment, options.process, [] { return stop_requested != 0; });
    return kDone;
  });
}

}  // namespace ves::app
