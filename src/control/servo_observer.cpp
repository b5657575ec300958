// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/servo_observer.hpp"

#include <algorithm>
#include <cmath>

namespace ves {
namespace {

constexpr double kPhase = 0.5;  // [-] see ModelledServos

}  // namespace

ServoObserver::ServoObserver(const ServoModel& servo, double period, bool feels)
    : servos_(servo, period, kPhase),
      period_(period),
      feels_(feels),
      between_(std::llround(period * 1e9) / 16),
      filter_(servo.sensor_cutoff),
      whole_(filter_.prepare(servo.update)) {}

void ServoObserver::reset(const Vec6& L, std::int64_t time) noexcept {
  servos_.reset(L, time);
  filter_.settle(Channels::Zero());
  remembered_ = 0;
  remember();
}

void ServoObserver::advance(std::int64_t time) noexcept {
  if (time <= servos_.time()) return;
  const auto passed = [&](const ModelledServos::Passage& passage, const Channels& acceleration) {
    if (!feels_) return;
    filter_.advanceHeld(passage.dt == whole_.dt ? whole_ : filter_.prepare(passage.dt),
                        acceleration);
  };
  const auto updated = [&] {
    if (servos_.time() - past_[(remembered_ - 1) % kInstants].time >= between_) remember();
  };
  servos_.advance(time, passed, updated);
  remember();
}

void ServoObserver::remember() noexcept {
  const double w = servos_.model().sensor_cutoff;
  const Channels a = filter_.output(), a_rate = filter_.rate();
  const Vec6& v = servos_.velocity();
  past_[remembered_++ % kInstants] = {servos_.time(),
                                      servos_.length(),
                                      v,
                                      v - ((a_rate + M_SQRT2 * w * a) / (w * w)).matrix(),
                                      a.matrix(),
                                      a_rate.matrix(),
                                      servos_.acceleration()};
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
    // Between two updates v goes to where the last one sends it.
    const Eigen::Array<double, kLegs, 1> tau = model().tau.array(), decay = (-h * s / tau).exp();
    out.v = earlier.v + (tau * (1.0 - decay) * earlier.a.array()).matrix();
    return out;
  }
  return *later;
}

Vec6 ServoObserver::filteredAcceleration(std::int64_t time) const noexcept {
  const Instant end = at(time);
  const double window = model().sensor_window, delay = model().sensor_delay;
  if (!(window > 0.0)) return end.filtered_a - delay * end.filtered_a_rate;
  const Instant begin = at(time - std::llround(window * 1e9));
  return (end.filtered_v - begin.filtered_v - delay * (end.filtered_a - begin.filtered_a)) / window;
}

Motions ServoObserver::moments(std::int64_t from, std::int64_t to) const noexcept {
  const Instant first = at(from), last = at(to);
  Motions sum = Motions::Zero();
  const auto add = [&](const Instant& earlier, const Instant& later) {
    const double t = 0.5 * kSecondPerNanosecond *
                     static_cast<double>((earlier.time - from) + (later.time - from));
    Vec6 term = later.L - earlier.L;
    for (Eigen::Index n = 0; n < sum.cols(); ++n, term *= t) sum.col(n) += term;
  };
  const Instant* later = &last;
  for (std::size_t i = 1; i <= std::min(remembered_, kInstants); ++i) {
    const Instant& earlier = past_[(remembered_ - i) % kInstants];
    if (earlier.time <= first.time) break;
    if (earlier.time >= last.time) continue;
    add(earlier, *later);
    later = &earlier;
  }
  add(first, *later);
  return sum;
}

void ServoObserver::correct(const Vec6& L, std::int64_t time) noexcept {
  const Instant then = at(time);
  const Vec6 slack = 0.5 * model().readings.scale + model().jitter * then.v.cwiseAbs();
  const Vec6 change = then.L.cwiseMax(L - slack).cwiseMin(L + slack) - then.L;
  servos_.move(change);
  for (std::size_t i = 1; i <= std::min(remembered_, kInstants); ++i) {
    Instant& one = past_[(remembered_ - i) % kInstants];
    if (one.time < time) break;
    one.L += change;
  }
}

Vec6 ServoObserver::rounding(const Vec6& L_dot, double later) const noexcept {
  const double update = model().update, to_update = servos_.toUpdate();
  const Vec6 L_then = length() + later * velocity();
  const double first =
      to_update + std::max(0.0, std::ceil((later - to_update) / update)) * update - later;
  Vec6 sum = Vec6::Zero();
  int updates = 0;
  for (double t = first; t < period_; t += update, ++updates) {
    const Vec6 L = L_then + t * L_dot;
    sum += servos_.reading(L, L_dot) - (L - model().reading_age * L_dot);
  }
  return sum / std::max(1, updates);
}

}  // namespace ves
