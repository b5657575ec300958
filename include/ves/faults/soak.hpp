// SPDX-License-Identifier: BSD-3-Clause
//
// A long run in lockstep under random faults, orders and recoveries, and the laws that no command
// may break meanwhile.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "ves/config/experiment.hpp"

namespace ves {

struct SoakResult {
  std::int64_t ticks = 0;       // [-]
  std::int64_t faults = 0;      // [-] injected
  std::int64_t stops = 0;       // [-]
  std::int64_t recoveries = 0;  // [-] resets that led back to armed
  std::uint64_t hash = 0;       // of every command
  std::string violated;         // a law that a command broke; empty
};

/// So many ticks of an experiment, the same for one seed; `progress` is told the ticks.
SoakResult soak(const Experiment& experiment, std::int64_t ticks, std::uint32_t seed,
                const std::function<void(std::int64_t)>& progress);

}  // namespace ves
