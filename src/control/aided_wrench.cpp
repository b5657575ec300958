// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/aided_wrench.hpp"

#include <algorithm>
#include <cmath>

#include "ves/math/dense.hpp"

namespace ves {

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
      gate_(config) {}

Wrench AidedWrench::update(const Input& in, bool engaged) noexcept {
  if (!aided_) return in.measured;
  if (!engaged) {
    gate_.reset();
    residuals_ = 0;
    reaction_ = {};
    withholds_ = false;
    return in.measured;
  }
  reaction_ = in.joints.force();
  if (!in.bias.calibrated()) return in.measured;
  if (in.samples.fresh()) {
    constexpr std::int64_t kRefresh = 100;  // [-] samples: attitude and joints change slowly
    if (residuals_++ % kRefresh == 0) refreshNoise(in);
    const Wrench residual = in.measured - in.joints.shown(in.w_IP_I);
    withholds_ = !gate_.open(countsOf(residual, in.X_IP.R), noise_);
  }
  if (!withholds_) return in.measured;
  return in.measured + Wrench::from(in.share * (reaction_ - in.measured).stacked());
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
