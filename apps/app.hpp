// SPDX-License-Identifier: BSD-3-Clause
//
// The frame of a command: Ctrl-C, the three exit statuses, and what its errors look like.
#pragma once

#include <CLI/CLI.hpp>
#include <csignal>
#include <filesystem>
#include <functional>
#include <string>

namespace ves::app {

inline constexpr int kDone = 0;     // the run went well
inline constexpr int kTripped = 1;  // a check stopped it, or a comparison failed
inline constexpr int kBadInput = 2;

inline volatile std::sig_atomic_t stop_requested = 0;

/// Ctrl-C, SIGTERM, a terminal that closes and processor time that is used up ask for a gentle end.
/// A closed pipe ends nothing.
void catchSignals();

/// Asks a command for the words that may be completed.
inline constexpr const char* kWords = "--words";

/// Parses, runs, and turns bad input into one line and status 2.
int run(CLI::App& cli, int argc, char** argv, const std::function<int()>& body);

/// Where bases, robots and scenarios are: as VES_CONFIG_DIR says, here, or beside the installed
/// program.
std::filesystem::path configFolder();

/// This very program, to start its other processes.
std::filesystem::path ownProgram();

/// Environment: the token of a socket that `ves view` inherits. Arguments are for all to see.
inline constexpr const char* kViewToken = "VES_VIEW_TOKEN";

/// One line that a person can read, whatever was quoted in it.
std::string shortened(std::string text);

}  // namespace ves::app
