// SPDX-License-Identifier: BSD-3-Clause
#include "ves/vehicle/modal_vehicle.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include "ves/kinematics/stewart.hpp"
#include "ves/math/dense.hpp"
#include "ves/math/lu6.hpp"
#include "ves/math/second_order.hpp"

namespace ves {

ModalModel scaled(const ModalModel& model, const VehicleFactors& f) {
  return {model.Phi / std::sqrt(f.mass), model.stiffness * (f.stiffness / f.mass),
          model.damping * (f.damping / f.mass)};
}

ModalHold modalHold(const ModalModel& model, double dt) {
  const Eigen::Index k = model.stiffness.size();
  ModalHold out;
  if (model.damping.isDiagonal(0.0)) {
    out = {Eigen::MatrixXd::Zero(2 * k, 2 * k), Eigen::MatrixXd::Zero(2 * k, k)};
    for (Eigen::Index i = 0; i < k; ++i) {
      const SecondOrderHold one = discretise(model.stiffness(i), model.damping(i, i), dt);
      out.Phi(i, i) = one.Phi(0, 0);
      out.Phi(i, k + i) = one.Phi(0, 1);
      out.Phi(k + i, i) = one.Phi(1, 0);
      out.Phi(k + i, k + i) = one.Phi(1, 1);
      out.Gamma(i, i) = one.Gamma(0);
      out.Gamma(k + i, i) = one.Gamma(1);
    }
    return out;
  }
  // exp([A B; 0 0] T) = [Phi Gamma; 0 I] (van Loan), of {w eta, eta', u/w} with w the fastest
  // mode's frequency: as they are, stiffness beside ones costs four digits.
  const double w = std::max(1.0, std::sqrt(model.stiffness.maxCoeff()));
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(3 * k, 3 * k);
  M.block(0, k, k, k).setIdentity();
  M.block(0, k, k, k) *= w;
  M.block(k, 0, k, k) = -Eigen::MatrixXd(model.stiffness.asDiagonal()) / w;
  M.block(k, k, k, k) = -model.damping;
  M.block(k, 2 * k, k, k).setIdentity();
  M.block(k, 2 * k, k, k) *= w;
  const Eigen::MatrixXd E = exponential(M * dt);
  out = {E.topLeftCorner(2 * k, 2 * k), E.topRightCorner(2 * k, k) / w};
  out.Phi.topRightCorner(k, k) /= w;
  out.Phi.bottomLeftCorner(k, k) *= w;
  out.Gamma.topRows(k) /= w;
  return out;
}

ModalDynamics::ModalDynamics(const ModalModel& model)
    : Phi_(model.Phi),
      compliance_(Phi_ * Phi_.transpose()),
      k_(model.stiffness),
      c_(model.damping.diagonal()),
      coupled_(!model.damping.isDiagonal(0.0)) {
  assert(size() <= (coupled_ ? kMaxCoupledModes : kMaxModes));
  assert(model.Phi.cols() == size() && model.damping.rows() == size());
  if (coupled_) damping_ = model.damping;
  if (size() == 0) return;
  fastest_ = std::sqrt(k_.maxCoeff());
  most_damping_ = coupled_ ? damping_.norm() : c_.maxCoeff();
}

ModalDynamics::Hold ModalDynamics::hold(double dt) const {
  const Eigen::Index k = size();
  Hold out;
  if (!coupled_) {
    out.modes.resize(6, k);
    for (Eigen::Index i = 0; i < k; ++i) {
      const SecondOrderHold h = discretise(k_(i), c_(i), dt);
      out.modes.col(i) << h.Phi(0, 0), h.Phi(0, 1), h.Phi(1, 0), h.Phi(1, 1), h.Gamma(0),
          h.Gamma(1);
    }
    return out;
  }
  const ModalHold both = modalHold({Phi_, k_, damping_}, dt);
  out.Phi = both.Phi;
  out.Gamma = both.Gamma;
  return out;
}

ModalDynamics::Modes ModalDynamics::atRest() const {
  return {Vector<kMaxModes>::Zero(size()), Vector<kMaxModes>::Zero(size())};
}

ModalDynamics::Modes ModalDynamics::advance(const Hold& hold, const Modes& from,
                                            const Forces& u) const noexcept {
  const Eigen::Index k = size();
  Modes to;
  if (coupled_) {
    Vector<kCoupledStates> state(2 * k), next(2 * k);
    state << from.eta, from.eta_dot;
    next.noalias() = hold.Phi * state;
    next.noalias() += hold.Gamma * u;
    to.eta = next.head(k);
    to.eta_dot = next.tail(k);
    return to;
  }
  to.eta.resize(k);
  to.eta_dot.resize(k);
  for (Eigen::Index i = 0; i < k; ++i) {
    const double y = from.eta(i), y_dot = from.eta_dot(i);
    const auto h = hold.modes.col(i);
    to.eta(i) = h(0) * y + h(1) * y_dot + h(4) * u(i);
    to.eta_dot(i) = h(2) * y + h(3) * y_dot + h(5) * u(i);
  }
  return to;
}

ModalDynamics::Vector<kMaxModes> ModalDynamics::acceleration(const Modes& modes,
                                                             const Forces& u) const noexcept {
  Vector<kMaxModes> eta_ddot = u - k_.cwiseProduct(modes.eta);
  if (coupled_)
    eta_ddot.noalias() -= damping_ * modes.eta_dot;
  else
    eta_ddot -= c_.cwiseProduct(modes.eta_dot);
  return eta_ddot;
}

ModalDynamics ModalDynamics::withoutDampingAbove(double most) const noexcept {
  ModalDynamics out = *this;
  if (coupled_ && most_damping_ > most) out.damping_.setZero();
  for (Eigen::Index i = 0; i < size(); ++i)
    if (c_(i) > most) out.c_(i) = 0.0;
  out.most_damping_ = std::min(most_damping_, most);
  return out;
}

ModalDynamics ModalDynamics::scaled(const VehicleFactors& f) const noexcept {
  ModalDynamics out = *this;
  out.k_ *= f.stiffness / f.mass;
  out.c_ *= f.damping / f.mass;
  out.damping_ *= f.damping / f.mass;
  out.fastest_ *= std::sqrt(f.stiffness / f.mass);
  out.most_damping_ *= f.damping / f.mass;
  return out;
}

/// Woodbury: (1 + Phi^T M_1 Phi)^-1 = 1 - Phi^T (1 + M_1 Phi Phi^T)^-1 M_1 Phi.
ModalDynamics::Body ModalDynamics::body(const Mat6& M_1) const noexcept {
  const Mat6 left = Mat6::Identity() + M_1.lazyProduct(compliance_);
  const Mat6 inverse = Lu6(left).inverse(), X = inverse.lazyProduct(M_1);
  Body out;
  out.pull = X.lazyProduct(Phi_);
  out.mobility = compliance_.lazyProduct(inverse);
  return out;
}

ModalDynamics::Vector<kMaxModes> ModalDynamics::acceleration(const Body& body, const Modes& modes,
                                                             const Forces& u) const noexcept {
  Vector<kMaxModes> eta_ddot = acceleration(modes, u);
  const Vec6 pull = body.pull * eta_ddot;
  eta_ddot.noalias() -= Phi_.transpose() * pull;
  return eta_ddot;
}

ModalDynamics::Vector<kMaxModes> ModalDynamics::afterBlow(const Body& body,
                                                          const Vector<kMaxModes>& eta_dot,
                                                          const Vec6& blow) const noexcept {
  Vector<kMaxModes> change;
  change.noalias() = Phi_.transpose() * blow;
  const Vec6 pull = body.pull * change;
  change.noalias() -= Phi_.transpose() * pull;
  return eta_dot + change;
}

ModalDynamics::Modes ModalDynamics::advance(const Body& body, double dt, const Modes& from,
                                            const Forces& u) const noexcept {
  // A body only slows the modes down: steps that suffice without it do.
  constexpr double kMostAngle = 1.5;     // [rad] of the fastest mode in a step
  constexpr int kMostTerms = 26;         // 1.5^26/26! < 1e-21
  constexpr double kNegligible = 1e-17;  // [-] of the sum
  const int steps = std::max(
      1, static_cast<int>(std::ceil(std::abs(dt) * (fastest_ + most_damping_) / kMostAngle)));
  const double h = dt / steps;
  const auto sizeOf = [this](const Modes& m) {
    return fastest_ * m.eta.cwiseAbs().sum() + m.eta_dot.cwiseAbs().sum();
  };
  const Forces none = Forces::Zero(size());
  Modes sum = from, term;  // by elements: a whole one is as long as kMaxModes
  for (int n = 0; n < steps; ++n) {
    // Of {eta, eta'}: its derivative number j times h^j/j!.
    term.eta = h * sum.eta_dot;
    term.eta_dot = h * acceleration(body, sum, u);
    for (int j = 2; j <= kMostTerms; ++j) {
      sum.eta += term.eta;
      sum.eta_dot += term.eta_dot;
      if (!(sizeOf(term) > kNegligible * sizeOf(sum))) break;
      const Vector<kMaxModes> next = acceleration(body, term, none);
      term.eta = (h / j) * term.eta_dot;
      term.eta_dot = (h / j) * next;
    }
  }
  return sum;
}

Vec6 workOfWeight(const Vec3& gravity, double mass, const Vec3& moment_P,
                  const Vec3& rpy) noexcept {
  const Vec3 n = (rotation(rpy) * moment_P).cross(gravity);
  return (Vec6() << mass * gravity, angleRateMap(rpy).transpose() * n).finished();
}

/// Second derivatives of -g . Rz Ry Rx s, where none of them turns.
Mat6 stiffnessOfWeight(const Vec3& gravity, const Vec3& moment_P) noexcept {
  Mat6 out = Mat6::Zero();
  for (int i = 0; i < 3; ++i)
    for (int j = i; j < 3; ++j)
      out(3 + i, 3 + j) = out(3 + j, 3 + i) =
          -gravity.dot(Vec3::Unit(j).cross(Vec3::Unit(i).cross(moment_P)));
  return out;
}

ModalVehicle::ModalVehicle(const ModalModel& model, double period, const GroundMotion& ground,
                           const Vec3& felt_gravity)
    : nominal_(model),
      dynamics_(nominal_),
      Phi_pinv_(leastSquares(model.Phi, Mat6::Identity())),
      ground_(ground),
      gravity_(felt_gravity),
      weighs_(!felt_gravity.isZero(0.0)),
      shakes_(weighs_ || ground.moves()),
      period_(period),
      step_(dynamics_.hold(period)) {
  now_.modes = dynamics_.atRest();
  before_ = now_;
  damping_.setZero(dynamics_.size());
  drag_.setZero(dynamics_.size());
}

void ModalVehicle::become(const VehicleFactors& factors) noexcept {
  if (factors == factors_) return;
  factors_ = factors;
  dynamics_ = nominal_.scaled(factors);
  if (!dynamics_.coupled()) step_ = dynamics_.hold(period_);
}

double ModalVehicle::costOf(const VehicleFactors& to) const noexcept {
  return (to.mass - factors_.mass) * 0.5 * now_.modes.eta_dot.squaredNorm() +
         (to.stiffness - factors_.stiffness) * nominal_.potentialEnergy(now_.modes);
}

void ModalVehicle::reset(const Vec6& x, const Mat6& M_1, double ahead) noexcept {
  constexpr double kMostGrowth = 5.0;  // [-] exponent of a damped mode's way back
  const auto& Phi = dynamics_.Phi();
  Modes& modes = now_.modes;
  modes.eta.noalias() = Phi_pinv_ * x;
  modes.eta_dot.setZero();
  offset_ = x;
  if (ground_.moves()) {
    now_.time = ahead > 0.0 ? -ahead : 0.0;
    now_.ground = ground_.at(now_.time);
    modes.eta.noalias() -= Phi_pinv_ * now_.ground.x;
    modes.eta_dot.noalias() -= Phi_pinv_ * now_.ground.x_dot;
    offset_ -= now_.ground.x;
  }
  offset_.noalias() -= Phi * modes.eta;
  now_.motion = {};
  now_.motion.x = x;
  E_.setIdentity();
  balanced_ = false;
  if (!(ahead > 0.0)) return;
  E_ = angleRateMap(x.tail<3>());
  const ModalDynamics light = dynamics_.withoutDampingAbove(kMostGrowth / ahead);
  ModalDynamics::Forces u = ModalDynamics::Forces::Zero(dynamics_.size());
  if (weighs_) {  // by M_1, until a step tells better
    const Mat3 mc = M_1.bottomLeftCorner<3, 3>();
    const Vec3 moment_P =
        rotation(Vec3(x.tail<3>())).transpose() * Vec3(mc(2, 1), mc(0, 2), mc(1, 0));
    at_home_ = workOfWeight(gravity_, M_1(0, 0), moment_P, Vec3::Zero());
    u = weightAt(M_1(0, 0), moment_P, x, now_.ground);
  }
  modes = light.advance(light.body(working(M_1) / factors_.mass), -ahead, modes, u);
}

ModalDynamics::Forces ModalVehicle::weightAt(double mass, const Vec3& moment_P, const Vec6& x,
                                             const PathPoint<6>& ground) const noexcept {
  // In the axes of what it stands on, which gravity turns away from.
  Vec6 own = Vec6::Zero();  // [m/s^2]
  own.head<3>() = rotation(Vec3(ground.x.tail<3>())).transpose() * gravity_ - gravity_;
  const Vec3 rpy = (x - ground.x).tail<3>();
  const Vec6 body = workOfWeight(gravity_ + own.head<3>(), mass, moment_P, rpy) - at_home_;
  ModalDynamics::Forces out;
  out.noalias() = dynamics_.Phi().transpose() * body;
  out /= factors_.mass;
  out.noalias() += Phi_pinv_ * own;
  return out;
}

void ModalVehicle::step(const Wrench& F_Po_I, double damping) noexcept {
  before_ = now_;
  dt_ = period_;
  mobility_ = dynamics_.mobility();
  ModalDynamics::Forces u;  // Phi^T F
  u.noalias() = dynamics_.Phi().transpose() * F_Po_I.stacked();
  u /= factors_.mass;
  damping_ = -damping * before_.modes.eta_dot;
  u += damping_;
  ModalDynamics::Forces then;  // of the ground as it is at the end
  if (ground_.moves()) {
    now_.time += period_;
    now_.ground = ground_.at(now_.time);
    drag_ = dragAt((now_.ground.x_dot - before_.ground.x_dot) / period_, Mat6::Zero());
    then = dragAt(now_.ground.x_ddot, Mat6::Zero()) - drag_;
    u += drag_;
  }
  // The coupled transition of another vehicle would be computed on the heap.
  const bool by_series = dynamics_.coupled() && factors_ != VehicleFactors();
  now_.modes = by_series
                   ? dynamics_.advance(dynamics_.body(Mat6::Zero()), period_, before_.modes, u)
                   : dynamics_.advance(step_, before_.modes, u);
  if (ground_.moves()) u += then;
  now_.motion = at(now_.modes, dynamics_.acceleration(now_.modes, u), now_.ground);
  if (damped() < 0.0) {
    now_ = before_;
    step(F_Po_I, 0.0);
  }
}

void ModalVehicle::step(const Wrench& F_Po_I, const CarriedBody& carried, double dt, double ahead,
                        double damping) noexcept {
  before_ = now_;
  // What the body's momentum loses by another shape or attitude goes to base and body. The moment
  // of a body that slides is not in it: r' x v is no torque about a point that slides along.
  const Mat6& M_1_before = dt > 0.0 ? carried.before : carried.M_1;
  Vec6 lost = M_1_before.rightCols<3>() * (E_ * angleRates(before_));
  Modes middle = before_.modes;
  middle.eta += 0.5 * dt * middle.eta_dot;
  if (ground_.moves()) {
    now_.time += dt;
    now_.ground = ground_.at(now_.time);
  }
  const Vec6 x_middle = coordinates(middle, now_.ground);
  E_ = angleRateMap(x_middle.tail<3>());
  lost -= carried.M_1.rightCols<3>() * (E_ * angleRates(before_));
  const Mat6 M_1_per_mass = working(carried.M_1) / factors_.mass;
  const ModalDynamics::Body body = dynamics_.body(M_1_per_mass);
  dt_ = dt;
  mobility_ = body.mobility;
  before_.modes.eta_dot =
      dynamics_.afterBlow(body, before_.modes.eta_dot, working(Wrench::from(lost)) / factors_.mass);

  ModalDynamics::Forces u;
  u.noalias() = dynamics_.Phi().transpose() * working(F_Po_I);
  u /= factors_.mass;
  const Vec6 momentum = M_1_per_mass * (dynamics_.Phi() * before_.modes.eta_dot);
  damping_ = -damping * before_.modes.eta_dot;
  damping_.noalias() -= damping * dynamics_.Phi().transpose() * momentum;
  u += damping_;
  PathPoint<6> then = now_.ground;
  ModalDynamics::Forces u_then = u;
  if (ground_.moves()) {
    const auto mean = [&](const PathPoint<6>& from, const PathPoint<6>& to, double over) {
      return dragAt(over > 0.0 ? Vec6((to.x_dot - from.x_dot) / over) : to.x_ddot, M_1_per_mass);
    };
    then = ground_.at(now_.time + ahead);
    drag_ = mean(before_.ground, now_.ground, dt);
    u_then += mean(now_.ground, then, ahead);
    u += drag_;
  }
  ModalDynamics::Forces weight;
  if (weighs_) {
    if (!std::exchange(balanced_, true))
      at_home_ = workOfWeight(gravity_, carried.mass, carried.moment_P, Vec3::Zero());
    weight = weightAt(carried.mass, carried.moment_P, x_middle, now_.ground);
    if (!ground_.moves()) drag_.setZero();
    drag_ += weight;
    u += weight;
    u_then += weight;
  }
  now_.modes = dynamics_.advance(body, dt, before_.modes, u);
  const Modes later = dynamics_.advance(body, ahead, now_.modes, u_then);
  if (ground_.moves()) {
    u_then = u - drag_ + dragAt(then.x_ddot, M_1_per_mass);
    if (weighs_) u_then += weight;
  }
  now_.motion = at(later, dynamics_.acceleration(body, later, u_then), then);
  if (damped() < 0.0) {
    now_ = before_;
    CarriedBody kept = carried;
    kept.before = carried.M_1;
    step(F_Po_I, kept, dt, ahead, 0.0);
  }
}

Vec6 ModalVehicle::coordinates(const Modes& modes, const PathPoint<6>& ground) const noexcept {
  Vec6 x = offset_;
  x.noalias() += dynamics_.Phi() * modes.eta;
  if (ground_.moves()) x += ground.x;
  return x;
}

Vec3 ModalVehicle::angleRates(const State& state) const noexcept {
  Vec3 rates = dynamics_.Phi().bottomRows<3>() * state.modes.eta_dot;
  if (ground_.moves()) rates += state.ground.x_dot.tail<3>();
  return rates;
}

ModalDynamics::Forces ModalVehicle::dragAt(const Vec6& g_ddot,
                                           const Mat6& M_1_per_mass) const noexcept {
  ModalDynamics::Forces out;
  out.noalias() = -(Phi_pinv_ * g_ddot);
  const Vec6 of_body = M_1_per_mass * g_ddot;
  out.noalias() -= dynamics_.Phi().transpose() * of_body;
  return out;
}

Mat6 ModalVehicle::working(const Mat6& M_1) const noexcept {
  Mat6 out = M_1;
  out.rightCols<3>() = M_1.rightCols<3>() * E_;
  out.bottomRows<3>() = (E_.transpose() * out.bottomRows<3>()).eval();
  return out;
}

PathPoint<6> ModalVehicle::at(const Modes& modes,
                              const ModalDynamics::Vector<kMaxModes>& acceleration,
                              const PathPoint<6>& ground) const noexcept {
  const auto& Phi = dynamics_.Phi();
  PathPoint<6> out;
  out.x = coordinates(modes, ground);
  out.x_dot.noalias() = Phi * modes.eta_dot;
  out.x_ddot.noalias() = Phi * acceleration;
  if (ground_.moves()) {
    out.x_dot += ground.x_dot;
    out.x_ddot += ground.x_ddot;
  }
  return out;
}

BodyMotion ModalVehicle::bodyMotion() const noexcept {
  const PathPoint<6>& m = now_.motion;
  return ves::bodyMotion(Vec3::Zero(), Pose::from(m.x), m.x_dot, m.x_ddot);
}

BodyMotion ModalVehicle::coasting() const noexcept {
  BodyMotion out = bodyMotion();
  out.a = out.alpha = Vec3::Zero();
  return out;
}

BodyMotion ModalVehicle::atWrench() const noexcept {
  Vec6 x_dot = dynamics_.Phi() * now_.modes.eta_dot;
  if (ground_.moves()) x_dot += now_.ground.x_dot;
  BodyMotion out = ves::bodyMotion(Vec3::Zero(), Pose::from(coordinates(now_.modes, now_.ground)),
                                   x_dot, Vec6::Zero());
  out.alpha = Vec3::Zero();  // with the angles' rates held it is not zero: their axes turn
  return out;
}

void ModalVehicle::displace(const Modes& by) noexcept {
  const auto& Phi = dynamics_.Phi();
  now_.modes.eta += by.eta;
  now_.modes.eta_dot += by.eta_dot;
  now_.motion.x.noalias() += Phi * by.eta;
  now_.motion.x_dot.noalias() += Phi * by.eta_dot;
}

void ModalVehicle::slow(double share) noexcept {
  Modes& modes = now_.modes;
  PathPoint<6>& motion = now_.motion;  // which may be ahead of the modes
  modes.eta = before_.modes.eta + share * (modes.eta - before_.modes.eta);
  modes.eta_dot *= share;
  if (ground_.moves()) {  // which waits
    now_.time = before_.time + share * (now_.time - before_.time);
    now_.ground = ground_.at(now_.time);
  }
  motion.x = before_.motion.x + share * (motion.x - before_.motion.x);
  motion.x_dot *= share;
  motion.x_ddot = (motion.x_dot - before_.motion.x_dot) / period_;
}

}  // namespace ves
