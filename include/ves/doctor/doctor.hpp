// SPDX-License-Identifier: BSD-3-Clause
//
// Whether this machine can keep the loop's time, and what to do about it where it cannot.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "ves/realtime/latency.hpp"
#include "ves/run/run.hpp"

namespace ves {

/// What cyclictest -h prints: a histogram in microseconds. What overflows it counts as its maximum.
/// None when there is no histogram in the text.
std::optional<Latency> cyclictestLatency(const std::string& text);

struct Finding {
  enum class State { kGood, kAdvice, kBad };
  State state = State::kGood;
  std::string what, found, remedy;
};

/// What can be read of a machine.
struct MachineFacts {
  std::string kernel;
  bool real_time_kernel = false;
  unsigned processors = 0;              // [-]
  std::string governor;                 // of their frequency; empty: unknown
  std::int64_t clock_resolution = 0;    // [ns]
  std::string clock_source;             // empty: unknown
  bool fifo = false, lockable = false;  // real-time priority, and memory that stays
  std::uint64_t priority_limit = 0;     // [-]
  std::uint64_t lock_limit = 0;         // [B]
  long socket_buffer = 0;               // [B] at most
};

/// Of this one. Changes nothing.
MachineFacts readMachineFacts();

/// What of it keeps the loop from its time.
std::vector<Finding> examine(const MachineFacts& machine);

/// How late a Ticker wakes, for `seconds` at `period` [ns], at the priority that is granted.
Latency wakeUp(double seconds, std::int64_t period);

/// The same by cyclictest; none when it is not installed or says nothing.
std::optional<Latency> cyclictest(double seconds, std::int64_t period, bool realtime);

/// From sending a sample_t to hearing a leg_command_t that another process answers with, over LCM
/// and without any work in between. Throws InputError where the bus does not work.
Latency echo(const std::string& url, int times);

/// From sending a sample_t to hearing our controller's leg_command_t for it: the echo, with the
/// work in between. In lockstep, so that no waiting for a tick is in it. Throws InputError where
/// the bus does not work.
Latency response(const Experiment& experiment, const std::string& url, int times);

}  // namespace ves
