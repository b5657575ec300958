// SPDX-License-Identifier: BSD-3-Clause
//
// Newton-Euler on a tree beside two judges: KDL's solver on a base that stands, and the rate of
// momentum on one that moves.
#pragma once

#include <algorithm>
#include <kdl/treeidsolver_recursive_newton_euler.hpp>
#include <random>
#include <tuple>

#include "support/momentum.hpp"
#include "support/poses.hpp"
#include "support/robots.hpp"
#include "ves/robot/newton_euler.hpp"

namespace ves::test {

constexpr double kG = 9.81;  // [m/s^2]

inline JointState anyState(int joints, std::mt19937& random) {
  std::uniform_real_distribution<double> u(-2.0, 2.0);
  JointState s;
  for (int i = 0; i < joints; ++i) {
    s.q(i) = u(random);
    s.q_dot(i) = u(random);
    s.q_ddot(i) = u(random);
  }
  return s;
}

/// [-] Largest error of the joints' efforts in fifty states, relative to their size (and 1 N m).
/// KDL knows no joints that follow: there each has an effort of its own, and by virtual work the
/// master feels the sum of ratio times effort. Joints that are held stand where `robot` holds them.
inline double offFromKdl(const UrdfTree& tree, const std::string& text, const UrdfRobot& robot,
                         unsigned seed, const std::map<std::string, double>& held = {}) {
  const KDL::Tree kdl = kdlTree(text);
  KDL::TreeIdSolver_RNE solver(kdl, KDL::Vector(0, 0, -kG));
  const unsigned n = kdl.getNrOfJoints();
  std::mt19937 random(seed);
  ProperMotion base;
  base.a = {0.0, 0.0, kG};
  double most = 0.0;
  for (int k = 0; k < 50; ++k) {
    const JointState s = anyState(robot.model.joints, random);
    KDL::JntArray q(n), qd(n), qdd(n), tau(n);
    JointVector expected = JointVector::Zero();
    std::vector<std::tuple<unsigned, int, double>> at;  // of KDL's, ours, ratio
    for (const auto& [name, segment] : kdl.getSegments()) {
      const UrdfTree::Joint* joint = tree.find(segment.segment.getJoint().getName());
      if (!joint) continue;
      const unsigned theirs = segment.q_nr;
      const auto own =
          std::find(robot.joint_names.begin(), robot.joint_names.end(), joint->master());
      if (own == robot.joint_names.end()) {
        q(theirs) = joint->ratio * held.at(joint->master()) + joint->offset;
        continue;
      }
      const auto i = own - robot.joint_names.begin();
      q(theirs) = joint->ratio * s.q(i) + joint->offset;
      qd(theirs) = joint->ratio * s.q_dot(i);
      qdd(theirs) = joint->ratio * s.q_ddot(i);
      at.emplace_back(theirs, static_cast<int>(i), joint->ratio);
    }
    if (solver.CartToJnt(q, qd, qdd, KDL::WrenchMap(), tau) < 0) return HUGE_VAL;
    for (const auto& [theirs, ours, ratio] : at) expected(ours) += ratio * tau(theirs);
    const JointVector found = newtonEuler(robot.model, s, base).tau;
    most = std::max(most, (found - expected).norm() / (1.0 + expected.norm()));
  }
  return most;
}

/// [-] Error of the wrench on a base that swings, relative to its size (and 1 N), at three times.
inline double offFromMomentum(const RobotModel& robot, unsigned seed) {
  const Swing base(seed);
  const auto swing = [&](double t) {
    JointState s;
    for (int i = 0; i < robot.joints; ++i) {
      const double w = 1.0 + 0.2 * i;
      s.q(i) = 0.6 * std::sin(w * t + i);
      s.q_dot(i) = 0.6 * w * std::cos(w * t + i);
      s.q_ddot(i) = -0.6 * w * w * std::sin(w * t + i);
    }
    return s;
  };
  constexpr double h = 1e-2;  // [s]
  double most = 0.0;
  for (const double t : {0.7, 1.3, 2.1}) {
    const auto p = [&](double s) {
      return momentum(
          robot, [&](double at) { return base.motion(at).X; },
          [&](double at) { return swing(at).q; }, s, h);
    };
    const Vec6 rate = derivative(p, t, h);
    const BodyMotion P = base.motion(t);
    const Wrench F = newtonEuler(robot, swing(t), properMotion(P, {}, Vec3::Zero())).F_L0o_L0;
    most = std::max(most, (transfer(P.X, F).stacked() - rate).norm() / (1.0 + rate.norm()));
  }
  return most;
}

}  // namespace ves::test
