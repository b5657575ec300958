// SPDX-License-Identifier: BSD-3-Clause
#include "ves/math/dense.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <unsupported/Eigen/MatrixFunctions>

namespace ves {

using Eigen::MatrixXd;

Mat6 inverse(const Mat6& A) { return A.inverse(); }

Eigen::VectorXcd eigenvalues(const MatrixXd& A) {
  return Eigen::EigenSolver<MatrixXd>(A, false).eigenvalues();
}

Eigen::VectorXcd eigenvector(const MatrixXd& A, std::complex<double> eigenvalue) {
  const Eigen::MatrixXcd shifted =
      A.cast<std::complex<double>>() -
      eigenvalue * (1.0 + 1e-10) * Eigen::MatrixXcd::Identity(A.rows(), A.cols());
  const Eigen::PartialPivLU<Eigen::MatrixXcd> lu(shifted);
  Eigen::VectorXcd vector = Eigen::VectorXcd::Ones(A.rows());
  for (int i = 0; i < 3; ++i) vector = lu.solve(vector).normalized();
  return vector;
}

Eigen::VectorXd symmetricEigenvalues(const MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

SymmetricEigen symmetricEigen(const MatrixXd& A) {
  if (A.size() == 0) return {};
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(A);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

SymmetricEigen symmetricEigen(const MatrixXd& A, const MatrixXd& B) {
  if (A.size() == 0 || B.llt().info() != Eigen::Success) return {};
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> solver(A, B);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Svd svd(const MatrixXd& A) {
  const Eigen::JacobiSVD<MatrixXd> of(A, Eigen::ComputeThinU | Eigen::ComputeThinV);
  return {of.matrixU(), of.matrixV(), of.singularValues()};
}

MatrixXd exponential(const MatrixXd& A) { return A.exp(); }

MatrixXd leastSquares(const MatrixXd& A, const MatrixXd& B) {
  if (A.cols() == 0) return MatrixXd(0, B.cols());
  return A.completeOrthogonalDecomposition().solve(B);
}

MatrixXd solvePositive(const MatrixXd& A, const MatrixXd& B) { return A.llt().solve(B); }

}  // namespace ves
