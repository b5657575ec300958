// SPDX-License-Identifier: BSD-3-Clause
//
// The vehicle's part in the equations of motion of chapter 3, by kind.
#pragma once

#include <algorithm>
#include <variant>

#include "ves/srms/interaction.hpp"

namespace ves {

/// The robot that rides on it, at one time.
struct RidingRobot {
  const RobotModel& model;
  const Transform& X_PL0;
  JointState q;
  double t;                       // [s] since they were let go
  const RigidBody& composite_L0;  // with its joints locked

  bool stands() const { return q.q_dot.isZero(0.0) && q.q_ddot.isZero(0.0); }
};

/// y = {eta, eta'}; without modes one number that stays.
class ModalEquations {
 public:
  ModalEquations(const ModalModel& base, const Interaction& interaction,
                 const InteractionOptions& options);

  Eigen::Index size() const { return std::max<Eigen::Index>(1, 2 * modes()); }
  Eigen::VectorXd start(const RidingRobot& robot) const;
  /// [-] of y's units that are a millimetre at the tip.
  double milli() const { return modes() > 0 ? 1e-3 / base_.Phi.cwiseAbs().maxCoeff() : 1e-3; }
  /// The interval that begins now, `step` steps after the start.
  void begin(const RidingRobot& robot, std::int64_t step, const Eigen::VectorXd& y);
  /// Whether something is held from step to step.
  bool holdsAStep() const { return options_.hold_mass > 0; }
  /// Where P is, and how it moves.
  BodyMotion platform(const RidingRobot& robot, const Eigen::VectorXd& y) const;
  /// The robot has another load, while P moves as before.
  void load(const RidingRobot&, const BodyMotion&, Eigen::VectorXd&) const {}
  /// Under what touches or pushes the two, about Po in I.
  void derivative(const RidingRobot& robot, const Eigen::VectorXd& y, const Wrench& F_Po_I,
                  Eigen::VectorXd& dy) const;
  void tell(const RidingRobot& robot, const Eigen::VectorXd& y, InteractionPoint& point) const;

 private:
  Eigen::Index modes() const { return base_.stiffness.size(); }
  using Shapes = Eigen::Matrix<double, 6, Eigen::Dynamic>;
  /// How the platform moves, but for the accelerations of the modes.
  struct Place {
    PathPoint<6> ground;
    Vec6 x, x_dot;  // [m, rad], [m/s, rad/s]
  };
  Place placeOf(const RidingRobot& robot, const Eigen::VectorXd& y) const;
  BodyMotion motionOf(const Place& place) const {
    return bodyMotion(p_IH_, Pose::from(place.x), place.x_dot, place.ground.x_ddot);
  }
  Shapes jacobian(const Place& place) const;
  RigidBody lockedInP(const RidingRobot& robot) const;
  void split(const RidingRobot& robot, const Place& place, Eigen::MatrixXd& A,
             Eigen::VectorXd& right) const;
  void whole(const RidingRobot& robot, const Place& place, const Shapes& J, Eigen::MatrixXd& A,
             Eigen::VectorXd& right) const;

  void weight(const RidingRobot& robot, const Place& place, Eigen::VectorXd& right) const;

  const ModalModel& base_;
  const GroundMotion& ground_;
  Vec3 gravity_;  // [m/s^2] felt, in I
  Vec6 at_home_;  // work of weight that the springs are in balance with
  const InteractionOptions& options_;
  Vec3 p_IH_;
  Eigen::VectorXd eta_;        // where it is let go
  Vec6 rest_;                  // [m, rad] constant part of x, which the modes do not express
  std::int64_t held_at_ = -1;  // [-] step that A was last computed for
  RigidBody held_;
};

/// y = {p, q, P, L}: where P is from home, its attitude, and the momentum of all that floats, about
/// home in I, over its mass at the start. Whatever the joints do, nothing but F_Po_I changes it.
class FreeBodyEquations {
 public:
  FreeBodyEquations(const FreeBodyModel& model, const Interaction& interaction,
                    const InteractionOptions& options);

  Eigen::Index size() const { return 13; }
  Eigen::VectorXd start(const RidingRobot& robot) const;
  double milli() const { return 1e-3; }
  /// Thrusters are held from step to step, as a controller holds them.
  void begin(const RidingRobot& robot, std::int64_t step, const Eigen::VectorXd& y);
  bool holdsAStep() const { return model_.propulsion.any(); }
  BodyMotion platform(const RidingRobot& robot, const Eigen::VectorXd& y) const;
  void load(const RidingRobot& robot, const BodyMotion& P, Eigen::VectorXd& y) const {
    y.head(size()) = stateOf(robot, P);
  }
  void derivative(const RidingRobot& robot, const Eigen::VectorXd& y, const Wrench& F_Po_I,
                  Eigen::VectorXd& dy) const;
  void tell(const RidingRobot& robot, const Eigen::VectorXd& y, InteractionPoint& point) const;

 private:
  Eigen::VectorXd stateOf(const RidingRobot& robot, const BodyMotion& P) const;

  const FreeBodyModel& model_;
  const std::vector<OrderedFiring>& ordered_;
  Vec3 p_IH_;
  Vec6 start_;
  double mass_;                  // [kg] at the start
  double step_;                  // [s]
  std::int64_t pushes_at_ = -1;  // [-] step that pushed_P_ is for
  Pulses pulses_;
  Wrench pushed_P_;  // by thrusters, about Po
};

using VehicleEquations = std::variant<ModalEquations, FreeBodyEquations>;
VehicleEquations equationsOf(const Interaction& interaction, const InteractionOptions& options);

}  // namespace ves
