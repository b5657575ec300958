// SPDX-License-Identifier: BSD-3-Clause
//
// ves controller: testPlatform as a process of its own.
#include "app.hpp"

int main(int argc, char** argv) {
  using namespace ves;
  CLI::App cli(
      "The controller (testPlatform) as a process: runs a scenario's program against the "
      "machine on the bus.",
      "ves controller");
  app::Options options;
  options.addExperiment(cli);
  options.addBus(cli);
  cli.add_flag("--start", options.process.start, "run the scenario's program at once");
  cli.add_option("--log", options.process.log, "record samples, states and commands (lockstep)");
  return app::run(cli, argc, argv, [&] {
    if (options.private_bus) enterPrivateBus();
    app::catchSignals();
    const Experiment experiment = options.load();
    const RunResult result = runController(experiment, options.process, [](const TickState&) {
      return app::stop_requested ? Order{Request::kStop, {}, {}} : Order();
    });
    if (result.good()) return app::kDone;
    if (result.phase == Phase::kDisarmed)
      fmt::print(stderr, "ves controller: not armed: {}\n", name(result.cause));
    else
      fmt::print(stderr, "ves controller: stopped by the {} check in tick {}\n", name(result.cause),
                 result.cause_tick);
    return app::kTripped;
  });
}
