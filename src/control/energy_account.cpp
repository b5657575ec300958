// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/energy_account.hpp"

#include <algorithm>

namespace ves {

EnergyAccount::EnergyAccount(const ControllerConfig& config) noexcept
    : passivity_(config.passivity), averages_(config.servo.sensor_window > 0.0) {
  constexpr double kRise = 0.05;  // [s] from none to all of the damping
  slew_ = passivity_.damping * std::min(1.0, config.periodSeconds() / kRise);
  reset();
}

void EnergyAccount::reset() noexcept {
  put_in_ = paid_ = damping_ = 0.0;
  tank_ = passivity_.reserve;
  known_ = false;
}

void EnergyAccount::take(const Wrench& F_Po_I, const Vec6& work_place, double taken, double paid,
                         double kinetic) noexcept {
  const Vec6 F = F_Po_I.stacked();
  if (known_) {
    const Vec6 between = averages_ ? F : Vec6(0.5 * (F_ + F));
    const double put_in = taken - between.dot(work_place - work_place_);
    put_in_ += put_in;
    paid_ += paid;
    tank_ = std::min(passivity_.reserve, tank_ - put_in + paid);
  }
  known_ = true;
  work_place_ = work_place;
  F_ = F;
  if (!passivity_.enabled) return;
  // A debt of d with an energy of motion of E is paid at 2 b E, which is 2 damping d.
  const double debt = std::max(0.0, -tank_);
  const double due = debt > 0.0 ? passivity_.damping * std::min(1.0, debt / kinetic) : 0.0;
  damping_ += std::clamp(due - damping_, -slew_, slew_);
}

}  // namespace ves
