// SPDX-License-Identifier: BSD-3-Clause
//
// The wrench without the sensor's noise: what the robot's joints do is computed from their angles,
// and of what the sensor shows beyond that only significant residuals pass. Beyond the report.
#pragma once

#include "ves/control/joint_momentum.hpp"
#include "ves/control/sensor_bias.hpp"

namespace ves {

/// [1/s] The largest mean over so many samples, a period apart, of the acceleration that the wrench
/// shows of a leg whose v_end steps by 1 m/s.
double largestFelt(const ServoModel& servo, double period, std::size_t samples);

/// What a residual may be without a force, by channel.
struct ResidualNoise {
  Vec6 once = Vec6::Zero();    // [count^2] variance of one sample, from the sensor
  Vec6 mean = Vec6::Zero();    // [count^2] of its mean over a calibration: how far the bias is off
  Vec6 weight = Vec6::Zero();  // [count^2] from the attitude by rounded lengths, turning the weight
  Vec6 legs = Vec6::Zero();    // [count s] of a leg that takes its next count sooner or later than
                               // modelled, and so goes K count quicker; per [1/s] of largestFelt()
};

/// Whether a residual is more than noise: its mean over 1, 5 or 50 samples, in any channel.
class ResidualGate {
 public:
  explicit ResidualGate(const ControllerConfig& config);

  void reset() noexcept { taken_ = 0, open_ = 0; }
  /// A new sample's residual [count]. Stays open for a while after the last that was more.
  bool open(const Vec6& residual, const ResidualNoise& noise) noexcept;

 private:
  static constexpr std::array<std::size_t, 3> kMeans = {1, 5, 50};  // [-] samples
  static constexpr std::size_t kKept = 50;

  double deviations_;                       // [-]
  std::array<double, kMeans.size()> felt_;  // [1/s] largestFelt()
  int hold_;                                // [-] samples
  std::array<Vec6, kKept> last_{};          // a ring
  std::size_t taken_ = 0;                   // [-] so far
  int open_ = 0;                            // [-] samples to come
};

/// The admittance model's input: the measured wrench, or the modelled one while they differ by no
/// more than noise. So it is never further from the measured one than the gate lets a residual be.
/// The sensor's noise is what its last calibration found; without one everything passes.
class AidedWrench {
 public:
  explicit AidedWrench(const ControllerConfig& config);

  struct Input {
    const Wrench& measured;  // F_Po_I that the sensor shows beyond weight and inertia
    const Wrench& weight;    // F_Po_I
    const Mat6& M_1;         // RobotInertia
    const Vec3& w_IP_I;      // [rad/s] of the platform, when the newest sample was taken
    const JointMomentum& joints;
    const SampleStream& samples;
    const SensorBias& bias;
    const Transform& X_IP;
    double share;  // [-] of the compensation
  };
  /// F_Po_I that the admittance model is to feel; before the legs are `engaged`, the measured one.
  Wrench update(const Input& in, bool engaged) noexcept;

  /// Of the newest sample; zero unless the wrench is aided.
  const Wrench& reaction() const noexcept { return reaction_; }  // F_Po_I, modelled
  bool withholds() const noexcept { return withholds_; }         // the residual
  const ResidualNoise& noise() const noexcept { return noise_; }

 private:
  Vec6 countsOf(const Wrench& F_Po_I, const Mat3& R_IP) const noexcept;
  void refreshNoise(const Input& in) noexcept;

  bool aided_;
  Geometry geometry_;
  double rounding_;      // [m] of a leg, rms
  Vec6 speed_of_count_;  // [m/s] K times a count
  Transform X_SP_;
  Mat6 S_proc_;  // [count per N | N m]
  ResidualGate gate_;
  ResidualNoise noise_;
  std::int64_t residuals_ = 0;  // [-] so far
  Wrench reaction_;
  bool withholds_ = false;
};

}  // namespace ves
