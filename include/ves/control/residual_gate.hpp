// SPDX-License-Identifier: BSD-3-Clause
//
// Whether what is left of the sensor's reading is a force, or noise. Beyond the report.
#pragma once

#include "ves/control/hindsight.hpp"
#include "ves/control/residual_noise.hpp"

namespace ves {

/// [1/s] The largest mean over so many samples, a period apart, of the acceleration that the wrench
/// shows of a leg whose v_end steps by 1 m/s.
double largestFelt(const ServoModel& servo, double period, std::size_t samples);

/// Whether the mean of residuals over some samples is more than noise, in any channel.
class ResidualGate {
 public:
  /// [-] samples: one, and groups of Lesson::kGroup.
  static constexpr std::array<int, 6> kMeans = {1, 5, 10, 20, 60, ResidualNoise::kLongestMean};
  /// What only means from this one on show is a force that lasts.
  static constexpr std::size_t kLasting = 4;

  explicit ResidualGate(const ControllerConfig& config);

  /// `mean` [count] over so many samples; `unknown` [count^2] its variance for want of knowledge
  /// of masses and bias.
  bool exceeds(int samples, const Vec6& mean, const ResidualNoise& noise,
               const Vec6& unknown) const noexcept;
  /// [-] of the channel that is farthest from 0, in terms of what would be noise.
  double excess(int samples, const Vec6& mean, const ResidualNoise& noise,
                const Vec6& unknown) const noexcept;

 private:
  Vec6 most(int samples, const ResidualNoise& noise, const Vec6& unknown) const noexcept;

  double deviations_;                         // [-]
  std::array<double, kMeans.size()> felt_{};  // [1/s] largestFelt()
};

}  // namespace ves
