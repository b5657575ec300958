// SPDX-License-Identifier: BSD-3-Clause
//
// The books of the port between robot and platform: what the emulation has put into them, and how
// the passivity controller takes it back.
//
// An ideal base takes the work that the robot does on it, F^T x', where the platform is. This one
// takes F^T x' of its model; the robot, the contact at its tool and what it pushes feel the
// platform, which is late. What the two differ in, nobody has done: the emulation has put it in.
// The wrench is behind the sensor's filter; its work is counted along ServoObserver::workLength().
//
// The tank is De Stefano, Balachandran and Secchi's (IEEE T-RO 36(1), 2020): filled to its reserve
// at most, it is emptied by what is put in; below zero the model's modes are damped, all alike,
// until they have paid. The damping acts on the model and grows and fades over several ticks, so
// that the command stays smooth.
#pragma once

#include "ves/control/controller_config.hpp"

namespace ves {

class EnergyAccount {
 public:
  explicit EnergyAccount(const ControllerConfig& config) noexcept;

  void reset() noexcept;

  /// One step of admittance control: the work of F_Po_I since the step before is along the way from
  /// the last work_place [m, rad] to this one (ServoObserver::workLength()); `taken` [J] is what
  /// the model took of it, `paid` [J] what damping took of the model, `kinetic` [J] what is in its
  /// motion.
  void take(const Wrench& F_Po_I, const Vec6& work_place, double taken, double paid,
            double kinetic) noexcept;

  double putIn() const noexcept { return put_in_; }     // [J] since the beginning, paid or not
  double paid() const noexcept { return paid_; }        // [J]
  double damping() const noexcept { return damping_; }  // [1/s] of every mode in the next step

 private:
  Passivity passivity_;
  bool averages_;  // a wrench is a mean since the one before, not a reading
  double slew_;    // [1/s] a tick
  double put_in_ = 0.0, paid_ = 0.0, tank_ = 0.0;  // [J]
  double damping_ = 0.0;
  bool known_ = false;  // of the step before:
  Vec6 F_ = Vec6::Zero(), work_place_ = Vec6::Zero();
};

}  // namespace ves
