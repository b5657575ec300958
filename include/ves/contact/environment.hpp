// SPDX-License-Identifier: BSD-3-Clause
//
// The world that the robot's tool touches: bodies fixed in I, and one that floats. What its contact
// does to the tool and to the floating body, in the plant as in free space.
#pragma once

#include <optional>
#include <vector>

#include "ves/contact/law.hpp"
#include "ves/contact/shape.hpp"
#include "ves/math/orbit.hpp"
#include "ves/robot/robot_model.hpp"

namespace ves {

/// A ball on the tool; of radius 0 a point.
struct Feeler {
  Vec3 p_TQ_T = Vec3::Zero();  // [m] its centre in the tool's frame
  double radius = 0.0;         // [m]

  bool operator==(const Feeler&) const = default;
};

struct FixedBody {
  Transform X_IB;
  Shape shape;

  bool operator==(const FixedBody&) const = default;
};

/// A hand that holds the target where it was when it closed, as a spring and a damper would.
struct Grip {
  double stiffness = 0.0, damping = 0.0;            // [N/m], [N s/m]
  double turn_stiffness = 0.0, turn_damping = 0.0;  // [N m/rad], [N m s/rad]
  double reach = 0.0;                               // [m] from the tool's balls, at most

  bool operator==(const Grip&) const = default;
};

/// How a rigid body floats. B stands in its centre of mass.
struct Floating {
  Vec3 p = Vec3::Zero();                                  // [m] p_IB_I
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();  // of R_IB
  Vec3 v = Vec3::Zero();                                  // [m/s] v_IB_I
  Vec3 w = Vec3::Zero();                                  // [rad/s] w_IB_I
  std::optional<Transform> X_TB;  // in the tool's grip: where it is held, in the tool's frame

  Transform X_IB() const { return {q.toRotationMatrix(), p}; }
};

struct Target {
  double mass = 0.0;                // [kg]
  Mat3 I_Bcm_B = Mat3::Identity();  // [kg m^2]
  Shape shape = Ball{};
  Floating start;

  bool operator==(const Target& o) const {
    return mass == o.mass && I_Bcm_B == o.I_Bcm_B && shape == o.shape && start.p == o.start.p &&
           start.q.coeffs() == o.start.q.coeffs() && start.v == o.start.v && start.w == o.start.w;
  }
};

struct Environment {
  std::vector<Feeler> tool;
  ContactLaw law;
  std::vector<FixedBody> bodies;
  std::optional<Target> target;
  std::optional<Grip> grip;
  Vec3 gravity = Vec3::Zero();  // [m/s^2] g_I, on the target
  Orbit orbit;                  // that it goes round with,
  Vec3 p_IO_I = Vec3::Zero();   // [m] and the origin of it

  bool operator==(const Environment&) const = default;
};

/// An environment, and where on a robot the tool is that touches it.
struct World {
  Environment environment;
  int link = -1;     // [-] index of the link that carries the tool; -1: link 0
  Transform X_link;  // the tool's frame in it
  int release = -1;  // [-] segment of the program with which what floats is let go; -1: at once

  bool operator==(const World&) const = default;
};

class ContactWatch;

/// A frame that moves.
struct FrameMotion {
  Transform X;            // X_IT
  Vec3 v = Vec3::Zero();  // [m/s] v_IT_I
  Vec3 w = Vec3::Zero();  // [rad/s] w_IT_I
};

/// What touches, at one instant.
struct Touch {
  Wrench on_tool_To_I;            // on the tool, about To, its grip's share included
  Wrench on_target_Bo_I;          // on the target, about its centre
  Vec3 pressed = Vec3::Zero();    // [N] on the tool, without the grip
  double least = HUGE_VAL;        // [m] distance of the tool from the nearest surface,
  double closing = 0.0;           // [m/s] at which it shrinks,
  double from_target = HUGE_VAL;  // [m] and from the target's
  double stored = 0.0;            // [J] in the springs of contacts and grip
};
/// The tool does not touch what it holds.
Touch touch(const Environment& environment, const FrameMotion& tool,
            const Floating& target) noexcept;

/// Rates of the floating body under that wrench, and gravity.
struct FloatingRates {
  Vec3 p, v, w;
  Eigen::Vector4d q;  // of its coefficients x, y, z, w
};
FloatingRates rates(const Environment& environment, const Floating& target,
                    const Wrench& on_target_Bo_I) noexcept;

/// Closes the grip on a target within its reach; false where there is none.
bool grasp(const Environment& environment, const FrameMotion& tool, Floating& target) noexcept;

/// Moves the target over dt [s] from t [s] on while the tool goes from one motion to the other, in
/// Runge-Kutta steps, each seen by the watch: of at most `step` [s] where the tool touches
/// something or may before the end. Returns the mean of what touched.
Touch advance(const Environment& environment, const FrameMotion& from, const FrameMotion& to,
              double t, double dt, double step, Floating& target, ContactWatch& watch) noexcept;

/// The motion of a frame that a robot's link carries, on a base that moves.
FrameMotion carriedFrame(const RobotModel& robot, const JointState& joints, const BodyMotion& base,
                         const Transform& X_BaseL0, int link, const Transform& X_link) noexcept;

}  // namespace ves
