// SPDX-License-Identifier: BSD-3-Clause
#include "ves/kinematics/stewart.hpp"

#include <Eigen/LU>
#include <cmath>

namespace ves {
namespace {

/// Vectors of one leg in inertial axes.
struct Leg {
  Vec3 d;  // [m] Bi to Pi
  Vec3 r;  // [m] Po to Pi
};

inline Leg leg(const Geometry& g, const Transform& X_IP, int i) {
  const auto k = static_cast<std::size_t>(i);
  const Vec3 r = X_IP.R * g.p_PPi_P[k];
  return {X_IP.p + r - g.p_IBi_I[k], r};
}

using Legs = std::array<Leg, kLegs>;

Legs legs(const Geometry& g, const Transform& X_IP) {
  Legs out;
  for (int i = 0; i < kLegs; ++i) out[static_cast<std::size_t>(i)] = leg(g, X_IP, i);
  return out;
}

/// Row i maps the twist {v_IPo_I, w_IP_I} to L_i dL_i/dt.
Mat6 halfJacobian(const Legs& legs) {
  Mat6 J;
  for (int i = 0; i < kLegs; ++i) {
    const Leg& l = legs[static_cast<std::size_t>(i)];
    J.row(i) << l.d.transpose(), l.r.cross(l.d).transpose();
  }
  return J;
}

/// Factorises; whether the matrix is regular.
bool factorise(const Legs& legs, JacobianFactors& out) {
  out.lu.compute(halfJacobian(legs));
  return out.known = out.lu.regular();
}

/// Newton-Raphson. The last factors do for another step where the step before has left no more than
/// `leaves` [-] of the residual: with those of a pose so near, the next one leaves as little.
ForwardSolution solve(const Geometry& geometry, const Vec6& L, const Transform& guess,
                      JacobianFactors& factors, double leaves) noexcept {
  ForwardSolution out;
  out.X_IP = guess;
  if (!L.allFinite() || !(L.minCoeff() > 0.0)) return out;
  if (!guess.p.allFinite() || !guess.R.allFinite()) return out;
  double before = HUGE_VAL;  // [m]
  for (out.iterations = 0;; ++out.iterations) {
    const Legs at = legs(geometry, out.X_IP);
    Vec6 f;  // half of (2.22): (|d|^2 - L^2) / 2
    for (int i = 0; i < kLegs; ++i)
      f(i) = 0.5 * (at[static_cast<std::size_t>(i)].d.squaredNorm() - L(i) * L(i));
    out.residual = (f.array() / L.array()).abs().maxCoeff<Eigen::PropagateNaN>();
    if (!std::isfinite(out.residual)) {
      out.status = SolveStatus::kInvalid;
      return out;
    }
    if (out.residual <= kForwardTolerance) {
      // One step of the polar iteration: warm starts must not let R drift from orthogonality.
      out.X_IP.R =
          0.5 * out.X_IP.R * (3.0 * Mat3::Identity() - out.X_IP.R.transpose() * out.X_IP.R);
      out.status = SolveStatus::kConverged;
      return out;
    }
    if (out.iterations == kForwardIterations) {
      out.status = SolveStatus::kIterationLimit;
      return out;
    }
    const bool near = factors.known && out.residual < leaves * before;
    if (!near && !factorise(at, factors)) {
      out.status = SolveStatus::kSingular;
      return out;
    }
    before = out.residual;
    const Vec6 step = factors.lu.solve(-f);
    out.X_IP.p += step.head<3>();
    out.X_IP.R = rotationOf(step.tail<3>()) * out.X_IP.R;
  }
}

}  // namespace

Vec6 legLengths(const Geometry& geometry, const Transform& X_IP) noexcept {
  Vec6 L;
  for (int i = 0; i < kLegs; ++i) L(i) = leg(geometry, X_IP, i).d.norm();
  return L;
}

LegLines legLines(const Geometry& geometry, const Transform& X_IP) noexcept {
  LegLines out;
  for (int i = 0; i < kLegs; ++i) {
    const Leg l = leg(geometry, X_IP, i);
    out.L(i) = l.d.norm();
    const Vec3 u = l.d / out.L(i);
    out.J.row(i) << u.transpose(), l.r.cross(u).transpose();
  }
  return out;
}

LegMotion legMotion(const Geometry& geometry, const BodyMotion& P) noexcept {
  LegMotion out;
  for (int i = 0; i < kLegs; ++i) {
    const Leg l = leg(geometry, P.X, i);
    const Vec3 v = P.v + P.w.cross(l.r);                                  // v_Pi
    const Vec3 a = P.a + P.alpha.cross(l.r) + P.w.cross(P.w.cross(l.r));  // a_Pi
    const double L = l.d.norm();
    const double L_dot = l.d.dot(v) / L;
    out.L(i) = L;
    out.L_dot(i) = L_dot;
    out.L_ddot(i) = (v.squaredNorm() + l.d.dot(a) - L_dot * L_dot) / L;
  }
  return out;
}

BodyMotion bodyMotion(const Vec3& p_IH, const Pose& x, const Vec6& x_dot,
                      const Vec6& x_ddot) noexcept {
  const Mat3 E = angleRateMap(x.rpy);
  BodyMotion P;
  P.X = {rotation(x.rpy), x.p + p_IH};
  P.v = x_dot.head<3>();
  P.w = E * x_dot.tail<3>();
  P.a = x_ddot.head<3>();
  P.alpha = E * x_ddot.tail<3>() + angleRateMapDerivative(x.rpy, x_dot.tail<3>()) * x_dot.tail<3>();
  return P;
}

PathPoint<6> coordinates(const BodyMotion& P) noexcept {
  const Vec3 rpy = fixedAngles(P.X.R);
  const Mat3 to_rates = angleRateMap(rpy).inverse();
  const Vec3 rpy_dot = to_rates * P.w;
  PathPoint<6> out;
  out.x << P.X.p, rpy;
  out.x_dot << P.v, rpy_dot;
  out.x_ddot << P.a, to_rates * (P.alpha - angleRateMapDerivative(rpy, rpy_dot) * rpy_dot);
  return out;
}

ForwardSolution forwardPose(const Geometry& geometry, const Vec6& L,
                            const Transform& guess) noexcept {
  JacobianFactors factors;
  return solve(geometry, L, guess, factors, 1e-3);
}

ForwardSolution forwardPose(const Geometry& geometry, const Vec6& L, const Transform& guess,
                            JacobianFactors& near) noexcept {
  return solve(geometry, L, guess, near, 0.1);
}

bool platformMotions(const Geometry& geometry, const Transform& X_IP, Motions& motions) noexcept {
  const Legs at = legs(geometry, X_IP);
  JacobianFactors here;
  if (!factorise(at, here)) return false;
  for (int i = 0; i < kLegs; ++i) motions.row(i) *= at[static_cast<std::size_t>(i)].d.norm();
  motions = here.lu.solve(motions);
  return true;
}

double jointRadius(const Geometry& geometry) noexcept {
  Vec3 middle = Vec3::Zero();
  for (const Vec3& p : geometry.p_PPi_P) middle += p / kLegs;
  double sum = 0.0;
  for (const Vec3& p : geometry.p_PPi_P) sum += (p - middle).squaredNorm();
  return std::sqrt(sum / kLegs);
}

double conditionNumber(const LegLines& lines, double joint_radius) noexcept {
  Mat6 J = lines.J;
  J.rightCols<3>() /= joint_radius;
  const Lu6 lu(J);
  if (!lu.regular()) return HUGE_VAL;
  return J.norm() * lu.inverse().norm() / 6.0;
}

double conditionNumber(const Geometry& geometry, const Transform& X_IP) noexcept {
  return conditionNumber(legLines(geometry, X_IP), jointRadius(geometry));
}

bool forwardMotion(const Geometry& geometry, const Transform& X_IP, const LegMotion& legs,
                   BodyMotion& P) noexcept {
  JacobianFactors factors;
  return forwardMotion(geometry, X_IP, legs, P, factors);
}

bool forwardMotion(const Geometry& geometry, const Transform& X_IP, const LegMotion& motion,
                   BodyMotion& P, JacobianFactors& here) noexcept {
  P.X = X_IP;
  const Legs at = legs(geometry, X_IP);
  if (!factorise(at, here)) return false;

  const Vec6 twist = here.lu.solve(motion.L.cwiseProduct(motion.L_dot));
  P.v = twist.head<3>();
  P.w = twist.tail<3>();

  // d/dt (d . v_Pi) = |v_Pi|^2 + d . a_Pi, with the centripetal part of a_Pi on the right.
  Vec6 rhs = motion.L_dot.cwiseAbs2() + motion.L.cwiseProduct(motion.L_ddot);
  for (int i = 0; i < kLegs; ++i) {
    const Leg& l = at[static_cast<std::size_t>(i)];
    rhs(i) -= (P.v + P.w.cross(l.r)).squaredNorm() + l.d.dot(P.w.cross(P.w.cross(l.r)));
  }
  const Vec6 acceleration = here.lu.solve(rhs);
  P.a = acceleration.head<3>();
  P.alpha = acceleration.tail<3>();
  return true;
}

}  // namespace ves
