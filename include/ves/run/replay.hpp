// SPDX-License-Identifier: BSD-3-Clause
//
// Feeds the recorded samples and requests of a log through the controller again.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "ves/bus/event_log.hpp"
#include "ves/config/experiment.hpp"

namespace ves {

/// The first place where the replay and the log part.
struct Difference {
  std::int64_t tick = 0;    // [-]
  std::int64_t offset = 0;  // [B] of the recorded message in the file
  std::string field;        // "state_t.x[2]"
  std::string recorded, replayed;
};

struct ReplayResult {
  std::string name, hash, version;  // of the recorded experiment; empty: not in the log
  bool same_arithmetic = false;     // this build's; else the last bit may differ
  std::int64_t ticks = 0;           // [-] replayed
  std::int64_t messages = 0;        // [-] states and commands compared
  std::int64_t different = 0;       // [-] of them
  std::optional<Difference> first;
  Vec6 pose_difference = Vec6::Zero();  // [m, rad] largest, replayed minus recorded command
  Phase phase = Phase::kDisarmed;       // at the end, replayed
  Check cause = Check::kCount;
  std::int64_t cause_tick = -1;
  Stability stability = Stability::kUnknown;  // of the replayed configuration
};

struct ReplayOptions {
  double speed = 0.0;                // times real time; 0: as fast as it goes
  const Experiment* with = nullptr;  // another configuration for the same samples
};

/// Called for every replayed tick.
using ReplayWatch = std::function<void(const TickState&)>;

/// Throws InputError where the file is no log, has no configuration, or lacks what a tick used.
ReplayResult replay(const std::string& log, const ReplayOptions& options, const ReplayWatch& watch);

}  // namespace ves
