// SPDX-License-Identifier: BSD-3-Clause
//
// What is heard of legs and controllers on a bus, by a process that only listens.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>

#include "ves/bus/bus.hpp"
#include "ves/control/safety_limits.hpp"

namespace ves {

struct BusObserver {
  Bus bus{kDefaultUrl};
  std::int64_t engaged = 0, states = 0, truths = 0;  // [-] messages
  std::int64_t controller = 0;                       // source of the last state
  state_t state{};                                   // the last one
  Vec6 legs = Vec6::Zero();                          // [m] the last
  double low = HUGE_VAL, high = 0.0;                 // [m] of all legs so far

  BusObserver();

  Phase phase() const { return static_cast<Phase>(state.phase); }
  Check cause() const { return static_cast<Check>(state.cause); }

  /// Listens until `what` holds, for at most `seconds`; whether it does.
  bool until(const std::function<bool()>& what, double seconds = 15.0);
  /// The legs come to rest: 100 messages of the plant in a row.
  bool rests();
  /// [m] by which a leg has been outside its limits; 0 or less: never.
  double outside(const SafetyLimits& limits) const {
    return std::max(limits.leg_min - low, high - limits.leg_max);
  }
};

}  // namespace ves
