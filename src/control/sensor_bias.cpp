// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/sensor_bias.hpp"

namespace ves {

void Tare::begin() noexcept {
  state_ = State::kAveraging;
  statistics_.reset();
}

void Tare::cancel(Vec6& bias) noexcept {
  if (state_ == State::kRamping) bias = before_;
  state_ = State::kNone;
}

void Tare::step(const Sample& sample, bool fresh, const Vec6& static_counts, Vec6& bias) noexcept {
  switch (state_) {
    case State::kNone: return;
    case State::kAveraging: {
      if (!fresh || !sample.q.allFinite()) return;
      statistics_.add(sample.adc, static_counts);
      if (!statistics_.complete()) return;
      if (!(statistics_.mean().cwiseAbs().maxCoeff() <= limit_)) {
        state_ = State::kNone;  // no stray voltage: a load, or a fault
        return;
      }
      before_ = bias;
      PathPoint<6> from;
      from.x = bias;
      path_ = Quintic<6>(from, statistics_.mean(), ramp_);
      n_ = 0;
      state_ = State::kRamping;
      return;
    }
    case State::kRamping:
      const double t = static_cast<double>(++n_) * period_;
      bias = path_.at(t).x;
      if (t >= ramp_) state_ = State::kNone;
  }
}

void SensorBias::calibrate(const Sample& sample, bool fresh, const Vec6& static_counts) noexcept {
  if (fresh) calibration_.add(sample, static_counts);
  if (calibration_.status() != CalibrationStatus::kDone) return;
  calibrated_ = true;
  found_ = calibration_.statistics().mean();
  learnt_.setZero();
  deviation_ = calibration_.statistics().deviation();
  standard_error_ = calibration_.statistics().standardError();
  noise_ = noiseOf(calibration_.statistics());
}

}  // namespace ves
