// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/servo.hpp"

#include <algorithm>
#include <cmath>

namespace ves {

Vec6 feedForward(const ServoModel& servo, const LegMotion& legs, double lead, double period,
                 double share) noexcept {
  Vec6 reference;
  for (int i = 0; i < kLegs; ++i) {
    // The command's middle, half an update until a LegSlave looks, half an update's hold.
    const double D = 0.5 * period + servo.delay(i) + servo.update - lead;
    const double A = D - servo.reading_age - 0.5 * servo.update;
    const double v = legs.L_dot(i) + D * legs.L_ddot(i);
    const double v_end = v + servo.tau(i) * legs.L_ddot(i);
    const double E = v_end / (v_end > 0.0 ? servo.extend(i) : servo.retract(i));
    const double ahead = A * (legs.L_dot(i) + 0.5 * A * legs.L_ddot(i)) + servo.derivative * v;
    reference(i) = legs.L(i) + share * (ahead + std::clamp(E, -servo.rail, servo.rail));
  }
  return reference;
}

ServoObserver::ServoObserver(const ServoModel& servo, double period, double phase)
    : servo_(servo),
      period_(period),
      to_update_(phase * servo.update),
      filter_(servo.sensor_cutoff),
      whole_(passage(servo.update)) {}

ServoObserver::Passage ServoObserver::passage(double dt) const noexcept {
  return {dt, (-dt / servo_.tau.array()).exp(), filter_.prepare(dt)};
}

void ServoObserver::reset(const Vec6& L) noexcept {
  L_ = reference_ = L;
  v_.setZero();
  v_end_.setZero();
  filter_.settle(Channels::Zero());
}

void ServoObserver::advance(const Vec6& reference) noexcept {
  double left = period_;
  bool first = true;
  while (to_update_ <= left) {
    if (to_update_ > 0.0) pass(first ? passage(to_update_) : whole_);
    first = false;
    left -= to_update_;
    to_update_ = servo_.update;
    Vec6 arrived;
    for (int i = 0; i < kLegs; ++i)
      arrived(i) = period_ - left >= servo_.delay(i) ? reference(i) : reference_(i);
    update(arrived);
  }
  if (left > 0.0) pass(passage(left));
  to_update_ -= left;
  reference_ = reference;
}

/// All LegSlaves compare.
void ServoObserver::update(const Vec6& reference) noexcept {
  for (int i = 0; i < kLegs; ++i) {
    const double X = reading(i, L_(i), v_(i));
    const double E =
        std::clamp(reference(i) - X - servo_.derivative * v_(i), -servo_.rail, servo_.rail);
    v_end_(i) = (E > 0.0 ? servo_.extend(i) : servo_.retract(i)) * E;
  }
}

void ServoObserver::pass(const Passage& passage) noexcept {
  const Channels excess = v_.array() - v_end_.array();
  const Channels v = v_end_.array() + excess * passage.decay;
  L_.array() += v_end_.array() * passage.dt + excess * servo_.tau.array() * (1.0 - passage.decay);
  const Channels acceleration = (v - v_.array()) / passage.dt;  // mean
  filter_.jump(acceleration);
  filter_.advance(passage.filter, acceleration);
  v_ = v.matrix();
}

void ServoObserver::correct(const Vec6& L) noexcept {
  const Vec6 slack = 0.5 * servo_.readings.scale + servo_.jitter * v_.cwiseAbs();
  L_ = L_.cwiseMax(L - slack).cwiseMin(L + slack);
}

/// Mean of a LegSlave's two readings, each to the nearest count.
double ServoObserver::reading(int leg, double L, double v) const noexcept {
  const double offset = servo_.readings.offset(leg), scale = servo_.readings.scale(leg);
  const auto count = [&](double length) { return std::floor((length - offset) / scale + 0.5); };
  return offset + 0.5 * scale * (count(L) + count(L - 2.0 * servo_.reading_age * v));
}

Vec6 ServoObserver::rounding(const Vec6& L_dot) const noexcept {
  Vec6 sum = Vec6::Zero();
  int updates = 0;
  for (double t = to_update_; t < period_; t += servo_.update, ++updates)
    for (int i = 0; i < kLegs; ++i) {
      const double v = L_dot(i), L = L_(i) + t * v;
      sum(i) += reading(i, L, v) - (L - servo_.reading_age * v);
    }
  return sum / std::max(1, updates);
}

}  // namespace ves
