// SPDX-License-Identifier: BSD-3-Clause
//
// The stretches of a run in which everything stands still.
#pragma once

#include "ves/identification/mass_parameters.hpp"
#include "ves/series/series.hpp"

namespace ves {

/// Every stretch of a run in which platform and robot stand still for a second or more, its
/// beginning left out: the sensor's filter settles.
std::vector<StaticInterval> staticIntervals(const Series& series);

}  // namespace ves
