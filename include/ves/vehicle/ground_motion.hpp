// SPDX-License-Identifier: BSD-3-Clause
//
// What a vehicle stands on and which moves by itself: the sea under a ship, or a motion that was
// recorded. It does not feel the vehicle. Beyond the report.
#pragma once

#include "ves/math/frames.hpp"
#include "ves/math/quintic.hpp"

namespace ves {

/// Six coordinates over time, those of Pose about home: waves, rows between which it goes by
/// fifth-order polynomials, or both. Time begins as the vehicle is let go; before, it stands at
/// home.
struct GroundMotion {
  Eigen::Matrix<double, 13, Eigen::Dynamic> waves;  // [rad/s], [m, rad] of the cosines, the sines
  Eigen::Matrix<double, 18, Eigen::Dynamic> rows;   // [m, rad], rates, accelerations
  double step = 0.0;                                // [s] between rows
  double fade = 0.0;                                // [s] in which it comes in, evenly

  bool moves() const noexcept { return waves.cols() > 0 || rows.cols() > 0; }
  /// [s] after which rows say nothing, and it stands where the last one is.
  double lasts() const noexcept;
  PathPoint<6> at(double t) const noexcept;

  bool operator==(const GroundMotion& other) const {
    return waves.cols() == other.waves.cols() && waves == other.waves &&
           rows.cols() == other.rows.cols() && rows == other.rows && step == other.step &&
           fade == other.fade;
  }
};

}  // namespace ves
