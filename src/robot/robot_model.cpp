// SPDX-License-Identifier: BSD-3-Clause
#include "ves/robot/robot_model.hpp"

namespace ves {

RigidBody combine(const RigidBody& a_A, const Transform& X_AB, const RigidBody& b_B) noexcept {
  RigidBody sum;
  sum.mass = a_A.mass + b_B.mass;
  if (!(sum.mass > 0.0)) return a_A;
  const Vec3 a = a_A.p_BoBcm_B, b = X_AB * b_B.p_BoBcm_B;
  sum.p_BoBcm_B = (a_A.mass * a + b_B.mass * b) / sum.mass;
  const Mat3 Sa = skew(a - sum.p_BoBcm_B), Sb = skew(b - sum.p_BoBcm_B);
  sum.I_Bcm_B = a_A.I_Bcm_B - a_A.mass * Sa * Sa + X_AB.R * b_B.I_Bcm_B * X_AB.R.transpose() -
                b_B.mass * Sb * Sb;
  return sum;
}

Transform linkPose(const Link& link, double q) noexcept {
  switch (link.type) {
    case JointType::kRevolute:
      return {link.X_parent.R * Eigen::AngleAxisd(q, link.axis).toRotationMatrix(),
              link.X_parent.p};
    case JointType::kPrismatic: return {link.X_parent.R, link.X_parent * Vec3(q * link.axis)};
  }
  return {};
}

}  // namespace ves
