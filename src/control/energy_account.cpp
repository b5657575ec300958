// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/energy_account.hpp"

namespace ves {

EnergyAccount::EnergyAccount(const ControllerConfig& config) noexcept
    : passivity_(config.passivity), slew_(dampingSlew(passivity_.damping, config.periodSeconds())) {
  reset();
}

void EnergyAccount::reset() noexcept {
  put_in_ = taken_ = paid_ = damping_ = 0.0;
  tank_ = passivity_.reserve;
}

void EnergyAccount::take(const ModelWork& model, const PortWork::Work& work) noexcept {
  // On a platform that follows the model, noise seems to do work too: interpolated without the
  // sensor's filter, readings have to do with those two and three before. Measured, 0.5 to 0.9 of
  // what the model takes of it.
  constexpr double kAtPlatform = 1.0;  // [-]
  const double taken = model.taken - model.noise;
  put_in_ += taken_ - work.settled;
  taken_ = taken;
  paid_ += model.paid;
  tank_ = std::min(passivity_.reserve, tank_ - (taken - work.newest) + kAtPlatform * model.noise +
                                           model.paid + model.dissipated);
  if (!passivity_.enabled) return;
  // A debt of d with an energy of motion of E is paid at 2 b E, which is 2 damping d.
  const double debt = std::max(0.0, -tank_);
  const double due = debt > 0.0 ? passivity_.damping * std::min(1.0, debt / model.kinetic) : 0.0;
  damping_ += std::clamp(due - damping_, -slew_, slew_);
}

}  // namespace ves
