// SPDX-License-Identifier: BSD-3-Clause
//
// testPlatform's menu on a terminal, or its commands from a script.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "ves/run/run.hpp"

namespace ves {

struct ConsoleOptions {
  LaunchOptions launch;
  std::vector<std::string> commands;  // of a script; none: ask the terminal
  std::filesystem::path calibration;  // where a calibration is kept
  std::function<bool()> stop;         // true: Ctrl-C was pressed
};

/// Starts a controller and does what is asked for. Returns how it ended; `failed` tells whether a
/// script's command could not be carried out. Throws InputError, before anything moves, when a
/// script cannot be read.
RunResult runConsole(const Experiment& experiment, const ConsoleOptions& options, bool& failed);

}  // namespace ves
