// SPDX-License-Identifier: BSD-3-Clause
#include "ves/contact/environment.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "ves/contact/contact_watch.hpp"

namespace ves {
namespace {

/// One feeler on one body: adds what it does to the tool; returns force, place and gap.
struct Push {
  Vec3 force_I = Vec3::Zero();  // [N] on the tool
  Vec3 p_I = Vec3::Zero();      // [m] where
  double gap = 0.0;             // [m]
};
Push push(const ContactLaw& law, const Feeler& feeler, const FrameMotion& tool, const Shape& shape,
          const Transform& X_IB, const Vec3& v_IB_I, const Vec3& w_IB_I, Touch& out) {
  const Vec3 centre = tool.X * feeler.p_TQ_T;
  const Proximity near = proximity(shape, inverse(X_IB) * centre);
  const Vec3 n = X_IB.R * near.normal;
  Push done;
  done.gap = near.distance - feeler.radius;
  done.p_I = centre - feeler.radius * n;
  const Vec3 v =
      tool.v + tool.w.cross(done.p_I - tool.X.p) - (v_IB_I + w_IB_I.cross(done.p_I - X_IB.p));
  if (done.gap < out.least) {
    out.least = done.gap;
    out.closing = -n.dot(v);
  }
  if (!(done.gap < 0.0)) return done;
  done.force_I = contactForce(law, -done.gap, n, v);
  out.stored += storedEnergy(law, -done.gap);
  out.pressed += done.force_I;
  out.on_tool_To_I.f += done.force_I;
  out.on_tool_To_I.n += (done.p_I - tool.X.p).cross(done.force_I);
  return done;
}

/// What holds the target where the tool has taken it.
void hold(const Grip& grip, const FrameMotion& tool, const Floating& target, Touch& out) {
  const Transform X_IB = tool.X * *target.X_TB;  // where it should be
  const Vec3 off = target.p - X_IB.p, lever = target.p - tool.X.p;
  const Eigen::AngleAxisd turned(target.X_IB().R * X_IB.R.transpose());
  const Vec3 angle = turned.angle() * turned.axis();
  const Vec3 v = target.v - (tool.v + tool.w.cross(lever)), w = target.w - tool.w;
  const Wrench on_target{-grip.stiffness * off - grip.damping * v,
                         -grip.turn_stiffness * angle - grip.turn_damping * w};
  out.on_target_Bo_I = out.on_target_Bo_I + on_target;
  out.on_tool_To_I = out.on_tool_To_I - shift(on_target, -lever);
  out.stored +=
      0.5 * (grip.stiffness * off.squaredNorm() + grip.turn_stiffness * angle.squaredNorm());
}

Floating moved(const Floating& from, const FloatingRates& by, double dt) {
  Floating out = from;
  out.p = from.p + dt * by.p;
  out.v = from.v + dt * by.v;
  out.w = from.w + dt * by.w;
  out.q.coeffs() = from.q.coeffs() + dt * by.q;
  out.q.normalize();
  return out;
}

/// From one motion to another over dt: a cubic for the place, the turn even.
class Passage {
 public:
  Passage(const FrameMotion& a, const FrameMotion& b, double dt)
      : a_(a), b_(b), dt_(dt), from_(a.X.R), to_(b.X.R) {}

  /// A share s of dt after the first, 0 <= s <= 1.
  FrameMotion at(double s) const {
    const double s2 = s * s, s3 = s2 * s;
    FrameMotion out;
    out.X.p = (2.0 * s3 - 3.0 * s2 + 1.0) * a_.X.p + (s3 - 2.0 * s2 + s) * dt_ * a_.v +
              (3.0 * s2 - 2.0 * s3) * b_.X.p + (s3 - s2) * dt_ * b_.v;
    out.v = (6.0 * s2 - 6.0 * s) / dt_ * (a_.X.p - b_.X.p) + (3.0 * s2 - 4.0 * s + 1.0) * a_.v +
            (3.0 * s2 - 2.0 * s) * b_.v;
    out.X.R = from_.slerp(s, to_).toRotationMatrix();
    out.w = a_.w + s * (b_.w - a_.w);
    return out;
  }

 private:
  const FrameMotion &a_, &b_;
  double dt_;
  Eigen::Quaterniond from_, to_;
};

/// What the gap of the tool to anything may shrink by over dt [m], and more.
double mayShrink(const Environment& environment, const FrameMotion& from, const FrameMotion& to,
                 const Floating& target, double dt) {
  constexpr double kMore = 2.0, kLeast = 1e-5;  // [-], [m]
  double arm = 0.0;
  for (const Feeler& feeler : environment.tool) arm = std::max(arm, feeler.p_TQ_T.norm());
  const double tool = std::max(from.v.norm(), to.v.norm()) +
                      std::max(from.w.norm(), to.w.norm()) * arm,
               floats = target.v.norm() + target.w.norm() * ((from.X.p - target.p).norm() + arm) +
                        environment.gravity.norm() * dt;
  return kMore * dt * (tool + floats) + kLeast;
}

/// How long a step may be while nothing touches [s]: what is held swings on the grip's springs.
double smoothStep(const Environment& environment, const Floating& target) {
  constexpr double kLongest = 2e-3;  // [s]
  constexpr double kTurn = 0.05;     // [rad] of the quickest swing
  if (!target.X_TB) return kLongest;
  const Grip& grip = *environment.grip;
  const double m_1 = 1.0 / environment.target->mass,
               I_1 = environment.target->I_Bcm_B.inverse().norm();  // the least, or more
  const double quickest = std::max({std::sqrt(grip.stiffness * m_1), grip.damping * m_1,
                                    std::sqrt(grip.turn_stiffness * I_1), grip.turn_damping * I_1});
  return std::min(kLongest, kTurn / quickest);
}

}  // namespace

Touch touch(const Environment& environment, const FrameMotion& tool,
            const Floating& target) noexcept {
  Touch out;
  for (const Feeler& feeler : environment.tool) {
    for (const FixedBody& body : environment.bodies)
      push(environment.law, feeler, tool, body.shape, body.X_IB, Vec3::Zero(), Vec3::Zero(), out);
    if (!environment.target || target.X_TB) continue;
    const Push on = push(environment.law, feeler, tool, environment.target->shape, target.X_IB(),
                         target.v, target.w, out);
    out.from_target = std::min(out.from_target, on.gap);
    out.on_target_Bo_I.f -= on.force_I;
    out.on_target_Bo_I.n -= (on.p_I - target.p).cross(on.force_I);
  }
  if (target.X_TB) hold(*environment.grip, tool, target, out);
  return out;
}

bool grasp(const Environment& environment, const FrameMotion& tool, Floating& target) noexcept {
  if (!environment.target || !environment.grip || target.X_TB ||
      !(touch(environment, tool, target).from_target <= environment.grip->reach))
    return false;
  target.X_TB = inverse(tool.X) * target.X_IB();
  return true;
}

FloatingRates rates(const Environment& environment, const Floating& target,
                    const Wrench& on_target_Bo_I) noexcept {
  FloatingRates out;
  out.p = target.v;
  out.q =
      0.5 * (Eigen::Quaterniond(0.0, target.w.x(), target.w.y(), target.w.z()) * target.q).coeffs();
  out.v = out.w = Vec3::Zero();
  if (!environment.target) return out;
  const Target& body = *environment.target;
  const Orbit& orbit = environment.orbit;
  out.v = on_target_Bo_I.f / body.mass + environment.gravity +
          orbit.acceleration(target.p - environment.p_IO_I, target.v);
  const Mat3 R = target.q.toRotationMatrix(), I_I = R * body.I_Bcm_B * R.transpose();
  const Vec3 w = target.w + orbit.w();
  out.w = I_I.inverse() * (on_target_Bo_I.n + orbit.gradient(I_I) - w.cross(I_I * w)) +
          target.w.cross(orbit.w());
  return out;
}

Touch advance(const Environment& environment, const FrameMotion& from, const FrameMotion& to,
              double t, double dt, double step, Floating& target, ContactWatch& watch) noexcept {
  Touch mean;
  if (!(dt > 0.0)) return mean;
  const bool near =
      !(touch(environment, from, target).least > mayShrink(environment, from, to, target, dt));
  const double most = near ? step : std::max(step, smoothStep(environment, target));
  const int steps = std::max(1, static_cast<int>(std::ceil(dt / most - 1e-9)));
  const double h = dt / steps;
  const Passage tool(from, to, dt);
  FrameMotion end = tool.at(0.0);
  for (int k = 0; k < steps; ++k) {
    const FrameMotion begin = end, middle = tool.at((k + 0.5) / steps);
    end = tool.at((k + 1.0) / steps);
    const auto at = [&](const FrameMotion& there, const Floating& body, Touch& touched) {
      touched = touch(environment, there, body);
      return rates(environment, body, touched.on_target_Bo_I);
    };
    std::array<Touch, 4> stage;
    const FloatingRates a = at(begin, target, stage[0]);
    watch.see(t + k * h, stage[0]);
    const FloatingRates b = at(middle, moved(target, a, 0.5 * h), stage[1]);
    const FloatingRates c = at(middle, moved(target, b, 0.5 * h), stage[2]);
    const FloatingRates d = at(end, moved(target, c, h), stage[3]);
    const FloatingRates sum = {a.p + 2.0 * b.p + 2.0 * c.p + d.p, a.v + 2.0 * b.v + 2.0 * c.v + d.v,
                               a.w + 2.0 * b.w + 2.0 * c.w + d.w,
                               a.q + 2.0 * b.q + 2.0 * c.q + d.q};
    target = moved(target, sum, h / 6.0);
    constexpr std::array<double, 4> kWeights = {1.0, 2.0, 2.0, 1.0};
    for (std::size_t i = 0; i < 4; ++i) {
      const double share = kWeights[i] / (6.0 * steps);
      const auto add = [&](Wrench& sum_of, const Wrench& one) {
        sum_of.f += share * one.f;
        sum_of.n += share * one.n;
      };
      add(mean.on_tool_To_I, stage[i].on_tool_To_I);
      add(mean.on_target_Bo_I, stage[i].on_target_Bo_I);
      mean.pressed += share * stage[i].pressed;
      mean.least = std::min(mean.least, stage[i].least);
      mean.from_target = std::min(mean.from_target, stage[i].from_target);
      mean.stored += share * stage[i].stored;
    }
  }
  return mean;
}

FrameMotion carriedFrame(const RobotModel& robot, const JointState& joints, const BodyMotion& base,
                         const Transform& X_BaseL0, int link, const Transform& X_link) noexcept {
  const LinkPoses X_L0L = linkPoses(robot, joints.q);
  const Transform X_IL0 = base.X * X_BaseL0;
  FrameMotion out;
  out.X = X_IL0 * (link < 0 ? X_link : X_L0L[link] * X_link);
  out.w = base.w;
  out.v = base.v + base.w.cross(out.X.p - base.X.p);
  // Every joint between the base and the frame adds its own motion.
  for (int i = link; i >= 0; i = robot.link(i).parent) {
    const Link& l = robot.link(i);
    const Transform X_IL = X_IL0 * X_L0L[i];
    const Vec3 axis = X_IL.R * l.axis * (l.ratio * joints.q_dot(l.joint));
    if (l.type == JointType::kRevolute) {
      out.w += axis;
      out.v += axis.cross(out.X.p - X_IL.p);
    } else {
      out.v += axis;
    }
  }
  return out;
}

}  // namespace ves
