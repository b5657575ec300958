// SPDX-License-Identifier: BSD-3-Clause
#include "ves/contact/contact_watch.hpp"

#include <algorithm>

namespace ves {

double ContactWatch::gapAt(double t) const noexcept {
  const std::size_t known = std::min(places_, before_.size());
  Place after{t, NAN};
  for (std::size_t i = 1; i <= known; ++i) {
    const Place& place = before_[(places_ - i) % before_.size()];
    if (place.t == t) return place.gap;
    if (place.t < t)
      return place.gap + (after.gap - place.gap) * (t - place.t) / (after.t - place.t);
    after = place;
  }
  return NAN;
}

double ContactWatch::closedAt(double t) const noexcept {
  const double near = gapAt(t - kApart), far = gapAt(t - 2.0 * kApart);
  if (std::isfinite(near) && std::isfinite(far)) return endSpeed(kApart, near, 2.0 * kApart, far);
  const std::size_t known = std::min(places_, before_.size());
  const Place first = known > 0 ? before_[(places_ - known) % before_.size()] : Place{t, 0.0};
  return first.t < t ? first.gap / (t - first.t) : 0.0;
}

void ContactWatch::see(double t, const Touch& now) noexcept {
  const bool touches = now.least < 0.0, known = std::isfinite(gap_);
  // A share of the time since the last look after which the gap was zero.
  const double share =
      known && touches != touching_ ? std::clamp(gap_ / (gap_ - now.least), 0.0, 1.0) : 1.0;
  const double changed = known ? t_ + share * (t - t_) : t;
  if (touches && !touching_) {
    parted_ = -1.0;
    ++count_;
    contact_ = {};
    contact_.began = changed;
    const double closed = closedAt(changed);
    contact_.approach = closed > 0.0 && std::isfinite(closed) ? closed : now.closing;
    contact_.impulse = 0.5 * (t - changed) * now.pressed;
  } else if (touching_) {
    contact_.impulse += 0.5 * ((touches ? t : changed) - t_) * (force_ + now.pressed);
  }
  if (touches || touching_) contact_.duration = (touches ? t : changed) - contact_.began;
  if (touches) contact_.peak = std::max(contact_.peak, now.pressed.norm());
  if (touching_ && !touches) {
    parted_ = changed;
    before_[0] = {changed, 0.0};
    places_ = 1;
  }
  if (parted_ >= 0.0) {
    const double from = std::max(t_, parted_), gap = touching_ ? 0.0 : gap_;  // at `from`
    const auto at = [&](double then) {
      return gap + (now.least - gap) * (then - from) / (t - from);
    };
    const double near = parted_ + kApart, far = near + kApart;
    if (from < near && near <= t) {
      opened_ = at(near);
      contact_.separation = opened_ / kApart;  // all that is known if it touches again
    }
    if (far <= t) {
      contact_.separation = endSpeed(kApart, opened_, 2.0 * kApart, at(far));
      parted_ = -1.0;
    }
  }
  if (!touches && (places_ == 0 || t - before_[(places_ - 1) % before_.size()].t >= kStep))
    before_[places_++ % before_.size()] = {t, now.least};
  touching_ = touches;
  t_ = t;
  gap_ = now.least;
  force_ = now.pressed;
}

}  // namespace ves
