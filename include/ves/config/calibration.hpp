// SPDX-License-Identifier: BSD-3-Clause
//
// The file that a calibration leaves, for the runs after it.
#pragma once

#include <cstdint>
#include <string>

#include "ves/config/document.hpp"
#include "ves/math/frames.hpp"

namespace ves {

/// 4.1.2 asks for a new one every 3 to 4 hours.
inline constexpr double kCalibrationKeeps = 3.0;  // [h]

struct CalibrationRecord {
  std::int64_t date = 0;               // [s] since 1970, UTC
  std::string setup;                   // hash of what it was taken with: sensor, robot, gravity
  double temperature = 0.0;            // [C]
  Vec6 bias = Vec6::Zero();            // [count]
  Vec6 deviation = Vec6::Zero();       // [count] of a sample
  Vec6 standard_error = Vec6::Zero();  // [count] of the bias
};

/// YAML, as readCalibration() takes it.
std::string write(const CalibrationRecord& record);

/// Throws InputError.
CalibrationRecord readCalibration(Section section);

/// "2026-11-21T07:40:12Z"
std::string dateText(std::int64_t seconds);

/// The section's `date`, written so. [s] since 1970, UTC. Throws InputError.
std::int64_t readDate(Section& section);

/// [h] from the record to now, by this machine's clock.
double age(const CalibrationRecord& record);

}  // namespace ves
