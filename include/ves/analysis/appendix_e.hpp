// SPDX-License-Identifier: BSD-3-Clause
//
// Stability of the sampled force feedback as published (Appendix E): the sensor and its sampling
// are all that stands between a base and the mass on it.
#pragma once

#include <array>
#include <complex>

#include "ves/vehicle/admittance_model.hpp"
#include "ves/robot/robot_model.hpp"

namespace ves {

/// One oscillator that a mass m_1 is fed back to through a sampled force sensor (figure E.3).
struct SampledOscillator {
  double mass_ratio = 0.0;       // [-] m_1/m
  double frequency_ratio = 0.0;  // [-] f/F, samples a period
  double damping_ratio = 0.0;    // [-] zeta, 0 to less than 1
};

/// Roots of the characteristic equation (E.11): the pair, then the real third root.
std::array<std::complex<double>, 3> roots(const SampledOscillator& oscillator);

/// {x, x', x''} from one sample to the next, (E.9), at omega = 1. Two of its entries are
/// misprinted: (3,1) has beta/w_d for alpha, (3,3) a plus.
Eigen::Matrix3d transition(const SampledOscillator& oscillator);

/// Eigenvalues of M^-1 M_1, largest first, from the base's modes: Phi^T M_1 Phi has the same,
/// (E.18) to (E.20). The limit of every one is 1. (E.20) prints R without its minus.
Eigen::VectorXd massRatios(const ModalModel& base, const RigidBody& robot_P);

}  // namespace ves
