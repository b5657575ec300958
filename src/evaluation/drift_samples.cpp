// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/drift_samples.hpp"

namespace ves {

std::vector<DriftSample> driftSamples(const Series& series) {
  std::vector<DriftSample> out;
  double n = 0.0;
  const Row* last = nullptr;
  for (const Row& row : series.rows) {
    if (row.state.kind != static_cast<int>(SegmentKind::kMonitor) || !row.has_sample) continue;
    // Ticks are passed over between two samples.
    const bool begins =
        !last || row.state.header.sequence > last->state.header.sequence + kCalibrationSamples;
    if (begins) {
      out.emplace_back();
      n = 0.0;
    }
    last = &row;
    DriftSample& sample = out.back();
    n += 1.0;
    sample.t += (row.t - sample.t) / n;
    sample.temperature += (row.sample.temperature - sample.temperature) / n;
    sample.wrench += (Vec6::Map(row.state.dynamic) - sample.wrench) / n;
  }
  return out;
}

}  // namespace ves
