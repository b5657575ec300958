// SPDX-License-Identifier: BSD-3-Clause
//
// ves demo: the main job. PUMA 560 on a compliant base, two processes, real time.
#include "commands.hpp"
#include "runner.hpp"

namespace ves::app {

int demoCommand(int argc, char** argv) {
  CLI::App cli(
      "The main job, in real time: controller and plant as two processes over LCM, a PUMA 560 "
      "on a compliant base, about 20 s.",
      "ves demo");
  RunnerOptions options;
  options.scenario = "puma_on_table_4_1";
  options.addOut(cli);
  options.addBus(cli);
  options.addPace(cli);
  options.addQuiet(cli);
  options.addView(cli);
  return run(cli, argc, argv, [&] { return runExperiment(cli, options); });
}

}  // namespace ves::app
