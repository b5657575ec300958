// SPDX-License-Identifier: BSD-3-Clause
//
// Force-torque sensor, strain-gage conditioner and A/D converter (report, section 2.2, figure 2.9).
#pragma once

#include "ves/contract/sample.hpp"
#include "ves/math/butterworth.hpp"
#include "ves/plant/noise.hpp"

namespace ves::plant {

struct ForceTorqueSensorModel {
  Mat6 S = Mat6::Zero();         // [V/(V N) | V/(V N m)] sensitivity, crosstalk included, (2.4)
  double excitation = 10.0;      // [V] V_ex
  Vec6 gain = Vec6::Ones();      // [-] A_i of the conditioner
  Vec6 bias = Vec6::Zero();      // [V] stray voltage at the converter
  Vec6 noise = Vec6::Zero();     // [V/sqrt(Hz)] white, at the conditioner's input
  double cutoff = 0.0;           // [rad/s] of the two-pole Butterworth filter
  double volts_per_count = 0.0;  // [V/count] K_ad; the report prints 305 mV for 0.305 mV
  double pressure = 0.0;         // [V] hydraulic pressure, seventh channel
  Vec6 drift = Vec6::Zero();     // [V/C] of the bias with the laboratory's temperature

  /// [count/N | count/(N m)] S_proc of (2.6).
  Mat6 S_proc() const { return (gain * (excitation / volts_per_count)).asDiagonal() * S; }
};

class ForceTorqueSensor {
 public:
  ForceTorqueSensor(const ForceTorqueSensorModel& model, Noise noise) noexcept;

  using Step = Butterworth2<kWrenchChannels>::Step;
  Step prepare(double dt) const noexcept { return filter_.prepare(dt); }

  /// As after a long time under the wrench.
  void settle(const Wrench& F_So_S) noexcept;

  /// The wrench runs from its last value to F_So_S over the step, or is F_So_S all along; noise on
  /// top.
  enum class Over { kRamp, kConstant };
  void advance(const Step& step, const Wrench& F_So_S, Over over) noexcept;

  /// F_So_S that the converter's input stands for, `warmer` [C] than when the bias was named:
  /// filtered, with noise and stray voltage, before it is rounded to counts.
  Wrench reading(double warmer) const noexcept;

  /// Sixteen bits, saturating, of all seven channels, `warmer` [C] than when the bias was named.
  AdcCounts convert(double warmer) const noexcept;

 private:
  using Channels = Butterworth2<kWrenchChannels>::Channels;

  ForceTorqueSensorModel model_;
  Mat6 volts_per_newton_;  // [V/N | V/(N m)] bridge and amplifier
  Mat6 newtons_per_volt_;
  Channels noise_gain_;  // [V/sqrt(Hz)] after the amplifier
  bool noisy_;
  Butterworth2<kWrenchChannels> filter_;
  Noise noise_;
};

}  // namespace ves::plant
