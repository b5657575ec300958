// SPDX-License-Identifier: BSD-3-Clause
//
// What a robot's momentum and weight change by when its bodies are not what they are believed to
// be: linear in four parameters a body, to first order.
#pragma once

#include <span>

#include "ves/robot/robot_model.hpp"

namespace ves {

/// Bodies whose masses may be wrong: the heaviest of a robot's, and what is in its hand.
inline constexpr int kMaxUncertain = 9;
/// {density [-], shift of the first moment x, y, z per the believed mass [m]} of each body: mass,
/// first moment, and, to first order, the inertia about the link's origin are linear in them.
inline constexpr int kMaxMassParameters = 4 * kMaxUncertain;
using MassVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxMassParameters, 1>;
/// One column a parameter.
using MassColumns = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxMassParameters>;
using MassCovariance = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxMassParameters,
                                     kMaxMassParameters>;

/// Bodies whose masses may be wrong, in their own units. Zero behind the last.
struct BodyMasses {
  using PerBody = Eigen::Matrix<double, kMaxUncertain, 1>;
  using PerAxis = Eigen::Matrix<double, 3 * kMaxUncertain, 1>;           // x, y, z of each body
  PerBody mass = PerBody::Zero(), mass_deviation = PerBody::Zero();      // [kg]
  PerAxis moment = PerAxis::Zero(), moment_deviation = PerAxis::Zero();  // [kg m] first, about the
                                                                         // link's origin
};

/// The last four parameters are those of a body in the hand that nobody told of: of 1 kg and at the
/// hand, so its mass [kg] and its first moment about there [kg m].
class MassRegressor {
 public:
  explicit MassRegressor(const RobotModel& robot, const Hand& hand = {});

  int size() const noexcept { return 4 * count_; }  // parameters
  int hand() const noexcept { return hand_; }       // the first of its parameters; -1: none
  /// What the parameters may be where each body's mass is off by a share of it, and its centre by
  /// that share of its distance from the link's origin. Nothing is in the hand.
  MassVector deviations(double share) const noexcept;

  /// A platform and the robot on it.
  struct State {
    Mat3 R_IP;
    Vec3 v = Vec3::Zero(), w = Vec3::Zero();  // [m/s], [rad/s] of Po and P in I
    JointVector q = JointVector::Zero(), q_dot = JointVector::Zero();
  };
  /// Momentum [N s, N m s] and weight [N, N m] per parameter, about Po in I; X_PL0 poses the base
  /// link, g_I [m/s^2].
  void evaluate(const Transform& X_PL0, const Vec3& g_I, const State& at, MassColumns& momentum,
                MassColumns& weight) const noexcept;

  /// The bodies with these parameters, known with this covariance.
  BodyMasses described(const MassVector& parameters, const MassCovariance& P) const noexcept;
  /// [-] of each body in BodyMasses: the link that it is or hangs on, -1: link 0. So many as there
  /// are; what is in the hand, if anything may be, is the last.
  std::span<const int> links() const noexcept {
    return {links_.data(), static_cast<std::size_t>(count_)};
  }

  /// The robot with these parameters.
  RobotModel changed(const MassVector& parameters) const noexcept;

 private:
  RobotModel robot_;
  std::array<int, kMaxUncertain> links_{};  // -1: link 0
  std::array<RigidBody, kMaxUncertain> body_{};
  int count_ = 0, hand_ = -1;
};

}  // namespace ves
