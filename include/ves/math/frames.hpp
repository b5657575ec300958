// SPDX-License-Identifier: BSD-3-Clause
//
// Frames, poses and wrenches. This file owns the notation of the whole project.
//
// Frames (report, figure 2.1)
//   I   inertial, fixed at the platform's base, Z up; the report also calls it {B} in section 2.5
//   P   centre of the platform's top plate
//   S   force-torque sensor, fixed in P (180 degrees about x: its z axis points down)
//   R   centre of the robot's adapter plate, fixed in P
//   L0..Ln  links of the robot; L0 is its base
//   E   inertial, where a vehicle is emulated; it is I unless the laboratory flies along with it
//   H   the laboratory, at P's home, in I's axes
//
// Monogram notation, as in Drake: R_IP turns the coordinates of P into those of I, X_IP is the pose
// of P in I, p_PS_P the position of So from Po expressed in P, w_IP_I the angular velocity of P in
// I expressed in I, F_So_S the wrench about the point So expressed in S. Neighbouring letters
// cancel: X_IS = X_IP * X_PS. The report's ^l(^jP_k) is p_jk_l here.
//
// SI units throughout: m, rad, s, kg, N, N m.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

#include "ves/math/layout.hpp"

namespace ves {

using Vec3 = Eigen::Vector3d;
using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat3 = Eigen::Matrix3d;
using Mat6 = Eigen::Matrix<double, 6, 6>;

inline constexpr double kDegree = M_PI / 180.0;       // [rad]
inline constexpr double kMetrePerInch = 0.0254;       // [m]
inline constexpr double kSecondPerNanosecond = 1e-9;  // [s]

/// Pose of a frame in another: rotates, then translates.
struct Transform {
  Mat3 R = Mat3::Identity();  // [-]
  Vec3 p = Vec3::Zero();      // [m]

  bool operator==(const Transform&) const = default;
};

/// X_AC = X_AB * X_BC.
inline Transform operator*(const Transform& X_AB, const Transform& X_BC) {
  return {X_AB.R * X_BC.R, X_AB.p + X_AB.R * X_BC.p};
}

/// X_BA from X_AB.
inline Transform inverse(const Transform& X_AB) {
  return {X_AB.R.transpose(), X_AB.R.transpose() * -X_AB.p};
}

/// p_AQ_A = X_AB * p_BQ_B.
inline Vec3 operator*(const Transform& X_AB, const Vec3& p_BQ_B) {
  return X_AB.p + X_AB.R * p_BQ_B;
}

/// The six generalised coordinates of the platform, {x, y, z, alpha, beta, gamma}: a displacement
/// and the X-Y-Z fixed angles of (2.19).
struct Pose {
  Vec3 p = Vec3::Zero();    // [m]
  Vec3 rpy = Vec3::Zero();  // [rad] alpha, beta, gamma about the fixed X, Y, Z axes

  Vec6 stacked() const { return (Vec6() << p, rpy).finished(); }
  static Pose from(const Vec6& x) { return {x.head<3>(), x.tail<3>()}; }
};

/// Force and moment, one point and one basis; which ones, the name says.
struct Wrench {
  Vec3 f = Vec3::Zero();  // [N]
  Vec3 n = Vec3::Zero();  // [N m]

  Vec6 stacked() const { return Vec6{{f.x(), f.y(), f.z(), n.x(), n.y(), n.z()}}; }
  static Wrench from(const Vec6& w) { return {w.head<3>(), w.tail<3>()}; }
};

inline Wrench operator+(const Wrench& a, const Wrench& b) { return {a.f + b.f, a.n + b.n}; }
inline Wrench operator-(const Wrench& a, const Wrench& b) { return {a.f - b.f, a.n - b.n}; }

/// F_Q_E from F_P_E: moves the point of application, not the basis.
inline Wrench shift(const Wrench& F_P_E, const Vec3& p_PQ_E) {
  return {F_P_E.f, F_P_E.n - p_PQ_E.cross(F_P_E.f)};
}

/// F_P_D from F_P_E: turns the basis, not the point.
inline Wrench rotate(const Mat3& R_DE, const Wrench& F_P_E) {
  return {R_DE * F_P_E.f, R_DE * F_P_E.n};
}

/// F_Ao_A from F_Bo_B, for a frame B posed in A.
inline Wrench transfer(const Transform& X_AB, const Wrench& F_Bo_B) {
  return shift(rotate(X_AB.R, F_Bo_B), -X_AB.p);
}

/// R_IP = Rz(gamma) Ry(beta) Rx(alpha), (2.19), of the angles' cosines and sines. The page prints
/// R(2,2) with a minus before cos(gamma) cos(alpha); a rotation has a plus there.
inline Mat3 rotation(const Vec3& cosines, const Vec3& sines) {
  const double ca = cosines.x(), sa = sines.x(), cb = cosines.y(), sb = sines.y(), cg = cosines.z(),
               sg = sines.z();
  Mat3 R;
  R << cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa,  //
      sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa,   //
      -sb, cb * sa, cb * ca;
  return R;
}
inline Mat3 rotation(const Vec3& rpy) {
  return rotation({std::cos(rpy.x()), std::cos(rpy.y()), std::cos(rpy.z())},
                  {std::sin(rpy.x()), std::sin(rpy.y()), std::sin(rpy.z())});
}
/// The same of angles in degrees; quarter turns are exact.
inline Mat3 rotationOfDegrees(const Vec3& rpy) {
  const auto sine = [](double degrees) {
    const double turn = std::remainder(degrees, 360.0);
    return std::remainder(turn, 180.0) == 0.0  ? 0.0
           : std::remainder(turn, 90.0) == 0.0 ? std::copysign(1.0, turn)
                                               : std::sin(turn * kDegree);
  };
  const auto cosine = [&](double degrees) { return sine(degrees + 90.0); };
  const Mat3 R = rotation({cosine(rpy.x()), cosine(rpy.y()), cosine(rpy.z())},
                          {sine(rpy.x()), sine(rpy.y()), sine(rpy.z())});
  return R.array() + 0.0;  // no zero is negative
}

/// The angles of (2.19), |beta| < 90 degrees.
inline Vec3 fixedAngles(const Mat3& R) {
  return {std::atan2(R(2, 1), R(2, 2)), std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0))),
          std::atan2(R(1, 0), R(0, 0))};
}

/// w_IP_I = E(rpy) * d(rpy)/dt. The inverse of (2.27b) taken for the angular velocity in inertial
/// axes: the printed matrix holds for platform axes only.
inline Mat3 angleRateMap(const Vec3& rpy) {
  const double cb = std::cos(rpy.y()), sb = std::sin(rpy.y());
  const double cg = std::cos(rpy.z()), sg = std::sin(rpy.z());
  Mat3 E;
  E << cb * cg, -sg, 0,  //
      cb * sg, cg, 0,    //
      -sb, 0, 1;
  return E;
}

/// dE/dt, so that the angular acceleration is E * d2(rpy)/dt2 + dE/dt * d(rpy)/dt; (2.33) is the
/// same relation solved for the angles in platform axes.
inline Mat3 angleRateMapDerivative(const Vec3& rpy, const Vec3& rpy_dot) {
  const double cb = std::cos(rpy.y()), sb = std::sin(rpy.y()), b = rpy_dot.y();
  const double cg = std::cos(rpy.z()), sg = std::sin(rpy.z()), g = rpy_dot.z();
  Mat3 E_dot;
  E_dot << -sb * cg * b - cb * sg * g, -cg * g, 0,  //
      -sb * sg * b + cb * cg * g, -sg * g, 0,       //
      -cb * b, 0, 0;
  return E_dot;
}

/// Rotation by the vector v (axis times angle), Rodrigues.
inline Mat3 rotationOf(const Vec3& v) {
  // I + sin(t)/t S + (1 - cos(t))/t^2 S^2 with S = skew(v), t = |v|; series where t is small.
  const double t2 = v.squaredNorm();
  double first, second;
  if (t2 < 1e-4) {
    first = 1.0 - t2 / 6.0 * (1.0 - t2 / 20.0 * (1.0 - t2 / 42.0));
    second = 0.5 - t2 / 24.0 * (1.0 - t2 / 30.0 * (1.0 - t2 / 56.0));
  } else {
    const double t = std::sqrt(t2), half = std::sin(0.5 * t);
    first = std::sin(t) / t;
    second = 2.0 * half * half / t2;
  }
  const Vec3 u = first * v;
  Mat3 R = second * v * v.transpose();
  R.diagonal().array() += 1.0 - second * t2;
  R(0, 1) -= u.z();
  R(0, 2) += u.y();
  R(1, 0) += u.z();
  R(1, 2) -= u.x();
  R(2, 0) -= u.y();
  R(2, 1) += u.x();
  return R;
}

/// [rad] The vector, of at most half a turn, that rotationOf() takes to R.
inline Vec3 rotationVector(const Mat3& R) {
  const Eigen::Quaterniond q(R);
  const double half = q.vec().norm(), angle = 2.0 * std::atan2(half, std::abs(q.w()));
  const double per_half = half > 0.0 ? angle / half : 2.0;
  return std::copysign(per_half, q.w()) * q.vec();
}

/// The matrix (3.10): skew(a) * b = a x b.
inline Mat3 skew(const Vec3& a) {
  Mat3 S;
  S << 0, -a.z(), a.y(),  //
      a.z(), 0, -a.x(),   //
      -a.y(), a.x(), 0;
  return S;
}

/// Motion of a frame in I, everything in inertial axes.
struct BodyMotion {
  Transform X;                // X_IP
  Vec3 v = Vec3::Zero();      // [m/s] v_IPo_I
  Vec3 w = Vec3::Zero();      // [rad/s] w_IP_I
  Vec3 a = Vec3::Zero();      // [m/s^2] a_IPo_I
  Vec3 alpha = Vec3::Zero();  // [rad/s^2] alpha_IP_I
};

}  // namespace ves
