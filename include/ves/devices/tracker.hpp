// SPDX-License-Identifier: BSD-3-Clause
//
// Position, velocity and acceleration of what is only read as positions: external legs and joints
// that a simulated robot or sensor has to follow.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <Eigen/Core>

namespace ves::devices {

/// Fading-memory polynomial filter of second degree (N. Morrison, Introduction to Sequential
/// Smoothing and Prediction, 1969, ch. 13): no lag while the acceleration is constant. Its memory
/// fades with exp(-bandwidth t).
template <int N>
class Tracker {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;
  struct Motion {
    Vector x, v, a;
  };

  explicit Tracker(double bandwidth) : bandwidth_(bandwidth) {}  // [1/s]

  /// A reading at `time` [ns]. An older one than the last is none; the first, and one after a pause
  /// of a second, are at rest.
  void take(const Vector& x, std::int64_t time) noexcept {
    constexpr std::int64_t kPause = 1'000'000'000;  // [ns]
    if (known_ && time <= time_) return;
    const bool rest = !known_ || time - time_ > kPause;
    const double dt = static_cast<double>(time - time_) * 1e-9;
    if (rest) {
      state_ = {x, Vector::Zero(), Vector::Zero()};
    } else {
      state_ = ahead(dt);
      const double theta = std::exp(-bandwidth_ * dt), fresh = 1.0 - theta;
      const Vector r = x - state_.x;
      state_.x += (1.0 - theta * theta * theta) * r;
      state_.v += 1.5 * fresh * fresh * (1.0 + theta) / dt * r;
      state_.a += fresh * fresh * fresh / (dt * dt) * r;
    }
    known_ = true;
    time_ = time;
  }

  bool known() const noexcept { return known_; }
  /// At `time` [ns], extrapolated over at most three memories: what is silent comes to rest.
  Motion at(std::int64_t time) const noexcept {
    const double dt = static_cast<double>(std::max<std::int64_t>(0, time - time_)) * 1e-9;
    const double most = 3.0 / bandwidth_;
    if (dt <= most) return ahead(dt);
    return {ahead(most).x, Vector::Zero(), Vector::Zero()};
  }

 private:
  Motion ahead(double dt) const noexcept {
    return {state_.x + dt * state_.v + 0.5 * dt * dt * state_.a, state_.v + dt * state_.a,
            state_.a};
  }

  double bandwidth_;  // [1/s]
  bool known_ = false;
  std::int64_t time_ = 0;  // [ns]
  Motion state_{Vector::Zero(), Vector::Zero(), Vector::Zero()};
};

}  // namespace ves::devices
