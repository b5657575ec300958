// SPDX-License-Identifier: BSD-3-Clause
//
// What the menu says of a state: pose, failing checks, the status.
#pragma once

#include <optional>
#include <string>

#include "ves/bus/messages.hpp"
#include "ves/config/experiment.hpp"

namespace ves {

/// x is 6 coordinates about home [m | rad]; shown in mm and deg.
std::string poseText(const double (&x)[6]);
/// Coordinate i alone, without its unit.
std::string coordinateText(int i, double x);
/// The names of the checks in a state's bits.
std::string failing(std::int32_t bits);

struct Status {
  const state_t& state;
  const std::optional<timing_t>& timing;
  const std::optional<CalibrationRecord>& calibration;
  double temperature;  // [C]
};
std::string statusText(const Status& status);

}  // namespace ves
