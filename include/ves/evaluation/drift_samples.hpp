// SPDX-License-Identifier: BSD-3-Clause
//
// The sensor's drift over a run, sample by sample (4.1.2).
#pragma once

#include <vector>

#include "ves/series/series.hpp"

namespace ves {

/// One look of a watch at the sensor: means over its samples.
struct DriftSample {
  double t = 0.0;              // [s] since the first tick
  double temperature = 0.0;    // [C]
  Vec6 wrench = Vec6::Zero();  // [N, N m] without gravity
};

std::vector<DriftSample> driftSamples(const Series& series);

}  // namespace ves
