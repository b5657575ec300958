// SPDX-License-Identifier: BSD-3-Clause
//
// What is said of orders: each is answered once, one in a tick, so that whoever asked can see it.
#pragma once

#include <array>

#include "ves/control/program.hpp"
#include "ves/control/safety_checks.hpp"

namespace ves {

struct Answer {
  OrderId order;
  Refusal refusal = Refusal::kNone;  // kChecking: no answer yet
  Check refused_by = Check::kCount;  // of a path that was refused
};

class Answers {
 public:
  /// Shown in this tick, or after those that wait.
  void give(const Answer& answer) noexcept {
    if (answer.refusal == Refusal::kChecking && waiting_ > 0) return;  // it is no answer
    if (waiting_ == kMost) return;  // an order answers at most two
    answers_[(first_ + waiting_++) % kMost] = answer;
  }
  /// The end of a tick: the next is shown, or the last one still is.
  void advance() noexcept {
    if (waiting_ == 0) return;
    shown_ = answers_[first_];
    first_ = (first_ + 1) % kMost;
    --waiting_;
  }
  const Answer& shown() const noexcept { return shown_; }

 private:
  static constexpr std::size_t kMost = 8;  // [-]
  std::array<Answer, kMost> answers_{};    // a ring
  std::size_t first_ = 0, waiting_ = 0;
  Answer shown_;
};

}  // namespace ves
