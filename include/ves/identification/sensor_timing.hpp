// SPDX-License-Identifier: BSD-3-Clause
//
// The force-torque sensor from a run that shakes the platform under a robot that stands still: how
// much later its wrench is than the servo model says, and how much of the robot's inertia it shows.
#pragma once

#include <vector>

#include "ves/control/controller_config.hpp"

namespace ves {

/// Ticks without a gap.
struct ShakeRecord {
  std::vector<std::int64_t> tick;  // [-]
  std::vector<std::int64_t> time;  // [ns] of the machine's clock, when it began
  std::vector<Vec6> reference;     // [m] sent then
  std::vector<Sample> sample;      // used then
  std::vector<Vec6> bias;          // [count] of the sensor
};

struct SensorEstimate {
  double delay = 0.0, delay_deviation = 0.0;  // [s] ServoModel::sensor_delay, which may be negative
  double scale = 1.0, scale_deviation = 0.0;  // [-] ServoModel::sensor_scale
};

/// Weighted least squares of the measured wrench, gravity compensated, on that of the robot's
/// inertia under the accelerations that the servo model foretells, and on its rate: W = -scale (F -
/// delay F'). Deviations by leaving out a tenth of the record at a time. Throws std::domain_error
/// where the platform moves too little, or the robot moves.
SensorEstimate identifySensor(const ControllerConfig& controller, const ShakeRecord& record);

}  // namespace ves
