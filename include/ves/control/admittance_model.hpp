// SPDX-License-Identifier: BSD-3-Clause
//
// Admittance model (Appendices C and D): the base that the platform pretends to be.
#pragma once

#include "ves/math/frames.hpp"
#include "ves/math/quintic.hpp"

namespace ves {

/// Degrees of freedom of the report's SRMS model.
inline constexpr int kMaxModes = 132;
/// Modes that may be coupled by damping.
inline constexpr int kMaxCoupledModes = 6;

/// (C.4) in mode space: eta'' + damping eta' + diag(stiffness) eta = Phi^T W, x = Phi eta.
struct ModalModel {
  Eigen::MatrixXd Phi;        // 6 x k, mass-normalised mode shapes at the platform, m or rad
  Eigen::VectorXd stiffness;  // k, [1/s^2] omega^2
  Eigen::MatrixXd damping;    // k x k, [1/s] diagonal (2 zeta omega) when it is proportional
};

/// Steps a modal model by the exact zero-order hold. Coordinates are those of Pose about home,
/// taken as small: the wrench's moments drive the fixed angles directly, as in (C.2).
class AdmittanceModel {
 public:
  /// Discretises for the period [s]: mode by mode (D.5), or, when damping couples the modes, all
  /// of them in one state space. Requires at most kMaxModes modes, kMaxCoupledModes if coupled.
  AdmittanceModel(const ModalModel& model, double period);

  /// At rest at x. What the modes cannot express of x stays as a constant offset.
  void reset(const Vec6& x) noexcept;

  /// (C.6): the state one period after W began to act.
  void step(const Wrench& F_Po_I) noexcept;

  /// Takes back all but `share` of the last step, and of the rate it led to: all modes alike, so
  /// the path stays and only the motion along it is slowed.
  void slow(double share) noexcept;

  /// [J] the modes are mass-normalised.
  double kineticEnergy() const noexcept { return 0.5 * eta_dot_.squaredNorm(); }
  double energy() const noexcept { return kineticEnergy() + 0.5 * k_.dot(eta_.cwiseAbs2()); }

  /// (C.7): position, velocity, acceleration at the last step's end.
  const PathPoint<6>& motion() const noexcept { return motion_; }

  int modes() const noexcept { return static_cast<int>(k_.size()); }

 private:
  template <int Max>
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, Max, 1>;
  template <int Rows, int MaxRows, int MaxCols>
  using Matrix = Eigen::Matrix<double, Rows, Eigen::Dynamic, 0, MaxRows, MaxCols>;
  static constexpr int kCoupledStates = 2 * kMaxCoupledModes;
  using Square =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kCoupledStates, kCoupledStates>;

  void stepModes(const Vector<kMaxModes>& u) noexcept;
  void stepCoupled(const Vector<kMaxModes>& u) noexcept;

  Matrix<6, 6, kMaxModes> Phi_;
  Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor, kMaxModes, 6> Phi_pinv_;
  Vector<kMaxModes> k_;  // [1/s^2]
  Vector<kMaxModes> c_;  // [1/s] diagonal of the damping
  double period_ = 0.0;  // [s]
  bool coupled_ = false;
  Eigen::Array<double, 6, Eigen::Dynamic, 0, 6, kMaxModes> hold_;  // a mode's Phi (4), Gamma (2)
  Square Phi_coupled_, Gamma_coupled_;                             // when coupled
  Square damping_;                                                 // when coupled
  Vector<kMaxModes> eta_, eta_dot_;
  Vector<kMaxModes> eta_before_, eta_dot_before_;  // the last step
  Vec6 offset_ = Vec6::Zero();
  PathPoint<6> motion_;
};

}  // namespace ves
