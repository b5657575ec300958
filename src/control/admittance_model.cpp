// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/admittance_model.hpp"

#include <Eigen/QR>
#include <cassert>
#include <unsupported/Eigen/MatrixFunctions>

#include "ves/math/second_order.hpp"

namespace ves {

AdmittanceModel::AdmittanceModel(const ModalModel& model, double period)
    : Phi_(model.Phi), k_(model.stiffness), c_(model.damping.diagonal()) {
  const Eigen::Index k = k_.size();
  assert(k <= kMaxModes && model.Phi.cols() == k && model.damping.rows() == k);
  Phi_pinv_ = model.Phi.completeOrthogonalDecomposition().pseudoInverse();
  hold_.resize(6, k);
  eta_.setZero(k);
  eta_dot_.setZero(k);
  eta_before_ = eta_;
  eta_dot_before_ = eta_dot_;
  period_ = period;
  coupled_ = !model.damping.isDiagonal(0.0);
  if (!coupled_) {
    for (Eigen::Index i = 0; i < k; ++i) {
      const SecondOrderHold h = discretise(k_(i), c_(i), period);
      hold_.col(i) << h.Phi(0, 0), h.Phi(0, 1), h.Phi(1, 0), h.Phi(1, 1), h.Gamma(0), h.Gamma(1);
    }
    return;
  }
  assert(k <= kMaxCoupledModes);
  damping_ = model.damping;
  // exp([A B; 0 0] T) = [Phi Gamma; 0 I] (van Loan): exact for damping of any form.
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(3 * k, 3 * k);
  M.block(0, k, k, k).setIdentity();
  M.block(k, 0, k, k) = -Eigen::MatrixXd(model.stiffness.asDiagonal());
  M.block(k, k, k, k) = -model.damping;
  M.block(k, 2 * k, k, k).setIdentity();
  const Eigen::MatrixXd E = (M * period).exp();
  Phi_coupled_ = E.topLeftCorner(2 * k, 2 * k);
  Gamma_coupled_ = E.topRightCorner(2 * k, k);
}

void AdmittanceModel::reset(const Vec6& x) noexcept {
  eta_.noalias() = Phi_pinv_ * x;
  eta_dot_.setZero();
  offset_ = x;
  offset_.noalias() -= Phi_ * eta_;
  motion_ = {};
  motion_.x = x;
}

void AdmittanceModel::step(const Wrench& F_Po_I) noexcept {
  Vector<kMaxModes> u;  // Phi^T W
  eta_before_ = eta_;
  eta_dot_before_ = eta_dot_;
  u.noalias() = Phi_.transpose() * F_Po_I.stacked();
  if (coupled_)
    stepCoupled(u);
  else
    stepModes(u);

  Vector<kMaxModes> eta_ddot = u - k_.cwiseProduct(eta_);
  if (coupled_)
    eta_ddot.noalias() -= damping_ * eta_dot_;
  else
    eta_ddot -= c_.cwiseProduct(eta_dot_);
  motion_.x = offset_;
  motion_.x.noalias() += Phi_ * eta_;
  motion_.x_dot.noalias() = Phi_ * eta_dot_;
  motion_.x_ddot.noalias() = Phi_ * eta_ddot;
}

void AdmittanceModel::slow(double share) noexcept {
  eta_ = eta_before_ + share * (eta_ - eta_before_);
  eta_dot_ *= share;
  motion_.x = offset_;
  motion_.x.noalias() += Phi_ * eta_;
  motion_.x_dot.noalias() = Phi_ * eta_dot_;
  motion_.x_ddot.noalias() = Phi_ * (eta_dot_ - eta_dot_before_);
  motion_.x_ddot /= period_;
}

void AdmittanceModel::stepModes(const Vector<kMaxModes>& u) noexcept {
  for (Eigen::Index i = 0; i < eta_.size(); ++i) {
    const double y = eta_(i), y_dot = eta_dot_(i);
    const auto h = hold_.col(i);
    eta_(i) = h(0) * y + h(1) * y_dot + h(4) * u(i);
    eta_dot_(i) = h(2) * y + h(3) * y_dot + h(5) * u(i);
  }
}

void AdmittanceModel::stepCoupled(const Vector<kMaxModes>& u) noexcept {
  const Eigen::Index k = eta_.size();
  Vector<kCoupledStates> state(2 * k), next(2 * k);
  state << eta_, eta_dot_;
  next.noalias() = Phi_coupled_ * state;
  next.noalias() += Gamma_coupled_ * u;
  eta_ = next.head(k);
  eta_dot_ = next.tail(k);
}

}  // namespace ves
