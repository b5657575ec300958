// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/force_torque_sensor.hpp"

#include <algorithm>
#include <cmath>

#include "ves/math/dense.hpp"

namespace ves::plant {

ForceTorqueSensor::ForceTorqueSensor(const ForceTorqueSensorModel& model, Noise noise) noexcept
    : model_(model),
      volts_per_newton_(model.S_proc() * model.volts_per_count),
      newtons_per_volt_(inverse(volts_per_newton_)),
      noise_gain_((model.gain.cwiseProduct(model.noise)).array()),
      noisy_(!model.noise.isZero(0.0)),
      filter_(model.cutoff),
      noise_(std::move(noise)) {}

void ForceTorqueSensor::settle(const Wrench& F_So_S) noexcept {
  filter_.settle((volts_per_newton_ * F_So_S.stacked()).array());
}

void ForceTorqueSensor::advance(const Step& step, const Wrench& F_So_S, Over over) noexcept {
  const Channels volts = (volts_per_newton_ * F_So_S.stacked()).array();
  if (over == Over::kConstant) filter_.jump(volts);
  Channels held = Channels::Zero();
  if (noisy_) {
    // White noise of two-sided density noise^2/2, held over the step.
    const double root = 1.0 / std::sqrt(2.0 * step.dt);
    for (int i = 0; i < kWrenchChannels; ++i) held(i) = noise_gain_(i) * root * noise_.normal();
  }
  filter_.advance(step, volts, held);
}

Wrench ForceTorqueSensor::reading(double warmer) const noexcept {
  const Vec6 volts = filter_.output().matrix() + model_.bias + model_.drift * warmer;
  return Wrench::from(newtons_per_volt_ * volts);
}

AdcCounts ForceTorqueSensor::convert(double warmer) const noexcept {
  const auto count = [this](double volts) {
    return static_cast<std::int32_t>(
        std::lround(std::clamp(volts / model_.volts_per_count, -32768.0, 32767.0)));
  };
  AdcCounts adc{};
  for (int i = 0; i < kWrenchChannels; ++i)
    adc[static_cast<std::size_t>(i)] =
        count(filter_.output()(i) + model_.bias(i) + model_.drift(i) * warmer);
  adc[kWrenchChannels] = count(model_.pressure);
  return adc;
}

}  // namespace ves::plant
