// SPDX-License-Identifier: BSD-3-Clause
//
// The clock of another host, from messages that go to and fro.
#pragma once

#include <cstdint>

namespace ves {

/// A message and its answer bound the other clock's offset: ours t1 when it left, theirs t2 when it
/// came and t3 when the answer left, ours t4 when that came. The offset is ((t2 - t1) + (t3 -
/// t4))/2, off by at most half of the round trip, (t4 - t1) - (t3 - t2) (RFC 5905, section 8). The
/// shortest round trip is kept; what it says grows less certain as two clocks drift apart.
class ClockOffset {
 public:
  static constexpr double kDrift = 1e-4;  // [-] of two quartz clocks against each other, at most

  /// All in [ns]. An answer that came before its question, or an order of times that cannot be,
  /// counts for nothing.
  void take(std::int64_t t1, std::int64_t t2, std::int64_t t3, std::int64_t t4) noexcept;

  bool known() const noexcept { return known_; }
  /// [ns] at `now`, ours; -1 while nothing is known.
  std::int64_t uncertainty(std::int64_t now) const noexcept;
  /// [ns] theirs minus ours; 0 while both could be one clock, as on one host they are.
  std::int64_t offset(std::int64_t now) const noexcept;

 private:
  bool known_ = false;
  std::int64_t offset_ = 0;  // [ns]
  std::int64_t half_ = 0;    // [ns] of the round trip
  std::int64_t taken_ = 0;   // [ns] when
};

}  // namespace ves
