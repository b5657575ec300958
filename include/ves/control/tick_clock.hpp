// SPDX-License-Identifier: BSD-3-Clause
//
// The two inputs of a tick that need a memory of the last one: its number, and the sample.
#pragma once

#include <cstdint>

#include "ves/control/sample.hpp"

namespace ves {

/// Ticks that have passed.
struct Elapsed {
  std::int64_t tick = 0;     // [-] this one
  std::int64_t count = -1;   // [-] ticks run before this one
  std::int64_t between = 0;  // [-] passed over since the last one that ran
  std::int64_t missed = 0;   // [-] of those, the ones that should have run
  std::int64_t late = 0;     // [-] times that any were missed, so far
};

/// Counts ticks. Those announced as idle may be passed over; all others that are, were missed.
class TickClock {
 public:
  const Elapsed& update(std::int64_t tick) noexcept {
    now_.between = now_.count < 0 ? 0 : tick - now_.tick - 1;
    // Lockstep passes over all idle ticks, real time over none.
    now_.missed = now_.between >= idle_ ? now_.between - idle_ : now_.between;
    if (now_.missed > 0) ++now_.late;
    now_.tick = tick;
    ++now_.count;
    return now_;
  }
  /// Of the ticks to come so many are idle.
  void announceIdle(std::int64_t ticks) noexcept { idle_ = ticks; }

  const Elapsed& elapsed() const noexcept { return now_; }

 private:
  Elapsed now_;
  std::int64_t idle_ = 0;  // [-]
};

/// The newest sample and its age.
class SampleStream {
 public:
  /// An older sample than the last is none, while the legs are ours; before that, a machine may
  /// begin anew. One whose clock stands still is not new either.
  void update(const Sample& newest, bool engaged, bool conflict) noexcept {
    const std::int64_t last = sample_.sequence, last_time = sample_.time;
    if (!(engaged && newest.sequence < last)) sample_ = newest;
    age_before_ = age_;
    const bool newer = sample_.sequence > last && (sample_.time > last_time || last < 0);
    age_ = newer ? 0 : age_ + 1;
    fresh_ticks_ = fresh() && !conflict ? fresh_ticks_ + 1 : 0;
  }
  /// The count of fresh ticks begins anew.
  void restart() noexcept { fresh_ticks_ = 0; }

  const Sample& sample() const noexcept { return sample_; }
  bool fresh() const noexcept { return age_ == 0; }
  int age() const noexcept { return age_; }                 // [-] ticks since the sample was new
  int ageBefore() const noexcept { return age_before_; }    // [-] the same in the tick before
  int freshTicks() const noexcept { return fresh_ticks_; }  // [-] in a row, without a conflict

 private:
  Sample sample_;
  int age_ = 0, age_before_ = 0;
  int fresh_ticks_ = 0;
};

}  // namespace ves
