// SPDX-License-Identifier: BSD-3-Clause
#include "ves/robot/robot_model.hpp"

#include "ves/robot/payload.hpp"

namespace ves {

RigidBody combine(const RigidBody& a_A, const Transform& X_AB, const RigidBody& b_B) noexcept {
  RigidBody sum;
  sum.mass = a_A.mass + b_B.mass;
  if (!(sum.mass > 0.0)) {  // inertia alone
    sum.p_BoBcm_B = a_A.p_BoBcm_B;
    sum.I_Bcm_B = a_A.I_Bcm_B + X_AB.R * b_B.I_Bcm_B * X_AB.R.transpose();
    return sum;
  }
  const Vec3 a = a_A.p_BoBcm_B, b = X_AB * b_B.p_BoBcm_B;
  sum.p_BoBcm_B = (a_A.mass * a + b_B.mass * b) / sum.mass;
  const Mat3 Sa = skew(a - sum.p_BoBcm_B), Sb = skew(b - sum.p_BoBcm_B);
  sum.I_Bcm_B = a_A.I_Bcm_B - a_A.mass * Sa * Sa + X_AB.R * b_B.I_Bcm_B * X_AB.R.transpose() -
                b_B.mass * Sb * Sb;
  return sum;
}

RigidBody rotated(const Mat3& R_AB, const RigidBody& body_B) noexcept {
  return {body_B.mass, R_AB * body_B.p_BoBcm_B, R_AB * body_B.I_Bcm_B * R_AB.transpose()};
}

Mat6 spatialMass(const RigidBody& body) noexcept {
  const Mat3 S = skew(body.p_BoBcm_B);
  Mat6 M;
  M << body.mass * Mat3::Identity(), -body.mass * S,  //
      body.mass * S, body.I_Bcm_B - body.mass * S * S;
  return M;
}

Mat6 rotated(const Mat3& R_AB, const Mat6& M_B) noexcept {
  Mat6 out;
  for (int i = 0; i < 6; i += 3)
    for (int j = 0; j < 6; j += 3)
      out.block<3, 3>(i, j) =
          R_AB.lazyProduct(M_B.block<3, 3>(i, j)).eval().lazyProduct(R_AB.transpose());
  return out;
}

void RobotModel::add(const Link& link, bool follows) {
  const auto k = static_cast<std::size_t>(size++);
  links[k] = link;
  if (follows) return;
  links[k].joint = joints;
  own[static_cast<std::size_t>(joints++)] = static_cast<int>(k);
}

LinkPoses linkPoses(const RobotModel& robot, const JointVector& q) noexcept {
  LinkPoses X;
  for (int i = 0; i < robot.size; ++i) {
    const Link& link = robot.link(i);
    const Transform own = linkPose(link, link.at(q(link.joint)));
    X[i] = link.parent < 0 ? own : X[link.parent] * own;
  }
  return X;
}

RigidBody compositeBody(const RobotModel& robot, const JointVector& q) noexcept {
  const LinkPoses X_L0L = linkPoses(robot, q);
  RigidBody all = robot.base;
  for (int i = 0; i < robot.size; ++i) all = combine(all, X_L0L[i], robot.link(i).body);
  return all;
}

RobotModel carried(const Payload& payload) noexcept {
  RobotModel all = payload.robot;
  const Transform X_L0P = inverse(payload.X_PL0());
  all.base = combine(all.base, X_L0P * payload.X_PR, payload.adapter_R);
  all.base = combine(all.base, X_L0P * payload.X_PS, payload.top_plate_S);
  return all;
}

RigidBody lockedRobot(const Payload& payload, const JointVector& q) noexcept {
  return combine(RigidBody{}, payload.X_PL0(), compositeBody(carried(payload), q));
}

RobotModel withLoad(RobotModel robot, int link, const RigidBody& load) noexcept {
  RigidBody& carrier = robot.bodyOf(link);
  if (load.mass > 0.0) carrier = combine(carrier, {}, load);
  return robot;
}

void setLinkPose(const Link& link, double q, Mat3& R, Vec3& p) noexcept {
  const Transform& X = link.X_parent;
  if (link.type == JointType::kPrismatic) {
    R = X.R;
    p = X * Vec3(q * link.axis);
    return;
  }
  p = X.p;
  if (link.axis != Vec3::UnitZ()) {
    R = X.R * Eigen::AngleAxisd(q, link.axis).toRotationMatrix();
    return;
  }
  const double s = std::sin(q), c = std::cos(q);  // as in DH parameters, and most of the time
  R.col(0) = c * X.R.col(0) + s * X.R.col(1);
  R.col(1) = c * X.R.col(1) - s * X.R.col(0);
  R.col(2) = X.R.col(2);
}

Transform linkPose(const Link& link, double q) noexcept {
  Transform X;
  setLinkPose(link, q, X.R, X.p);
  return X;
}

}  // namespace ves
