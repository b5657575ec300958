// SPDX-License-Identifier: BSD-3-Clause
#include "vehicle_equations.hpp"

#include <Eigen/LU>

#include "ves/kinematics/stewart.hpp"
#include "ves/math/dense.hpp"
#include "ves/robot/momentum.hpp"
#include "ves/robot/newton_euler.hpp"

namespace ves {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Eigen::Index kAttitude = 3, kMomentum = 7, kStates = 13;  // of a free body

/// What the vehicle feels of the robot, about Po in P. One that stands is one body.
Wrench reaction(const RidingRobot& robot, const ProperMotion& L0) {
  const Wrench on_robot = robot.stands() ? inertialWrench(robot.composite_L0, L0)
                                         : newtonEuler(robot.model, robot.q, L0).F_L0o_L0;
  return transfer(robot.X_PL0, Wrench{} - on_robot);
}

RigidBody lockedInP(const RidingRobot& robot) {
  return combine(RigidBody{}, robot.X_PL0, robot.composite_L0);
}

}  // namespace

ModalEquations::ModalEquations(const ModalModel& base, const Interaction& interaction,
                               const InteractionOptions& options)
    : base_(base),
      ground_(interaction.vehicle.ground),
      gravity_(interaction.vehicle.gravity),
      options_(options),
      p_IH_(interaction.p_IH),
      eta_(leastSquares(base.Phi, interaction.start - ground_.at(0.0).x)),
      rest_(interaction.start - ground_.at(0.0).x - base.Phi * eta_) {
  const RigidBody robot_P = lockedRobot(interaction.payload, interaction.q0);
  at_home_ = workOfWeight(gravity_, robot_P.mass, robot_P.mass * robot_P.p_BoBcm_B, Vec3::Zero());
}

VectorXd ModalEquations::start(const RidingRobot&) const {
  VectorXd y = VectorXd::Zero(size());
  y.head(modes()) = eta_;
  if (options_.eta.size()) y.head(modes()) += options_.eta;
  if (ground_.moves())
    y.segment(modes(), modes()) = -leastSquares(base_.Phi, ground_.at(0.0).x_dot);
  if (options_.eta_dot.size()) y.segment(modes(), modes()) += options_.eta_dot;
  return y;
}

void ModalEquations::begin(const RidingRobot& robot, std::int64_t step, const VectorXd&) {
  if (options_.hold_mass == 0 || step % options_.hold_mass != 0 || step == held_at_) return;
  held_at_ = step;
  held_ = robot.composite_L0;
}

ModalEquations::Place ModalEquations::placeOf(const RidingRobot& robot, const VectorXd& y) const {
  const PathPoint<6> ground = ground_.at(robot.t);
  return {ground, rest_ + base_.Phi * y.head(modes()) + ground.x,
          base_.Phi * y.segment(modes(), modes()) + ground.x_dot};
}

BodyMotion ModalEquations::platform(const RidingRobot& robot, const VectorXd& y) const {
  return motionOf(placeOf(robot, y));
}

void ModalEquations::derivative(const RidingRobot& robot, const VectorXd& y, const Wrench& F_Po_I,
                                VectorXd& dy) const {
  const Eigen::Index k = modes();
  if (k == 0) {
    dy.head(size()).setZero();
    return;
  }
  const auto eta = y.head(k), eta_dot = y.segment(k, k);
  dy.head(k) = eta_dot;
  VectorXd right = -base_.stiffness.cwiseProduct(eta) - base_.damping * eta_dot;
  MatrixXd A;
  const Place place = placeOf(robot, y);
  const Shapes J = jacobian(place);
  if (options_.model == InteractionModel::kSplit)
    split(robot, place, A, right);
  else
    whole(robot, place, J, A, right);
  if (const Vec6 F = F_Po_I.stacked(); !F.isZero(0.0)) right += J.transpose() * F;
  if (ground_.moves()) right -= leastSquares(base_.Phi, place.ground.x_ddot);
  if (!gravity_.isZero(0.0)) weight(robot, place, right);
  dy.segment(k, k) = solvePositive(A, right);
}

/// Of the robot, beyond what it is in balance with, and by the ground's tilt of the vehicle itself.
void ModalEquations::weight(const RidingRobot& robot, const Place& place, VectorXd& right) const {
  const RigidBody all = ves::lockedInP(robot);
  Vec6 own = Vec6::Zero();
  own.head<3>() = rotation(Vec3(place.ground.x.tail<3>())).transpose() * gravity_ - gravity_;
  const Vec3 rpy = (place.x - place.ground.x).tail<3>();
  right +=
      base_.Phi.transpose() *
      (workOfWeight(gravity_ + own.head<3>(), all.mass, all.mass * all.p_BoBcm_B, rpy) - at_home_);
  right += leastSquares(base_.Phi, own);
}

void ModalEquations::tell(const RidingRobot& robot, const VectorXd& y, InteractionPoint& p) const {
  const Place place = placeOf(robot, y);
  p.eta = y.head(modes());
  p.eta_dot = y.segment(modes(), modes());
  p.x = place.x;
  p.x_dot = place.x_dot;
}

/// {v, w} of P per eta'.
ModalEquations::Shapes ModalEquations::jacobian(const Place& place) const {
  const Mat3 E = angleRateMap(place.x.tail<3>());
  Shapes J = base_.Phi;
  for (Eigen::Index i = 0; i < J.cols(); ++i) J.col(i).tail<3>() = E * J.col(i).tail<3>().eval();
  return J;
}

RigidBody ModalEquations::lockedInP(const RidingRobot& robot) const {
  return options_.hold_mass > 0 ? combine(RigidBody{}, robot.X_PL0, held_) : ves::lockedInP(robot);
}

/// (3.11): A, and what stands beside stiffness and damping on its right.
void ModalEquations::split(const RidingRobot& robot, const Place& place, MatrixXd& A,
                           VectorXd& right) const {
  const RigidBody locked = lockedInP(robot);
  A = augmentedModalMass(base_, locked);
  const auto Phi_u = base_.Phi.topRows<3>(), Phi_l = base_.Phi.bottomRows<3>();
  const Mat3 Rx = skew(locked.p_BoBcm_B);
  const Vec3 w = place.x_dot.tail<3>();
  const Vec3 centripetal = locked.mass * w.cross(Rx * w);
  right += (Phi_u.transpose() + Phi_l.transpose() * Rx) * centripetal;
  right += base_.Phi.transpose() * reaction(robot, ProperMotion{}).stacked();
  if (ground_.moves()) right -= base_.Phi.transpose() * spatialMass(locked) * place.ground.x_ddot;
}

void ModalEquations::whole(const RidingRobot& robot, const Place& place, const Shapes& J,
                           MatrixXd& A, VectorXd& right) const {
  const BodyMotion P = motionOf(place);
  // The wrench is affine in the base's acceleration: this much without, the locked mass with it.
  const Wrench F_Po_P = reaction(robot, properMotion(P, robot.X_PL0, Vec3::Zero()));
  right += J.transpose() * rotate(P.X.R, F_Po_P).stacked();
  const Mat6 M_1 = spatialMass(rotated(P.X.R, ves::lockedInP(robot)));
  Shapes M_1_J(6, modes());
  for (Eigen::Index i = 0; i < modes(); ++i) M_1_J.col(i).noalias() = M_1 * J.col(i);
  A.resize(modes(), modes());
  A.noalias() = J.transpose().lazyProduct(M_1_J);
  A.diagonal().array() += 1.0;
}

FreeBodyEquations::FreeBodyEquations(const FreeBodyModel& model, const Interaction& interaction,
                                     const InteractionOptions& options)
    : model_(model),
      ordered_(interaction.firings),
      p_IH_(interaction.p_IH),
      start_(interaction.start),
      mass_(model.body_P.mass + lockedRobot(interaction.payload, interaction.q0).mass),
      step_(static_cast<double>(options.step) * kSecondPerNanosecond) {}

namespace {

/// Of vehicle and robot, its joints locked, about Po in I.
Mat6 massOf(const RigidBody& body_P, const RidingRobot& robot, const Mat3& R_IP) {
  return spatialMass(rotated(R_IP, combine(body_P, robot.X_PL0, robot.composite_L0)));
}

/// Of the joints alone, about Po in I.
Vec6 momentumOfJoints(const RidingRobot& robot, const Mat3& R_IP) {
  if (robot.stands()) return Vec6::Zero();
  const Wrench of_L0 = Wrench::from(jointMomentum(robot.model, robot.q.q, robot.q.q_dot));
  return rotate(R_IP, transfer(robot.X_PL0, of_L0)).stacked();
}

Eigen::Quaterniond attitude(const VectorXd& y) {
  return Eigen::Quaterniond(Eigen::Vector4d(y.segment<4>(kAttitude))).normalized();
}

}  // namespace

VectorXd FreeBodyEquations::start(const RidingRobot& robot) const {
  BodyMotion P;
  P.X = {rotation(Vec3(start_.tail<3>())), p_IH_ + start_.head<3>()};
  P.v = model_.v_IPo_I;
  P.w = model_.w_IP_I;
  return stateOf(robot, P);
}

/// Whatever the robot carries.
VectorXd FreeBodyEquations::stateOf(const RidingRobot& robot, const BodyMotion& P) const {
  const Vec3 p = P.X.p - p_IH_, w = model_.orbit.w();
  Vec6 momentum =
      massOf(model_.body_P, robot, P.X.R) * (Vec6() << P.v + w.cross(p), P.w + w).finished() +
      momentumOfJoints(robot, P.X.R);
  momentum.tail<3>() += P.X.R * wheelMomentum(model_.propulsion, robot.t);
  momentum.tail<3>() += p.cross(momentum.head<3>());  // about home
  VectorXd y(kStates);
  y << p, Eigen::Quaterniond(P.X.R).coeffs(), momentum / mass_;
  return y;
}

BodyMotion FreeBodyEquations::platform(const RidingRobot& robot, const VectorXd& y) const {
  BodyMotion P;
  const Vec3 p = y.head<3>();
  P.X = {attitude(y).toRotationMatrix(), p_IH_ + p};
  Vec6 momentum = mass_ * y.segment<6>(kMomentum);
  momentum.tail<3>() -= p.cross(momentum.head<3>());
  momentum -= momentumOfJoints(robot, P.X.R);
  momentum.tail<3>() -= P.X.R * wheelMomentum(model_.propulsion, robot.t);
  const Vec6 V = massOf(model_.body_P, robot, P.X.R).llt().solve(momentum);
  const Vec3 w = model_.orbit.w();
  P.v = V.head<3>() - w.cross(p);
  P.w = V.tail<3>() - w;
  return P;
}

void FreeBodyEquations::begin(const RidingRobot& robot, std::int64_t step, const VectorXd& y) {
  if (!model_.propulsion.any() || step == pushes_at_) return;
  pushes_at_ = step;
  const BodyMotion P = platform(robot, y);
  pulses_ =
      pulsesOf(model_.propulsion.hold, pulses_, rotationVector(P.X.R), P.X.R.transpose() * P.w);
  pushed_P_ =
      firings(model_.propulsion, pulses_, ordered_, static_cast<double>(step) * step_, step_).mean;
  pulses_ = spent(pulses_, step_);
}

void FreeBodyEquations::derivative(const RidingRobot& robot, const VectorXd& y,
                                   const Wrench& touching_Po_I, VectorXd& dy) const {
  const BodyMotion P = platform(robot, y);
  const Wrench F_Po_I = touching_Po_I + rotate(P.X.R, pushed_P_);
  const Vec3 p = y.head<3>();
  dy.head<3>() = P.v;
  const Eigen::Quaterniond turn(0.0, 0.5 * P.w.x(), 0.5 * P.w.y(), 0.5 * P.w.z());
  dy.segment<4>(kAttitude) = (turn * attitude(y)).coeffs();
  Vec6 rate;
  rate << F_Po_I.f, F_Po_I.n + p.cross(F_Po_I.f);
  if (const Orbit& orbit = model_.orbit; orbit.rate != 0.0) {
    // The axes turn under the momentum, and what is not at the origin is pulled elsewhere.
    const RigidBody all = rotated(P.X.R, combine(model_.body_P, robot.X_PL0, robot.composite_L0));
    const Vec3 c = p + all.p_BoBcm_B, w = orbit.w(),
               pull = all.mass * orbit.rate * orbit.rate * Vec3(2.0 * c.x(), -c.y(), -c.z()),
               linear = mass_ * y.segment<3>(kMomentum),
               angular = mass_ * y.segment<3>(kMomentum + 3);
    rate.head<3>() += pull - w.cross(linear);
    rate.tail<3>() += c.cross(pull) + orbit.gradient(all.I_Bcm_B) - w.cross(angular);
  }
  dy.segment<6>(kMomentum) = rate / mass_;
}

void FreeBodyEquations::tell(const RidingRobot& robot, const VectorXd& y,
                             InteractionPoint& point) const {
  const BodyMotion P = platform(robot, y);
  const Vec3 rpy = fixedAngles(P.X.R);
  point.x << y.head<3>(), rpy;
  point.x_dot << P.v, angleRateMap(rpy).inverse() * P.w;
}

VehicleEquations equationsOf(const Interaction& interaction, const InteractionOptions& options) {
  return std::visit(
      [&](const auto& model) -> VehicleEquations {
        if constexpr (std::is_same_v<std::decay_t<decltype(model)>, ModalModel>)
          return ModalEquations(model, interaction, options);
        else
          return FreeBodyEquations(model, interaction, options);
      },
      interaction.vehicle.kind);
}

}  // namespace ves
