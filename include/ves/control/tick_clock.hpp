// SPDX-License-Identifier: BSD-3-Clause
//
// The two inputs of a tick that need a memory of the last one: its number, and the sample.
#pragma once

#include <cstdint>

#include "ves/contract/sample.hpp"

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

/// When a tick's wrench was read.
struct WrenchTiming {
  double since = 0.0;     // [s] after the one before; 0: there is no new one
  double age = 0.0;       // [s] before the tick
  std::int64_t time = 0;  // [ns] of the machine's clock
};

/// The newest sample and its age.
class SampleStream {
 public:
  explicit SampleStream(std::int64_t period) : period_(period) {}  // [ns]

  /// While the legs follow, a sample with a lower sequence than the last is ignored; before that, a
  /// machine may start over. A sample with an unchanged time is not new. `now` [ns] of the
  /// machine's clock.
  void update(const Sample& newest, std::int64_t now, bool engaged, bool conflict) noexcept {
    const Sample before = sample_;
    if (!(engaged && newest.sequence < before.sequence)) sample_ = newest;
    age_before_ = age_;
    const bool first = before.sequence < 0;
    // A clock that went back is stale until it is later than it has ever been.
    if (!engaged && (newest.sequence < before.sequence || newest.time < before.time))
      latest_ = INT64_MIN;
    const bool newer = sample_.sequence > before.sequence && sample_.time > latest_;
    if (newer) latest_ = sample_.time;
    age_ = newer ? 0 : age_ + 1;
    fresh_ticks_ = fresh() && !conflict ? fresh_ticks_ + 1 : 0;
    const auto seconds = [this](std::int64_t time) {
      constexpr std::int64_t kMostPeriods = 5;  // [-] more says nothing of now
      return static_cast<double>(std::clamp<std::int64_t>(time, 0, kMostPeriods * period_)) *
             kSecondPerNanosecond;
    };
    wrench_ = {!newer ? 0.0 : seconds(first ? period_ : sample_.wrench_time - before.wrench_time),
               seconds(now - sample_.wrench_time), sample_.wrench_time};
  }
  /// The count of fresh ticks begins anew.
  void restart() noexcept { fresh_ticks_ = 0; }

  const Sample& sample() const noexcept { return sample_; }
  bool fresh() const noexcept { return age_ == 0; }
  int age() const noexcept { return age_; }                 // [-] ticks since the sample was new
  int ageBefore() const noexcept { return age_before_; }    // [-] the same in the tick before
  int freshTicks() const noexcept { return fresh_ticks_; }  // [-] in a row, without a conflict
  const WrenchTiming& wrench() const noexcept { return wrench_; }

 private:
  std::int64_t period_;  // [ns]
  Sample sample_;
  std::int64_t latest_ = INT64_MIN;  // [ns] time of the newest so far
  WrenchTiming wrench_;
  int age_ = 0, age_before_ = 0;
  int fresh_ticks_ = 0;
};

}  // namespace ves
