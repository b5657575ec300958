// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/tool_motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "ves/core/coordinates.hpp"

namespace ves {

std::optional<ToolMotion> toolMotion(const Series& series, const std::optional<Emulation>& e) {
  const Experiment& experiment = series.experiment;
  if (!e || !experiment.robot.tool()) return {};
  ToolMotion out;
  const BasePoses base = basePoses(series, e->base);
  const Geometry& geometry = experiment.plant.geometry;
  const Transform start = geometry.fromHome(Pose::from(e->base.x.front()));
  eachTick(series, [&](const Row& row, double) {
    const auto x = at(base, row.state);
    if (!row.hasTruePose() || !x) return;
    const Transform X_PT = toolInP(experiment, JointVector::Map(row.truth.q));
    out.tick.push_back(row.state.header.sequence);
    out.actual.push_back(geometry.fromHome(Pose::from(Vec6::Map(row.truth.x))) * X_PT);
    out.on_base.push_back(geometry.fromHome(Pose::from(*x)) * X_PT);
    out.at_rest.push_back(start * X_PT);
  });
  return out;
}

std::vector<Column> columnsOf(const ToolMotion& motion) {
  const auto at = std::make_shared<std::map<std::int64_t, Transform>>();  // by tick
  for (std::size_t k = 0; k < motion.tick.size(); ++k) (*at)[motion.tick[k]] = motion.on_base[k];
  std::vector<Column> out;
  for (int i = 0; i < 6; ++i)
    out.push_back({fmt::format("tool_{}_base_{}", coordinate(i).name, coordinate(i).unit),
                   [at, i](const Row& row) {
                     const auto found = at->find(row.state.header.sequence);
                     return found == at->end() ? NAN : coordinateOf(found->second, i);
                   },
                   "of the tool on the simulated base",
                   {}});
  return out;
}

ToolDistance distance(const std::vector<Transform>& a, const std::vector<Transform>& b) {
  ToolDistance d;
  const std::size_t n = std::min(a.size(), b.size());
  for (std::size_t i = 0; i < n; ++i) {
    const double off = (a[i].p - b[i].p).norm();
    d.rms += off * off / static_cast<double>(n);
    d.peak = std::max(d.peak, off);
  }
  d.rms = std::sqrt(d.rms);
  return d;
}

}  // namespace ves
