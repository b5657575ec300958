// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/admittance_model.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <cassert>
#include <unsupported/Eigen/MatrixFunctions>

#include "ves/math/second_order.hpp"

namespace ves {

ModalHold modalHold(const ModalModel& model, double dt) {
  const Eigen::Index k = model.stiffness.size();
  ModalHold out{Eigen::MatrixXd::Zero(2 * k, 2 * k), Eigen::MatrixXd::Zero(2 * k, k)};
  if (model.damping.isDiagonal(0.0)) {
    for (Eigen::Index i = 0; i < k; ++i) {
      const SecondOrderHold one = discretise(model.stiffness(i), model.damping(i, i), dt);
      out.Phi(i, i) = one.Phi(0, 0);
      out.Phi(i, k + i) = one.Phi(0, 1);
      out.Phi(k + i, i) = one.Phi(1, 0);
      out.Phi(k + i, k + i) = one.Phi(1, 1);
      out.Gamma(i, i) = one.Gamma(0);
      out.Gamma(k + i, i) = one.Gamma(1);
    }
    return out;
  }
  // exp([A B; 0 0] T) = [Phi Gamma; 0 I] (van Loan).
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(3 * k, 3 * k);
  M.block(0, k, k, k).setIdentity();
  M.block(k, 0, k, k) = -Eigen::MatrixXd(model.stiffness.asDiagonal());
  M.block(k, k, k, k) = -model.damping;
  M.block(k, 2 * k, k, k).setIdentity();
  const Eigen::MatrixXd E = (M * dt).exp();
  return {E.topLeftCorner(2 * k, 2 * k), E.topRightCorner(2 * k, k)};
}

AdmittanceModel::AdmittanceModel(const ModalModel& model, double period, double ahead)
    : Phi_(model.Phi),
      k_(model.stiffness),
      c_(model.damping.diagonal()),
      period_(period),
      ahead_(ahead),
      coupled_(!model.damping.isDiagonal(0.0)) {
  const Eigen::Index k = k_.size();
  assert(k <= (coupled_ ? kMaxCoupledModes : kMaxModes));
  assert(model.Phi.cols() == k && model.damping.rows() == k);
  Phi_pinv_ = model.Phi.completeOrthogonalDecomposition().pseudoInverse();
  if (coupled_) damping_ = model.damping;
  step_ = hold(model, period);
  if (ahead > 0.0) {
    constexpr double kMostGrowth = 5.0;  // [-] exponent of a damped mode's way back
    ahead_hold_ = hold(model, ahead);
    const Hold stay = hold(model, 0.0);
    back_ = coupled_ && !(model.damping.norm() * ahead < kMostGrowth) ? stay : hold(model, -ahead);
    for (Eigen::Index i = 0; !coupled_ && i < k; ++i)
      if (!(c_(i) * ahead < kMostGrowth)) back_.modes.col(i) = stay.modes.col(i);
  }
  const Eigen::MatrixXd Gamma_2 = coupled_
                                      ? Eigen::MatrixXd(step_.Gamma.bottomRows(k))
                                      : Eigen::MatrixXd(step_.modes.row(5).matrix().asDiagonal());
  rate_per_wrench_ = model.Phi * Gamma_2 * model.Phi.transpose();
  now_.eta.setZero(k);
  now_.eta_dot.setZero(k);
  before_ = now_;
}

AdmittanceModel::Hold AdmittanceModel::hold(const ModalModel& model, double dt) const {
  const Eigen::Index k = k_.size();
  Hold out;
  if (!coupled_) {
    out.modes.resize(6, k);
    for (Eigen::Index i = 0; i < k; ++i) {
      const SecondOrderHold h = discretise(k_(i), c_(i), dt);
      out.modes.col(i) << h.Phi(0, 0), h.Phi(0, 1), h.Phi(1, 0), h.Phi(1, 1), h.Gamma(0),
          h.Gamma(1);
    }
    return out;
  }
  const ModalHold both = modalHold(model, dt);
  out.Phi = both.Phi;
  out.Gamma = both.Gamma;
  return out;
}

void AdmittanceModel::reset(const Vec6& x, const Mat6& M_1) noexcept {
  now_.eta.noalias() = Phi_pinv_ * x;
  now_.eta_dot.setZero();
  offset_ = x;
  offset_.noalias() -= Phi_ * now_.eta;
  motion_ = {};
  motion_.x = x;
  if (!(ahead_ > 0.0)) return;
  // The reaction of M_1 when let go: a = Phi (Phi^T (-M_1 a) - K eta).
  const Mat6 left = Mat6::Identity() + Phi_ * Phi_.transpose() * M_1;
  const Vec6 pull = Phi_ * k_.cwiseProduct(now_.eta);
  const Vec6 a = -left.partialPivLu().solve(pull);
  const Vector<kMaxModes> u = -(Phi_.transpose() * (M_1 * a));
  now_ = advance(back_, now_, u);
}

void AdmittanceModel::step(const Wrench& F_Po_I, const Mat6& M_1, double share) noexcept {
  before_ = now_;
  motion_before_ = motion_;
  Vec6 F = F_Po_I.stacked();
  Vector<kMaxModes> u;  // Phi^T F
  if (!M_1.isZero(0.0)) {
    u.setZero(k_.size());
    const Modes free = advance(step_, before_, u);
    Vec6 change = rate_per_wrench_ * F;  // of the base's rate, were there no body
    change.noalias() += Phi_ * (free.eta_dot - before_.eta_dot);
    const Mat6 left = period_ * Mat6::Identity() + rate_per_wrench_ * M_1;
    const Vec6 a = left.partialPivLu().solve(change);
    F -= M_1 * a;
  }
  u.noalias() = Phi_.transpose() * F;
  now_ = advance(step_, before_, u);
  motion_ = at(now_, u);
  if (!(share * ahead_ > 0.0)) return;
  const PathPoint<6> later = at(advance(ahead_hold_, now_, u), u);
  motion_.x += share * (later.x - motion_.x);
  motion_.x_dot += share * (later.x_dot - motion_.x_dot);
  motion_.x_ddot += share * (later.x_ddot - motion_.x_ddot);
}

PathPoint<6> AdmittanceModel::at(const Modes& modes, const Vector<kMaxModes>& u) const noexcept {
  Vector<kMaxModes> eta_ddot = u - k_.cwiseProduct(modes.eta);
  if (coupled_)
    eta_ddot.noalias() -= damping_ * modes.eta_dot;
  else
    eta_ddot -= c_.cwiseProduct(modes.eta_dot);
  PathPoint<6> out;
  out.x = offset_;
  out.x.noalias() += Phi_ * modes.eta;
  out.x_dot.noalias() = Phi_ * modes.eta_dot;
  out.x_ddot.noalias() = Phi_ * eta_ddot;
  return out;
}

void AdmittanceModel::slow(double share) noexcept {
  now_.eta = before_.eta + share * (now_.eta - before_.eta);
  now_.eta_dot *= share;
  motion_.x = motion_before_.x + share * (motion_.x - motion_before_.x);
  motion_.x_dot.noalias() = Phi_ * now_.eta_dot;
  motion_.x_ddot.noalias() = Phi_ * (now_.eta_dot - before_.eta_dot);
  motion_.x_ddot /= period_;
}

AdmittanceModel::Modes AdmittanceModel::advance(const Hold& hold, const Modes& from,
                                                const Vector<kMaxModes>& u) const noexcept {
  const Eigen::Index k = k_.size();
  Modes to;
  if (coupled_) {
    Vector<kCoupledStates> state(2 * k), next(2 * k);
    state << from.eta, from.eta_dot;
    next.noalias() = hold.Phi * state;
    next.noalias() += hold.Gamma * u;
    to.eta = next.head(k);
    to.eta_dot = next.tail(k);
    return to;
  }
  to.eta.resize(k);
  to.eta_dot.resize(k);
  for (Eigen::Index i = 0; i < k; ++i) {
    const double y = from.eta(i), y_dot = from.eta_dot(i);
    const auto h = hold.modes.col(i);
    to.eta(i) = h(0) * y + h(1) * y_dot + h(4) * u(i);
    to.eta_dot(i) = h(2) * y + h(3) * y_dot + h(5) * u(i);
  }
  return to;
}

}  // namespace ves
