// SPDX-License-Identifier: BSD-3-Clause
//
// Force measurement (Appendix C): A/D counts to the wrench on the platform.
#pragma once

#include "ves/contract/tick_state.hpp"
#include "ves/control/program.hpp"
#include "ves/control/servo.hpp"

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
/// [N | N m per count] F_Po_I = this (counts - bias).
Mat6 wrenchPerCount(const ForceSensor& sensor, const Mat3& R_IP) noexcept;

/// How much may change while the machine counts as still.
struct StillnessLimits {
  int leg_counts = 0;      // [count] of a leg's reading
  double joint = 0.0;      // [rad | m] of the robot
  double deviation = 0.0;  // [count] standard deviation of a wrench channel
  double bias = 0.0;       // [count] largest that can be a stray voltage; more is an unknown load
};

/// Mean, standard deviation and standard error of the six wrench channels over kCalibrationSamples.
class ChannelStatistics {
 public:
  /// `load` is what the known static load alone would read: taken out.
  void add(const AdcCounts& adc, const Vec6& load) noexcept;
  void reset() noexcept { *this = ChannelStatistics(); }

  bool complete() const noexcept { return n_ >= kCalibrationSamples; }
  const Vec6& mean() const noexcept { return mean_; }  // [count]
  Vec6 deviation() const noexcept;                     // [count] of one sample
  /// [count] of the mean, from the spread of the means of kBatches batches: successive samples
  /// behind a 20 Hz filter are not independent, their batches nearly are.
  Vec6 standardError() const noexcept;

 private:
  static constexpr int kBatches = 10;
  static constexpr int kBatchSize = kCalibrationSamples / kBatches;

  int n_ = 0;
  Vec6 mean_ = Vec6::Zero();
  Vec6 m2_ = Vec6::Zero();  // sum of squared differences from the mean
  Vec6 batch_sum_ = Vec6::Zero();
  Vec6 batch_mean_ = Vec6::Zero();  // of the batches
  Vec6 batch_m2_ = Vec6::Zero();
};

/// Of the six channels, which have the same filter.
struct SensorNoise {
  Vec6 variance = Vec6::Zero();  // [count^2] of one sample
  /// [-] By how much less a mean tells than of independent samples: behind the filter they are not
  /// quite.
  double correlation = 1.0;

  /// [count^2] Of the mean of n samples in a row.
  Vec6 ofMean(int n) const noexcept { return (n > 1 ? correlation / n : 1.0) * variance; }
};
/// SensorNoise::correlation of noise that is white ahead of the sensor's filter, samples a period
/// [s] apart.
double filteredCorrelation(const ServoModel& servo, double period);
/// [N^2 | N^2 m | N^2 m^2] Covariance of F_Po_I, a sample's part in a mean over many.
Mat6 wrenchNoise(const ForceSensor& sensor, const SensorNoise& noise, const Mat3& R_IP) noexcept;
/// As a calibration found it.
SensorNoise noiseOf(const ChannelStatistics& statistics) noexcept;

/// The calibration routine (report, 2.3): the bias of each channel over 100 samples at rest. Starts
/// again whenever something moves, and gives up after kPatience samples.
class Calibration {
 public:
  static constexpr int kPatience = 5 * kCalibrationSamples;  // [-] samples

  explicit Calibration(const StillnessLimits& limits) : limits_(limits) {}

  void begin() noexcept;
  void add(const Sample& sample, const Vec6& load) noexcept;

  CalibrationStatus status() const noexcept { return status_; }
  const ChannelStatistics& statistics() const noexcept { return statistics_; }
  /// Of the last movement seen: what, which (from 0), and how much [count | rad | m].
  StillnessViolation violation() const noexcept { return violation_; }
  int violationIndex() const noexcept { return violation_index_; }
  double violationAmount() const noexcept { return violation_amount_; }

 private:
  void restart(StillnessViolation what, int index, double amount) noexcept;
  bool moved(const Sample& sample) noexcept;

  StillnessLimits limits_;
  CalibrationStatus status_ = CalibrationStatus::kNone;
  int samples_ = 0;  // [-] since begin()
  bool has_first_ = false;
  Sample first_;
  ChannelStatistics statistics_;
  StillnessViolation violation_ = StillnessViolation::kNone;
  int violation_index_ = 0;
  double violation_amount_ = 0.0;
};

}  // namespace ves
