// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/residual_gate.hpp"

#include <algorithm>
#include <cmath>

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

ResidualGate::ResidualGate(const ControllerConfig& config) : deviations_(config.compensation.gate) {
  if (!config.compensation.aided) return;
  for (std::size_t i = 0; i < kMeans.size(); ++i)
    felt_[i] =
        largestFelt(config.servo, config.periodSeconds(), static_cast<std::size_t>(kMeans[i]));
}

Vec6 ResidualGate::most(int samples, const ResidualNoise& noise,
                        const Vec6& unknown) const noexcept {
  std::size_t i = kMeans.size() - 1;
  while (samples < kMeans[i]) --i;  // a leg is felt less in a longer mean
  return deviations_ * (noise.ofMean(samples) + unknown).cwiseSqrt() + felt_[i] * noise.legs;
}

bool ResidualGate::exceeds(int samples, const Vec6& mean, const ResidualNoise& noise,
                           const Vec6& unknown) const noexcept {
  return !(mean.cwiseAbs().array() <= most(samples, noise, unknown).array()).all();
}

double ResidualGate::excess(int samples, const Vec6& mean, const ResidualNoise& noise,
                            const Vec6& unknown) const noexcept {
  return mean.cwiseAbs().cwiseQuotient(most(samples, noise, unknown)).maxCoeff();
}

}  // namespace ves
