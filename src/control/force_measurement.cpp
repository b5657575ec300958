// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/force_measurement.hpp"

#include <algorithm>
#include <cmath>

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

Mat6 wrenchPerCount(const ForceSensor& sensor, const Mat3& R_IP) noexcept {
  Mat6 out;
  for (int i = 0; i < 6; ++i)
    out.col(i) = rotate(R_IP, transfer(sensor.X_PS, Wrench::from(sensor.C_proc.col(i)))).stacked();
  return out;
}

void ChannelStatistics::add(const AdcCounts& adc, const Vec6& load) noexcept {
  // Welford: no sum of squares to cancel.
  const Vec6 x = wrenchCounts(adc) - load;
  const Vec6 before = x - mean_;
  mean_ += before / ++n_;
  m2_ += before.cwiseProduct(x - mean_);

  batch_sum_ += x;
  if (n_ % kBatchSize != 0) return;
  const Vec6 batch = batch_sum_ / kBatchSize;
  batch_sum_.setZero();
  const Vec6 batch_before = batch - batch_mean_;
  batch_mean_ += batch_before / (n_ / kBatchSize);
  batch_m2_ += batch_before.cwiseProduct(batch - batch_mean_);
}

Vec6 ChannelStatistics::deviation() const noexcept {
  if (n_ < 2) return Vec6::Zero();
  return (m2_ / (n_ - 1)).cwiseSqrt();
}

Vec6 ChannelStatistics::standardError() const noexcept {
  const int batches = n_ / kBatchSize;
  if (batches < 2) return Vec6::Zero();
  return (batch_m2_ / ((batches - 1) * batches)).cwiseSqrt();
}

Mat6 wrenchNoise(const ForceSensor& sensor, const SensorNoise& noise, const Mat3& R_IP) noexcept {
  const Mat6 J = wrenchPerCount(sensor, R_IP);
  const Vec6 variance = noise.correlation * noise.variance;
  const Mat6 right = variance.asDiagonal() * J.transpose();
  return J.lazyProduct(right);
}

double filteredCorrelation(const ServoModel& servo, double period) {
  if (!(servo.sensor_cutoff > 0.0)) return 1.0;
  // Autocorrelation behind the filter, of readings a time apart.
  const double a = servo.sensor_cutoff / M_SQRT2;
  const auto behind = [&](double apart) {
    const double x = a * std::abs(apart);
    return std::exp(-x) * (std::cos(x) + std::sin(x));
  };
  const int n = servo.sensor_readings;
  const auto ofSamples = [&](double apart) {
    double sum = 0.0;  // over pairs of readings, by how many lie between them
    for (int d = 1 - n; d < n; ++d)
      sum += (n - std::abs(d)) * behind(apart + d * servo.sensor_window / n);
    return sum;
  };
  constexpr double kForgotten = 20.0;  // [-] times 1/a
  double all = ofSamples(0.0);
  for (int k = 1; k * period < kForgotten / a; ++k) all += 2.0 * ofSamples(k * period);
  return all / ofSamples(0.0);
}

SensorNoise noiseOf(const ChannelStatistics& statistics) noexcept {
  SensorNoise out;
  out.variance = statistics.deviation().cwiseAbs2();
  const double once = out.variance.sum(), mean = statistics.standardError().squaredNorm();
  if (once > 0.0) out.correlation = std::max(1.0, kCalibrationSamples * mean / once);
  return out;
}

void Calibration::begin() noexcept {
  const StillnessLimits limits = limits_;
  *this = Calibration(limits);
  status_ = CalibrationStatus::kTaking;
}

void Calibration::add(const Sample& sample, const Vec6& load) noexcept {
  if (status_ != CalibrationStatus::kTaking) return;
  ++samples_;
  if (!has_first_) {
    first_ = sample;
    has_first_ = true;
  }
  if (!moved(sample)) statistics_.add(sample.adc, load);
  if (statistics_.complete()) {
    Eigen::Index worst = 0;
    const double most = statistics_.deviation().maxCoeff(&worst);
    Eigen::Index largest = 0;
    const double bias = statistics_.mean().cwiseAbs().maxCoeff(&largest);
    if (most <= limits_.deviation && bias <= limits_.bias) {
      status_ = CalibrationStatus::kDone;
      return;
    }
    if (most <= limits_.deviation)
      restart(StillnessViolation::kBias, static_cast<int>(largest), bias);
    else
      restart(StillnessViolation::kChannel, static_cast<int>(worst), most);
  }
  if (samples_ >= kPatience) status_ = CalibrationStatus::kRefused;
}

bool Calibration::moved(const Sample& sample) noexcept {
  for (std::size_t i = 0; i < kLegs; ++i) {
    const int change = std::abs(sample.legs[i] - first_.legs[i]);
    if (change > limits_.leg_counts) {
      restart(StillnessViolation::kLeg, static_cast<int>(i), change);
      return true;
    }
  }
  for (int i = 0; i < kMaxJoints; ++i) {
    const double change = std::abs(sample.q(i) - first_.q(i));
    if (!(change <= limits_.joint)) {
      restart(StillnessViolation::kJoint, i, change);
      return true;
    }
  }
  return false;
}

void Calibration::restart(StillnessViolation what, int index, double amount) noexcept {
  violation_ = what;
  violation_index_ = index;
  violation_amount_ = amount;
  statistics_.reset();
  has_first_ = false;
}

}  // namespace ves
