// SPDX-License-Identifier: BSD-3-Clause
//
// What a driver of legs, sensor or robot has to know of the controller's configuration
// (docs/machine.md). Each field is described in contract/schema.hpp.
#pragma once

#include "ves/contract/leg_communication.hpp"
#include "ves/contract/leg_watchdog.hpp"

namespace ves {

struct MachineSetup {
  std::int64_t period = 0;
  bool lockstep = false;
  std::int32_t arming_samples = 0;
  std::int32_t stale_ticks = 0;
  LegCodec legs;
  LegCounts leg_min{}, leg_max{}, leg_home{};
  double leg_velocity = 0.0;
  Mat6 wrench_per_count = Mat6::Zero();
  std::int64_t wrench_window = 0;
  std::int32_t pressure_min = 0, pressure_max = 0;
  std::int32_t joints = 0;
  JointVector joint_min = JointVector::Zero(), joint_max = JointVector::Zero();
  Watchdog watchdog;
};

}  // namespace ves
