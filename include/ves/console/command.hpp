// SPDX-License-Identifier: BSD-3-Clause
//
// The words of testPlatform's menu. Lengths in mm, angles in degrees, times in s, rates in Hz.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ves/config/experiment.hpp"
#include "ves/contract/robot_order.hpp"

namespace ves {

enum class Verb {
  kArm,
  kProgram,
  kAdmittance,
  kTrajectory,
  kMove,
  kCalibration,
  kTare,
  kRobot,
  kTool,
  kGrasp,
  kRelease,
  kPush,
  kCollect,
  kStatus,
  kHold,
  kStop,
  kReset,
  kCompensate,
  kUncompensate,
  kVehicle,
  kGripper,
  kThrust,
  kWait,
  kHelp,
  kQuit
};

/// One item of the menu.
struct Item {
  Verb verb;
  const char* word;
  const char* arguments;
  const char* what;
};
const std::vector<Item>& menu();

/// What to write to a file, from the next tick on.
struct Collection {
  std::string file;
  double duration = 10.0;           // [s]
  double rate = 0.0;                // [Hz] 0: every tick
  std::vector<std::string> select;  // beginnings of columns' names; all when empty
};

struct Command {
  Verb verb = Verb::kHelp;
  Order order;            // of what moves the platform
  Collection collection;  // of kCollect
  double wait = 0.0;      // [s] of kWait
  RobotOrder robot;       // of kRobot, kTool, kGrasp, kRelease and kPush
};

/// A number in [lo, hi]. Throws InputError that says so.
double parseNumber(const std::string& text, const std::string& what, double lo, double hi,
                   const char* unit);

/// The verb that a word, the beginning of only one, or a number of the menu stands for. Throws
/// InputError.
Verb parseVerb(const std::string& word);

/// A whole line: "trajectory 3 z sine 200 0.5". Throws InputError that says what is allowed, by the
/// limits of the experiment.
Command parseCommand(const std::string& line, const Experiment& experiment);

}  // namespace ves
