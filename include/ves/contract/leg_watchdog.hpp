// SPDX-License-Identifier: BSD-3-Clause
//
// What the LegSlaves follow, commanded or not: docs/machine.md, States. The plant's, and any
// driver's of real legs.
//
//   follows a command's counts -- silent for hold_after --> rests at its checked lengths
//         ^   |                                              |            ^
//         |   | not engaged: at the checked lengths          |            | not engaged,
//         |   '----------------------------------------------|            | or a loop opened:
//         |                                                  |            | where they are
//         '------------------ engaged -----------------------|            |
//                                       silent for park_after, and may    |
//                                                            '--> goes home, slowly
#pragma once

#include "ves/contract/sample.hpp"

namespace ves {

/// Of the LegSlaves when nobody commands them. Each goes by itself: every board knows its own
/// length at home, and all take the same time.
struct Watchdog {
  std::int64_t hold_after = 30'000'000;      // [ns] of silence
  std::int64_t park_after = 10'000'000'000;  // [ns] of silence
  std::int64_t park_time = 20'000'000'000;   // [ns]
};

class LegWatchdog {
 public:
  /// At rest at `at`; `home` [count] is the length of every leg at home.
  LegWatchdog(const Watchdog& times, const LegCounts& at, const LegCounts& home) noexcept
      : times_(times), home_(home), reference_(at), rest_(at) {}

  /// Heard at `now` [ns].
  void take(const LegCommand& command, std::int64_t now) noexcept;
  /// A safety loop has been opened: nobody goes home by itself until the next command.
  void loopOpened() noexcept { may_park_ = false; }
  /// So much time [ns] is passed over, in which commands would have come as before.
  void skip(std::int64_t time) noexcept {
    if (heard_ >= 0) heard_ += time;
  }

  /// What the legs are to follow at `now` [ns].
  const LegCounts& reference(std::int64_t now) noexcept;
  bool parking() const noexcept { return parking_; }

 private:
  Watchdog times_;
  LegCounts home_, reference_;
  LegCounts rest_;           // [count] where they stay; while parking, where that began
  std::int64_t heard_ = -1;  // [ns] the last command since the first that engaged; -1: none
  bool may_park_ = false, parking_ = false;
};

}  // namespace ves
