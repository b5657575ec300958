// SPDX-License-Identifier: BSD-3-Clause
#include "ves/vehicle/free_body.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "ves/math/lu6.hpp"
#include "ves/math/relative_motion.hpp"

namespace ves {
namespace {

/// The body of a spatial mass.
struct Lumped {
  explicit Lumped(const Mat6& M) noexcept
      : mass(M(0, 0)),
        center(Vec3(M(5, 1), M(3, 2), M(4, 0)) / mass),
        inertia(M.bottomRightCorner<3, 3>() + mass * skew(center) * skew(center)) {}

  double mass;   // [kg]
  Vec3 center;   // [m] from Po
  Mat3 inertia;  // [kg m^2] about the centre
};

/// The rate of the rotation vector th of R = rotationOf(th) R_0 where R turns at w.
Vec3 rotationRate(const Vec3& th, const Vec3& w) noexcept {
  return w - 0.5 * th.cross(w) + th.cross(th.cross(w)) / 12.0;
}

Vec6 velocity(const RigidState& s) noexcept { return (Vec6() << s.v, s.w).finished(); }

/// The same with the acceleration under F.
BodyMotion motionOf(const Gyrostat& whole, const RigidState& s, const Wrench& F_Po_I,
                    const Orbit& orbit) noexcept {
  const Lumped body(whole.M_P);
  const Vec3 c = s.R_IP * body.center, h = s.R_IP * whole.h_P;
  const Mat3 J = s.R_IP * body.inertia * s.R_IP.transpose();
  const Vec3 W = orbit.w(), w = s.w + W;
  const Vec3 alpha =
      J.inverse() * (F_Po_I.n - c.cross(F_Po_I.f) + orbit.gradient(J) - w.cross(J * w + h)) +
      s.w.cross(W);
  const Vec3 a = F_Po_I.f / body.mass + orbit.acceleration(s.p + c, s.v + s.w.cross(c)) -
                 alpha.cross(c) - s.w.cross(s.w.cross(c));
  return {{s.R_IP, s.p}, s.v, s.w, a, alpha};
}

}  // namespace

ModalModel linearised(const FreeBodyModel& model) {
  const Eigen::LLT<Mat6> llt(spatialMass(model.body_P));
  ModalModel out;
  out.Phi = llt.matrixU().solve(Mat6::Identity());  // Phi^T M Phi = 1
  out.stiffness = Vec6::Zero();
  out.damping = Mat6::Zero();
  return out;
}

RigidState advanced(const Gyrostat& body, const Gyrostat& then, const RigidState& from,
                    const Wrench& F, double dt, const Orbit& orbit,
                    const Vec3& h_joints_I) noexcept {
  constexpr double kMostTurn = 0.005;  // [rad] in a step
  constexpr double kMostSteps = 1e3;   // [-] a turn as fast as that is no vehicle's
  if (dt == 0.0) return from;
  const Lumped at_first(body.M_P), at_last(then.M_P);
  const Vec3 c_first = from.R_IP * at_first.center, shift_P = at_last.center - at_first.center;
  const Mat3 reshape = at_last.inertia - at_first.inertia;
  const Vec3 a_c = F.f / at_last.mass, W = orbit.w();
  Vec3 L = from.R_IP * (at_first.inertia * (from.R_IP.transpose() * (from.w + W)) + body.h_P);

  const double turn =
      std::abs(dt) * (from.w.norm() + std::abs(dt) * (F.n - c_first.cross(F.f)).norm() *
                                          at_first.inertia.inverse().norm());
  const int steps = static_cast<int>(std::min(kMostSteps, 1.0 + turn / kMostTurn));
  const double h = dt / steps;
  RigidState to = from;
  Vec3 p_c = from.p + c_first, v_c = from.v + from.w.cross(c_first);  // but for the joints' part
  for (int i = 0; i < steps; ++i) {
    struct Rates {
      Vec3 th, L, p, v;
    };
    // (J_c w)' = n - c x f + (w x c) x m c_rel', where m c_rel' is the linear momentum of the
    // joints, which shows in how they move the centre: with f and n of their momentum h, J_c w +
    // h_c stays.
    const auto rates = [&](double part, const Vec3& th, const Vec3& momentum, const Vec3& p,
                           const Vec3& v) -> Rates {
      const double share = (i + part) / steps;
      const Mat3 R = rotationOf(th) * to.R_IP, J_P = at_first.inertia + share * reshape;
      const Vec3 h_P = body.h_P + share * (then.h_P - body.h_P);
      const Vec3 w = R * (J_P.inverse() * (R.transpose() * momentum - h_P)) - W,
                 c = R * (at_first.center + share * shift_P), c_dot = R * shift_P / dt;
      Rates out = {rotationRate(th, w), F.n - c.cross(F.f) + at_last.mass * w.cross(c).cross(c_dot),
                   v + c_dot, a_c};
      if (orbit.rate != 0.0) {
        out.L += orbit.gradient(R * J_P * R.transpose()) - W.cross(momentum + h_joints_I);
        out.v += orbit.acceleration(p, out.p);
      }
      return out;
    };
    const auto on = [&](double part, const Rates& k) {
      return rates(part, part * h * k.th, L + part * h * k.L, p_c + part * h * k.p,
                   v_c + part * h * k.v);
    };
    const Rates k1 = rates(0.0, Vec3::Zero(), L, p_c, v_c), k2 = on(0.5, k1), k3 = on(0.5, k2),
                k4 = on(1.0, k3);
    const auto mean = [&](Vec3 Rates::*of) -> Vec3 {
      return h / 6.0 * (k1.*of + 2.0 * k2.*of + 2.0 * k3.*of + k4.*of);
    };
    L += mean(&Rates::L);
    p_c += mean(&Rates::p);
    v_c += mean(&Rates::v);
    to.R_IP = rotationOf(mean(&Rates::th)) * to.R_IP;
  }
  to.R_IP = orthogonal(to.R_IP);
  const Vec3 c_last = to.R_IP * at_last.center;
  to.w = to.R_IP * (at_last.inertia.inverse() * (to.R_IP.transpose() * L - then.h_P)) - W;
  to.v = v_c - to.w.cross(c_last);
  to.p = p_c - c_last;
  return to;
}

FreeBody::FreeBody(const FreeBodyModel& model, double period)
    : model_(model),
      M_P_(spatialMass(model.body_P)),
      beside_({Mat6::Identity(), Vec6::Zero(), Mat6::Zero()}),
      period_(period),
      whole_{M_P_} {}

void FreeBody::reset(const Vec6& x, const Mat6& M_1, double ahead) noexcept {
  RigidState& s = now_.rigid;
  s = {rotation(Vec3(x.tail<3>())), x.head<3>(), model_.v_IPo_I, model_.w_IP_I};
  whole_ = {massInP() + rotated(s.R_IP.transpose(), M_1)};
  now_.motion = motionOf(whole_, s, {}, model_.orbit);
  now_.time = ahead > 0.0 ? -ahead : 0.0;
  along_.setZero();
  now_.pulses = {};
  now_.ordered = {};
  thrust_ = {};
  joints_.setZero();
  if (ahead > 0.0 && !(velocity(s).isZero(0.0) && model_.orbit.rate == 0.0))
    s = advanced(whole_, whole_, s, {}, -ahead, model_.orbit);
}

void FreeBody::step(const Wrench& F_Po_I, double damping) noexcept {
  step(F_Po_I, CarriedBody(Mat6::Zero()), period_, 0.0, damping);
}

void FreeBody::step(const Wrench& F_Po_I, const CarriedBody& carried, double dt, double ahead,
                    double damping) noexcept {
  before_ = now_;
  dt_ = dt;
  thrust_.time = now_.time;
  for (int i = 0; i < kMostThrusters; ++i) {
    const Firing& on = now_.ordered[static_cast<std::size_t>(i)].on;
    thrust_.left(i) = on.until > on.from ? std::max(0.0, on.until - now_.time) : 0.0;
  }
  const RigidState& from = before_.rigid;
  const Mat6 own = massInP();
  const Gyrostat before{own + rotated(carried.R_IP_before.transpose(), carried.before),
                        wheels(now_.time)};
  Gyrostat after{own + rotated(carried.R_IP.transpose(), carried.M_1), wheels(now_.time)};
  const Mat6 middle = rotated(from.R_IP, 0.5 * (before.M_P + after.M_P));
  mobility_ = Lu6(middle).inverse();
  damping_ = -damping * (middle * (velocity(from) - along_));
  Wrench F = Wrench::from(F_Po_I.stacked() + damping_), F_ahead = F;
  pushed_.setZero();
  jets_.setZero();
  const Propulsion& jets = model_.propulsion;
  if (jets.any()) {
    const Mat3 R_PI = from.R_IP.transpose();
    if (now_.time >= 0.0)
      now_.pulses = pulsesOf(jets.hold, now_.pulses, rotationVector(from.R_IP), R_PI * from.w);
    const auto fires = [&](double t, double over) {
      return firings(jets, now_.pulses, now_.ordered, t, over);
    };
    const auto inI = [&](const Wrench& F_P, double turned_for) {
      return rotate(rotationOf(turned_for * from.w) * from.R_IP, F_P);
    };
    const Firings fired = fires(now_.time, dt);
    const Wrench pushed = inI(fired.mean, 0.5 * dt);
    F = F + pushed;
    thrust_.on = fired.on;
    now_.pulses = spent(now_.pulses, dt);
    now_.time += dt;
    after.h_P = wheels(now_.time);
    pushed_ = jets_ = pushed.stacked();
    if (dt > 0.0) pushed_.tail<3>() -= from.R_IP * (after.h_P - before.h_P) / dt;
    F_ahead = F_ahead + inI(fires(now_.time, ahead).mean, dt + 0.5 * ahead);
  }
  const Orbit& orbit = model_.orbit;
  if (orbit.rate != 0.0) {  // what it puts into the vehicle alone
    const Gyrostat alone{own, before.h_P};
    const BodyMotion with = motionOf(alone, from, {}, orbit),
                     without = motionOf(alone, from, {}, {});
    pushed_ += rotated(from.R_IP, own) *
               (Vec6() << with.a - without.a, with.alpha - without.alpha).finished();
  }
  const Vec3 c = from.R_IP * Lumped(before.M_P).center,
             h_joints = carried.joints.tail<3>() - c.cross(carried.joints.head<3>());
  const RigidState s = advanced(before, after, from, F, dt, orbit, h_joints);
  way_ << s.p - from.p, rotationVector(s.R_IP * from.R_IP.transpose());
  now_.rigid = s;
  whole_ = after;
  joints_ = carried.joints;
  if (!(ahead > 0.0)) F_ahead = F;
  const Gyrostat then{after.M_P, wheels(now_.time + ahead)};
  Wrench shown = F_ahead;
  const double over = ahead > 0.0 ? ahead : dt;
  if (over > 0.0)
    shown.n -= s.R_IP * ((ahead > 0.0 ? then.h_P - after.h_P : after.h_P - before.h_P) / over);
  now_.motion = motionOf(then, advanced(after, then, s, F_ahead, ahead, orbit), shown, orbit);
  if (damped() < 0.0) {
    now_ = before_;
    step(F_Po_I, carried, dt, ahead, 0.0);
  }
}

Refusal FreeBody::fire(const ThrustOrder& order) noexcept {
  const Propulsion& jets = model_.propulsion;
  for (int i = 0; i < kMostThrusters; ++i) {
    if (!(order(i) > 0.0)) continue;
    if (i >= jets.size) return Refusal::kNoSuchPart;
    if (!(order(i) >= jets.thrusters[static_cast<std::size_t>(i)].least_on))
      return Refusal::kTooShort;
  }
  const double from = std::max(0.0, now_.time);
  for (int i = 0; i < kMostThrusters; ++i)
    if (order(i) > 0.0) now_.ordered[static_cast<std::size_t>(i)] = {i, {from, from + order(i)}};
  return Refusal::kNone;
}

BodyMotion FreeBody::coasting() const noexcept {
  const BodyMotion& m = now_.motion;
  return motionOf(whole_, {m.X.R, m.X.p, m.v, m.w}, {}, model_.orbit);
}

BodyMotion FreeBody::atWrench() const noexcept {
  const RigidState& s = now_.rigid;
  return {{s.R_IP, s.p}, s.v, s.w, Vec3::Zero(), Vec3::Zero()};
}

Vec6 FreeBody::momentum() const noexcept {
  Vec6 out = massOfAll() * velocity(now_.rigid) + joints_;
  out.tail<3>() += now_.rigid.R_IP * whole_.h_P;
  return out;
}

double FreeBody::kineticEnergy() const noexcept {
  const RigidState& s = now_.rigid;
  const Mat3 R_PI = s.R_IP.transpose();
  Vec6 V_P;
  V_P << R_PI * (s.v - along_.head<3>()), R_PI * (s.w - along_.tail<3>());
  return 0.5 * factors_.mass * V_P.dot(M_P_ * V_P);
}

ModalDynamics::Body FreeBody::body(const Mat6& M_1) const noexcept {
  return beside_.body(rotated(now_.rigid.R_IP, M_P_) + M_1 / factors_.mass - Mat6::Identity());
}

void FreeBody::displace(const ModalDynamics::Modes& by) noexcept {
  const auto moved = [&](Mat3& R, Vec3& p, Vec3& v, Vec3& w) {
    p += by.eta.head<3>();
    R = rotationOf(by.eta.tail<3>()) * R;
    v += by.eta_dot.head<3>();
    w += by.eta_dot.tail<3>();
  };
  RigidState& s = now_.rigid;
  moved(s.R_IP, s.p, s.v, s.w);
  BodyMotion& m = now_.motion;  // which may be ahead
  moved(m.X.R, m.X.p, m.v, m.w);
}

void FreeBody::slow(double share) noexcept {
  const auto back = [&](Mat3& R, Vec3& p, const Mat3& R_from, const Vec3& p_from) {
    p = p_from + share * (p - p_from);
    R = rotationOf(share * rotationVector(R * R_from.transpose())) * R_from;
  };
  RigidState &s = now_.rigid, from = before_.rigid;
  back(s.R_IP, s.p, from.R_IP, from.p);
  s.v *= share;
  s.w *= share;
  now_.time = before_.time + share * (now_.time - before_.time);
  way_ *= share;
  BodyMotion& m = now_.motion;  // which may be ahead
  back(m.X.R, m.X.p, before_.motion.X.R, before_.motion.X.p);
  m.v *= share;
  m.w *= share;
  m.a = (m.v - before_.motion.v) / period_;
  m.alpha = (m.w - before_.motion.w) / period_;
}

}  // namespace ves
