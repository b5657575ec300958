// SPDX-License-Identifier: BSD-3-Clause
#include "ves/math/dense.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <unsupported/Eigen/MatrixFunctions>

namespace ves {

using Eigen::MatrixXd;

Eigen::VectorXcd eigenvalues(const MatrixXd& A) {
  return Eigen::EigenSolver<MatrixXd>(A, false).eigenvalues();
}

Eigen::VectorXd symmetricEigenvalues(const MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

MatrixXd exponential(const MatrixXd& A) { return A.exp(); }

MatrixXd leastSquares(const MatrixXd& A, const MatrixXd& B) {
  return A.completeOrthogonalDecomposition().solve(B);
}

MatrixXd solvePositive(const MatrixXd& A, const MatrixXd& B) { return A.llt().solve(B); }

}  // namespace ves
