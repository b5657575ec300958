// SPDX-License-Identifier: BSD-3-Clause
//
// Iterative Newton-Euler dynamics (Appendix A, after Craig) on a base that moves arbitrarily.
#pragma once

#include "ves/robot/robot_model.hpp"

namespace ves {

/// Motion of a body B in its own axes, gravity included as an upward acceleration of everything.
struct ProperMotion {
  Vec3 w = Vec3::Zero();      // [rad/s] w_IB_B
  Vec3 alpha = Vec3::Zero();  // [rad/s^2] alpha_IB_B
  Vec3 a = Vec3::Zero();      // [m/s^2] a_IBo_B - g_B
};

/// Proper motion of the frame B, posed in P, when P moves as given under gravity g_I.
ProperMotion properMotion(const BodyMotion& P, const Transform& X_PB, const Vec3& g_I) noexcept;

/// Wrench about Bo in B that must act on the body for it to move so: Newton's and Euler's equation.
Wrench inertialWrench(const RigidBody& body, const ProperMotion& B) noexcept;

struct InverseDynamics {
  Wrench F_L0o_L0;                        // on link 0 from what it stands on
  JointVector tau = JointVector::Zero();  // [N m | N] joint efforts
};

/// Efforts and base wrench for joint motion `q` on a base with the proper motion `L0`.
///
/// Departures from the page: link 0 (20 kg of the PUMA) has its own term, prismatic joints are
/// included, and gravity comes with the base's motion. The recursion's wrench acts *on* the robot;
/// the sensor measures its negative.
InverseDynamics newtonEuler(const RobotModel& robot, const JointState& q,
                            const ProperMotion& L0) noexcept;

}  // namespace ves
