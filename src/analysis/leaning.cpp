// SPDX-License-Identifier: BSD-3-Clause
#include "ves/analysis/leaning.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "ves/contact/contact_watch.hpp"
#include "ves/math/dense.hpp"
#include "ves/math/second_order.hpp"

namespace ves {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNear = 0.05;  // [m] to what comes so near, speed is that of a contact
constexpr double kLook = 0.02;  // [s] between two looks at the program

/// Where the tool comes nearest to one surface, and how fast.
struct Nearest {
  double gap = HUGE_VAL;  // [m]
  Vec3 n = Vec3::Zero(), p_I = Vec3::Zero();
  JointVector q;
  double speed = 0.0;  // [m/s] at which it is met
};

/// Of a spring and a damper that give back this share of the speed.
double dampingRatio(double restitution) {
  const double decay = -std::log(std::max(restitution, 1e-6));
  return decay / std::hypot(M_PI, decay);
}

/// [1/kg] of a free body at a point r from its centre, along n.
double inverseMass(const Target& body, const Mat3& R_IB, const Vec3& r, const Vec3& n) {
  const Mat3 I_I = R_IB * body.I_Bcm_B * R_IB.transpose();
  const Vec3 turn = r.cross(n);
  return 1.0 / body.mass + turn.dot(Mat3(I_I.inverse()) * turn);
}

Vec6 along(const Vec3& n, const Vec3& p_Po_I) { return (Vec6() << n, p_Po_I.cross(n)).finished(); }

/// [kg] of base and robot along d.
double massAlong(const Loop& loop, const Vec6& d) {
  const ModalModel all = withBody(loop.base, spatialMass(loop.robot_P));
  return 1.0 / (all.Phi.transpose() * d).squaredNorm();
}

/// Every surface, ball by ball, that the tool or the target on its way may come near to; the target
/// last. `gripped`: the robot as its hand closes on the target, if it does.
std::vector<Nearest> nearestSurfaces(const ControllerConfig& controller, const RobotTask& task,
                                     const Transform& X_IP, std::optional<JointVector>& gripped) {
  const World& world = *task.world;
  const Payload& payload = controller.payload;
  const Environment& environment = world.environment;
  const std::size_t bodies = environment.bodies.size(), balls = environment.tool.size();
  std::vector<Nearest> nearest((bodies + 1) * balls);
  BodyMotion P;  // stands
  P.X = X_IP;
  FrameMotion tool;
  JointVector q;
  const auto look = [&](std::size_t which, const Shape& shape, const Transform& X_IB,
                        const Vec3& v) {
    for (std::size_t b = 0; b < balls; ++b) {
      const Feeler& ball = environment.tool[b];
      const Vec3 centre = tool.X * ball.p_TQ_T;
      const Proximity near = proximity(shape, inverse(X_IB) * centre);
      Nearest& best = nearest[which * balls + b];
      const Vec3 n = X_IB.R * near.normal;
      const double gap = near.distance - ball.radius,
                   closing = n.dot(v - tool.v - tool.w.cross(centre - tool.X.p));
      if (gap < kNear) best.speed = std::max(best.speed, closing);
      if (gap >= best.gap) continue;
      best.gap = gap;
      best.n = n;
      best.p_I = centre - ball.radius * n;
      best.q = q;
    }
  };
  MovingRobot robot(carried(payload), task.initial_joints);
  std::int64_t origin = 0, released = world.release < 0 ? 0 : INT64_MAX;  // [ns]
  for (int i = 0; i < controller.program.size; ++i) {
    const Segment& segment = controller.program.segments[static_cast<std::size_t>(i)];
    const auto duration = std::llround(segment.duration * 1e9);
    if (world.release == i) released = origin;
    std::vector<RobotEvent> events;
    for (const RobotEvent& event : task.robot_events)
      if (event.cue.segment == i) events.push_back(event);
    auto next = events.begin();
    for (std::int64_t now = 0; now <= duration; now += std::llround(kLook * 1e9)) {
      for (; next != events.end() && next->cue.after <= now; ++next) {
        robot.begin(next->action, origin + next->cue.after);
        if (std::holds_alternative<GraspTarget>(next->action)) gripped = robot.at(origin + now).q;
      }
      if (segment.kind != SegmentKind::kAdmittance) continue;
      const JointState joints = robot.at(origin + now);
      q = joints.q;
      tool = carriedFrame(robot.model(), joints, P, payload.X_PL0(), world.link, world.X_link);
      for (std::size_t b = 0; b < bodies; ++b)
        look(b, environment.bodies[b].shape, environment.bodies[b].X_IB, Vec3::Zero());
      if (!environment.target || gripped) continue;
      const Floating& start = environment.target->start;
      const double drifted =
          static_cast<double>(std::max<std::int64_t>(0, origin + now - released)) *
          kSecondPerNanosecond;
      look(bodies, environment.target->shape, {start.X_IB().R, start.p + drifted * start.v},
           start.v);
    }
    origin += duration;
  }
  return nearest;
}

/// What the grip holds, along each axis of I and about it. It is held with its surface at the tool.
std::vector<ExpectedContact> gripped(const World& world, const Payload& payload,
                                     const Transform& X_IP, const JointVector& q) {
  const Grip& grip = *world.environment.grip;
  const Target& target = *world.environment.target;
  BodyMotion P;
  P.X = X_IP;
  JointState joints;
  joints.q = q;
  const Vec3 tool =
      carriedFrame(carried(payload), joints, P, payload.X_PL0(), world.link, world.X_link).X.p;
  const Transform X_IB = target.start.X_IB();
  const Vec3 towards = target.start.p - tool;
  const double to_surface = proximity(target.shape, inverse(X_IB) * tool).distance;
  const Vec3 centre = tool + towards.normalized() * std::max(0.0, towards.norm() - to_surface);
  const Mat3 turning = (X_IB.R * target.I_Bcm_B * X_IB.R.transpose()).inverse();
  std::vector<ExpectedContact> out;
  for (const bool turns : {false, true})
    for (int i = 0; i < 3; ++i) {
      const Vec3 n = Vec3::Unit(i);
      ExpectedContact one;
      one.name = fmt::format("grip {}{}", turns ? "about " : "", "xyz"[i]);
      one.q = q;
      if (turns)
        one.leaning = {(Vec6() << Vec3::Zero(), n).finished(), grip.turn_stiffness,
                       grip.turn_damping, n.dot(turning * n)};
      else
        one.leaning = {along(n, centre - X_IP.p), grip.stiffness, grip.damping, 1.0 / target.mass};
      out.push_back(one);
    }
  return out;
}

}  // namespace

std::vector<ExpectedContact> expectedContacts(const ControllerConfig& controller,
                                              const RobotTask& task) {
  if (!task.world) return {};
  const Environment& environment = task.world->environment;
  const Transform X_IP = controller.geometry.fromHome({});
  std::optional<JointVector> held;
  const std::vector<Nearest> nearest = nearestSurfaces(controller, task, X_IP, held);
  std::vector<ExpectedContact> out;
  for (std::size_t i = 0; i < nearest.size(); ++i) {
    const Nearest& near = nearest[i];
    if (!(near.gap < kNear)) continue;
    const std::size_t which = i / environment.tool.size();
    const bool body = which < environment.bodies.size();
    ExpectedContact one;
    one.name = body ? fmt::format("bodies[{}]", which) : "target";
    one.q = near.q;
    one.speed = near.speed;
    one.leaning.direction = along(near.n, near.p_I - X_IP.p);
    if (!body)
      one.leaning.inverse_mass =
          inverseMass(*environment.target, environment.target->start.X_IB().R,
                      near.p_I - environment.target->start.p, near.n);
    const Loop loop = loopOf(controller, one.q, Direction::kSwinging);
    const double mass =
        1.0 / (one.leaning.inverse_mass + 1.0 / massAlong(loop, one.leaning.direction));
    one.leaning.stiffness = springLike(environment.law, mass, near.speed);
    one.leaning.damping = 2.0 * dampingRatio(restitution(environment.law, near.speed)) *
                          std::sqrt(one.leaning.stiffness * mass);
    out.push_back(one);
  }
  if (held)
    for (const ExpectedContact& one : gripped(*task.world, controller.payload, X_IP, *held))
      out.push_back(one);
  return out;
}

namespace {

/// Base and robot in free space, pushed along a direction: exact over a substep, the force held.
class FreeSpace {
 public:
  FreeSpace(const Loop& loop, double dt)
      : base_(withBody(loop.base, spatialMass(loop.robot_P))),
        hold_(modalHold(base_, dt)),
        g_(base_.Phi.transpose() * loop.contact->direction),
        pushed_(hold_.Gamma * g_),
        ahead_(g_.transpose() * hold_.Phi.topRows(g_.size())),
        state_(VectorXd::Zero(2 * base_.stiffness.size())),
        next_(state_) {}

  void push(double force) {
    next_.noalias() = hold_.Phi * state_;
    next_.noalias() += force * pushed_;
    state_.swap(next_);
  }
  double place() const { return g_.dot(state_.head(g_.size())); }
  double ahead() const { return ahead_.dot(state_); }  // a substep on, without a force
  double energy() const {
    const auto eta = state_.head(g_.size());
    return 0.5 *
           (state_.tail(g_.size()).squaredNorm() + eta.dot(base_.stiffness.cwiseProduct(eta)));
  }

 private:
  ModalModel base_;
  ModalHold hold_;
  VectorXd g_, pushed_;
  Eigen::RowVectorXd ahead_;
  VectorXd state_, next_;
};

/// What is met: it comes at `speed` and is slowed by the force; of infinite mass it just comes.
struct Comer {
  double inverse_mass, p = 0.0, v = 0.0;  // [1/kg]; [m], [m/s] along the direction
  double work = 0.0;                      // [J] done on the robot
  bool parted = false;
  double duration = 0.0, peak = 0.0;                   // [s], [N]
  double separation = 0.0, since = 0.0;                // [m/s], [s]
  double first_gap = 0.0, near = 0.0, near_gap = 0.0;  // [m], [s] after it, [m]

  /// The force on the robot over a substep in which its place along the direction goes from a to b.
  double meet(const Leaning& lean, double a, double b, double dt) {
    // Halfway; it comes along d and pushes the robot along d.
    const double gap = 0.5 * (a + b) - (p + 0.5 * dt * v), rate = (b - a) / dt - v;
    double force = -lean.stiffness * gap - lean.damping * rate;
    parted = parted || (duration > 0.0 && gap > 0.0);
    if (parted && first_gap == 0.0) {
      first_gap = gap;
    } else if (parted && since < 2.0 * ContactWatch::kApart) {
      since += dt;
      if (since < ContactWatch::kApart + 0.5 * dt) {
        near = since;
        near_gap = gap - first_gap;
        separation = near_gap / near;
      } else {
        separation = endSpeed(near, near_gap, since, gap - first_gap);
      }
    }
    if (parted || !(gap < 0.0) || !(force > 0.0)) force = 0.0;
    if (!parted) duration += dt;
    peak = std::max(peak, force);
    const double before = v;
    v -= dt * inverse_mass * force;
    p += 0.5 * dt * (before + v);
    work += 0.5 * dt * (before + v) * force;
    return force;
  }
};

}  // namespace

double meetingMass(const Loop& loop) {
  return 1.0 / (loop.contact->inverse_mass + 1.0 / massAlong(loop, loop.contact->direction));
}

Impact impact(const Loop& loop, double speed) {
  const Leaning& lean = *loop.contact;
  const PushedLoop pushed = pushedLoop(loop);
  const double dt = loop.period / PushedLoop::kSubsteps, w = loop.sensor_cutoff;
  FreeSpace base(loop, dt);
  Comer in_loop{lean.inverse_mass}, in_space{lean.inverse_mass};
  in_loop.v = in_space.v = speed;
  // The sensor's filter, the force held over a substep.
  const SecondOrderHold filter = discretise(w * w, M_SQRT2 * w, dt);
  Eigen::Vector2d sensor = Eigen::Vector2d::Zero();
  VectorXd state = VectorXd::Zero(pushed.step.rows()), with(state.size() + 1);
  const int readings = loop.readings;
  double sum = 0.0;
  Impact out;
  double until = Impact::kLongest;
  for (double now = 0.0; now < until; now += loop.period) {
    with << state, (readings > 1 ? sum / readings : sensor(0) - loop.late * sensor(1));
    sum = 0.0;
    const VectorXd places = pushed.places * with;
    int read = 0;
    for (int j = 0; j < PushedLoop::kSubsteps; ++j) {
      const double force = in_loop.meet(lean, places(j), places(j + 1), dt);
      sensor = filter.Phi * sensor + filter.Gamma * (w * w * force);
      if (readings > 1 && (j + 1.0) / PushedLoop::kSubsteps >= (read + 0.5) / readings - 1e-9) {
        sum += sensor(0) - loop.late * sensor(1);
        ++read;
      }
      base.push(in_space.meet(lean, base.place(), base.ahead(), dt));
    }
    state = pushed.step * with;
    if (in_loop.parted && in_space.parted && until == Impact::kLongest)
      until = std::min(until, now + Impact::kAnswer);
  }
  out.restitution = in_loop.separation / speed;
  out.free_space = in_space.separation / speed;
  out.peak = in_loop.peak;
  out.peak_free_space = in_space.peak;
  out.duration = in_loop.duration;
  out.duration_free_space = in_space.duration;
  if (!(in_loop.parted && in_space.parted)) return out;
  // What is met has lost what it did.
  const double excess =
      state.dot(pushed.energy * state) - in_loop.work - (base.energy() - in_space.work);
  out.energy_error = excess / (0.5 * meetingMass(loop) * speed * speed);
  return out;
}

bool growsLeaning(const Loop& loop) {
  constexpr double kSlightly = 1e-3;  // [1/s] a doubling in ten minutes
  Loop free = loop;
  free.contact.reset();
  const auto growth = [](const Loop& one) { return std::log(radius(one)) / one.period; };
  const double with = growth(loop);
  return with > kSlightly && with > growth(free) + kSlightly;
}

Loop leaning(Loop loop, const ExpectedContact& contact, double stiffness) {
  loop.contact = contact.leaning;
  loop.contact->stiffness = stiffness;
  loop.contact->damping *= std::sqrt(stiffness / contact.leaning.stiffness);
  return loop;
}

std::vector<ContactVerdict> assessContacts(const ControllerConfig& controller,
                                           const RobotTask& task, bool limits) {
  std::vector<ContactVerdict> out;
  for (const ExpectedContact& contact : expectedContacts(controller, task)) {
    ContactVerdict worst;
    worst.contact = contact;
    worst.limits = {HUGE_VAL, HUGE_VAL};
    double most = -1.0;
    for (const Direction direction : directionsOf(controller)) {
      const Loop loop = loopOf(controller, contact.q, direction);
      const Loop as_is = leaning(loop, contact, contact.leaning.stiffness);
      worst.grows = worst.grows || growsLeaning(as_is);
      const DominantRoot root = dominantRoot(as_is);
      if (root.growth > worst.growth || worst.frequency == 0.0) {
        worst.growth = root.growth;
        worst.frequency = root.frequency;
      }
      const bool met = contact.speed > 0.0;
      const Impact one = met ? impact(as_is, contact.speed) : Impact();
      if (met && !(std::abs(one.energy_error) <= most)) {
        most = std::abs(one.energy_error);
        worst.impact = one;
      }
      if (!limits) continue;
      const auto upTo = [&](const auto& bears) {
        double low = ContactLimits::kLeast;
        if (!bears(low)) return 0.0;
        double high = low;
        while (low < ContactLimits::kMost && bears(high = 4.0 * low)) low = high;
        constexpr int kHalvings = 6;
        for (int i = 0; i < kHalvings && low < ContactLimits::kMost; ++i) {
          const double middle = std::sqrt(low * high);
          (bears(middle) ? low : high) = middle;
        }
        return low;
      };
      worst.limits.growth =
          std::min(worst.limits.growth,
                   upTo([&](double k) { return !growsLeaning(leaning(loop, contact, k)); }));
      if (!met) continue;
      worst.limits.energy = std::min(worst.limits.energy, upTo([&](double k) {
                                       const Impact other =
                                           impact(leaning(loop, contact, k), contact.speed);
                                       return !(std::abs(other.energy_error) > kMostEnergyError);
                                     }));
    }
    out.push_back(worst);
  }
  return out;
}

std::string explain(const ContactVerdict& v) {
  const bool turns = v.contact.leaning.direction.head<3>().isZero(0.0);
  const char* const unit = turns ? "N m/rad" : "N/m";
  std::string out =
      fmt::format("contact with {}, {:.3g} {}", v.contact.name, v.contact.leaning.stiffness, unit);
  if (v.contact.speed > 0.0) out += fmt::format(" at {:.3g} m/s", v.contact.speed);
  out += ": ";
  if (std::isfinite(v.impact.energy_error))
    out += fmt::format(
        "{:+.1f} % of the energy of approach beyond free space, at most {:.0f} % up "
        "to {:.3g} {}; ",
        100.0 * v.impact.energy_error, 100.0 * kMostEnergyError, v.limits.energy, unit);
  if (v.grows)
    out += fmt::format("leaning on it grows at {:.2f} Hz, doubling every {:.2g} s, ", v.frequency,
                       std::log(2.0) / v.growth);
  return out + fmt::format("{} {:.3g} {}", v.grows ? "but not up to" : "nothing grows up to",
                           v.limits.growth, unit);
}

}  // namespace ves
