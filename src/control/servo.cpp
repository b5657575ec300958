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
      period_(std::llround(period * 1e9)),
      between_(period_ / 16),
      to_update_(phase * servo.update),
      filter_(servo.sensor_cutoff),
      whole_(passage(servo.update)) {}

ServoObserver::Passage ServoObserver::passage(double dt) const noexcept {
  return {dt, (-dt / servo_.tau.array()).exp(), filter_.prepare(dt)};
}

void ServoObserver::reset(const Vec6& L, std::int64_t time) noexcept {
  L_ = L;
  v_.setZero();
  v_end_.setZero();
  filter_.settle(Channels::Zero());
  now_ = time;
  sent_ = remembered_ = 0;
  send(L, -1, time - period_);
  remember();
}

void ServoObserver::send(const Vec6& reference, std::int64_t tick, std::int64_t time) noexcept {
  commands_[sent_++ % kCommands] = {tick, time, reference};
}

void ServoObserver::arrived(std::int64_t tick, std::int64_t time) noexcept {
  constexpr std::int64_t kMostPeriods = 5;  // [-] on the way; what says more is not about ours
  for (std::size_t i = 1; i <= std::min(sent_, kCommands); ++i) {
    Command& command = commands_[(sent_ - i) % kCommands];
    if (command.tick != tick) continue;
    if (std::abs(time - command.time) < kMostPeriods * period_) command.time = time;
    return;
  }
}

void ServoObserver::advance(std::int64_t time) noexcept {
  constexpr std::int64_t kMostPeriods = 10;  // [-]
  if (time <= now_) return;
  now_ = std::max(now_, time - kMostPeriods * period_);
  double left = static_cast<double>(time - now_) * kSecondPerNanosecond;
  bool first = true;
  while (to_update_ <= left) {
    if (to_update_ > 0.0) pass(first ? passage(to_update_) : whole_);
    first = false;
    left -= to_update_;
    to_update_ = servo_.update;
    now_ = time - std::llround(left * 1e9);
    if (now_ - past_[(remembered_ - 1) % kInstants].time >= between_) remember();
    update();
  }
  if (left > 0.0) pass(passage(left));
  to_update_ -= left;
  now_ = time;
  remember();
}

/// [m] of the newest command that has taken effect.
double ServoObserver::reference(int leg) const noexcept {
  const auto delay = std::llround(servo_.delay(leg) * 1e9);
  const std::size_t known = std::min(sent_, kCommands);
  for (std::size_t i = 1; i < known; ++i) {
    const Command& command = commands_[(sent_ - i) % kCommands];
    if (command.time + delay <= now_) return command.reference(leg);
  }
  return commands_[(sent_ - known) % kCommands].reference(leg);
}

void ServoObserver::remember() noexcept {
  const double w = servo_.sensor_cutoff;
  const Channels a = filter_.output(), a_rate = filter_.rate();
  past_[remembered_++ % kInstants] = {
      now_,           L_, v_, v_ - ((a_rate + M_SQRT2 * w * a) / (w * w)).matrix(), a.matrix(),
      a_rate.matrix()};
}

/// Between two instants by cubic Hermite polynomials, the acceleration's rate by a line; outside
/// them the oldest or the newest.
ServoObserver::Instant ServoObserver::at(std::int64_t time) const noexcept {
  const Instant* later = &past_[(remembered_ - 1) % kInstants];
  for (std::size_t i = 1; i <= std::min(remembered_, kInstants); ++i) {
    const Instant& earlier = past_[(remembered_ - i) % kInstants];
    if (earlier.time > time) {
      later = &earlier;
      continue;
    }
    if (earlier.time == time || later->time <= time) return earlier;
    const double h = static_cast<double>(later->time - earlier.time) * kSecondPerNanosecond,
                 s = static_cast<double>(time - earlier.time) * kSecondPerNanosecond / h;
    const auto between = [&](Vec6 Instant::*y, Vec6 Instant::*rate) -> Vec6 {
      return (1.0 - s) * (1.0 - s) * ((1.0 + 2.0 * s) * earlier.*y + h * s * earlier.*rate) +
             s * s * ((3.0 - 2.0 * s) * later->*y - h * (1.0 - s) * later->*rate);
    };
    Instant out;
    out.time = time;
    out.L = between(&Instant::L, &Instant::v);
    out.filtered_v = between(&Instant::filtered_v, &Instant::filtered_a);
    out.filtered_a = between(&Instant::filtered_a, &Instant::filtered_a_rate);
    out.filtered_a_rate = (1.0 - s) * earlier.filtered_a_rate + s * later->filtered_a_rate;
    return out;
  }
  return *later;
}

Vec6 ServoObserver::filteredAcceleration(std::int64_t time) const noexcept {
  const Instant end = at(time);
  const double window = servo_.sensor_window, delay = servo_.sensor_delay;
  if (!(window > 0.0)) return end.filtered_a - delay * end.filtered_a_rate;
  const Instant begin = at(time - std::llround(window * 1e9));
  return (end.filtered_v - begin.filtered_v - delay * (end.filtered_a - begin.filtered_a)) / window;
}

/// All LegSlaves compare.
void ServoObserver::update() noexcept {
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

void ServoObserver::correct(const Vec6& L, std::int64_t time) noexcept {
  const Instant then = at(time);
  const Vec6 slack = 0.5 * servo_.readings.scale + servo_.jitter * then.v.cwiseAbs();
  const Vec6 change = then.L.cwiseMax(L - slack).cwiseMin(L + slack) - then.L;
  L_ += change;
  for (std::size_t i = 1; i <= std::min(remembered_, kInstants); ++i) {
    Instant& one = past_[(remembered_ - i) % kInstants];
    if (one.time < time) break;
    one.L += change;
  }
}

/// Mean of a LegSlave's two readings, each to the nearest count.
double ServoObserver::reading(int leg, double L, double v) const noexcept {
  const double offset = servo_.readings.offset(leg), scale = servo_.readings.scale(leg);
  const auto count = [&](double length) { return std::floor((length - offset) / scale + 0.5); };
  return offset + 0.5 * scale * (count(L) + count(L - 2.0 * servo_.reading_age * v));
}

Vec6 ServoObserver::rounding(const Vec6& L_dot, double later) const noexcept {
  const double period = static_cast<double>(period_) * kSecondPerNanosecond;
  const Vec6 L_then = L_ + later * v_;
  const double first =
      to_update_ + std::max(0.0, std::ceil((later - to_update_) / servo_.update)) * servo_.update -
      later;
  Vec6 sum = Vec6::Zero();
  int updates = 0;
  for (double t = first; t < period; t += servo_.update, ++updates)
    for (int i = 0; i < kLegs; ++i) {
      const double v = L_dot(i), L = L_then(i) + t * v;
      sum(i) += reading(i, L, v) - (L - servo_.reading_age * v);
    }
  return sum / std::max(1, updates);
}

}  // namespace ves
