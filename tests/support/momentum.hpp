// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>

#include "ves/robot/robot_model.hpp"

namespace ves::test {

/// df/dt at t by nine points, h [s] apart: exact for polynomials of the eighth degree.
template <class F>
auto derivative(const F& f, double t, double h) {
  using T = std::decay_t<decltype(f(t))>;
  const auto pair = [&](int k) { return T(f(t + k * h) - f(t - k * h)); };
  return T(
      (4.0 / 5.0 * pair(1) - 1.0 / 5.0 * pair(2) + 4.0 / 105.0 * pair(3) - 1.0 / 280.0 * pair(4)) /
      h);
}

/// Momentum {linear, about the origin of I} of a robot at t, from poses alone: X_IL0(t), q(t), and
/// differences over h [s].
inline Vec6 momentum(const RobotModel& robot, const std::function<Transform(double)>& X_IL0,
                     const std::function<JointVector(double)>& q, double t, double h) {
  const auto poseOf = [&](int body, double s) {
    const Transform X = X_IL0(s);
    Transform X_L0L;
    for (int i = body - 1; i >= 0; i = robot.link(i).parent) {  // from the tip inwards
      const Link& link = robot.link(i);
      X_L0L = linkPose(link, link.ratio * q(s)(link.joint) + link.offset) * X_L0L;
    }
    return X * X_L0L;
  };
  Vec6 sum = Vec6::Zero();
  for (int body = 0; body <= robot.size; ++body) {
    const RigidBody& b = body == 0 ? robot.base : robot.link(body - 1).body;
    const auto com = [&](double s) { return Vec3(poseOf(body, s) * b.p_BoBcm_B); };
    const auto R = [&](double s) { return poseOf(body, s).R; };
    const Vec3 v = derivative(com, t, h);
    const Mat3 W = derivative(R, t, h) * R(t).transpose();
    const Vec3 w(0.5 * (W(2, 1) - W(1, 2)), 0.5 * (W(0, 2) - W(2, 0)), 0.5 * (W(1, 0) - W(0, 1)));
    const Mat3 I_I = R(t) * b.I_Bcm_B * R(t).transpose();
    sum.head<3>() += b.mass * v;
    sum.tail<3>() += I_I * w + com(t).cross(b.mass * v);
  }
  return sum;
}

}  // namespace ves::test
