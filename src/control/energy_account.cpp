// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/energy_account.hpp"

#include <algorithm>

namespace ves {

EnergyAccount::EnergyAccount(const ControllerConfig& config) noexcept
    : passivity_(config.passivity),
      age_(wrenchDelay(config.servo, config.periodSeconds()) / config.periodSeconds() - 1.0) {
  constexpr double kRise = 0.05;  // [s] from none to all of the damping
  slew_ = passivity_.damping * std::min(1.0, config.periodSeconds() / kRise);
  reset();
}

void EnergyAccount::reset() noexcept {
  put_in_ = paid_ = damping_ = 0.0;
  tank_ = passivity_.reserve;
  known_ = 0;
}

void EnergyAccount::take(const Wrench& F_Po_I, const Vec6& x, double taken, double paid,
                         double kinetic) noexcept {
  const Vec6 moved = x - x_;
  if (known_ == 2) {
    // Over the period that the wrench is the mean of, between those of the last two poses.
    const Vec6 then = moved + age_ * (moved_ - moved);
    const double put_in = taken - F_Po_I.stacked().dot(then);
    put_in_ += put_in;
    paid_ += paid;
    tank_ = std::min(passivity_.reserve, tank_ - put_in + paid);
  }
  known_ = std::min(2, known_ + 1);
  x_ = x;
  moved_ = moved;
  if (!passivity_.enabled) return;
  // A debt of d with an energy of motion of E is paid at 2 b E, which is 2 damping d.
  const double debt = std::max(0.0, -tank_);
  const double due = debt > 0.0 ? passivity_.damping * std::min(1.0, debt / kinetic) : 0.0;
  damping_ += std::clamp(due - damping_, -slew_, slew_);
}

}  // namespace ves
