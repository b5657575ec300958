// SPDX-License-Identifier: BSD-3-Clause
#include "ves/robot/newton_euler.hpp"

namespace ves {
namespace {

void setInertialWrench(const RigidBody& body, const Vec3& w, const Vec3& alpha, const Vec3& a,
                       Vec3& f, Vec3& n) noexcept {
  const Vec3& c = body.p_BoBcm_B;
  f = body.mass * (a + alpha.cross(c) + w.cross(w.cross(c)));
  n = body.I_Bcm_B * alpha + w.cross(body.I_Bcm_B * w) + c.cross(f);
}

}  // namespace

ProperMotion properMotion(const BodyMotion& P, const Transform& X_PB, const Vec3& g_I) noexcept {
  const Mat3 R_BI = (P.X.R * X_PB.R).transpose();
  const Vec3 p_PB_I = P.X.R * X_PB.p;
  return {R_BI * P.w, R_BI * P.alpha,
          R_BI * (P.a - g_I + P.alpha.cross(p_PB_I) + P.w.cross(P.w.cross(p_PB_I)))};
}

Wrench inertialWrench(const RigidBody& body, const ProperMotion& B) noexcept {
  Wrench F;
  setInertialWrench(body, B.w, B.alpha, B.a, F.f, F.n);
  return F;
}

// Every result is written where it stays, one quantity a loop: a copy of a struct just written in
// parts would wait for the stores, which took a third of the time.
InverseDynamics newtonEuler(const RobotModel& robot, const JointState& q,
                            const ProperMotion& L0) noexcept {
  // Vectors and matrices of Eigen begin without values: only the links that there are cost time.
  std::array<Mat3, kMaxLinks> R;               // link in its parent
  std::array<Vec3, kMaxLinks> p, w, alpha, a;  // pose in its parent, and proper motion
  std::array<Vec3, kMaxLinks> f, n;            // wrench on the link, about its origin, its axes
  const auto links = static_cast<std::size_t>(robot.size);

  for (std::size_t k = 0; k < links; ++k) {
    const Link& link = robot.links[k];
    setLinkPose(link, link.at(q.q(link.joint)), R[k], p[k]);
  }

  // Outward: motion of each link.
  for (std::size_t k = 0; k < links; ++k) {
    const Link& link = robot.links[k];
    const auto c = static_cast<std::size_t>(link.parent);
    const bool on_base = link.parent < 0;
    const Vec3 &w_c = on_base ? L0.w : w[c], &alpha_c = on_base ? L0.alpha : alpha[c],
               &a_c = on_base ? L0.a : a[c];
    const Mat3 R_T = R[k].transpose();
    w[k] = R_T * w_c;
    alpha[k] = R_T * alpha_c;
    a[k] = R_T * (a_c + alpha_c.cross(p[k]) + w_c.cross(w_c.cross(p[k])));
    const double q_dot = link.ratio * q.q_dot(link.joint),
                 q_ddot = link.ratio * q.q_ddot(link.joint);
    switch (link.type) {
      case JointType::kRevolute:
        alpha[k] += w[k].cross(q_dot * link.axis) + q_ddot * link.axis;
        w[k] += q_dot * link.axis;
        break;
      case JointType::kPrismatic:
        a[k] += 2.0 * w[k].cross(q_dot * link.axis) + q_ddot * link.axis;
        break;
    }
  }

  // The wrench each link takes.
  for (std::size_t k = 0; k < links; ++k)
    setInertialWrench(robot.links[k].body, w[k], alpha[k], a[k], f[k], n[k]);

  // Inward: what each link asks of its parent.
  InverseDynamics out;
  Wrench& on_link_0 = out.F_L0o_L0;
  setInertialWrench(robot.base, L0.w, L0.alpha, L0.a, on_link_0.f, on_link_0.n);
  for (std::size_t k = links; k-- > 0;) {
    const Link& link = robot.links[k];
    out.tau(link.joint) +=
        link.ratio * link.axis.dot(link.type == JointType::kRevolute ? n[k] : f[k]);
    const auto c = static_cast<std::size_t>(link.parent);
    const bool on_base = link.parent < 0;
    Vec3 &f_c = on_base ? on_link_0.f : f[c], &n_c = on_base ? on_link_0.n : n[c];
    const Vec3 f_asked = R[k] * f[k];
    f_c += f_asked;
    n_c += R[k] * n[k] + p[k].cross(f_asked);
  }
  return out;
}

}  // namespace ves
