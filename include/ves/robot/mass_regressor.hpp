// SPDX-License-Identifier: BSD-3-Clause
//
// What a robot's momentum and weight change by when its bodies are not what they are believed to
// be: linear in four parameters a body, to first order.
#pragma once

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

  /// The robot with these parameters.
  RobotModel changed(const MassVector& parameters) const noexcept;

 private:
  RobotModel robot_;
  std::array<int, kMaxUncertain> links_{};  // -1: link 0
  std::array<RigidBody, kMaxUncertain> body_{};
  int count_ = 0, hand_ = -1;
};

}  // namespace ves
