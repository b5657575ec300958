// SPDX-License-Identifier: BSD-3-Clause
//
// Stewart platform: geometry, inverse kinematics (report C.11, C.12, 2.25, 2.31) and forward
// kinematics of position (2.23), rate (2.24) and acceleration (2.32).
#pragma once

#include <array>

#include "ves/math/frames.hpp"
#include "ves/math/lu6.hpp"
#include "ves/math/quintic.hpp"

namespace ves {

inline constexpr int kLegs = 6;

/// Ball joints of the six legs, and where the platform rests.
struct Geometry {
  std::array<Vec3, kLegs> p_IBi_I{};  // [m] base joints
  std::array<Vec3, kLegs> p_PPi_P{};  // [m] platform joints
  double home_height = 0.0;           // [m] z of P in I at the home pose

  /// Where P is in I at the home pose.
  Vec3 home() const { return {0.0, 0.0, home_height}; }
  /// X_IP of coordinates counted from the home pose.
  Transform fromHome(const Pose& x) const { return {rotation(x.rpy), x.p + home()}; }
  /// Coordinates of X_IP counted from the home pose.
  Pose toHome(const Transform& X_IP) const { return {X_IP.p - home(), fixedAngles(X_IP.R)}; }
};

/// Lengths with their first two derivatives.
struct LegMotion {
  Vec6 L = Vec6::Zero();       // [m]
  Vec6 L_dot = Vec6::Zero();   // [m/s]
  Vec6 L_ddot = Vec6::Zero();  // [m/s^2]
};

/// (C.11), (C.12): |Bi Pi|. (C.11) as printed would count the translation twice; p_PPi_P is meant.
Vec6 legLengths(const Geometry& geometry, const Transform& X_IP) noexcept;

/// Lengths, and the Jacobian of unit lines: leg rates = J {v_IPo_I, w_IP_I}, (2.24).
struct LegLines {
  Vec6 L = Vec6::Zero();  // [m]
  Mat6 J = Mat6::Zero();  // [- | m] row i: u_i, r_i x u_i
};
LegLines legLines(const Geometry& geometry, const Transform& X_IP) noexcept;

/// Lengths, rates (2.25) and accelerations (2.31) for a moving platform.
LegMotion legMotion(const Geometry& geometry, const BodyMotion& P) noexcept;

/// Motion of P from coordinates about p_IH [m], where P is at home, and their derivatives; (2.27),
/// (2.33) in inertial axes.
BodyMotion bodyMotion(const Vec3& p_IH, const Pose& x, const Vec6& x_dot,
                      const Vec6& x_ddot) noexcept;
/// The coordinates of a motion of P about home, |beta| < 90 degrees.
PathPoint<6> coordinates(const BodyMotion& P) noexcept;

enum class SolveStatus {
  kConverged,
  kIterationLimit,  // no root near the guess
  kSingular,        // the Jacobian lost rank on the way
  kInvalid          // a leg or the guess is not a number, or a leg not positive
};

struct ForwardSolution {
  Transform X_IP;         // the last iterate
  double residual = 0.0;  // [m] largest leg error at X_IP
  int iterations = 0;     // [-]
  SolveStatus status = SolveStatus::kInvalid;

  bool ok() const noexcept { return status == SolveStatus::kConverged; }
};

inline constexpr double kForwardTolerance = 1e-9;  // [m] on every leg
inline constexpr int kForwardIterations = 20;

/// Newton-Raphson on the squared lengths (2.22), (2.23), stepping in SE(3); takes the root nearest
/// `guess`. (2.22) prints squares on its last two terms that expanding (2.20) does not give, and
/// (2.21) a norm for its square.
///
/// The step is a twist applied to the pose, not added to the angles: the distinction the report
/// draws in (2.26), and what makes the convergence quadratic.
ForwardSolution forwardPose(const Geometry& geometry, const Vec6& L,
                            const Transform& guess) noexcept;

/// The Jacobian of one pose, factorised. Consecutive poses are close, so that the factors of the
/// last pose serve for the next.
struct JacobianFactors {
  Lu6 lu;  // of half the derivative of (2.22) with respect to the twist
  bool known = false;
};

/// The same root, beginning with the Jacobian of a pose `near` the guess and keeping it as long as
/// each step takes nine tenths of what is left; factorises anew where it does not. From afar a
/// first step with it may lead to another root.
ForwardSolution forwardPose(const Geometry& geometry, const Vec6& L, const Transform& guess,
                            JacobianFactors& near) noexcept;

/// Four columns of small motions: of the legs [m], or of the platform as twists [m | rad]_Po_I.
using Motions = Eigen::Matrix<double, 6, 4>;
/// The platform's motions that the legs' are, at X_IP. False, and as it was, when the Jacobian is
/// singular.
bool platformMotions(const Geometry& geometry, const Transform& X_IP, Motions& motions) noexcept;

/// [m] root mean square distance of the platform's joints from their middle: how large it is.
double jointRadius(const Geometry& geometry) noexcept;

/// |J| |J^-1| / 6 in the Frobenius norm, of the Jacobian from twists to leg rates with lengths
/// counted in jointRadius(), the same for platforms of one shape: 1 at best, infinite where the
/// legs cannot hold it.
double conditionNumber(const LegLines& lines, double joint_radius) noexcept;
double conditionNumber(const Geometry& geometry, const Transform& X_IP) noexcept;

/// Rate (2.24) and acceleration (2.32) of P at the pose X_IP. Where (2.30) to (2.32) print only the
/// diagonal of the second derivative, the whole of it is used. False when the Jacobian is singular;
/// then only P.X is set.
bool forwardMotion(const Geometry& geometry, const Transform& X_IP, const LegMotion& legs,
                   BodyMotion& P) noexcept;
/// The same; leaves the Jacobian at X_IP in `here`.
bool forwardMotion(const Geometry& geometry, const Transform& X_IP, const LegMotion& legs,
                   BodyMotion& P, JacobianFactors& here) noexcept;

}  // namespace ves
