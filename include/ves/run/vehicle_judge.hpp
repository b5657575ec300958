// SPDX-License-Identifier: BSD-3-Clause
//
// Asks the stability check about orders that change the vehicle, before the controller gets them.
// That takes from milliseconds to seconds: in real time a thread of its own does it.
#pragma once

#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "ves/config/experiment.hpp"

namespace ves {

/// The order with the verdict; any other as it is. `state` is the last.
Order judged(Order order, const Experiment& experiment, const TickState& state);

class VehicleJudge {
 public:
  /// Begins the thread, which is to be before the caller's own becomes urgent.
  explicit VehicleJudge(const Experiment& experiment);

  /// What is to be obeyed now: the order, when it needs no verdict; else none, and in a later call
  /// without an order the judged one. While one is judged a second one passes unjudged, and will be
  /// refused; a hold or a stop overtakes it.
  Order pass(const Order& order, const TickState& state);

 private:
  void work(const std::stop_token& stop);

  const Experiment& experiment_;
  std::mutex mutex_;
  std::condition_variable_any asked_;
  bool busy_ = false;       // until the answer is taken
  bool overtaken_ = false;  // by a hold or a stop
  std::optional<Order> order_, answer_;
  TickState state_;
  std::jthread thread_;  // last: it uses the others
};

}  // namespace ves
