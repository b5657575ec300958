// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/trajectory_generation.hpp"

#include <algorithm>
#include <cmath>

namespace ves {

PathPoint<6> trajectoryGeneration(const Trajectory& trajectory, const Vec6& initial, std::int64_t n,
                                  std::int64_t steps, double period) noexcept {
  PathPoint<6> out;
  out.x = initial;
  for (int i = 0; i < 6; ++i) {
    switch (trajectory.motion[static_cast<std::size_t>(i)]) {
      case AxisMotion::kHold:
      case AxisMotion::kCount: break;
      case AxisMotion::kRamp: {
        if (n >= steps) {
          out.x(i) = trajectory.final(i);
          break;
        }
        const double delta =
            (trajectory.final(i) - initial(i)) / static_cast<double>(steps);  // (C.8)
        out.x(i) = initial(i) + delta * static_cast<double>(n);               // (C.9)
        out.x_dot(i) = delta / period;
        break;
      }
      case AxisMotion::kSine: {
        const double w = 2.0 * M_PI * trajectory.frequency(i);
        const double phase = w * (static_cast<double>(n) * period);
        out.x(i) = initial(i) + trajectory.amplitude(i) * std::sin(phase);  // (C.10)
        out.x_dot(i) = trajectory.amplitude(i) * w * std::cos(phase);
        out.x_ddot(i) = -trajectory.amplitude(i) * w * w * std::sin(phase);
        break;
      }
    }
  }
  return out;
}

PathPoint<6> recordedPath(const RecordedPath& path, std::int64_t n, double period) noexcept {
  const auto column = [&](std::int64_t k) {
    return path.col(std::clamp<std::int64_t>(k, 0, path.cols() - 1));
  };
  PathPoint<6> out;
  out.x = column(n);
  out.x_dot = (column(n + 1) - column(n - 1)) / (2.0 * period);
  out.x_ddot = (column(n + 1) - 2.0 * column(n) + column(n - 1)) / (period * period);
  return out;
}

}  // namespace ves
