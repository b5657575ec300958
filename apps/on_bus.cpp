// SPDX-License-Identifier: BSD-3-Clause
//
// ves on-bus: any program on a private bus.
#include <unistd.h>

#include "app.hpp"
#include "commands.hpp"

namespace ves::app {

int onBusCommand(int argc, char** argv) {
  CLI::App cli(
      "Runs any program on the private bus of that name, which `--join NAME` of the other commands "
      "reaches too: somebody's machine is tried there without touching the network.",
      "ves on-bus");
  std::string name;
  std::vector<std::string> program;
  cli.add_option("name", name, "of the bus; the first to ask begins it")->required();
  cli.add_option("program", program, "and its arguments")->required();
  cli.prefix_command();
  return run(cli, argc, argv, [&] {
    for (const std::string& more : cli.remaining()) program.push_back(more);
    if (program.front() == "--") program.erase(program.begin());
    if (program.empty()) throw InputError("program: want one to run");
    joinPrivateBus(name);
    std::vector<char*> arguments;
    for (std::string& argument : program) arguments.push_back(argument.data());
    arguments.push_back(nullptr);
    execvp(arguments.front(), arguments.data());
    throw InputError(fmt::format("{}: {}", program.front(), std::strerror(errno)));
    return kDone;
  });
}

}  // namespace ves::app
