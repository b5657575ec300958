// SPDX-License-Identifier: BSD-3-Clause
//
// A controller, a machine, an operator and a bus between them, in one process that owns the clock,
// the bus and the disk: a life goes as fast as it is computed, and the same every time.
#pragma once

#include "laws.hpp"
#include "life.hpp"

namespace ves::swarm {

struct Outcome {
  std::optional<Finding> finding;
  double seconds = 0.0;          // [s] simulated
  std::int64_t ticks = 0;        // [-] of controllers
  std::int64_t stops = 0;        // [-]
  std::int64_t emulated = 0;     // [-] ticks of admittance control
  std::int64_t compensated = 0;  // [-] of those, with compensation in
  std::uint64_t hash = 0;        // of every command and phase
};

struct Conditions {
  std::filesystem::path config;   // folder of scenarios
  std::filesystem::path scratch;  // for logs
  std::string only;               // the law that is looked at; empty: all
};

/// From the beginning until it ends or breaks a law.
Outcome live(const Life& life, const Experiment& experiment, const Conditions& conditions);

}  // namespace ves::swarm
