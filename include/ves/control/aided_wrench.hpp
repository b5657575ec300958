// SPDX-License-Identifier: BSD-3-Clause
//
// The wrench without the sensor's noise: what the robot's joints do is computed from their angles,
// and of what the sensor shows beyond that only significant residuals pass. Beyond the report.
#pragma once

#include "ves/control/robot_load.hpp"
#include "ves/control/sensor_bias.hpp"

namespace ves {

/// The wrench of the robot's joints in motion, on a base that turns but does not accelerate, behind
/// the sensor's filter and mean: Newton-Euler (Appendix A) with rates and accelerations by divided
/// differences of the last three angles. These hold where the middle one was read; from there the
/// wrench is extrapolated along a line to where the newest sample was taken.
class JointReaction {
 public:
  explicit JointReaction(const ControllerConfig& config);

  /// Nothing is known of the past.
  void reset() noexcept { known_ = 0; }
  /// A new sample, taken while the platform turned at w_IP_P. F_Po_P as its wrench shows it; zero
  /// until three angles have come. A driver of the joints may be slower than the tick: then the
  /// last angles still hold.
  Wrench update(const KnownPayload& known, const Sample& sample, const Vec3& w_IP_P) noexcept;

 private:
  struct Angles {
    std::int64_t time = 0;  // [ns]
    JointVector q = JointVector::Zero();
    Vec3 w_IP_P = Vec3::Zero();  // [rad/s] of the platform then
  };
  /// Brought to `time` [ns]; zero while too little is known.
  Wrench newest(std::int64_t time) const noexcept;
  static Vec6 reaction(const KnownPayload& known, const JointState& joints,
                       const Vec3& w_IP_P) noexcept;

  double window_, delay_;  // [s] of the sensor, ServoModel
  Butterworth2<6> filter_;
  std::array<Angles, 3> last_{};  // the oldest first
  int known_ = 0;                 // [-] of them
  Vec6 input_ = Vec6::Zero();     // [N, N m] of the filter, at the middle one
  Vec6 rate_ = Vec6::Zero();      // [N/s, N m/s] of it there
};

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
    const KnownPayload& known;
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
  JointReaction joints_;
  ResidualGate gate_;
  ResidualNoise noise_;
  std::int64_t residuals_ = 0;  // [-] so far
  Wrench F_Po_P_, reaction_;
  bool withholds_ = false;
};

}  // namespace ves
