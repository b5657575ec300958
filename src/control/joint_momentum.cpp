// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/joint_momentum.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "ves/robot/momentum.hpp"

namespace ves {
namespace {

double seconds(std::int64_t from, std::int64_t to) {
  return static_cast<double>(to - from) * kSecondPerNanosecond;
}

}  // namespace

JointParabola::JointParabola(const ControllerConfig& config) {
  const JointSensors& sensors = config.joints;
  const double T = std::max(config.periodSeconds(), sensors.interval),
               deviation = sensors.deviation.maxCoeff();
  // [1/T] of its speed so many periods after the newest but one of n readings.
  const auto speedAfter = [](int n, double periods) {
    Mat3 normal = Mat3::Zero();
    for (int i = 0; i < n; ++i) {
      const Vec3 powers(1.0, 1 - i, (1 - i) * (1 - i));
      normal += powers * powers.transpose();
    }
    const Vec3 rate(0.0, 1.0, 2.0 * periods);
    return std::sqrt(rate.dot(normal.inverse() * rate));
  };
  // What it is off by at the end of a cubic, to the side of a Legendre polynomial. [rad/s | m/s]
  const auto byJerk = [&](int n) {
    const double half = 0.5 * (n - 1) * T;
    return 0.4 * config.compensation.joint_jerk * half * half;
  };
  while (readings < kMost && byJerk(readings) < deviation / T * speedAfter(readings, 1.0))
    ++readings;
  const double ahead = T + sensors.interval, x = config.servo.sensor_cutoff / M_SQRT2 * ahead,
               passed = 1.0 - std::exp(-x) * (std::cos(x) + std::sin(x));  // of a step, since then
  speed = speedAfter(readings, passed * ahead / T) / T;
}

JointMomentum::JointMomentum(const ControllerConfig& config)
    : compensated_(config.compensation.inertia),
      aided_(config.compensation.aided),
      delay_(std::llround(config.servo.sensor_delay * 1e9)),
      filter_(config.servo.sensor_cutoff),
      before_(filter_),
      fitted_(JointParabola(config).readings) {
  constexpr std::int64_t kInstant = 1'000'000;  // [ns] in which a rate hardly changes
  const std::int64_t window = std::llround(config.servo.sensor_window * 1e9);
  begin_ = window > 0 ? -window : -kInstant / 2;
  end_ = window > 0 ? 0 : kInstant / 2;
}

void JointMomentum::reset(const JointVector& q) noexcept {
  known_ = 0;
  read_ = 0;
  begun_ = false;
  q_ = q;
  shown_q_dot_.setZero();
  I_ = E_ = {};
}

JointVector JointMomentum::at(const Sample& sample) const noexcept {
  const std::int64_t time = sample.wrench_time - delay_;
  if (!compensated_ || known_ < 3 || sample.joints_time == time) return sample.q;
  const double since = seconds(last_[1].time, time);
  return middle_ + since * q_dot_ + 0.5 * since * since * q_ddot_;
}

void JointMomentum::update(const KnownPayload& known, const Sample& sample, const Mat3& R_IP,
                           const Mat3& R_EP, double since) noexcept {
  if (!compensated_) {
    q_ = sample.q;
    return;
  }
  if (known.changed() && known_ == 3 && aided_) relearn(known);
  if (!(since > 0.0)) return;
  if (known_ > 0 && sample.joints_time < last_[2].time) reset(sample.q);
  if (known_ == 0 || sample.joints_time > last_[2].time) {
    std::rotate(last_.begin(), last_.begin() + 1, last_.end());
    last_[2] = {sample.joints_time, sample.q};
    readings_[static_cast<std::size_t>(read_++ % JointParabola::kMost)] = last_[2];
    const bool first = known_ < 3;
    if (first) ++known_;
    if (known_ == 3) addMiddle(known, first);
  }
  q_ = sample.q;
  if (known_ < 3) return;
  const std::int64_t time = sample.wrench_time - delay_;
  const Filter at = filtered(time);
  const Channels& now = at.output();
  q_ = now.head<kMaxJoints>().matrix();
  shown_q_dot_ = at.rate().head<kMaxJoints>().matrix();
  if (!aided_) return;
  X_PL0_ = known.payload().X_PL0();
  const auto see = [&](Seen& seen, const Mat3& R) {
    const Vec6 before = seen.momentum;
    seen.R = R;
    seen.momentum = momentum(R, now);
    seen.force = begun_ ? Wrench::from((before - seen.momentum) / since) : Wrench{};
  };
  see(I_, R_IP);
  see(E_, R_EP);
  const Vec6 begin = momentum(R_IP, filtered(time + begin_).output()),
             end = momentum(R_IP, filtered(time + end_).output());
  begun_ = true;
  shown_ = (begin - end) / seconds(begin_, end_);
  mean_ = 0.5 * (begin + end);
}

Wrench JointMomentum::shown(const Vec3& w_IP_I) const noexcept {
  if (!begun_) return {};
  return Wrench::from(shown_) -
         Wrench{w_IP_I.cross(mean_.head<3>()), w_IP_I.cross(mean_.tail<3>())};
}

/// What has been filtered so far becomes that of the masses as they are known now.
void JointMomentum::relearn(const KnownPayload& known) noexcept {
  constexpr double kStep = 1e-4;  // [s] for a rate
  const auto change = [&](const JointVector& q, const JointVector& q_dot) -> Channels {
    Channels out = Channels::Zero();
    out.tail<6>() =
        (jointMomentum(known.carried(), q, q_dot) - jointMomentum(known.before(), q, q_dot))
            .array();
    return out;
  };
  const auto rate = [&](const JointVector& q, const JointVector& q_dot, const JointVector& q_ddot,
                        const Channels& now) -> Channels {
    return (change(q + kStep * q_dot, q_dot + kStep * q_ddot) - now) / kStep;
  };
  const Channels input = change(middle_, q_dot_),
                 input_rate = rate(middle_, q_dot_, q_ddot_, input);
  const auto raise = [&](Filter& filter, const Channels& in) {
    const JointVector q = filter.output().head<kMaxJoints>().matrix(),
                      q_dot = filter.rate().head<kMaxJoints>().matrix(),
                      q_ddot = filter.curve().head<kMaxJoints>().matrix();
    const Channels out = change(q, q_dot), out_rate = rate(q, q_dot, q_ddot, out);
    filter.raise(in, out, out_rate);
  };
  raise(before_, input - seconds(last_[0].time, last_[1].time) * input_rate);
  raise(filter_, input);
  input_ += input;
  rate_ += input_rate;
  chord_ += input_rate;
  const Channels more = change(q_, shown_q_dot_);
  for (Seen* seen : {&I_, &E_}) seen->momentum += momentum(seen->R, more);
}

/// Where the middle one of the last three angles was read.
void JointMomentum::fit() noexcept {
  const double T_0 = seconds(last_[0].time, last_[1].time),
               T_1 = seconds(last_[1].time, last_[2].time);
  const int n = static_cast<int>(std::min<std::int64_t>(fitted_, read_));
  if (n <= 3) {  // divided differences
    const JointVector rate_0 = (last_[1].q - last_[0].q) / T_0,
                      rate_1 = (last_[2].q - last_[1].q) / T_1;
    middle_ = last_[1].q;
    q_dot_ = (T_0 * rate_1 + T_1 * rate_0) / (T_0 + T_1);
    q_ddot_ = 2.0 / (T_0 + T_1) * (rate_1 - rate_0);
    return;
  }
  Mat3 normal = Mat3::Zero();
  Eigen::Matrix<double, 3, kMaxJoints> right = Eigen::Matrix<double, 3, kMaxJoints>::Zero();
  for (int i = 0; i < n; ++i) {
    const Angles& one = readings_[static_cast<std::size_t>((read_ - 1 - i) % JointParabola::kMost)];
    const double t = seconds(last_[1].time, one.time) / T_1;
    const Vec3 powers(1.0, t, t * t);
    normal += powers * powers.transpose();
    right += powers * (one.q - last_[1].q).transpose();
  }
  const Eigen::Matrix<double, 3, kMaxJoints> fitted = normal.inverse() * right;
  middle_ = last_[1].q + fitted.row(0).transpose();
  q_dot_ = fitted.row(1).transpose() / T_1;
  q_ddot_ = 2.0 / (T_1 * T_1) * fitted.row(2).transpose();
}

void JointMomentum::addMiddle(const KnownPayload& known, bool first) noexcept {
  const double T_0 = seconds(last_[0].time, last_[1].time);
  fit();
  const Channels before = input_;
  input_.head<kMaxJoints>() = middle_.array();
  if (aided_) input_.tail<6>() = jointMomentum(known.carried(), middle_, q_dot_).array();
  before_ = filter_;
  if (first) {
    filter_.settle(input_);
    before_ = filter_;
    chord_ = curve_ = rate_ = Channels::Zero();
  } else {
    const Channels chord = (input_ - before) / T_0;
    curve_ = 2.0 / (chord_time_ + T_0) * (chord - chord_);
    curve_.head<kMaxJoints>() = q_ddot_.array();
    rate_ = chord + 0.5 * T_0 * curve_;
    chord_ = chord;
    filter_.advanceAlong(filter_.prepare(T_0), input_, curve_);
  }
  chord_time_ = T_0;
  rate_.head<kMaxJoints>() = q_dot_.array();
}

/// What is filtered runs along parabolas.
JointMomentum::Filter JointMomentum::filtered(std::int64_t time) const noexcept {
  const double ahead = seconds(last_[1].time, time);
  const Channels input = input_ + ahead * rate_ + 0.5 * ahead * ahead * curve_;
  Filter at = filter_;
  if (ahead > 0.0) {
    at.advanceAlong(at.prepare(ahead), input, curve_);
  } else if (const double since = seconds(last_[0].time, time); since > 0.0) {
    at = before_;
    at.advanceAlong(at.prepare(since), input, curve_);
  }
  return at;
}

/// About Po in a frame that R turns the platform's axes to.
Vec6 JointMomentum::momentum(const Mat3& R, const Channels& filtered) const noexcept {
  const Wrench of_L0 = Wrench::from(filtered.tail<6>().matrix());
  return rotate(R, transfer(X_PL0_, of_L0)).stacked();
}

}  // namespace ves
