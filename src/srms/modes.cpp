// SPDX-License-Identifier: BSD-3-Clause
#include "ves/srms/modes.hpp"

#include <cmath>
#include <stdexcept>

#include "ves/math/dense.hpp"

namespace ves {
Eigenmodes eigenmodes(const Eigen::MatrixXd& M, const Eigen::MatrixXd& K) {
  const SymmetricEigen modes = symmetricEigen(K, M);
  if (modes.values.size() != M.rows())
    throw std::domain_error("the mass matrix is not positive definite");
  // A free direction: rounding must not turn it into a weak spring, or an unstable one.
  const auto free = modes.values.array() <= 1e-14 * modes.values.maxCoeff();
  Eigenmodes out;
  out.stiffness = free.select(0.0, modes.values);
  out.shapes = modes.vectors;
  for (auto shape : out.shapes.colwise()) shape /= std::sqrt(shape.dot(M * shape));
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
