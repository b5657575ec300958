// SPDX-License-Identifier: BSD-3-Clause
#include "ves/analysis/appendix_e.hpp"

#include <cmath>

#include "ves/math/dense.hpp"

namespace ves {

std::array<std::complex<double>, 3> roots(const SampledOscillator& o) {
  const double zeta = o.damping_ratio, r = -o.mass_ratio;
  const double omega_tau = 2.0 * M_PI / o.frequency_ratio;
  const double d = std::sqrt(1.0 - zeta * zeta);  // omega_d / omega
  const double e = std::exp(-zeta * omega_tau);
  const double c = std::cos(d * omega_tau), s = zeta / d * std::sin(d * omega_tau);
  const double a = e * (r * s - (2.0 + r) * c);
  const double b = e * e * (r + 1.0) + e * (r * c - r * s);
  Mat3 companion;
  companion << -a, -b, r * e * e, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  const Eigen::VectorXcd z = eigenvalues(companion);
  std::array<std::complex<double>, 3> out = {z(0), z(1), z(2)};
  // The third root is the one that is r when the sampling is infinitely fast.
  std::size_t third = 0;
  for (std::size_t i = 1; i < 3; ++i)
    if (std::abs(out[i] - r) < std::abs(out[third] - r)) third = i;
  std::swap(out[third], out[2]);
  return out;
}

Eigen::Matrix3d transition(const SampledOscillator& o) {
  const double zeta = o.damping_ratio, r = -o.mass_ratio;
  const double tau = 2.0 * M_PI / o.frequency_ratio;
  const double w_d = std::sqrt(1.0 - zeta * zeta);
  const double e = std::exp(-zeta * tau), s = std::sin(w_d * tau), c = std::cos(w_d * tau);
  const double alpha = c + zeta / w_d * s;
  const double beta = w_d * c - zeta * s;
  const double gamma = (2.0 * zeta * zeta - 1.0) * s - 2.0 * zeta * w_d * c;
  Eigen::Matrix3d phi;
  phi << alpha * e, e * s / w_d, r * (1.0 - alpha * e),  //
      -e * s / w_d, beta / w_d * e, r / w_d * e * s,     //
      -beta / w_d * e, gamma / w_d * e, r / w_d * beta * e;
  return phi;
}

Eigen::VectorXd massRatios(const ModalModel& base, const RigidBody& robot_P) {
  const Eigen::MatrixXd R = base.Phi.transpose() * spatialMass(robot_P) * base.Phi;
  return symmetricEigenvalues(R).reverse();
}

}  // namespace ves
