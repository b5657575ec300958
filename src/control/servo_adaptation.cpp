// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/servo_adaptation.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace ves {

ServoAdaptation::ServoAdaptation(const ServoModel& believed, const AdaptationSettings& settings,
                                 double period)
    : settings_(settings),
      believed_(believed, period, 0.5),
      gains_{believed.extend, believed.retract, believed.delay} {
  information_.fill(Mat3::Zero());
  evidence_.fill(Vec3::Zero());
}

void ServoAdaptation::reset(const Vec6& L, std::int64_t time) noexcept {
  believed_.reset(L, time);
  extend_ = retract_ = {};
}

void ServoAdaptation::learn(const Vec6& L, std::int64_t time) noexcept {
  const double since = static_cast<double>(time - believed_.time()) * kSecondPerNanosecond;
  if (!(since > 0.0)) return;
  advance(time);
  const double decay = std::exp(-since / settings_.forgetting);
  for (int i = 0; i < kLegs; ++i) learn(i, L(i) - believed_.length()(i), decay);
}

void ServoAdaptation::advance(std::int64_t time) noexcept {
  const Channels tau = believed_.model().tau.array();
  believed_.advance(
      time,
      [&](const ModelledServos::Passage& passage, const Channels&) {
        extend_.pass(passage, tau);
        retract_.pass(passage, tau);
      },
      [this] { update(); });
}

/// v_end = K E, E = r - L(t - a) - d v, differentiated; at the rail E stays.
void ServoAdaptation::update() noexcept {
  const ServoModel& servo = believed_.model();
  const Vec6& E = believed_.difference();
  for (int i = 0; i < kLegs; ++i) {
    if (isLapped(servo, i, E(i))) {
      extend_.v_end(i) = retract_.v_end(i) = 0.0;
      continue;
    }
    const bool extends = E(i) > 0.0, null = nearNull(servo, i, E(i));
    const double up = servo.extend(i), down = servo.retract(i),
                 K = null      ? up + down
                     : extends ? up
                               : down;
    // Beyond its opening a valve has 2 up down / (up + down) of that more: both gains are in it.
    const double open = null ? 0.0
                             : std::copysign(2.0 * servo.opening(i) * up * down, E(i)) /
                                   ((up + down) * (up + down));
    const double follows = std::abs(E(i)) < servo.rail ? K : 0.0;
    const auto change = [&](const Sensitivity& s) {
      return -follows * (s.L(i) + (servo.derivative - servo.reading_age) * s.v(i));
    };
    extend_.v_end(i) = change(extend_) + (null || extends ? up * E(i) : 0.0) + down * open;
    retract_.v_end(i) = change(retract_) + (null || !extends ? down * E(i) : 0.0) + up * open;
  }
}

void ServoAdaptation::Sensitivity::pass(const ModelledServos::Passage& passage,
                                        const Channels& tau) noexcept {
  const Channels excess = v - v_end;
  L += v_end * passage.dt + excess * tau * (1.0 - passage.decay);
  v = v_end + excess * passage.decay;
}

void ServoAdaptation::learn(int leg, double missed, double decay) noexcept {
  constexpr double kOutlier = 5.0;   // [-] deviations
  constexpr double kNothing = 1e-2;  // [-] information of a reading that shows nothing new
  const ServoModel& servo = believed_.model();
  const double v = believed_.velocity()(leg), count = servo.readings.scale(leg);
  const double R = 4.0 * count * count / 12.0 + servo.jitter * servo.jitter * v * v;  // [m^2]
  // A later command is an earlier time.
  const Vec3 s(settings_.gain * extend_.L(leg), settings_.gain * retract_.L(leg),
               -settings_.delay * v);
  if (!(missed * missed < kOutlier * kOutlier * (R + s.squaredNorm()))) return;
  if (s.squaredNorm() < kNothing * R) return;

  const auto i = static_cast<std::size_t>(leg);
  information_[i] = decay * information_[i] + s * s.transpose() / R;
  evidence_[i] = decay * evidence_[i] + s * (missed / R);
  const Vec3 theta = ((Mat3::Identity() + information_[i]).inverse() * evidence_[i])
                         .cwiseMax(-settings_.limit)
                         .cwiseMin(settings_.limit);
  gains_.extend(leg) = servo.extend(leg) * (1.0 + settings_.gain * theta(0));
  gains_.retract(leg) = servo.retract(leg) * (1.0 + settings_.gain * theta(1));
  gains_.delay(leg) = servo.delay(leg) + settings_.delay * theta(2);
}

}  // namespace ves
