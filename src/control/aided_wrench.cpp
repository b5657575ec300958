// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/aided_wrench.hpp"

#include <algorithm>
#include <cmath>

#include "ves/math/dense.hpp"
#include "ves/robot/newton_euler.hpp"

namespace ves {

JointReaction::JointReaction(const ControllerConfig& config)
    : window_(config.servo.sensor_window),
      delay_(config.servo.sensor_delay),
      filter_(config.servo.sensor_cutoff) {}

Wrench JointReaction::update(const KnownPayload& known, const Sample& sample,
                             const Vec3& w_IP_P) noexcept {
  if (known_ > 0 && sample.joints_time < last_[2].time) known_ = 0;
  if (known_ > 0 && sample.joints_time == last_[2].time) return newest(sample.wrench_time);
  std::rotate(last_.begin(), last_.begin() + 1, last_.end());
  last_[2] = {sample.joints_time, sample.q, w_IP_P};
  if (known_ < 3 && ++known_ < 3) {
    filter_.settle(Eigen::Array<double, 6, 1>::Zero());
    input_.setZero();
    rate_.setZero();
    return {};
  }
  const auto seconds = [](std::int64_t from, std::int64_t to) {
    return static_cast<double>(to - from) * kSecondPerNanosecond;
  };
  const double T_0 = seconds(last_[0].time, last_[1].time),
               T_1 = seconds(last_[1].time, last_[2].time);
  const JointVector rate_0 = (last_[1].q - last_[0].q) / T_0,
                    rate_1 = (last_[2].q - last_[1].q) / T_1;
  JointState joints;
  joints.q = last_[1].q;
  joints.q_dot = (T_0 * rate_1 + T_1 * rate_0) / (T_0 + T_1);
  joints.q_ddot = 2.0 / (T_0 + T_1) * (rate_1 - rate_0);
  const Vec6 before = input_;
  input_ = reaction(known, joints, last_[1].w_IP_P);
  rate_ = (input_ - before) / T_0;
  filter_.advance(filter_.prepare(T_0), input_.array());
  return newest(sample.wrench_time);
}

Wrench JointReaction::newest(std::int64_t time) const noexcept {
  if (known_ < 3) return {};
  const double ahead =
      std::max(0.0, static_cast<double>(time - last_[1].time) * kSecondPerNanosecond);
  if (!(ahead > 0.0)) return Wrench::from(filter_.output().matrix());
  Butterworth2<6> now = filter_;
  now.advance(now.prepare(ahead), (input_ + ahead * rate_).array());
  const Vec6 y_1 = now.output(), rate = now.rate();
  if (!(window_ > 0.0)) return Wrench::from(y_1 - delay_ * rate);
  // Over the window, or as much of it as is ahead.
  Butterworth2<6> begin = filter_;
  const double before = ahead - window_;
  if (before > 0.0) begin.advance(begin.prepare(before), (input_ + before * rate_).array());
  const Vec6 y_0 = begin.output();
  return Wrench::from(0.5 * (y_0 + y_1) - delay_ / std::min(ahead, window_) * (y_1 - y_0));
}

/// F_Po_P on the platform. What it takes to accelerate the locked robot is RobotInertia's.
Vec6 JointReaction::reaction(const KnownPayload& known, const JointState& joints,
                             const Vec3& w_IP_P) noexcept {
  BodyMotion P;
  P.w = w_IP_P;
  const Transform X_PL0 = known.payload().X_PL0();
  const Wrench on_robot =
      newtonEuler(known.carried(), joints, properMotion(P, X_PL0, Vec3::Zero())).F_L0o_L0;
  return -transfer(X_PL0, on_robot).stacked();
}

double largestFelt(const ServoModel& servo, double period, std::size_t samples) {
  // The mean of what steps make, later by a period each, is what their mean makes; a mean over the
  // sensor's window is the filtered speed less that of a window before, so less what later steps
  // make.
  constexpr int kParts = 40;  // [-] of a period
  const double w = servo.sensor_cutoff, dt = period / kParts;
  const int n = static_cast<int>(samples),
            window = static_cast<int>(std::lround(servo.sensor_window / dt));
  const auto steps = [&](int k) {  // [-] mean of those begun
    return k < 0 ? 0.0 : static_cast<double>(std::min(n, k / kParts + 1)) / n;
  };
  double largest = 0.0;
  for (const double tau : {servo.tau.minCoeff(), servo.tau.maxCoeff()}) {
    const double decay = std::exp(-dt / tau), settled = 20.0 * (tau + 1.0 / w);  // [-], [s]
    Butterworth2<1> filter(w);
    const Butterworth2<1>::Step step = filter.prepare(dt);
    double v = 0.0;
    for (int k = 0; k < n * kParts + window + settled / dt; ++k) {
      const double v_end = steps(k) - (window > 0 ? steps(k - window) : 0.0), before = v;
      v = v_end + (v - v_end) * decay;
      const Butterworth2<1>::Channels acceleration((v - before) / dt);
      filter.jump(acceleration);
      filter.advance(step, acceleration);
      const double a = filter.output()(0), a_rate = filter.rate()(0);
      const double filtered_v = v - (a_rate + M_SQRT2 * w * a) / (w * w);
      largest = std::max(largest, window > 0 ? filtered_v / servo.sensor_window : a);
    }
  }
  return largest;
}

ResidualGate::ResidualGate(const ControllerConfig& config)
    : deviations_(config.compensation.gate),
      hold_(static_cast<int>(std::lround(config.compensation.gate_hold / config.periodSeconds()))) {
  if (!config.compensation.aided) return;
  for (std::size_t i = 0; i < kMeans.size(); ++i)
    felt_[i] = largestFelt(config.servo, config.periodSeconds(), kMeans[i]);
}

bool ResidualGate::open(const Vec6& residual, const ResidualNoise& noise) noexcept {
  last_[taken_++ % kKept] = residual;
  open_ = std::max(0, open_ - 1);
  // Samples behind the sensor's filter are not quite independent: the calibration's mean says by
  // how much less a mean tells. The six channels have the same filter.
  const double total = noise.once.sum();
  const double correlation =
      total > 0.0 ? std::max(1.0, kCalibrationSamples * noise.mean.sum() / total) : 1.0;
  Vec6 sum = Vec6::Zero();
  std::size_t n = 0;
  for (std::size_t i = 0; i < kMeans.size() && taken_ >= kMeans[i]; ++i) {
    for (; n < kMeans[i]; ++n) sum += last_[(taken_ - 1 - n) % kKept];
    const double count = static_cast<double>(n);
    const Vec6 variance =
        (n == 1 ? 1.0 : correlation) / count * noise.once + noise.mean + noise.weight;
    const Vec6 most = deviations_ * variance.cwiseSqrt() + felt_[i] * noise.legs;
    if (!((sum / count).cwiseAbs().array() <= most.array()).all()) open_ = std::max(1, hold_);
  }
  return open_ > 0;
}

AidedWrench::AidedWrench(const ControllerConfig& config)
    : aided_(config.compensation.aided),
      geometry_(config.geometry),
      rounding_(config.servo.readings.scale.maxCoeff() / std::sqrt(12.0)),
      speed_of_count_(config.servo.extend.cwiseMax(config.servo.retract)
                          .cwiseProduct(config.servo.readings.scale)),
      X_SP_(inverse(config.sensor.X_PS)),
      S_proc_(inverse(config.sensor.C_proc)),
      joints_(config),
      gate_(config) {}

Wrench AidedWrench::update(const Input& in, bool engaged) noexcept {
  if (!aided_) return in.measured;
  if (!engaged) {
    joints_.reset();
    gate_.reset();
    residuals_ = 0;
    reaction_ = {};
    withholds_ = false;
    return in.measured;
  }
  if (in.samples.fresh())
    F_Po_P_ = joints_.update(in.known, in.samples.sample(), in.X_IP.R.transpose() * in.w_IP_I);
  reaction_ = rotate(in.X_IP.R, F_Po_P_);
  const Wrench residual = in.measured - reaction_;
  if (!in.bias.calibrated()) return in.measured;
  if (in.samples.fresh()) {
    constexpr std::int64_t kRefresh = 100;  // [-] samples: attitude and joints change slowly
    if (residuals_++ % kRefresh == 0) refreshNoise(in);
    withholds_ = !gate_.open(countsOf(residual, in.X_IP.R), noise_);
  }
  return withholds_ ? in.measured + Wrench::from(-in.share * residual.stacked()) : in.measured;
}

/// What the sensor reads of a wrench.
Vec6 AidedWrench::countsOf(const Wrench& F_Po_I, const Mat3& R_IP) const noexcept {
  return S_proc_ * transfer(X_SP_, rotate(R_IP.transpose(), F_Po_I)).stacked();
}

/// A leg whose length is taken wrongly turns the weight; one whose acceleration is, the inertia.
void AidedWrench::refreshNoise(const Input& in) noexcept {
  noise_.once = in.bias.deviation().cwiseAbs2();
  noise_.mean = in.bias.standardError().cwiseAbs2();
  noise_.weight.setZero();
  noise_.legs.setZero();
  const double mass = in.M_1(0, 0);
  if (!(mass > 0.0)) return;
  const Vec3 p_PoBcm_I = Vec3(in.M_1(5, 1), in.M_1(3, 2), in.M_1(4, 0)) / mass;
  LegMotion one;
  one.L = legLengths(geometry_, in.X_IP);
  for (int i = 0; i < kLegs; ++i) {
    BodyMotion P;
    one.L_ddot = Vec6::Unit(i);
    if (!forwardMotion(geometry_, in.X_IP, one, P)) return;
    const Vec6 inertial = in.M_1 * (Vec6() << P.a, P.alpha).finished();
    const Vec3 turned = P.alpha.cross(in.weight.f);
    const auto squared = [&](double size, const Wrench& wrench) -> Vec6 {
      return (size * countsOf(wrench, in.X_IP.R)).cwiseAbs2();
    };
    noise_.weight += squared(rounding_, {turned, p_PoBcm_I.cross(turned)});
    noise_.legs += squared(speed_of_count_(i), Wrench::from(inertial));
  }
  noise_.legs = noise_.legs.cwiseSqrt().eval();
}

}  // namespace ves
