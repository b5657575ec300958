// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/gravity_compensation.hpp"

namespace ves {

Wrench staticWrench(const Payload& payload, const JointVector& q, const Mat3& R_IP,
                    const Vec3& g_I) noexcept {
  // Robot: mass and first moment of every link in the base link's frame, then gravity turned there.
  const RobotModel& robot = payload.robot;
  double mass = robot.base.mass;
  Vec3 moment = robot.base.mass * robot.base.p_BoBcm_B;  // [kg m] about L0o in L0
  const LinkPoses X_L0L = linkPoses(robot, q);
  for (int i = 0; i < robot.size; ++i) {
    const RigidBody& body = robot.link(i).body;
    mass += body.mass;
    moment += body.mass * (X_L0L[i] * body.p_BoBcm_B);
  }
  const Transform X_PL0 = payload.X_PL0();
  const Vec3 g_P = R_IP.transpose() * g_I;
  const Vec3 g_L0 = X_PL0.R.transpose() * g_P;
  const Wrench F_L0o_L0{mass * g_L0, moment.cross(g_L0)};

  // Plates.
  const auto weight = [](const RigidBody& body, const Vec3& g_B) {
    return Wrench{body.mass * g_B, body.p_BoBcm_B.cross(body.mass * g_B)};
  };
  const Wrench F_Ro_R = weight(payload.adapter_R, payload.X_PR.R.transpose() * g_P) +
                        transfer(payload.X_RL0, F_L0o_L0);

  // To the sensor.
  const Mat3 R_SP = payload.X_PS.R.transpose();
  const Transform X_SR{R_SP * payload.X_PR.R, R_SP * (payload.X_PR.p - payload.X_PS.p)};
  return weight(payload.top_plate_S, R_SP * g_P) + transfer(X_SR, F_Ro_R);
}

Wrench gravityCompensation(const Payload& payload, const Mat3& R_IP,
                           const Wrench& static_S) noexcept {
  return rotate(R_IP, transfer(payload.X_PS, static_S));
}

}  // namespace ves
