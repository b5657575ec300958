// SPDX-License-Identifier: BSD-3-Clause
//
// The parts of the table, by what a row needs.
#pragma once

#include <fmt/format.h>

#include "ves/config/experiment.hpp"
#include "ves/faults/table.hpp"

namespace ves {

/// The bench's scenario with changes, its stability checked.
Experiment faultScenario(const FaultBench& bench, const std::vector<std::string>& sets = {});

/// How large the platform's workspace is beside the one that the table's amplitudes are for.
struct WorkspaceScale {
  WorkspaceScale(const SafetyLimits& limits, const FaultBench& bench)
      : lengths(bench.amplitude * limits.translation / 0.305),
        angles(bench.amplitude * limits.rotation / (30.0 * kDegree)) {}
  double lengths, angles;  // [-]
};

/// The table's own machine, as published: of rows that are about something else.
inline FaultBench own(FaultBench bench) {
  bench.scenario = FaultBench().scenario;
  bench.sets.clear();
  return bench;
}

inline FaultOutcome outcome(bool good, std::string what, std::int64_t ticks = -1) {
  FaultOutcome out;
  out.as_expected = good;
  out.what = std::move(what);
  out.ticks = ticks;
  return out;
}

/// Runs of a scenario with something injected, as config/faults.yaml lists them.
std::vector<FaultRow> scenarioRows(const FaultBench& bench);
/// An operator's hands on controller and plant in lockstep, tick by tick.
std::vector<FaultRow> operatorRows(const FaultBench& bench);
/// Files, logs and messages that are wrong.
std::vector<FaultRow> inputRows(const FaultBench& bench);
/// A force sensor over the network that loses, repeats, fails.
std::vector<FaultRow> sensorRows(const FaultBench& bench);
/// Controller and plant as processes on a bus.
std::vector<FaultRow> processRows(const FaultBench& bench);

}  // namespace ves
