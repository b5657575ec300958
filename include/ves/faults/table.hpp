// SPDX-License-Identifier: BSD-3-Clause
//
// The table of faults: what is injected, what must happen, and what did. The rows that run are the
// rows that are printed, and every figure in them was measured in that run.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace ves {

/// What happened in one row.
struct FaultOutcome {
  bool as_expected = false;
  std::string what;              // in a few words, with a figure
  std::int64_t ticks = -1;       // [-] from injection to detection; -1: nothing to detect
  double period = 0.01;          // [s] of a tick
  double peak_deviation = -1.0;  // [m] of the platform from where it should be, after injection
};

struct FaultRow {
  std::string id;
  std::string fault;
  std::string expected;
  bool processes = false;  // runs real processes, in real time
  std::function<FaultOutcome()> run;
  bool any_machine = false;  // the same is expected of any robot, base and platform
};

/// What the table is run on.
struct FaultBench {
  std::filesystem::path config;                // the folder with faults.yaml and the scenarios
  std::string scenario = "puma_on_table_4_1";  // a name in it, or a file
  std::vector<std::string> sets;               // for every row, as for --set
  double amplitude = 1.0;                      // [-] times the table's motions
  std::filesystem::path program;  // `ves`: the controller and the plant of rows with processes
};

/// Rows with processes need a bus: enterPrivateBus() first. Throws InputError where faults.yaml,
/// the scenario or a setting is wrong.
std::vector<FaultRow> faultTable(const FaultBench& bench);

}  // namespace ves
