// SPDX-License-Identifier: BSD-3-Clause
//
// The clock, the periodic loop, and the privileges of a real-time process.
#pragma once

#include <cstdint>
#include <string>

struct msghdr;

namespace ves {

/// CLOCK_MONOTONIC: no clock step reaches it.
std::int64_t monotonicNow() noexcept;  // [ns]

/// Since 1970, as logs are stamped.
std::int64_t wallNow() noexcept;  // [ns]

/// When a datagram came [ns, monotonic], by the kernel's stamp (SO_TIMESTAMPNS). `now` where it has
/// none, or none of the last `longest` before `now`: then somebody set the wall clock. `behind` is
/// wallNow() - monotonicNow().
std::int64_t arrivalOf(msghdr& message, std::int64_t now, std::int64_t behind,
                       std::int64_t longest) noexcept;

/// An absolute schedule. A missed deadline is counted and skipped, never made up; the phase stays.
class Ticker {
 public:
  explicit Ticker(std::int64_t period) noexcept : period_(period), next_(monotonicNow()) {}

  /// Sleeps until the next deadline; returns how many were missed before it.
  std::int64_t wait() noexcept;

  std::int64_t late() const noexcept { return late_; }      // [ns] of the last waking
  std::int64_t missed() const noexcept { return missed_; }  // [-] so far

 private:
  std::int64_t period_;  // [ns]
  std::int64_t next_;    // [ns]
  std::int64_t late_ = 0;
  std::int64_t missed_ = 0;
};

/// Real-time conduct of this process: SCHED_FIFO at `priority`, memory locked, stack touched. When
/// `required`, throws InputError with the reason. Returns what was refused, and why; empty:
/// nothing. Threads that are begun afterwards do not inherit it.
std::string claimRealtime(int priority, bool required);

}  // namespace ves
