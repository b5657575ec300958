// SPDX-License-Identifier: BSD-3-Clause
//
// What is left of the sensor's reading where no force is and the masses are known: its own noise,
// rounded lengths, legs that are early or late, readings of the joints. Beyond the report.
#pragma once

#include "ves/control/joint_momentum.hpp"
#include "ves/control/sensor_bias.hpp"
#include "ves/control/servo.hpp"

namespace ves {

/// What the sensor reads of a wrench, its calibration matrix inverted.
class SensorCounts {
 public:
  explicit SensorCounts(const ForceSensor& sensor);

  /// [count per N | N m] of F_Po_I.
  Mat6 perWrench(const Mat3& R_IP) const noexcept;
  /// F_Po_P that reads as these counts.
  Wrench wrench(const Vec6& counts) const noexcept;

 private:
  Transform X_SP_;
  Mat6 S_proc_;  // [count per N | N m], and
  Mat6 C_proc_;  // its inverse
};

/// What a residual may be without a force, by channel.
struct ResidualNoise {
  SensorNoise sensor;
  Vec6 weight = Vec6::Zero();  // [count^2] from the attitude by rounded lengths, turning the weight
  Vec6 legs = Vec6::Zero();    // [count s] of a leg that takes its next count, or what it is told,
                               // sooner or later than modelled, and so goes K times that quicker;
                               // per [1/s] of largestFelt()
  Vec6 joints = Vec6::Zero();  // [count] of a sample from the joints' readings, which give their
                               // momentum; of a mean it is what both its ends are off by

  static constexpr int kLongestMean = 200;  // [-] samples

  /// [count^2] Of sensor, attitude and joints in the mean of so many samples.
  Vec6 ofMean(int samples) const noexcept;
};

/// ResidualNoise, kept up to date while the machine moves.
class NoiseOfResidual {
 public:
  explicit NoiseOfResidual(const ControllerConfig& config);

  struct Input {
    const SensorNoise& sensor;  // as its calibration found it
    const RobotModel& carried;  // whose joints' momentum counts
    const JointVector& q;
    const Transform& X_IP;
    const Mat6& M_1;       // of the robot, about Po in I
    const Wrench& weight;  // F_Po_I
  };
  /// Attitude and joints change slowly: not for every sample.
  void refresh(const Input& in) noexcept;
  /// For every sample, with the platform's motion.
  void refreshLegs(const BodyMotion& P) noexcept;
  /// The legs have not moved of late.
  void stop() noexcept { leg_speed_.setZero(); }

  const ResidualNoise& now() const noexcept { return now_; }
  /// [count^2 s^2] Variance of the momentum, by modelled legs and the joints' readings, at an
  /// instant.
  Vec6 ofMomentum() const noexcept;

 private:
  Vec6 ofJoints(const Input& in) const noexcept;  // [count]

  Geometry geometry_;
  ServoModel servo_;
  double period_;             // [s]
  double rounding_;           // [m] of a leg, rms
  double least_correlation_;  // [-] of the sensor's noise: a calibration tells it poorly
  JointVector joint_speed_;   // [rad/s | m/s] rms, by readings of joints
  Transform X_PL0_;
  SensorCounts counts_;
  Mat6 felt_of_legs_ = Mat6::Zero();    // [count s^2/m] by a leg's acceleration,
  Mat6 rates_of_twist_ = Mat6::Zero();  // [m/s] of the legs by the platform's; as refreshed
  Vec6 leg_speed_ = Vec6::Zero();       // [m/s] of late
  ResidualNoise now_;
};

}  // namespace ves
