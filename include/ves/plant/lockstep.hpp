// SPDX-License-Identifier: BSD-3-Clause
//
// Controller and plant in lockstep in one process: no bus, no files, no clock.
#pragma once

#include <functional>

#include "ves/control/test_platform.hpp"
#include "ves/plant/plant.hpp"

namespace ves {

class Lockstep {
 public:
  Lockstep(const ControllerConfig& controller, const plant::PlantConfig& plant)
      : platform_(controller), plant_(plant), period_(controller.period) {}

  /// The controller's tick on the plant's newest sample. One that is not plausible was not there.
  const TickState& tick() noexcept;
  /// The command reaches the legs, and the plant moves on to the controller's next tick; `missed`
  /// ticks do not run.
  void advance(std::int64_t missed = 0) noexcept;

  /// Both, with an order for the tick.
  const TickState& step(const Order& order = {}) noexcept {
    input.order = order;
    tick();
    advance();
    return *state_;
  }

  const TickState& state() const noexcept { return *state_; }  // of the last tick
  const Sample& sample() const noexcept { return sample_; }    // of the machine, in the last tick
  plant::Plant& plant() noexcept { return plant_; }
  std::int64_t period() const noexcept { return period_; }  // [ns]

  TickInput input;                       // of the next tick; its sample is the machine's
  std::function<void(Sample&)> disturb;  // changes what the machine says
  bool gate = true;                      // off: implausible samples reach the controller too
  bool disconnected = false;             // commands do not reach the legs

 private:
  TestPlatform platform_;
  plant::Plant plant_;
  std::int64_t period_;
  Sample sample_;
  const TickState* state_ = nullptr;
};

}  // namespace ves
