// SPDX-License-Identifier: BSD-3-Clause
//
// The file that a servo identification leaves: what the controller believes of the six servos,
// instead of the numbers of the legs' data sheet.
#pragma once

#include <string>

#include "ves/config/document.hpp"
#include "ves/control/controller_config.hpp"

namespace ves {

struct ServoRecord {
  std::int64_t date = 0;  // [s] since 1970, UTC
  // Extend, retract, tau, delay, opening, friction; of the sensor, delay and scale.
  ServoModel servo;
  ServoModel deviation;  // standard, of the same
};

/// YAML, as readServo() takes it.
std::string write(const ServoRecord& record);

/// Throws InputError.
ServoRecord readServo(Section section);

/// `nominal` with what the record has found.
ServoModel withRecord(ServoModel nominal, const ServoRecord& record);
/// What the belief may be wrong by: three of the record's deviations; with adaptation at least.
Compensation withRecord(Compensation nominal, const ServoRecord& record);

}  // namespace ves
