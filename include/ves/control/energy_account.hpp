// SPDX-License-Identifier: BSD-3-Clause
//
// The books of the port between robot and platform: what the emulation has put into them, and how
// the passivity controller takes it back.
//
// An ideal base takes the work that the robot does on it, F^T x', where the platform is. This one
// takes F^T x' of its model; the robot, the contact at its tool and what it pushes feel the
// platform, which is late. The difference of the two is energy that the emulation injects.
//
// The tank is De Stefano, Balachandran and Secchi's (IEEE T-RO 36(1), 2020): filled to its reserve
// at most, also by what the base's own damping takes, it is emptied by what is put in, as soon as
// that is known; below zero the model's modes are damped, all alike, until they have paid. The
// damping acts on the model and grows and fades over several ticks, so that the command stays
// smooth.
#pragma once

#include <algorithm>

#include "ves/control/port_work.hpp"

namespace ves {

/// [1/s] a tick by which damping that is added grows and fades.
inline double dampingSlew(double most, double period) noexcept {
  constexpr double kRise = 0.05;  // [s] from none to all of it
  return most * std::min(1.0, period / kRise);
}

/// [J] of the admittance model, in a step.
struct ModelWork {
  double taken = 0.0;  // of the wrench
  double noise = 0.0;  // of that, on average, of the sensor's noise, which is no work of anybody
  double dissipated = 0.0;  // by the base's own damping
  double paid = 0.0;        // by damping that was added to pay
  double kinetic = 0.0;     // that is in its motion now
};

class EnergyAccount {
 public:
  explicit EnergyAccount(const ControllerConfig& config) noexcept;

  void reset() noexcept;

  /// One step of admittance control.
  void take(const ModelWork& model, const PortWork::Work& work) noexcept;

  /// [J] up to the reading before the last, paid or not.
  double putIn() const noexcept { return put_in_; }
  double paid() const noexcept { return paid_; }        // [J]
  double damping() const noexcept { return damping_; }  // [1/s] of every mode in the next step

 private:
  Passivity passivity_;
  double slew_;                                    // [1/s] a tick
  double put_in_ = 0.0, paid_ = 0.0, tank_ = 0.0;  // [J]
  double taken_ = 0.0;                             // [J] in the last step
  double damping_ = 0.0;
};

}  // namespace ves
