// SPDX-License-Identifier: BSD-3-Clause
//
// The bias of the force-torque sensor: from the configuration, by a calibration (report, 2.3), or
// by a tare while things run.
#pragma once

#include "ves/control/controller_config.hpp"
#include "ves/math/quintic.hpp"

namespace ves {

/// The bias slides to what the sensor reads beyond the static load, on average: the admittance
/// model never sees a step.
class Tare {
 public:
  Tare(double ramp, double period, double limit) : ramp_(ramp), period_(period), limit_(limit) {}

  void begin() noexcept;
  /// `bias` is what it was before.
  void cancel(Vec6& bias) noexcept;
  bool running() const noexcept { return state_ != State::kNone; }

  /// A tick: `static_counts` [count] is what the static load alone would read. Changes `bias`.
  void step(const Sample& sample, bool fresh, const Vec6& static_counts, Vec6& bias) noexcept;

 private:
  enum class State { kNone, kAveraging, kRamping };

  double ramp_;    // [s]
  double period_;  // [s]
  double limit_;   // [count] of a bias; more is a load, or a fault
  State state_ = State::kNone;
  ChannelStatistics statistics_;
  Vec6 before_ = Vec6::Zero();  // [count] the bias
  Quintic<6> path_;             // [count]
  std::int64_t n_ = 0;          // [-] ticks since the ramp began
};

class SensorBias {
 public:
  explicit SensorBias(const ControllerConfig& config)
      : tare_(config.tare_ramp, config.periodSeconds(), config.stillness.bias),
        calibration_(config.stillness),
        found_(config.bias) {}

  void beginTare() noexcept {
    found_ += learnt_;
    learnt_.setZero();
    tare_.begin();
  }
  void cancelTare() noexcept { tare_.cancel(found_); }
  bool taring() const noexcept { return tare_.running(); }
  void stepTare(const Sample& sample, bool fresh, const Vec6& static_counts) noexcept {
    tare_.step(sample, fresh, static_counts, found_);
  }

  /// A tare that is under way is given up: it would slide away from what is found.
  void beginCalibration() noexcept {
    cancelTare();
    calibration_.begin();
  }
  void calibrate(const Sample& sample, bool fresh, const Vec6& static_counts) noexcept;

  /// [count] beyond found(), by what the measurement shows of it; not during a tare.
  void learn(const Vec6& bias) noexcept {
    if (!taring()) learnt_ = bias;
  }

  Vec6 counts() const noexcept { return found_ + learnt_; }  // [count]
  const Vec6& found() const noexcept { return found_; }      // [count] by calibration and tare
  const Vec6& learnt() const noexcept { return learnt_; }    // [count] besides
  const Calibration& calibration() const noexcept { return calibration_; }
  bool calibrated() const noexcept { return calibrated_; }  // once at least
  /// Of the last calibration that succeeded. [count]
  const SensorNoise& noise() const noexcept { return noise_; }
  const Vec6& deviation() const noexcept { return deviation_; }
  const Vec6& standardError() const noexcept { return standard_error_; }

 private:
  Tare tare_;
  Calibration calibration_;
  Vec6 found_, learnt_ = Vec6::Zero();
  bool calibrated_ = false;
  SensorNoise noise_;
  Vec6 deviation_ = Vec6::Zero(), standard_error_ = Vec6::Zero();
};

}  // namespace ves
