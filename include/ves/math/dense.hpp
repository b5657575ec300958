// SPDX-License-Identifier: BSD-3-Clause
//
// Dense linear algebra for everything that is not a tick: Eigen's decompositions, compiled once.
#pragma once

#include <Eigen/Core>
#include <complex>

#include "ves/math/frames.hpp"

namespace ves {

/// Not finite where A has none.
Mat6 inverse(const Mat6& A);

/// Of a square matrix, in no order.
Eigen::VectorXcd eigenvalues(const Eigen::MatrixXd& A);

/// Of an eigenvalue that is known to rounding, by inverse iteration; of length one.
Eigen::VectorXcd eigenvector(const Eigen::MatrixXd& A, std::complex<double> eigenvalue);

/// Of a symmetric matrix, the smallest first. Reads the lower triangle.
Eigen::VectorXd symmetricEigenvalues(const Eigen::MatrixXd& A);

/// The same and their vectors, columns of length one.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigen symmetricEigen(const Eigen::MatrixXd& A);
/// Of A x = value B x, of length one in B, which is symmetric too; empty where B is not positive
/// definite.
SymmetricEigen symmetricEigen(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

/// A = U diag(s) V^T, rows >= columns, s falling.
struct Svd {
  Eigen::MatrixXd U, V;
  Eigen::VectorXd s;
};
Svd svd(const Eigen::MatrixXd& A);

/// e^A of a square matrix.
Eigen::MatrixXd exponential(const Eigen::MatrixXd& A);

/// X of least norm among those with the least |A X - B|, whatever the rank of A (m x n, m x k).
Eigen::MatrixXd leastSquares(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

/// X of A X = B, A symmetric and positive definite.
Eigen::MatrixXd solvePositive(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B);

}  // namespace ves
