// SPDX-License-Identifier: BSD-3-Clause
//
// One life of a controller and its machine: the experiment, and everything that happens meanwhile,
// as data. Drawn from a seed, written as YAML that a person can read, cut down and run again.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "ves/config/experiment.hpp"

namespace ves::swarm {

enum class Kind {
  kDo,          // an order of the menu, as typed
  kFault,       // a fault of the table, on the machine's samples
  kSamples,     // lost, late, twice on their way to the controller
  kCommands,    // the same of commands on their way to the machine
  kStall,       // the controller misses ticks
  kController,  // killed; another begins when it is over
  kMachine,     // its process ends, the legs stay; another begins when it is over
  kIntruder,    // commands of somebody else: `ghost` of an older epoch, `second` of a newer one
  kDisk,        // full
  kCount
};

struct Event {
  std::int64_t tick = 0;  // [-] of the controller's period since the beginning
  Kind kind = Kind::kCount;
  std::string what;        // kDo: the line; kFault: its name; lost, late, twice; ghost, second
  int which = 0;           // [-] channel or leg, from 0
  double amount = 0.0;     // of a fault
  std::int64_t ticks = 1;  // [-] for how long

  bool operator==(const Event&) const = default;
};

struct Life {
  std::uint64_t seed = 0;  // it was drawn from; 0: written by hand
  std::string scenario;
  std::vector<std::string> set;    // as for --set
  std::int64_t ticks = 0;          // [-] it lasts
  std::int64_t sample_period = 0;  // [ns] of the machine's loop
  std::int64_t machine_phase = 0;  // [ns] of its first step
  std::int64_t latency = 0;        // [ns] of a message
  std::int64_t clock_offset = 0;   // [ns] the machine's clock less the controller's
  bool logged = false;             // recorded, and replayed at the end
  std::vector<Event> events;       // by tick
};

/// Life number `seed`.
Life draw(std::uint64_t seed, const std::filesystem::path& config);
/// The experiment of a life; its admittance control begins whatever the stability check would say:
/// a loop that diverges is to be stopped too. Throws InputError.
Experiment experimentOf(const Life& life, const std::filesystem::path& config);

std::string write(const Life& life, const std::string& comment);
/// Throws InputError.
Life read(const std::filesystem::path& file);

}  // namespace ves::swarm
