// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/hindsight.hpp"

#include <algorithm>
#include <cmath>

namespace ves {

Hindsight::Hindsight(double period) : period_(period) {
  constexpr double kSlide = 0.2;  // [s]
  slide_ = std::max(1, static_cast<int>(std::lround(kSlide / period_)));
}

void Hindsight::reset(const AdmittanceModel& model, const Lesson& lesson) noexcept {
  const ModalDynamics& base = model.dynamics();
  const Eigen::Index k = base.size(), n = lesson.momentum.cols();
  eta_.setZero(k, n);
  eta_dot_.setZero(k, n);
  momentum_.resize(k, n);
  mass_ = model.factors().mass;
  momentum_.noalias() = base.Phi().transpose() * lesson.momentum / mass_;
  withheld_ = passed_ = owed_ = due_ = past_[0] = base.atRest();
  kept_ = 1;
  remaining_ = 0;
  any_ = false;
}

void Hindsight::step(const AdmittanceModel& model, const Mat6& M_1, double dt,
                     const Lesson& lesson) noexcept {
  any_ = false;
  if (!(dt > 0.0)) return;
  const ModalDynamics& base = model.dynamics();
  const double mass = model.factors().mass;
  if (mass != mass_) {  // its velocity stays
    momentum_ = (mass_ * momentum_ + (mass - mass_) * eta_dot_) / mass;
    mass_ = mass;
  }
  const ModalDynamics::Body body = model.body(M_1);
  const ModalDynamics::Forces none = ModalDynamics::Forces::Zero(base.size());
  if (lesson.momentum.cols() == eta_.cols() && lesson.hand >= 0) {
    eta_.middleCols<4>(lesson.hand).setZero();
    momentum_.middleCols<4>(lesson.hand).noalias() =
        base.Phi().transpose() * lesson.momentum.middleCols<4>(lesson.hand) / mass;
  }
  if (lesson.momentum.cols() == eta_.cols()) learn(base, body, mass, dt, lesson.momentum);
  if (remaining_ > 0) owed_ = base.advance(body, dt, owed_, none);
  if (lesson.learnt.size() == eta_.cols() && lesson.learnt.size() > 0)
    owe({eta_ * lesson.learnt, eta_dot_ * lesson.learnt}, 1.0);

  const auto force = [&](const Wrench& F_Po_I) -> ModalDynamics::Forces {
    return base.Phi().transpose() * F_Po_I.stacked() / mass;
  };
  withheld_ = base.advance(body, dt, withheld_, force(lesson.withheld));
  if (lesson.was_weight) owe(passed_, -1.0);
  if (lesson.passing)
    passed_ = base.advance(body, dt, passed_, force(lesson.passed));
  else
    passed_ = base.atRest();
  if (lesson.replay > 0) {
    const auto groups = static_cast<std::size_t>((lesson.replay - 1) / Lesson::kGroup + 1);
    const std::size_t back = std::min({groups, kept_, kKept});
    const double since = lesson.replay * period_;
    const Modes before = base.advance(body, since, past_[(kept_ - back) % kKept], none);
    passed_.eta += withheld_.eta - before.eta;
    passed_.eta_dot += withheld_.eta_dot - before.eta_dot;
    owe(withheld_, 1.0);
    owe(before, -1.0);
    withheld_ = past_[0] = base.atRest();
    kept_ = 1;
  } else if (lesson.group_ends) {
    past_[kept_++ % kKept] = withheld_;
  }

  if (remaining_ == 0) return;
  any_ = true;
  due_ = {owed_.eta / remaining_, owed_.eta_dot / remaining_};
  owed_.eta -= due_.eta;
  owed_.eta_dot -= due_.eta_dot;
  --remaining_;
}

/// (1 + Phi^T M_1 Phi) eta' + Phi^T p, per parameter, changes by what springs and dampers take.
void Hindsight::learn(const ModalDynamics& base, const ModalDynamics::Body& body, double mass,
                      double dt, const MassColumns& momentum) noexcept {
  eta_dot_ = momentum_;
  eta_dot_.noalias() -= base.Phi().transpose() * momentum / mass;
  const MassColumns pull = body.pull * eta_dot_;
  eta_dot_.noalias() -= base.Phi().transpose() * pull;
  // A mode that turns by more than this in a step follows at once, and hardly moves.
  constexpr double kMostAngle = 1.5;  // [rad]
  for (Eigen::Index i = 0; i < base.size(); ++i)
    if (base.stiffness()(i) * dt * dt > kMostAngle * kMostAngle) eta_dot_.row(i).setZero();
  eta_ += dt * eta_dot_;
  const ModalDynamics::Forces none = ModalDynamics::Forces::Zero(base.size());
  for (Eigen::Index j = 0; j < eta_.cols(); ++j)
    momentum_.col(j) += dt * base.acceleration({eta_.col(j), eta_dot_.col(j)}, none);
}

void Hindsight::owe(const Modes& more, double sign) noexcept {
  if (remaining_ == 0) owed_ = {0.0 * more.eta, 0.0 * more.eta_dot};
  owed_.eta += sign * more.eta;
  owed_.eta_dot += sign * more.eta_dot;
  remaining_ = slide_;
}

}  // namespace ves
