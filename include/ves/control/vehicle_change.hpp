// SPDX-License-Identifier: BSD-3-Clause
//
// Another mass, damping and stiffness for the vehicle while it is emulated, without giving energy.
//
// With H = m |eta'|^2 / 2 + k eta^T K eta / 2 a change at the place and speed of the moment puts
// in dH = dm |eta'|^2 / 2 + dk eta^T K eta / 2. The change goes along the straight line from the
// factors in use to those ordered, and only so far as damping has taken out before what it puts
// in: the sum of all dH less what was taken is never above zero. A vehicle that swings pays within
// its swing; one that rests under a load waits where stiffening would lift the load.
#pragma once

#include "ves/vehicle/admittance_model.hpp"

namespace ves {

class VehicleChange {
 public:
  /// `damping` [1/s] of every mode, at most.
  VehicleChange(double period, double damping) noexcept;

  /// What was ordered last.
  const VehicleFactors& target() const noexcept { return to_; }
  /// What an order leads to; what it leaves stays as it was ordered last.
  VehicleFactors ordered(const VehicleOrder& order) const noexcept;
  /// From the model's factors.
  void begin(const VehicleOrder& order, const AdmittanceModel& model) noexcept;
  /// All of it at once, while nothing is emulated.
  void finish(AdmittanceModel& model) noexcept;

  /// Before each step of the model.
  void advance(AdmittanceModel& model) noexcept;
  /// [J] that damping() took in that step.
  void pay(double taken) noexcept { energy_ -= taken; }

  double damping() const noexcept { return damping_; }  // [1/s] of every mode in the next step
  /// [J] that this change has put in, less what was taken for it.
  double energy() const noexcept { return energy_; }

 private:
  VehicleFactors at(double share) const noexcept;

  double period_;        // [s]
  double most_damping_;  // [1/s]
  double slew_;          // [1/s] a tick
  VehicleFactors from_, to_;
  double rate_ = 0.0;  // [-] of the way in a period, as ordered
  double due_ = 1.0;   // [-] of the way, by time
  double gone_ = 1.0;  // [-] of the way
  double energy_ = 0.0;
  double damping_ = 0.0;
};

}  // namespace ves
