// SPDX-License-Identifier: BSD-3-Clause
//
// The robot's tool in inertial axes: where it was, and where it would have been on the base in free
// space.
#pragma once

#include "ves/evaluation/comparison.hpp"

namespace ves {

/// In the first admittance segment, a point a tick. The joints are where they truly were.
struct ToolMotion {
  std::vector<std::int64_t> tick;  // [-]
  std::vector<Transform> actual;   // X_IT on the platform,
  std::vector<Transform> on_base;  // on the base in free space,
  std::vector<Transform> at_rest;  // and on a base that stays where the segment begins
};

/// "tool_x_base_m" and the others: the tool on the base in free space.
std::vector<Column> columnsOf(const ToolMotion& motion);

/// None without a tool, or without an emulation.
std::optional<ToolMotion> toolMotion(const Series& series, const std::optional<Emulation>& e);

/// [m] between two motions of the tool.
struct ToolDistance {
  double rms = 0.0, peak = 0.0;
};
ToolDistance distance(const std::vector<Transform>& a, const std::vector<Transform>& b);

}  // namespace ves
