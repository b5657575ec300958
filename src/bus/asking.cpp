// SPDX-License-Identifier: BSD-3-Clause
#include "ves/bus/asking.hpp"

#include "ves/bus/channels.hpp"

namespace ves {

void Asking::say(Bus& bus, std::int64_t now) noexcept {
  constexpr std::int64_t kRepeat = 200'000'000;  // [ns]
  constexpr int kTimes = 10;                     // [-]
  constexpr int kTimesOfVehicle = 1500;          // [-] the stability check may take minutes
  if (!underWay() || (times_ > 0 && now - said_ < kRepeat)) return;
  if (times_ == (order_.request == Request::kVehicle ? kTimesOfVehicle : kTimes)) {
    given_up_ = true;
    return;
  }
  said_ = now;
  ++times_;
  bus.publish(channel::kOperator, toMessage(order_, header(from_, sequence_, now)));
}

void Asking::hear(const state_t& state) noexcept {
  const auto refusal = static_cast<Refusal>(state.refusal);
  if (!answer_ && state.header.source == order_.controller && state.order_source == from_.source &&
      state.order_sequence == sequence_ && refusal != Refusal::kChecking)
    answer_ = refusal;
}

}  // namespace ves
