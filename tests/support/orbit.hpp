// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "ves/math/frames.hpp"

namespace ves::test {

/// Clohessy and Wiltshire's solution: where what was at r, moving at v, is t [s] later in axes that
/// go round the Earth at n [rad/s].
inline Vec3 inOrbit(double n, const Vec3& r, const Vec3& v, double t) {
  const double s = std::sin(n * t), c = std::cos(n * t);
  return {(4.0 - 3.0 * c) * r.x() + s / n * v.x() + 2.0 / n * (1.0 - c) * v.y(),
          6.0 * (s - n * t) * r.x() + r.y() + 2.0 / n * (c - 1.0) * v.x() +
              (4.0 * s / n - 3.0 * t) * v.y(),
          c * r.z() + s / n * v.z()};
}

}  // namespace ves::test
