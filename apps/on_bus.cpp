// SPDX-License-Identifier: BSD-3-Clause
//
// ves on-bus: any program on a private bus.
#include <fmt/format.h>
#include <unistd.h>
#include <cerrno>
#include <cstring>

#include "app.hpp"
#include "commands.hpp"
#include "ves/bus/bus.hpp"
#include "ves/core/errors.hpp"

namespace ves::app {

int onBusCommand(int argc, char** argv) {
  CLI::App cli(
      "Runs any program on the private bus of that name, which `--join NAME` of the other commands "
      "reaches too: somebody's machine is tried there without touching the network.",
      "ves on-bus");
  std::string name;
  std::string program;
  cli.add_option("name", name, "of the bus; the first to ask begins it")->required();
  cli.add_option("program", program, "and its arguments")->required();
  // What stands behind the program is not ours to read.
  const int ours = std::min(argc, 3);
  return run(cli, ours, argv, [&] {
    joinPrivateBus(name);
    execvp(argv[2], argv + 2);
    throw InputError(fmt::format("{}: {}", program, std::strerror(errno)));
    return kDone;
  });
}

}  // namespace ves::app
