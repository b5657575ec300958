// SPDX-License-Identifier: BSD-3-Clause
//
// An order that is said again until a state of its controller answers it, as both clients of ours
// (the console, the page) ask for something.
#pragma once

#include <optional>

#include "ves/bus/bus.hpp"

namespace ves {

class Asking {
 public:
  /// `order.controller` is who is asked, `from` who asks.
  Asking(const Order& order, const Identity& from, std::int64_t sequence) noexcept
      : order_(order), from_(from), sequence_(sequence) {}

  /// For every turn of the client's loop: says it when it is time to, `now` [ns] monotonic.
  void say(Bus& bus, std::int64_t now) noexcept;
  /// For every state of the controller that is asked: an answer may show in one of them only.
  void hear(const state_t& state) noexcept;

  /// Why it was refused, or that it was not; late is better than never. Nothing: not answered yet,
  /// or, where it is no longer underWay(), not in all its time. That its path is being checked is
  /// no answer.
  const std::optional<Refusal>& answer() const noexcept { return answer_; }
  bool underWay() const noexcept { return !answer_ && !given_up_; }

 private:
  Order order_;
  Identity from_;
  std::int64_t sequence_;
  std::int64_t said_ = 0;  // [ns] the last time
  int times_ = 0;          // [-] so far
  bool given_up_ = false;
  std::optional<Refusal> answer_;
};

}  // namespace ves
