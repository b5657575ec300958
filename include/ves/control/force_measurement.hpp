// SPDX-License-Identifier: BSD-3-Clause
//
// Force measurement (Appendix C): A/D counts to the wrench on the platform.
#pragma once

#include "ves/control/sample.hpp"

namespace ves {

struct ForceSensor {
  Mat6 C_proc =
      Mat6::Identity();  // [N | N m per count] inverse of S_proc (2.6), crosstalk included
  Transform X_PS;        // 180 degrees about x, and the sensor's height
};

/// The wrench {W_s} = C_proc ({V_R} - bias), (C.1).
Wrench sensorWrench(const ForceSensor& sensor, const Vec6& bias, const AdcCounts& adc) noexcept;

/// F_Po_I: bias removed, crosstalk undone, {S} to {P}, turned to inertial axes.
Wrench forceMeasurement(const ForceSensor& sensor, const Vec6& bias, const AdcCounts& adc,
                        const Mat3& R_IP) noexcept;

/// The calibration routine (report, 2.3): mean and standard deviation of each channel over a number
/// of samples taken at rest.
class Calibration {
 public:
  static constexpr int kSamples = 100;  // [-] per channel

  /// `load` is what the static load alone would read: taken out, so that a known robot may be
  /// aboard.
  void add(const AdcCounts& adc, const Vec6& load) noexcept;
  void reset() noexcept { *this = Calibration(); }

  bool complete() const noexcept { return n_ >= kSamples; }
  const Vec6& mean() const noexcept { return mean_; }  // [count] the bias
  Vec6 deviation() const noexcept;                     // [count] sample standard deviation

 private:
  int n_ = 0;
  Vec6 mean_ = Vec6::Zero();
  Vec6 m2_ = Vec6::Zero();  // sum of squared differences from the mean
};

}  // namespace ves
