// SPDX-License-Identifier: BSD-3-Clause
//
// ves plant: everything that was metal, as a process of its own.
#include "app.hpp"

int main(int argc, char** argv) {
  using namespace ves;
  CLI::App cli("The plant as a process: legs, platform, robot, sensor. Runs until Ctrl-C.",
               "ves plant");
  app::Options options;
  options.addExperiment(cli);
  options.addBus(cli);
  return app::run(cli, argc, argv, [&] {
    if (options.private_bus) enterPrivateBus();
    app::catchSignals();
    runPlant(options.load(), options.process, [] { return app::stop_requested != 0; });
    return app::kDone;
  });
}
