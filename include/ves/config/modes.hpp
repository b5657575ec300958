// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "ves/control/admittance_model.hpp"

namespace ves {

/// Mass-normalised modes of M x'' + C x' + K x = W: Phi^T M Phi = I, Phi^T K Phi = diag(stiffness),
/// (3.9), by GSL's generalised symmetric-definite eigensolver. Phi^T C Phi is kept whole unless it
/// is diagonal to rounding, so damping that is not proportional is never lost.
///
/// M must be symmetric positive definite, C and K symmetric positive semidefinite (see
/// definiteness()).
ModalModel modesOf(const Mat6& M, const Mat6& C, const Mat6& K);

/// What is wrong with a matrix that should be symmetric and positive definite (or semidefinite);
/// empty when nothing is.
std::string definitenessFault(const Mat6& A, bool semidefinite);

}  // namespace ves
