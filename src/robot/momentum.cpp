// SPDX-License-Identifier: BSD-3-Clause
#include "ves/robot/momentum.hpp"

namespace ves {

Vec6 jointMomentum(const RobotModel& robot, const JointVector& q,
                   const JointVector& q_dot) noexcept {
  // Without values: only the links that there are cost time.
  std::array<Mat3, kMaxLinks> R;        // link in its parent
  std::array<Vec3, kMaxLinks> p, w, v;  // origin in its parent; velocities in the link's axes
  std::array<Vec3, kMaxLinks> P, L;     // [N s, N m s] about the link's origin, in its axes
  const auto links = static_cast<std::size_t>(robot.size);
  for (std::size_t k = 0; k < links; ++k) {
    const Link& link = robot.links[k];
    const RigidBody& body = link.body;
    const double rate = link.ratio * q_dot(link.joint);
    setLinkPose(link, link.at(q(link.joint)), R[k], p[k]);
    if (link.parent < 0) {
      w[k].setZero();
      v[k].setZero();
    } else {
      const auto c = static_cast<std::size_t>(link.parent);
      w[k] = R[k].transpose() * w[c];
      v[k] = R[k].transpose() * (v[c] + w[c].cross(p[k]));
    }
    (link.type == JointType::kRevolute ? w[k] : v[k]) += rate * link.axis;
    P[k] = body.mass * (v[k] + w[k].cross(body.p_BoBcm_B));
    L[k] = body.I_Bcm_B * w[k] + body.p_BoBcm_B.cross(P[k]);
  }
  Vec3 P_0 = Vec3::Zero(), L_0 = Vec3::Zero();
  for (std::size_t k = links; k-- > 0;) {
    const int parent = robot.links[k].parent;
    const auto c = static_cast<std::size_t>(parent);
    Vec3 &P_c = parent < 0 ? P_0 : P[c], &L_c = parent < 0 ? L_0 : L[c];
    const Vec3 taken = R[k] * P[k];
    P_c += taken;
    L_c += R[k] * L[k] + p[k].cross(taken);
  }
  return (Vec6() << P_0, L_0).finished();
}

}  // namespace ves
