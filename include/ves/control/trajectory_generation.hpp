// SPDX-License-Identifier: BSD-3-Clause
//
// Trajectory generation (Appendix C): a ramp or a sine in each of the six coordinates.
#pragma once

#include <array>
#include <cstdint>

#include "ves/math/frames.hpp"
#include "ves/math/quintic.hpp"

namespace ves {

enum class AxisMotion { kHold, kRamp, kSine };

/// What one coordinate does.
struct Axis {
  AxisMotion motion = AxisMotion::kHold;
  double final = 0.0;      // [m | rad] of a ramp, counted from home
  double amplitude = 0.0;  // [m | rad] of a sine
  double frequency = 0.0;  // [Hz] of a sine
};

using Trajectory = std::array<Axis, 6>;

/// Coordinates n periods after the start at `initial`; a ramp reaches its end at n = steps, (C.8),
/// (C.9), and stays; a sine is (C.10). Ramps are evaluated, not accumulated, so they end exactly.
PathPoint<6> trajectoryGeneration(const Trajectory& trajectory, const Vec6& initial, std::int64_t n,
                                  std::int64_t steps, double period) noexcept;

/// A pose a period: {x, y, z, alpha, beta, gamma} in its columns, from home. [m, rad]
using RecordedPath = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// Column n, rates and accelerations by central differences; before the first and after the last it
/// stands. The path has a column at least.
PathPoint<6> recordedPath(const RecordedPath& path, std::int64_t n, double period) noexcept;

}  // namespace ves
