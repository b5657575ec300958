// SPDX-License-Identifier: BSD-3-Clause
//
// The table of faults: what is injected, what must happen, and what did. The rows that run are the
// rows that are printed.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace ves {

/// What happened to one row.
struct Seen {
  bool as_expected = false;
  std::string what;              // in a few words
  std::int64_t ticks = -1;       // [-] from injection to detection; -1: nothing to detect
  double period = 0.0;           // [s] of a tick
  double peak_deviation = -1.0;  // [m] of the platform from where it should be, after injection
};

struct FaultRow {
  const char* id;
  const char* fault;
  const char* expected;
  bool processes;  // runs real processes, in real time
  std::function<Seen()> run;
};

/// `config` is the folder of scenarios, `programs` that of ves-controller and ves-plant. Rows with
/// processes need a bus: enterPrivateBus() first.
std::vector<FaultRow> faultTable(const std::filesystem::path& config,
                                 const std::filesystem::path& programs);

struct SoakResult {
  std::int64_t ticks = 0;       // [-]
  std::int64_t faults = 0;      // [-] injected
  std::int64_t stops = 0;       // [-]
  std::int64_t recoveries = 0;  // [-] resets that led back to armed
  std::uint64_t hash = 0;       // of every command
  std::string violated;         // a law that a command broke; empty
};

/// Lockstep for so many ticks, with random faults, orders and recoveries; the same for one seed.
SoakResult soak(const std::filesystem::path& config, std::int64_t ticks, std::uint32_t seed,
                const std::function<void(std::int64_t)>& progress);

}  // namespace ves
