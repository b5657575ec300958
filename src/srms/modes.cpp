// SPDX-License-Identifier: BSD-3-Clause
#include "ves/srms/modes.hpp"

#include <gsl/gsl_eigen.h>

#include <cmath>
#include <memory>
#include <stdexcept>

#include "gsl_errors.hpp"

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

std::unique_ptr<gsl_matrix, FreeMatrix> toGsl(const Eigen::MatrixXd& A) {
  const auto n = static_cast<std::size_t>(A.rows());
  std::unique_ptr<gsl_matrix, FreeMatrix> m(gsl_matrix_alloc(n, n));
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      gsl_matrix_set(m.get(), i, j, A(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
  return m;
}

}  // namespace

Eigenmodes eigenmodes(const Eigen::MatrixXd& M, const Eigen::MatrixXd& K) {
  const auto n = static_cast<std::size_t>(M.rows());
  const auto a = toGsl(K), b = toGsl(M);
  const std::unique_ptr<gsl_vector, FreeVector> values(gsl_vector_alloc(n));
  const std::unique_ptr<gsl_matrix, FreeMatrix> vectors(gsl_matrix_alloc(n, n));
  const std::unique_ptr<gsl_eigen_gensymmv_workspace, FreeWorkspace> work(
      gsl_eigen_gensymmv_alloc(n));
  returnGslErrors();
  const int status = gsl_eigen_gensymmv(a.get(), b.get(), values.get(), vectors.get(), work.get());
  if (status) throw std::domain_error("the mass matrix is not positive definite");
  gsl_eigen_gensymmv_sort(values.get(), vectors.get(), GSL_EIGEN_SORT_VAL_ASC);

  Eigenmodes out;
  out.shapes.resize(M.rows(), M.cols());
  out.stiffness.resize(M.rows());
  const double largest = gsl_vector_max(values.get());
  for (std::size_t k = 0; k < n; ++k) {
    const auto j = static_cast<Eigen::Index>(k);
    const double value = gsl_vector_get(values.get(), k);
    // A free direction: rounding must not turn it into a weak spring, or an unstable one.
    out.stiffness(j) = value > 1e-14 * largest ? value : 0.0;
    auto shape = out.shapes.col(j);
    for (std::size_t i = 0; i < n; ++i)
      shape(static_cast<Eigen::Index>(i)) = gsl_matrix_get(vectors.get(), i, k);
    shape /= std::sqrt(shape.dot(M * shape));
  }
  return out;
}

ModalModel modesOf(const Mat6& M, const Mat6& C, const Mat6& K) {
  const Eigenmodes modes = eigenmodes(M, K);
  ModalModel out;
  out.Phi = modes.shapes;
  out.stiffness = modes.stiffness;
  const Mat6 damping = out.Phi.transpose() * C * out.Phi;
  const Mat6 diagonal = damping.diagonal().asDiagonal();
  const bool proportional =
      (damping - diagonal).cwiseAbs().maxCoeff() <= 1e-12 * damping.cwiseAbs().maxCoeff();
  out.damping = proportional ? diagonal : Mat6(0.5 * (damping + damping.transpose()));
  return out;
}

}  // namespace ves
