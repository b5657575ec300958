// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/port_work.hpp"

#include <algorithm>
#include <cmath>

namespace ves {

PortWork::PortWork(const ControllerConfig& config) noexcept : geometry_(config.geometry) {
  constexpr std::int64_t kMostPeriods = 3;  // [-] the servo model remembers no more
  const ServoModel& servo = config.servo;
  const double w = servo.sensor_cutoff, window = servo.sensor_window;
  late_ = std::llround((0.5 * window + servo.sensor_delay) * 1e9);
  longest_ = kMostPeriods * config.period;
  slope_ = M_SQRT2 / w;
  curvature_ = 1.0 / (w * w) - window * window / 24.0;
}

PortWork::Work PortWork::take(const Wrench& F_Po_I, std::int64_t time, const Transform& X_IP,
                              const ServoObserver& servo) noexcept {
  const std::int64_t middle = time - late_, since = middle - last_[3].time;
  if (known_ > 0 && since <= 0) return {};
  if (since > longest_) known_ = 0;
  std::rotate(last_.begin(), last_.begin() + 1, last_.end());
  last_[3] = {middle, F_Po_I.stacked()};
  known_ = std::min(known_ + 1, kReadings);
  const Motions before = moments_;
  moments_ = servo.moments(last_[2].time, last_[3].time);
  if (known_ < 3 || !platformMotions(geometry_, X_IP, moments_)) {
    moments_.setZero();
    return {};
  }

  Work out;
  const Polynomial newest = parabola(2);
  out.newest = work(newest, moments_);
  if (known_ < kReadings) return out;
  Polynomial S = parabola(1);
  const double T_0 = seconds(0, 1), T_1 = seconds(1, 2);
  const Vec6 third = (newest.col(2) - S.col(2)) / seconds(0, 3);
  S.col(1) -= T_0 * T_1 * third;
  S.col(2) += (T_0 - T_1) * third;
  S.col(3) = third;
  out.settled = work(S, before);
  return out;
}

double PortWork::seconds(int from, int to) const noexcept {
  const auto at = [this](int i) { return last_[static_cast<std::size_t>(i)].time; };
  return static_cast<double>(at(to) - at(from)) * kSecondPerNanosecond;
}

/// Through `middle`, where t is 0, and its neighbours.
PortWork::Polynomial PortWork::parabola(int middle) const noexcept {
  const auto F = [this](int i) -> const Vec6& { return last_[static_cast<std::size_t>(i)].F; };
  const double T_0 = seconds(middle - 1, middle), T_1 = seconds(middle, middle + 1);
  const Vec6 rate_0 = (F(middle) - F(middle - 1)) / T_0, rate_1 = (F(middle + 1) - F(middle)) / T_1,
             second = (rate_1 - rate_0) / (T_0 + T_1);
  Polynomial out;
  out << F(middle), rate_1 - T_1 * second, second, Vec6::Zero();
  return out;
}

/// Of S + slope S' + curvature S''.
double PortWork::work(const Polynomial& S, const Motions& moments) const noexcept {
  Polynomial F = S;
  F.leftCols<3>() += slope_ * S.rightCols<3>() * Vec3(1.0, 2.0, 3.0).asDiagonal();
  F.leftCols<2>() += curvature_ * S.rightCols<2>() * Eigen::Vector2d(2.0, 6.0).asDiagonal();
  return F.cwiseProduct(moments).sum();
}

}  // namespace ves
