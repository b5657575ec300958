// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/force_measurement.hpp"

namespace ves {
namespace {

Vec6 wrenchCounts(const AdcCounts& adc) {
  Vec6 counts;
  for (int i = 0; i < kWrenchChannels; ++i) counts(i) = adc[static_cast<std::size_t>(i)];
  return counts;
}

}  // namespace

Wrench sensorWrench(const ForceSensor& sensor, const Vec6& bias, const AdcCounts& adc) noexcept {
  return Wrench::from(sensor.C_proc * (wrenchCounts(adc) - bias));
}

Wrench forceMeasurement(const ForceSensor& sensor, const Vec6& bias, const AdcCounts& adc,
                        const Mat3& R_IP) noexcept {
  const Wrench F_So_S = sensorWrench(sensor, bias, adc);
  const Wrench F_Po_P = transfer(sensor.X_PS, F_So_S);
  return rotate(R_IP, F_Po_P);
}

void Calibration::add(const AdcCounts& adc, const Vec6& load) noexcept {
  // Welford: no sum of squares to cancel.
  const Vec6 x = wrenchCounts(adc) - load;
  const Vec6 before = x - mean_;
  mean_ += before / ++n_;
  m2_ += before.cwiseProduct(x - mean_);
}

Vec6 Calibration::deviation() const noexcept {
  if (n_ < 2) return Vec6::Zero();
  return (m2_ / (n_ - 1)).cwiseSqrt();
}

}  // namespace ves
