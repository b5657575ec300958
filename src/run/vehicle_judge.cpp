// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/vehicle_judge.hpp"

#include <utility>

#include "ves/analysis/gate.hpp"

namespace ves {

Order judged(Order order, const Experiment& experiment, const TickState& state) {
  if (order.request != Request::kVehicle) return order;
  order.verdict = assessChange(experiment.controller, experiment.plant.task, state.vehicle,
                               order.vehicle.appliedTo(state.vehicle_ordered));
  return order;
}

VehicleJudge::VehicleJudge(const Experiment& experiment)
    : experiment_(experiment), thread_([this](const std::stop_token& stop) { work(stop); }) {}

Order VehicleJudge::pass(const Order& order, const TickState& state) {
  const std::scoped_lock lock(mutex_);
  if (order.request == Request::kStop || order.request == Request::kHold)
    overtaken_ = overtaken_ || busy_;
  if (order.request == Request::kNone) {
    if (!answer_) return {};
    Order answer = *std::exchange(answer_, {});
    if (overtaken_) answer.request = Request::kOvertaken;
    busy_ = overtaken_ = false;
    return answer;
  }
  if (order.request != Request::kVehicle) return order;
  if (busy_) return order;
  busy_ = true;
  order_ = order;
  state_ = state;
  asked_.notify_one();
  return {};
}

void VehicleJudge::work(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (asked_.wait(lock, stop, [this] { return order_.has_value(); })) {
    const Order order = *std::exchange(order_, {});
    const TickState state = state_;
    lock.unlock();
    const Order answer = judged(order, experiment_, state);
    lock.lock();
    answer_ = answer;
  }
}

}  // namespace ves
