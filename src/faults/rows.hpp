// SPDX-License-Identifier: BSD-3-Clause
//
// The parts of the table, by what a row needs.
#pragma once

#include <fmt/format.h>

#include "ves/config/experiment.hpp"
#include "ves/faults/table.hpp"

namespace ves {

/// A scenario of the repository with changes, its stability checked.
Experiment faultScenario(const std::filesystem::path& config, const std::string& name,
                         const std::vector<std::string>& sets);

inline FaultOutcome outcome(bool good, std::string what, std::int64_t ticks = -1) {
  FaultOutcome out;
  out.as_expected = good;
  out.what = std::move(what);
  out.ticks = ticks;
  return out;
}

/// Runs of a scenario with something injected, as config/faults.yaml lists them.
std::vector<FaultRow> scenarioRows(const std::filesystem::path& config);
/// An operator's hands on controller and plant in lockstep, tick by tick.
std::vector<FaultRow> operatorRows(const std::filesystem::path& config);
/// Files, logs and messages that are wrong.
std::vector<FaultRow> inputRows(const std::filesystem::path& config);
/// A force sensor over the network that loses, repeats, fails.
std::vector<FaultRow> sensorRows(const std::filesystem::path& config);
/// Controller and plant as processes on a bus.
std::vector<FaultRow> processRows(const std::filesystem::path& config,
                                  const std::filesystem::path& program);

}  // namespace ves
