// SPDX-License-Identifier: BSD-3-Clause
//
// Modes of a beam frame.
#pragma once

#include "ves/vehicle/admittance_model.hpp"

namespace ves {

/// Solutions of K v = stiffness M v, softest first, with shapes' M shapes = I.
struct Eigenmodes {
  Eigen::VectorXd stiffness;  // n, [1/s^2] omega^2; 0 for a free direction
  Eigen::MatrixXd shapes;     // n x n, columns
};

/// M must be symmetric positive definite, K symmetric positive semidefinite; throws
/// std::domain_error where M is not.
Eigenmodes eigenmodes(const Eigen::MatrixXd& M, const Eigen::MatrixXd& K);

/// Mass-normalised modes of M x'' + C x' + K x = W: Phi^T M Phi = I, Phi^T K Phi = diag(stiffness),
/// (3.9). Phi^T C Phi is kept whole unless it is diagonal to rounding, so damping that is not
/// proportional is never lost.
ModalModel modesOf(const Mat6& M, const Mat6& C, const Mat6& K);

}  // namespace ves
