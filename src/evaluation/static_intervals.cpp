// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/static_intervals.hpp"

#include <cmath>
#include <cstdlib>
#include <utility>

namespace ves {
namespace {

constexpr double kSettle = 0.6;  // [s] servo and sensor's filter, after a motion
constexpr double kEdge = 0.2;    // [s] before a motion is seen
constexpr double kLeast = 0.3;   // [s] of readings that make a rest

/// Adds up what is at rest.
class Gatherer {
 public:
  explicit Gatherer(const StillnessLimits& limits) : limits_(limits) {}

  void add(const Row& row) {
    const bool still = row.has_sample && !rows_.empty() && stillAs(*rows_.front(), row);
    if (!still) finish();
    if (row.has_sample) rows_.push_back(&row);
  }
  std::vector<StaticInterval> end() {
    finish();
    return std::move(out_);
  }

 private:
  bool stillAs(const Row& first, const Row& row) const {
    for (int i = 0; i < kLegs; ++i)
      if (std::abs(row.sample.legs[i] - first.sample.legs[i]) > limits_.leg_counts) return false;
    for (int i = 0; i < kMaxJoints; ++i)
      if (!(std::abs(row.sample.q[i] - first.sample.q[i]) <= limits_.joint)) return false;
    return Vec6::Map(row.state.x_dot).isZero(0.0) && Vec6::Map(first.state.x_dot).isZero(0.0);
  }

  void finish() {
    std::vector<const Row*> rows = std::move(rows_);
    rows_.clear();
    if (rows.empty()) return;
    const double from = rows.front()->t + kSettle, to = rows.back()->t - kEdge;
    if (!(to - from >= kLeast)) return;
    StaticInterval rest;
    double n = 0.0;
    Vec6 counts = Vec6::Zero();
    for (const Row* row : rows) {
      if (row->t < from || row->t > to) continue;
      for (int c = 0; c < kWrenchChannels; ++c) counts(c) += row->sample.adc[c];
      rest.rpy += Vec3::Map(row->state.x_measured + 3);
      rest.q += JointVector::Map(row->sample.q);
      rest.t += row->t;
      n += 1.0;
    }
    rest.counts = counts / n;
    rest.rpy /= n;
    rest.q /= n;
    rest.t /= n;
    rest.duration = to - from;
    out_.push_back(rest);
  }

  StillnessLimits limits_;
  std::vector<const Row*> rows_;
  std::vector<StaticInterval> out_;
};

}  // namespace

std::vector<StaticInterval> staticIntervals(const Series& series) {
  Gatherer gatherer(series.experiment.controller.stillness);
  for (const Row& row : series.rows) gatherer.add(row);
  return gatherer.end();
}

}  // namespace ves
