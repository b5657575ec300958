// SPDX-License-Identifier: BSD-3-Clause
//
// Trajectory generation (Appendix C): a ramp or a sine in each of the six coordinates.
#pragma once

#include <cstdint>

#include "ves/contract/order.hpp"
#include "ves/math/quintic.hpp"

namespace ves {

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
