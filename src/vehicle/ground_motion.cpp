// SPDX-License-Identifier: BSD-3-Clause
#include "ves/vehicle/ground_motion.hpp"

#include <algorithm>
#include <cmath>

namespace ves {
namespace {

PathPoint<6> rowAt(const GroundMotion& ground, Eigen::Index i) noexcept {
  PathPoint<6> out;
  out.x = ground.rows.col(i).segment<6>(0);
  out.x_dot = ground.rows.col(i).segment<6>(6);
  out.x_ddot = ground.rows.col(i).segment<6>(12);
  return out;
}

}  // namespace

double GroundMotion::lasts() const noexcept {
  return rows.cols() > 0 ? static_cast<double>(rows.cols() - 1) * step : HUGE_VAL;
}

PathPoint<6> GroundMotion::at(double t) const noexcept {
  PathPoint<6> sum;
  if (!moves() || (t <= 0.0 && fade > 0.0)) return sum;
  for (Eigen::Index i = 0; i < waves.cols(); ++i) {
    const double w = waves(0, i), c = std::cos(w * t), s = std::sin(w * t);
    const auto cosines = waves.col(i).segment<6>(1), sines = waves.col(i).segment<6>(7);
    sum.x += c * cosines + s * sines;
    sum.x_dot += w * (c * sines - s * cosines);
    sum.x_ddot -= w * w * (c * cosines + s * sines);
  }
  if (const Eigen::Index last = rows.cols() - 1; last >= 0) {
    const double at = std::max(0.0, t / step);
    const auto i = static_cast<Eigen::Index>(std::min(std::floor(at), static_cast<double>(last)));
    PathPoint<6> row;
    if (i == last) {
      row.x = rows.col(last).segment<6>(0);
    } else {
      row = Quintic<6>(rowAt(*this, i), rowAt(*this, i + 1), step)
                .at((at - static_cast<double>(i)) * step);
    }
    sum.x += row.x;
    sum.x_dot += row.x_dot;
    sum.x_ddot += row.x_ddot;
  }
  if (t >= fade) return sum;
  // s^3 (10 - 15 s + 6 s^2), its rate and acceleration.
  const double s = t / fade, share = s * s * s * (10.0 - 15.0 * s + 6.0 * s * s),
               rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / fade,
               curve = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (fade * fade);
  PathPoint<6> faded;
  faded.x = share * sum.x;
  faded.x_dot = share * sum.x_dot + rate * sum.x;
  faded.x_ddot = share * sum.x_ddot + 2.0 * rate * sum.x_dot + curve * sum.x;
  return faded;
}

}  // namespace ves
