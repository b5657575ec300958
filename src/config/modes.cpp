// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/modes.hpp"

#include <fmt/format.h>
#include <gsl/gsl_eigen.h>

#include <Eigen/Eigenvalues>
#include <memory>

namespace ves {
namespace {

struct FreeMatrix {
  void operator()(gsl_matrix* m) const { gsl_matrix_free(m); }
};
struct FreeVector {
  void operator()(gsl_vector* v) const { gsl_vector_free(v); }
};
struct FreeWorkspace {
  void operator()(gsl_eigen_gensymmv_workspace* w) const { gsl_eigen_gensymmv_free(w); }
};

std::unique_ptr<gsl_matrix, FreeMatrix> toGsl(const Mat6& A) {
  std::unique_ptr<gsl_matrix, FreeMatrix> m(gsl_matrix_alloc(6, 6));
  for (std::size_t i = 0; i < 6; ++i)
    for (std::size_t j = 0; j < 6; ++j)
      gsl_matrix_set(m.get(), i, j, A(static_cast<int>(i), static_cast<int>(j)));
  return m;
}

}  // namespace

ModalModel modesOf(const Mat6& M, const Mat6& C, const Mat6& K) {
  const auto a = toGsl(K), b = toGsl(M);
  const std::unique_ptr<gsl_vector, FreeVector> values(gsl_vector_alloc(6));
  const std::unique_ptr<gsl_matrix, FreeMatrix> vectors(gsl_matrix_alloc(6, 6));
  const std::unique_ptr<gsl_eigen_gensymmv_workspace, FreeWorkspace> work(
      gsl_eigen_gensymmv_alloc(6));
  gsl_eigen_gensymmv(a.get(), b.get(), values.get(), vectors.get(), work.get());
  gsl_eigen_gensymmv_sort(values.get(), vectors.get(), GSL_EIGEN_SORT_VAL_ASC);

  ModalModel out;
  out.Phi.resize(6, 6);
  out.stiffness.resize(6);
  const double largest = gsl_vector_max(values.get());
  for (int j = 0; j < 6; ++j) {
    const auto k = static_cast<std::size_t>(j);
    const double value = gsl_vector_get(values.get(), k);
    // A free direction: rounding must not turn it into a weak spring, or an unstable one.
    out.stiffness(j) = value > 1e-14 * largest ? value : 0.0;
    for (std::size_t i = 0; i < 6; ++i)
      out.Phi(static_cast<int>(i), j) = gsl_matrix_get(vectors.get(), i, k);
    out.Phi.col(j) /= std::sqrt(out.Phi.col(j).dot(M * out.Phi.col(j)));
  }
  const Mat6 damping = out.Phi.transpose() * C * out.Phi;
  const Mat6 diagonal = damping.diagonal().asDiagonal();
  const bool proportional =
      (damping - diagonal).cwiseAbs().maxCoeff() <= 1e-12 * damping.cwiseAbs().maxCoeff();
  out.damping = proportional ? diagonal : Mat6(0.5 * (damping + damping.transpose()));
  return out;
}

std::string definitenessFault(const Mat6& A, bool semidefinite) {
  const double scale = A.cwiseAbs().maxCoeff();
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < i; ++j)
      if (!(std::abs(A(i, j) - A(j, i)) <= 1e-9 * scale))
        return fmt::format("not symmetric: entry [{}][{}] is {}, [{}][{}] is {}", i, j, A(i, j), j,
                           i, A(j, i));
  const double least = Eigen::SelfAdjointEigenSolver<Mat6>(A).eigenvalues()(0);
  if (semidefinite ? least >= -1e-12 * scale : least > 1e-12 * scale) return {};
  return fmt::format(
      "smallest eigenvalue {:.4g}, want {}", least,
      semidefinite ? "none below 0 (positive semidefinite)" : "all above 0 (positive definite)");
}

}  // namespace ves
