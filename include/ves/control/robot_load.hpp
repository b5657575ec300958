// SPDX-License-Identifier: BSD-3-Clause
//
// What the robot puts on the sensor by being there: its weight, and the inertia of its body while
// the joints stand. The controller's model of both.
#pragma once

#include <optional>

#include "ves/control/controller_config.hpp"
#include "ves/control/tick_clock.hpp"
#include "ves/math/butterworth.hpp"
#include "ves/vehicle/modal_vehicle.hpp"

namespace ves {

/// The model of what the sensor carries: as configured, and what the robot has in hand as announced
/// to the controller.
class KnownPayload {
 public:
  explicit KnownPayload(const ControllerConfig& config);

  /// `commanded` [-]: segment that the last command named, which the program's times count from.
  void update(const Elapsed& elapsed, std::int32_t commanded) noexcept;
  /// The robot is known better: what it has carried all along.
  void learn(const RobotModel& robot) noexcept;
  /// The gripper has closed or opened, from the next tick on.
  void moveGripper() noexcept { gripper_moves_ = true; }
  /// The gripper's switch of a new sample, where it has one: a change tells of this tick.
  void readGripper(std::uint32_t switches) noexcept;

  const Payload& payload() const noexcept { return payload_; }
  /// All of it, counted into the robot's links.
  const RobotModel& carried() const noexcept { return carried_; }
  const RobotModel& before() const noexcept { return before_; }  // carried() until the last change
  bool changed() const noexcept { return changed_; }             // in this tick,
  bool learnt() const noexcept { return learnt_; }               // and learnt
  /// In this tick it was told that the gripper has closed or opened, and not on what.
  bool gripperMoved() const noexcept { return gripper_moved_; }

 private:
  void take() noexcept;

  RobotModel empty_;  // with nothing in hand
  ToldLoad in_hand_;
  ToldLoads told_;
  std::int64_t period_;  // [ns]
  Payload payload_;
  RobotModel carried_, before_;
  std::int32_t segment_ = -1;  // [-]
  std::int64_t began_ = 0;     // [-] tick of the first command that named it
  std::array<bool, kMaxToldLoads> done_{};
  bool changed_ = false, learnt_ = false, learns_ = false;
  bool gripper_moved_ = false, gripper_moves_ = false;
  bool switched_;                       // it has a switch,
  std::optional<bool> gripper_closed_;  // which was last
};

/// The weight of everything the sensor carries.
class StaticLoad {
 public:
  explicit StaticLoad(const ControllerConfig& config);

  /// For joints at q, the platform turned by R_IP, `since` [s] after the time before. `share` [-]
  /// of the compensation is in; `engaged`: the legs follow, so that the weight has a past.
  void update(const KnownPayload& known, const JointVector& q, const Mat3& R_IP, double since,
              bool engaged, double share) noexcept;

  /// [count] what the weight alone would read, without a bias.
  const Vec6& counts() const noexcept { return counts_; }
  /// F_So_S, on its way to the filtered one of the inertia's compensation: a turn of the robot
  /// moves the weight at once, the measurement only after the sensor's filter and mean.
  const Wrench& wrench() const noexcept { return F_So_S_; }

 private:
  Vec3 gravity_;
  Mat6 S_proc_;  // [count per N | N m]
  bool filters_;
  Butterworth2<6> filter_;  // the sensor's
  bool averages_;           // the sensor's readings, over about the time between two of its samples
  Vec6 counts_ = Vec6::Zero();
  Vec6 weight_ = Vec6::Zero(), felt_ = Vec6::Zero();  // [N, N m], as the newest wrench shows it
  Wrench F_So_S_;
};

/// The robot's inertia as the platform moves: what changes the momentum of its composite body.
class RobotInertia {
 public:
  explicit RobotInertia(const ControllerConfig& config);

  /// F_Po_I that it takes to move the composite body, and to turn it while the joints change it;
  /// zero when that is not compensated, or before the legs are `engaged`. `count` [-] of the tick;
  /// joints at q as the wrench shows them, `since` [s] after the time before; the platform is
  /// emulated turned by R_EP; `legs` with the accelerations that the wrench shows; `share` [-] of
  /// the compensation that is in.
  Wrench update(const KnownPayload& known, std::int64_t count, const JointVector& q, double since,
                const Transform& X_IP, const Mat3& R_EP, const LegMotion& legs, bool engaged,
                double share) noexcept;

  /// Of the composite body about Po in I, times the share. [kg, kg m, kg m^2]
  const Mat6& M_1() const noexcept { return M_1_; }
  /// The same in E and before the newest sample, the share as now, with the attitudes they were
  /// seen at, and with the joints' momentum.
  CarriedBody carried(const Vec6& joints) const noexcept {
    CarriedBody out(share_ * E_before_.whole, share_ * E_.whole);
    out.joints = share_ * joints;
    out.R_IP_before = E_before_.R;
    out.R_IP = E_.R;
    out.mass = composite_P_.mass;
    out.moment_P = 0.5 * (E_before_.moment_P + E_.moment_P);
    return out;
  }
  /// Of the platform in I, when the newest sample was taken, its accelerations as the wrench shows
  /// them; zero where it is not looked at.
  const BodyMotion& platform() const noexcept { return platform_; }

 private:
  bool compensated_;
  int mass_update_;  // [-] ticks for which a composite body is kept
  double scale_;     // [-] of it that the wrench shows
  Geometry geometry_;
  RigidBody composite_P_;
  JointVector composite_q_ = JointVector::Zero();  // [rad | m] that it was found at
  bool known_ = false;                             // composite_P_, since the legs were engaged
  struct Seen {                                    // in I or E
    Mat6 whole = Mat6::Zero();                     // M_1 of all of it
    Mat3 R = Mat3::Identity();                     // of P, where it was so
    Vec3 moment_P = Vec3::Zero();                  // [kg m] first, about Po
  };
  Seen I_, I_before_, E_, E_before_;
  double since_ = 0.0;  // [s] between the two
  double share_ = 0.0;  // [-]
  Mat6 M_1_ = Mat6::Zero();
  BodyMotion platform_;
};

}  // namespace ves
