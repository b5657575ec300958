// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/hindsight.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace ves {

Hindsight::Hindsight(double period) : period_(period) {
  constexpr double kSlide = 0.2;  // [s]
  slide_ = std::max(1, static_cast<int>(std::lround(kSlide / period_)));
}

void Hindsight::reset(const AdmittanceModel& model, const Lesson& lesson) noexcept {
  const ModalDynamics& base = model.dynamics();
  const Eigen::Index k = base.size(), n = lesson.momentum.cols();
  learns_.eta.resize(k, n);
  learns_.eta_dot.resize(k, n);
  learns_.momentum.resize(k, n);
  begun_ = false;
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
  const ModalDynamics::Body body = model.body(M_1);
  const ModalDynamics::Forces none = ModalDynamics::Forces::Zero(base.size());
  const bool learns = lesson.momentum.cols() == learns_.eta.cols();
  if (learns && !begun_)
    model.begin(learns_, lesson.momentum, 0, learns_.eta.cols());
  else if (learns && lesson.hand >= 0)
    model.begin(learns_, lesson.momentum, lesson.hand, 4);
  if (learns && std::exchange(begun_, true)) model.advance(learns_, lesson.momentum, body, dt);
  if (remaining_ > 0) owed_ = base.advance(body, dt, owed_, none);
  if (lesson.learnt.size() == learns_.eta.cols() && lesson.learnt.size() > 0)
    owe({learns_.eta * lesson.learnt, learns_.eta_dot * lesson.learnt}, 1.0);

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

void Hindsight::owe(const Modes& more, double sign) noexcept {
  if (remaining_ == 0) owed_ = {0.0 * more.eta, 0.0 * more.eta_dot};
  owed_.eta += sign * more.eta;
  owed_.eta_dot += sign * more.eta_dot;
  remaining_ = slide_;
}

}  // namespace ves
