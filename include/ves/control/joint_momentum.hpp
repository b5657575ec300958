// SPDX-License-Identifier: BSD-3-Clause
//
// The robot's joints as the newest wrench shows them, and the wrench that they make: what their
// momentum changes by. Beyond the report.
#pragma once

#include "ves/control/robot_load.hpp"

namespace ves {

/// The parabola that the joints' angles run along.
struct JointParabola {
  static constexpr int kMost = 40;
  /// [-] the newest readings that it is laid through by least squares: three where they are exact;
  /// else so many that by their noise and by a steady jerk its speed is as far off.
  int readings = 3;
  /// [1/s] deviation of the speed that it foretells until the next reading, behind the sensor's
  /// filter, where each reading has one of 1.
  double speed = 0.0;

  explicit JointParabola(const ControllerConfig& config);
};

/// The joints' angles and their momentum behind the sensor's filter and delay.
class JointMomentum {
 public:
  explicit JointMomentum(const ControllerConfig& config);

  /// Nothing is known of the past; joints at q.
  void reset(const JointVector& q) noexcept;
  /// A tick; its sample `since` [s] after the one before (0: there is no new one), taken with the
  /// platform turned by R_IP, and as emulated by R_EP. What `known` newly knows counts as carried
  /// before.
  void update(const KnownPayload& known, const Sample& sample, const Mat3& R_IP, const Mat3& R_EP,
              double since) noexcept;

  /// [rad | m] Where the joints were at the time of the sample's wrench, by the parabola of the
  /// last update(); the reading itself if that is of this time, and where no inertia is
  /// compensated.
  JointVector at(const Sample& sample) const noexcept;
  const JointVector& q() const noexcept { return q_; }  // [rad | m] as the wrench shows them
  const JointVector& q_dot() const noexcept { return shown_q_dot_; }  // [rad/s | m/s] the same
  /// F_Po_I of the joints on a base at rest: what the momentum has lost since the sample before,
  /// per second. Its sum over time loses nothing. Zero where only inertia is compensated.
  const Wrench& force() const noexcept { return I_.force; }
  const Wrench& emulatedForce() const noexcept { return E_.force; }  // the same about Po in E
  const Vec6& emulatedMomentum() const noexcept { return E_.momentum; }
  /// F_Po_I that a platform turning at w_IP_I shows of it in the sensor's mean, beyond what
  /// RobotInertia counts.
  Wrench shown(const Vec3& w_IP_I) const noexcept;

 private:
  struct Angles {
    std::int64_t time = 0;  // [ns]
    JointVector q = JointVector::Zero();
  };
  using Filter = Butterworth2<kMaxJoints + 6>;  // of angles and momentum
  using Channels = Filter::Channels;

  void fit() noexcept;
  void relearn(const KnownPayload& known) noexcept;
  void addMiddle(const KnownPayload& known, bool first) noexcept;
  Filter filtered(std::int64_t time) const noexcept;
  Vec6 momentum(const Mat3& R, const Channels& filtered) const noexcept;

  bool compensated_, aided_;
  std::int64_t delay_;            // [ns] of the sensor, ServoModel
  std::int64_t begin_, end_;      // [ns] of what it shows, after the wrench
  Filter filter_, before_;        // at the middle one of the angles, and at the oldest
  std::array<Angles, 3> last_{};  // the oldest first
  int known_ = 0;                 // [-] of them
  int fitted_;                    // [-] readings
  std::array<Angles, JointParabola::kMost> readings_{};  // a ring
  std::int64_t read_ = 0;                                // [-] so far
  // At the middle one, not filtered.
  JointVector middle_ = JointVector::Zero();
  JointVector q_dot_ = JointVector::Zero(), q_ddot_ = JointVector::Zero();
  Channels input_ = Channels::Zero(), rate_ = Channels::Zero(), curve_ = Channels::Zero();
  Channels chord_ = Channels::Zero();  // rate from the one before to it,
  double chord_time_ = 0.0;            // [s] which took so long
  JointVector q_ = JointVector::Zero(), shown_q_dot_ = JointVector::Zero();
  Transform X_PL0_;
  struct Seen {                    // about Po, in I or in E
    Mat3 R = Mat3::Identity();     // of P in it
    Vec6 momentum = Vec6::Zero();  // at the newest wrench
    Wrench force;
  };
  Seen I_, E_;
  bool begun_ = false;         // there is a sample before
  Vec6 shown_ = Vec6::Zero();  // [N, N m] in I, R_IP held
  Vec6 mean_ = Vec6::Zero();   // [N s, N m s] about Po in I, in the sensor's mean
};

}  // namespace ves
