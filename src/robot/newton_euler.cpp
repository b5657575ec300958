// SPDX-License-Identifier: BSD-3-Clause
#include "ves/robot/newton_euler.hpp"

namespace ves {

ProperMotion properMotion(const BodyMotion& P, const Transform& X_PB, const Vec3& g_I) noexcept {
  const Mat3 R_BI = (P.X.R * X_PB.R).transpose();
  const Vec3 p_PB_I = P.X.R * X_PB.p;
  return {R_BI * P.w, R_BI * P.alpha,
          R_BI * (P.a - g_I + P.alpha.cross(p_PB_I) + P.w.cross(P.w.cross(p_PB_I)))};
}

Wrench inertialWrench(const RigidBody& body, const ProperMotion& B) noexcept {
  const Vec3& c = body.p_BoBcm_B;
  const Vec3 F = body.mass * (B.a + B.alpha.cross(c) + B.w.cross(B.w.cross(c)));
  const Vec3 N = body.I_Bcm_B * B.alpha + B.w.cross(body.I_Bcm_B * B.w);
  return {F, N + c.cross(F)};
}

InverseDynamics newtonEuler(const RobotModel& robot, const JointState& q,
                            const ProperMotion& L0) noexcept {
  std::array<Transform, kMaxJoints> X;  // link i in its parent
  std::array<Wrench, kMaxJoints> F;     // inertial wrench of link i, about its origin, its axes

  // Outward: motion of each link, and the wrench it takes.
  ProperMotion parent = L0;
  for (int i = 0; i < robot.joints; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Link& link = robot.links[k];
    X[k] = linkPose(link, q.q(i));
    const Mat3 R = X[k].R.transpose();
    const Vec3& p = X[k].p;
    ProperMotion m;
    m.w = R * parent.w;
    m.alpha = R * parent.alpha;
    m.a = R * (parent.a + parent.alpha.cross(p) + parent.w.cross(parent.w.cross(p)));
    switch (link.type) {
      case JointType::kRevolute:
        m.alpha += m.w.cross(q.q_dot(i) * link.axis) + q.q_ddot(i) * link.axis;
        m.w += q.q_dot(i) * link.axis;
        break;
      case JointType::kPrismatic:
        m.a += 2.0 * m.w.cross(q.q_dot(i) * link.axis) + q.q_ddot(i) * link.axis;
        break;
    }
    F[k] = inertialWrench(link.body, m);
    parent = m;
  }

  // Inward: what each link asks of its parent.
  InverseDynamics out;
  Wrench asked;  // by the links beyond, about this link's origin in its axes
  for (int i = robot.joints - 1; i >= 0; --i) {
    const auto k = static_cast<std::size_t>(i);
    const Link& link = robot.links[k];
    const Wrench total = F[k] + asked;
    out.tau(i) = link.axis.dot(link.type == JointType::kRevolute ? total.n : total.f);
    asked = transfer(X[k], total);
  }
  out.F_L0o_L0 = inertialWrench(robot.base, L0) + asked;
  return out;
}

}  // namespace ves
