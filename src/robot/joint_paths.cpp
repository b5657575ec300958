// SPDX-License-Identifier: BSD-3-Clause
#include "ves/robot/joint_paths.hpp"

#include <cmath>

namespace ves {
namespace {

double seconds(std::int64_t ns) { return static_cast<double>(ns) * kSecondPerNanosecond; }

}  // namespace

JointPaths::JointPaths(int joints, const JointVector& q) noexcept : joints_(joints) {
  for (int i = 0; i < joints_; ++i) {
    PathPoint<1> rest;
    rest.x(0) = q(i);
    paths_[static_cast<std::size_t>(i)].path = Quintic<1>(rest, rest.x, 1.0);
  }
}

bool JointPaths::move(const RobotMove& move, std::int64_t now) noexcept {
  if (move.joint < 0 || move.joint >= joints_ || !std::isfinite(move.target) ||
      !std::isfinite(move.duration) || !(move.duration > 0.0))
    return false;
  Path& joint = paths_[static_cast<std::size_t>(move.joint)];
  const PathPoint<1> from = joint.path.at(seconds(now - joint.start));
  joint.path = Quintic<1>(from, Eigen::Matrix<double, 1, 1>(move.target), move.duration);
  joint.start = now;
  return true;
}

JointState JointPaths::at(std::int64_t now, double later) const noexcept {
  JointState joints;
  for (int i = 0; i < joints_; ++i) {
    const Path& joint = paths_[static_cast<std::size_t>(i)];
    const PathPoint<1> at = joint.path.at(seconds(now - joint.start) + later);
    joints.q(i) = at.x(0);
    joints.q_dot(i) = at.x_dot(0);
    joints.q_ddot(i) = at.x_ddot(0);
  }
  return joints;
}

bool JointPaths::moving(std::int64_t now) const noexcept {
  for (int i = 0; i < joints_; ++i) {
    const Path& joint = paths_[static_cast<std::size_t>(i)];
    if (seconds(now - joint.start) < joint.path.duration()) return true;
  }
  return false;
}

}  // namespace ves
