// SPDX-License-Identifier: BSD-3-Clause
#include "ves/contact/contact_watch.hpp"

#include <algorithm>

namespace ves {

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
    // Since the older of the two places that are known; where there is none yet, as it is now.
    contact_.approach = earlier_.gap > 0.0 && std::isfinite(earlier_.gap)
                            ? earlier_.gap / (changed - earlier_.t)
                            : now.closing;
    contact_.impulse = 0.5 * (t - changed) * now.pressed;
  } else if (touching_) {
    contact_.impulse += 0.5 * ((touches ? t : changed) - t_) * (force_ + now.pressed);
  }
  if (touches || touching_) contact_.duration = (touches ? t : changed) - contact_.began;
  if (touches) contact_.peak = std::max(contact_.peak, now.pressed.norm());
  if (touching_ && !touches) {
    parted_ = changed;
    earlier_ = later_ = {changed, 0.0};
  }
  if (parted_ >= 0.0 && t - parted_ >= kMean) {
    contact_.separation = now.least / (t - parted_);
    parted_ = -1.0;
  }
  if (!touches && t - later_.t >= kMean) {
    earlier_ = later_;
    later_ = {t, now.least};
  }
  touching_ = touches;
  t_ = t;
  gap_ = now.least;
  force_ = now.pressed;
}

}  // namespace ves
