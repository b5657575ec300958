// SPDX-License-Identifier: BSD-3-Clause
//
// The servos from a run that moves every leg both ways: what compensation believes of them.
#pragma once

#include <vector>

#include "ves/control/modelled_servos.hpp"

namespace ves {

/// What the legs were told and what they did, a tick each, without gaps.
struct LegRecord {
  std::vector<Vec6> reference;     // [m] sent in this tick
  std::vector<std::int64_t> sent;  // [ns] of the machine's clock when it came there
  std::vector<Vec6> length;        // [m] used in this tick
  std::vector<std::int64_t> read;  // [ns] when it was read
};

struct ServoEstimate {
  ServoModel servo;              // gains, tau, delay, opening and friction found; the rest as given
  ServoModel deviation;          // standard, of the same
  Vec6 residual = Vec6::Zero();  // [m] rms, of lengths that the model foretells

  /// Valves just close at null, and nothing rubs.
  bool plain() const { return servo.opening.isZero(0.0) && servo.friction.isZero(0.0); }
};

/// Least squares on the lengths that the servo model of `nominal`, let run by itself, foretells:
/// Gauss-Newton, each leg for itself, over the phases that the LegSlaves may have had, whose spread
/// is in the deviations. Valves that just close at null and seals that do not rub are tried first;
/// open or overlapping ones and friction are believed where they fit better by a tenth, and by
/// three deviations. Throws std::domain_error where a leg moves too little to tell.
ServoEstimate identifyServo(const ServoModel& nominal, double period, const LegRecord& record);

}  // namespace ves
