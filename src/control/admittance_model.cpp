// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/admittance_model.hpp"

#include <Eigen/LU>
#include <cassert>

#include "ves/math/dense.hpp"
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
  const Eigen::MatrixXd E = exponential(M * dt);
  return {E.topLeftCorner(2 * k, 2 * k), E.topRightCorner(2 * k, k)};
}

ModalDynamics::ModalDynamics(const ModalModel& model)
    : Phi_(model.Phi),
      k_(model.stiffness),
      c_(model.damping.diagonal()),
      coupled_(!model.damping.isDiagonal(0.0)) {
  assert(size() <= (coupled_ ? kMaxCoupledModes : kMaxModes));
  assert(model.Phi.cols() == size() && model.damping.rows() == size());
  if (coupled_) damping_ = model.damping;
}

ModalDynamics::Hold ModalDynamics::hold(double dt) const {
  const Eigen::Index k = size();
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
  const ModalHold both = modalHold({Phi_, k_, damping_}, dt);
  out.Phi = both.Phi;
  out.Gamma = both.Gamma;
  return out;
}

Mat6 ModalDynamics::ratePerWrench(const Hold& hold) const {
  const Eigen::MatrixXd Gamma_2 = coupled_
                                      ? Eigen::MatrixXd(hold.Gamma.bottomRows(size()))
                                      : Eigen::MatrixXd(hold.modes.row(5).matrix().asDiagonal());
  return Eigen::MatrixXd(Phi_) * Gamma_2 * Eigen::MatrixXd(Phi_).transpose();
}

ModalDynamics::Modes ModalDynamics::atRest() const {
  return {Vector<kMaxModes>::Zero(size()), Vector<kMaxModes>::Zero(size())};
}

ModalDynamics::Modes ModalDynamics::advance(const Hold& hold, const Modes& from,
                                            const Forces& u) const noexcept {
  const Eigen::Index k = size();
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

ModalDynamics::Vector<kMaxModes> ModalDynamics::acceleration(const Modes& modes,
                                                             const Forces& u) const noexcept {
  Vector<kMaxModes> eta_ddot = u - k_.cwiseProduct(modes.eta);
  if (coupled_)
    eta_ddot.noalias() -= damping_ * modes.eta_dot;
  else
    eta_ddot -= c_.cwiseProduct(modes.eta_dot);
  return eta_ddot;
}

AdmittanceModel::AdmittanceModel(const ModalModel& model, double period, double ahead)
    : dynamics_(model),
      Phi_pinv_(leastSquares(model.Phi, Mat6::Identity())),
      period_(period),
      ahead_(ahead),
      step_(dynamics_.hold(period)),
      rate_per_wrench_(dynamics_.ratePerWrench(step_)) {
  if (ahead > 0.0) {
    constexpr double kMostGrowth = 5.0;  // [-] exponent of a damped mode's way back
    ahead_hold_ = dynamics_.hold(ahead);
    back_ = dynamics_.hold(-ahead);
    const Hold stay = dynamics_.hold(0.0);
    if (dynamics_.coupled() && !(dynamics_.damping(0) * ahead < kMostGrowth)) back_ = stay;
    for (Eigen::Index i = 0; !dynamics_.coupled() && i < dynamics_.size(); ++i)
      if (!(dynamics_.damping(i) * ahead < kMostGrowth)) back_.modes.col(i) = stay.modes.col(i);
  }
  now_.modes = dynamics_.atRest();
  before_ = now_;
}

void AdmittanceModel::reset(const Vec6& x, const Mat6& M_1) noexcept {
  const auto& Phi = dynamics_.Phi();
  Modes& modes = now_.modes;
  modes.eta.noalias() = Phi_pinv_ * x;
  modes.eta_dot.setZero();
  offset_ = x;
  offset_.noalias() -= Phi * modes.eta;
  now_.motion = {};
  now_.motion.x = x;
  if (!(ahead_ > 0.0)) return;
  // The reaction of M_1 when let go: a = Phi (Phi^T (-M_1 a) - K eta).
  const Mat6 left = Mat6::Identity() + Phi * Phi.transpose() * M_1;
  const Vec6 pull = Phi * dynamics_.stiffness().cwiseProduct(modes.eta);
  const Vec6 a = -left.partialPivLu().solve(pull);
  const ModalDynamics::Forces u = -(Phi.transpose() * (M_1 * a));
  modes = dynamics_.advance(back_, modes, u);
}

void AdmittanceModel::step(const Wrench& F_Po_I, const Mat6& M_1, double share) noexcept {
  const auto& Phi = dynamics_.Phi();
  before_ = now_;
  Vec6 F = F_Po_I.stacked();
  ModalDynamics::Forces u;  // Phi^T F
  if (!M_1.isZero(0.0)) {
    u.setZero(dynamics_.size());
    const Modes free = dynamics_.advance(step_, before_.modes, u);
    Vec6 change = rate_per_wrench_ * F;  // of the base's rate, were there no body
    change.noalias() += Phi * (free.eta_dot - before_.modes.eta_dot);
    const Mat6 left = period_ * Mat6::Identity() + rate_per_wrench_ * M_1;
    const Vec6 a = left.partialPivLu().solve(change);
    F -= M_1 * a;
  }
  u.noalias() = Phi.transpose() * F;
  now_.modes = dynamics_.advance(step_, before_.modes, u);
  PathPoint<6>& motion = now_.motion;
  motion = at(now_.modes, u);
  if (!(share * ahead_ > 0.0)) return;
  const PathPoint<6> later = at(dynamics_.advance(ahead_hold_, now_.modes, u), u);
  motion.x += share * (later.x - motion.x);
  motion.x_dot += share * (later.x_dot - motion.x_dot);
  motion.x_ddot += share * (later.x_ddot - motion.x_ddot);
}

PathPoint<6> AdmittanceModel::at(const Modes& modes,
                                 const ModalDynamics::Forces& u) const noexcept {
  const auto& Phi = dynamics_.Phi();
  PathPoint<6> out;
  out.x = offset_;
  out.x.noalias() += Phi * modes.eta;
  out.x_dot.noalias() = Phi * modes.eta_dot;
  out.x_ddot.noalias() = Phi * dynamics_.acceleration(modes, u);
  return out;
}

void AdmittanceModel::slow(double share) noexcept {
  const auto& Phi = dynamics_.Phi();
  Modes& modes = now_.modes;
  PathPoint<6>& motion = now_.motion;
  modes.eta = before_.modes.eta + share * (modes.eta - before_.modes.eta);
  modes.eta_dot *= share;
  motion.x = before_.motion.x + share * (motion.x - before_.motion.x);
  motion.x_dot.noalias() = Phi * modes.eta_dot;
  motion.x_ddot.noalias() = Phi * (modes.eta_dot - before_.modes.eta_dot);
  motion.x_ddot /= period_;
}

}  // namespace ves
