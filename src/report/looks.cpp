// SPDX-License-Identifier: BSD-3-Clause
#include "ves/report/looks.hpp"

namespace ves {

std::vector<Look> looks(const Series& series) {
  std::vector<Look> out;
  double n = 0.0;
  const Row* last = nullptr;
  for (const Row& row : series.rows) {
    if (row.state.kind != static_cast<int>(SegmentKind::kWatch) || !row.has_sample) continue;
    // Ticks are passed over between two looks.
    const bool begins =
        !last || row.state.header.sequence > last->state.header.sequence + kCalibrationSamples;
    if (begins) {
      out.emplace_back();
      n = 0.0;
    }
    last = &row;
    Look& look = out.back();
    n += 1.0;
    look.t += (row.t - look.t) / n;
    look.temperature += (row.sample.temperature - look.temperature) / n;
    look.wrench += (Vec6::Map(row.state.dynamic) - look.wrench) / n;
  }
  return out;
}

}  // namespace ves
