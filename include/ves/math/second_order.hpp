// SPDX-License-Identifier: BSD-3-Clause
//
// y'' + c y' + k y = u over one step, exactly: Appendix D of the report for every k >= 0, c >= 0.
#pragma once

#include <Eigen/Core>

namespace ves {

/// eta(t+T) = Phi eta(t) + Gamma u for eta = {y, y'} and u held over the step, (D.5).
struct SecondOrderHold {
  Eigen::Matrix2d Phi = Eigen::Matrix2d::Identity();
  Eigen::Vector2d Gamma = Eigen::Vector2d::Zero();
};

/// Phi = e^{AT} and Gamma = (integral of e^{At} over 0..T) B, with A = [0 1; -k -c], B = [0; 1].
///
/// Written in k [1/s^2] and c [1/s] where the report writes omega^2 and 2 zeta omega, so that a
/// free mass with a damper (k = 0, c > 0) is a mode like any other. Under-, critically and
/// overdamped, undamped and free modes are exact to rounding.
SecondOrderHold discretise(double k, double c, double T) noexcept;

}  // namespace ves
