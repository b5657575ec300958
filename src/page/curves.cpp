// SPDX-License-Identifier: BSD-3-Clause
#include "ves/page/curves.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "ves/core/coordinates.hpp"
#include "ves/page/page.hpp"

namespace ves {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kUnknown = 65535, kMostCount = 65534;  // [-]

}  // namespace

bool calibrates(const Program& program) noexcept {
  return std::any_of(program.segments.begin(), program.segments.begin() + program.size,
                     [](const Segment& s) { return s.kind == SegmentKind::kCalibration; });
}

bool calibrated(const state_t& state) noexcept {
  return state.kind != static_cast<int>(SegmentKind::kCalibration) &&
         (state.calibration == static_cast<int>(CalibrationStatus::kDone) ||
          !Vec6::Map(state.bias).isZero(0.0));
}

Curves::Curves(const Experiment& experiment) : columns_(columns(experiment)) {
  if (!calibrates(experiment.controller.program)) return;
  for (Column& column : columns_)
    if (column.name.find("_dynamic_") != std::string::npos)
      column.value = [value = column.value](const Row& r) {
        return calibrated(r.state) ? value(r) : NAN;
      };
}

nlohmann::ordered_json Curves::description() const {
  Json out = Json::array();
  for (const Column& column : columns_)
    out.push_back({{"name", column.name}, {"meaning", column.meaning}});
  for (int i = 0; i < 6; ++i)
    out.push_back({{"name", fmt::format("{}_base_{}", coordinate(i).name, coordinate(i).unit)},
                   {"meaning", "of the base in free space, let go where the platform was"}});
  return out;
}

std::vector<float> Curves::of(const Row& row, const std::optional<Vec6>& base) const {
  std::vector<float> out;
  out.reserve(size());
  for (const Column& column : columns_) out.push_back(static_cast<float>(column.value(row)));
  for (int i = 0; i < 6; ++i) out.push_back(base ? static_cast<float>((*base)(i)) : NAN);
  return out;
}

nlohmann::ordered_json recordedCurves(const Series& series, const BasePoses& base) {
  const Curves curves(series.experiment);
  std::vector<float> t;
  std::vector<std::vector<float>> rows;
  for (const Row& row : series.rows) {
    const auto at = base.find(row.state.header.sequence);
    t.push_back(static_cast<float>(row.t));
    rows.push_back(curves.of(row, at == base.end() ? std::nullopt : std::optional(at->second)));
  }
  Json out = {{"t", base64(t)}, {"curves", curves.description()}};
  for (std::size_t k = 0; k < curves.size(); ++k) {
    float least = std::numeric_limits<float>::infinity(), most = -least;
    bool gaps = false;
    for (const std::vector<float>& row : rows) {
      gaps = gaps || !std::isfinite(row[k]);
      if (!std::isfinite(row[k])) continue;
      least = std::min(least, row[k]);
      most = std::max(most, row[k]);
    }
    Json& curve = out["curves"][k];
    if (!(most >= least)) {
      curve["value"] = nullptr;  // never known
    } else if (least == most && !gaps) {
      curve["value"] = least;
    } else {
      const double step = std::max((double{most} - least) / kMostCount, 1e-300);
      std::vector<std::uint16_t> counts;
      for (const std::vector<float>& row : rows)
        counts.push_back(std::isfinite(row[k]) ? static_cast<std::uint16_t>(
                                                     std::lround((double{row[k]} - least) / step))
                                               : kUnknown);
      curve["least"] = least;
      curve["step"] = step;
      curve["counts"] = base64OfCounts(counts);
    }
  }
  return out;
}

}  // namespace ves
