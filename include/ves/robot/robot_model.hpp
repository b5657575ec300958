// SPDX-License-Identifier: BSD-3-Clause
//
// A robot as plain numbers, a tree of links: what gravity compensation and Newton-Euler read.
#pragma once

#include <array>

#include "ves/math/frames.hpp"

namespace ves {

inline constexpr int kMaxJoints = 12;  // [-] that move by themselves
inline constexpr int kMaxLinks = 24;   // [-] that move: the joints' own, and those that follow

enum class JointType { kRevolute, kPrismatic };

/// Joint values in files and messages: [rad/deg] of one that turns, [1] of one that slides.
inline double jointUnit(JointType type) { return type == JointType::kRevolute ? kDegree : 1.0; }
inline const char* jointUnitName(JointType type) {
  return type == JointType::kRevolute ? "deg" : "m";
}

/// Mass, centre and inertia of a rigid body B.
struct RigidBody {
  double mass = 0.0;              // [kg]
  Vec3 p_BoBcm_B = Vec3::Zero();  // [m] centre of mass
  Mat3 I_Bcm_B = Mat3::Zero();    // [kg m^2] about the centre of mass

  bool operator==(const RigidBody&) const = default;
};

/// The symmetric matrix of {xx, yy, zz, xy, xz, yz}.
inline Mat3 inertiaOf(const Vec6& i) {
  Mat3 I;
  I << i(0), i(3), i(4), i(3), i(1), i(5), i(4), i(5), i(2);
  return I;
}

/// One body of both, expressed in A; B's frame is posed in A.
RigidBody combine(const RigidBody& a_A, const Transform& X_AB, const RigidBody& b_B) noexcept;

/// The same body of so many times the density.
inline RigidBody scaledDensity(double times, const RigidBody& body) noexcept {
  return {times * body.mass, body.p_BoBcm_B, times * body.I_Bcm_B};
}

/// A joint and the link it moves. The link's frame is the joint's frame after the joint's motion.
struct Link {
  JointType type = JointType::kRevolute;
  int parent = -1;            // [-] index of the link that carries it, below its own; -1: link 0
  int joint = 0;              // [-] index of the joint value that moves it
  double ratio = 1.0;         // [-] its joint stands at ratio * value + offset; other than 1 and 0
  double offset = 0.0;        // [rad | m] where it follows another joint
  Transform X_parent;         // pose of the joint's frame in the parent link, at joint value 0
  Vec3 axis = Vec3::UnitZ();  // [-] unit vector, joint frame
  double lower = 0.0;         // [rad | m] joint range
  double upper = 0.0;         // [rad | m]
  RigidBody body;

  double at(double value) const { return ratio * value + offset; }  // [rad | m] of its joint
  bool operator==(const Link&) const = default;
};

/// Links 1..n on a fixed base link 0, whose frame is L0; each stands behind the one that carries
/// it.
struct RobotModel {
  RigidBody base;  // link 0
  int size = 0;    // [-] links that move
  int joints = 0;  // [-] joint values
  std::array<Link, kMaxLinks> links{};
  std::array<int, kMaxJoints> own{};  // [-] index of the link that joint value i moves itself

  const Link& link(int i) const { return links[static_cast<std::size_t>(i)]; }
  /// Of a link that moves, or of link 0 (-1).
  RigidBody& bodyOf(int i) { return i < 0 ? base : links[static_cast<std::size_t>(i)].body; }
  const RigidBody& bodyOf(int i) const {
    return i < 0 ? base : links[static_cast<std::size_t>(i)].body;
  }
  const Link& jointLink(int i) const { return link(own[static_cast<std::size_t>(i)]); }
  /// A further link. It has a joint of its own, or follows the one it names.
  void add(const Link& link, bool follows = false);
  /// A further link with a joint of its own on the last one: a serial arm.
  void extend(Link link) {
    link.parent = size - 1;
    add(link);
  }
  bool operator==(const RobotModel&) const = default;
};

/// Joint values; entries from `joints` on are zero.
using JointVector = Eigen::Matrix<double, kMaxJoints, 1>;

struct JointState {
  JointVector q = JointVector::Zero();       // [rad | m]
  JointVector q_dot = JointVector::Zero();   // [rad/s | m/s]
  JointVector q_ddot = JointVector::Zero();  // [rad/s^2 | m/s^2]
};

/// The same body in axes A that R_AB turns to; Bo stays where it is.
RigidBody rotated(const Mat3& R_AB, const RigidBody& body_B) noexcept;

/// [F; N] = spatialMass * [a; alpha] of Bo, for a body that does not turn yet.
Mat6 spatialMass(const RigidBody& body) noexcept;
/// Of the same body, with its basis turned.
Mat6 rotated(const Mat3& R_AB, const Mat6& M_B) noexcept;

/// Of every link that moves, in L0. Entries from RobotModel::size on are not set.
class LinkPoses {
 public:
  Transform& operator[](int i) { return X_[static_cast<std::size_t>(i)]; }
  const Transform& operator[](int i) const { return X_[static_cast<std::size_t>(i)]; }

 private:
  std::array<Transform, kMaxLinks> X_;
};
LinkPoses linkPoses(const RobotModel& robot, const JointVector& q) noexcept;

/// The whole robot with its joints locked at q, in L0: [M_1] of (3.1).
RigidBody compositeBody(const RobotModel& robot, const JointVector& q) noexcept;

/// Where a robot holds things.
struct Hand {
  int link = -2;               // [-] that carries it; -1: link 0, -2: there is none
  Vec3 p_LT_L = Vec3::Zero();  // [m] in that link's frame
  bool switched = false;       // a switch tells whether it is closed
};

/// The robot with a further body on a link (-1: link 0), rigid, in that link's frame.
RobotModel withLoad(RobotModel robot, int link, const RigidBody& load) noexcept;

/// Pose of a link's frame in its parent's, its joint at q.
Transform linkPose(const Link& link, double q) noexcept;
/// The same, written to R [3x3] and p [m].
void setLinkPose(const Link& link, double q, Mat3& R, Vec3& p) noexcept;

}  // namespace ves
