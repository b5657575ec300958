// SPDX-License-Identifier: BSD-3-Clause
//
// The admittance model alone: a mass on a spring that is pushed, 100 times a second.
#include <cmath>
#include <cstdio>
#include <ves/vehicle/admittance_model.hpp>

int main() {
  const double mass = 500.0, omega = 2.0 * M_PI * 0.5, zeta = 0.05, T = 0.01, push = 40.0;
  ves::ModalModel base;  // one mode, in z
  base.Phi = ves::Vec6::Unit(2) / std::sqrt(mass);
  base.stiffness = Eigen::VectorXd::Constant(1, omega * omega);
  base.damping = Eigen::MatrixXd::Constant(1, 1, 2.0 * zeta * omega);

  ves::AdmittanceModel model(base, T);
  model.reset(ves::Vec6::Zero());
  const double omega_d = omega * std::sqrt(1.0 - zeta * zeta), rest = push / (mass * omega * omega);
  double worst = 0.0;
  std::printf("t [s]   z [mm]   closed form\n");
  for (int k = 1; k <= 400; ++k) {
    model.step({{0.0, 0.0, push}, ves::Vec3::Zero()});  // [N], [N m]
    const double t = k * T, decay = std::exp(-zeta * omega * t),
                 z = rest * (1.0 - decay * (std::cos(omega_d * t) +
                                            zeta * omega / omega_d * std::sin(omega_d * t)));
    worst = std::max(worst, std::abs(model.motion().x(2) - z));
    if (k % 50 == 0) std::printf("%5.2f %8.3f %10.3f\n", t, 1e3 * model.motion().x(2), 1e3 * z);
  }
  std::printf("at most %.1e m apart: the step is exact, whatever its length\n", worst);
  return worst < 1e-14 ? 0 : 1;
}
