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
  // Vectors and matrices of Eigen begin without values: only the links that there are cost time.
  std::array<Mat3, kMaxLinks> R;               // link in its parent
  std::array<Vec3, kMaxLinks> p, w, alpha, a;  // pose in its parent, and proper motion
  std::array<Vec3, kMaxLinks> f, n;            // wrench on the link, about its origin, its axes

  // Outward: motion of each link, and the wrench it takes.
  for (int i = 0; i < robot.size; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Link& link = robot.links[k];
    const Transform X = linkPose(link, link.at(q.q(link.joint)));
    R[k] = X.R;
    p[k] = X.p;
    const auto c = static_cast<std::size_t>(link.parent);
    const bool on_base = link.parent < 0;
    const Vec3 &w_c = on_base ? L0.w : w[c], &alpha_c = on_base ? L0.alpha : alpha[c],
               &a_c = on_base ? L0.a : a[c];
    const Mat3 R_T = X.R.transpose();
    ProperMotion m;
    m.w = R_T * w_c;
    m.alpha = R_T * alpha_c;
    m.a = R_T * (a_c + alpha_c.cross(X.p) + w_c.cross(w_c.cross(X.p)));
    const double q_dot = link.ratio * q.q_dot(link.joint),
                 q_ddot = link.ratio * q.q_ddot(link.joint);
    switch (link.type) {
      case JointType::kRevolute:
        m.alpha += m.w.cross(q_dot * link.axis) + q_ddot * link.axis;
        m.w += q_dot * link.axis;
        break;
      case JointType::kPrismatic:
        m.a += 2.0 * m.w.cross(q_dot * link.axis) + q_ddot * link.axis;
        break;
    }
    const Wrench takes = inertialWrench(link.body, m);
    f[k] = takes.f;
    n[k] = takes.n;
    w[k] = m.w;
    alpha[k] = m.alpha;
    a[k] = m.a;
  }

  // Inward: what each link asks of its parent.
  InverseDynamics out;
  out.F_L0o_L0 = inertialWrench(robot.base, L0);
  for (int i = robot.size - 1; i >= 0; --i) {
    const auto k = static_cast<std::size_t>(i);
    const Link& link = robot.links[k];
    out.tau(link.joint) +=
        link.ratio * link.axis.dot(link.type == JointType::kRevolute ? n[k] : f[k]);
    const Wrench asked = transfer({R[k], p[k]}, {f[k], n[k]});
    if (link.parent < 0) {
      out.F_L0o_L0 = out.F_L0o_L0 + asked;
    } else {
      f[static_cast<std::size_t>(link.parent)] += asked.f;
      n[static_cast<std::size_t>(link.parent)] += asked.n;
    }
  }
  return out;
}

}  // namespace ves
