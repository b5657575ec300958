// SPDX-License-Identifier: BSD-3-Clause
#include "ves/srms/interaction.hpp"

#include <algorithm>
#include <boost/numeric/odeint/stepper/bulirsch_stoer_dense_out.hpp>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_cash_karp54.hpp>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "vehicle_equations.hpp"

namespace ves {
namespace {

namespace odeint = boost::numeric::odeint;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The equations of motion, y = {the vehicle's, and where there is a world {p, q, v, w} of what
/// floats in it}.
class Equations {
  template <typename F>
  decltype(auto) each(F&& f) const {
    return std::visit(f, vehicle_);
  }

 public:
  Equations(const Interaction& interaction, const InteractionOptions& options)
      : interaction_(interaction),
        robot_(carried(interaction.payload), interaction.q0),
        X_PL0_(interaction.payload.X_PL0()),
        vehicle_(equationsOf(interaction, options)) {}

  std::size_t size() const {
    return static_cast<std::size_t>(ofVehicle() + (interaction_.world ? kFloating : 0));
  }
  double milli() const {
    return each([](const auto& v) { return v.milli(); });
  }

  VectorXd start() const {
    VectorXd y(static_cast<Eigen::Index>(size()));
    y.head(ofVehicle()) = each([&](const auto& v) { return v.start(riding(robot_.at(0), 0.0)); });
    if (interaction_.world) {
      const std::optional<Target>& target = interaction_.world->environment.target;
      const Floating f = target ? target->start : Floating{};
      y.tail<kFloating>() << f.p, f.q.coeffs(), f.v, f.w;
    }
    return y;
  }

  /// The interval that begins now, `step` steps after the start.
  void begin(std::int64_t now, std::int64_t step, const VectorXd& y) {
    now_ = now;
    std::visit([&](auto& v) { v.begin(riding(robot_.at(now_), seconds(now_)), step, y); },
               vehicle_);
  }
  void begin(const RobotAction& action, VectorXd& y) {
    if (const auto* push = std::get_if<Push>(&action)) {
      push_ = BegunPush{*push, now_};
      return;
    }
    if (std::holds_alternative<GraspTarget>(action)) {
      Floating target = floating(y);
      const JointState q = robot_.at(now_);
      if (interaction_.world && grasp(interaction_.world->environment,
                                      toolMotion(q, platform(q, seconds(now_), y)), target))
        X_TB_ = target.X_TB;
    } else if (std::holds_alternative<Release>(action) && X_TB_) {
      X_TB_.reset();
    } else {
      const bool loads =
          std::holds_alternative<Grasp>(action) || std::holds_alternative<Release>(action);
      const JointState q = robot_.at(now_);
      const BodyMotion P = platform(q, seconds(now_), y);
      robot_.begin(action, now_);
      composite_of_.reset();
      if (loads) each([&](const auto& v) { v.load(riding(q, seconds(now_)), P, y); });
    }
  }

  /// Whether an interval ends with the step: something is held for its length, or may touch.
  bool holdsAStep() const {
    return hasWorld() || each([](const auto& v) { return v.holdsAStep(); });
  }
  void derivative(double later, const VectorXd& y, VectorXd& dy) const {
    const JointState q = robot_.at(now_, later);
    const double t = seconds(now_) + later;
    Wrench F_Po_I, on_target_Bo_I;  // beside the robot's
    if (pushing()) {
      const BodyMotion P = platform(q, t, y);
      const Push& push = push_->push;
      const Transform X_IB = interaction_.world ? floating(y).X_IB() : Transform();
      const Vec3 at = pushedPoint(push, P.X, X_PL0_, robot_.model(), q.q, X_IB);
      if (push.on == Push::On::kTarget)
        on_target_Bo_I = {push.force_I, (at - X_IB.p).cross(push.force_I)};
      else
        F_Po_I = {push.force_I, (at - P.X.p).cross(push.force_I)};
    }
    if (interaction_.world) {
      const BodyMotion P = platform(q, t, y);
      const FrameMotion tool = toolMotion(q, P);
      const Touch touched = touch(interaction_.world->environment, tool, floating(y));
      F_Po_I = F_Po_I + shift(touched.on_tool_To_I, P.X.p - tool.X.p);
      const FloatingRates f = rates(interaction_.world->environment, floating(y),
                                    touched.on_target_Bo_I + on_target_Bo_I);
      dy.tail<kFloating>() << f.p, f.q, f.v, f.w;
    }
    each([&](const auto& v) { v.derivative(riding(q, t), y, F_Po_I, dy); });
  }

  InteractionPoint point(std::int64_t now, const VectorXd& y) const {
    InteractionPoint p;
    p.t = seconds(now);
    const JointState q = robot_.at(now);
    each([&](const auto& v) { v.tell(riding(q, p.t), y, p); });
    if (interaction_.world) {
      p.target = floating(y);
      p.touch =
          touch(interaction_.world->environment, toolMotion(q, platform(q, p.t, y)), p.target);
      p.contacts = contacts_;
    }
    return p;
  }

  /// What touches, `later` [s] in the interval.
  Touch touched(double later, const VectorXd& y) const {
    const JointState q = robot_.at(now_, later);
    return touch(interaction_.world->environment,
                 toolMotion(q, platform(q, seconds(now_) + later, y)), floating(y));
  }
  const Contact& contact() const { return contacts_.last(); }
  bool hasWorld() const { return interaction_.world.has_value(); }
  void see(double later, const VectorXd& y) {
    contacts_.see(seconds(now_) + later, touched(later, y));
  }

 private:
  static constexpr int kFloating = 13;

  Eigen::Index ofVehicle() const {
    return each([](const auto& v) { return v.size(); });
  }
  static double seconds(std::int64_t ns) { return static_cast<double>(ns) * kSecondPerNanosecond; }
  RidingRobot riding(const JointState& q, double t) const {
    if (!composite_of_ || *composite_of_ != q.q) {  // most of the time it stands
      composite_of_ = q.q;
      composite_L0_ = compositeBody(robot_.model(), q.q);
    }
    return {robot_.model(), X_PL0_, q, t, composite_L0_};
  }
  BodyMotion platform(const JointState& q, double t, const VectorXd& y) const {
    return each([&](const auto& v) { return v.platform(riding(q, t), y); });
  }

  bool pushing() const { return push_ && now_ < push_->end(); }

  Floating floating(const VectorXd& y) const {
    const Eigen::Matrix<double, kFloating, 1> f = y.tail<kFloating>();
    Floating out;
    out.p = f.head<3>();
    out.q = Eigen::Quaterniond(Eigen::Vector4d(f.segment<4>(3))).normalized();
    out.v = f.segment<3>(7);
    out.w = f.tail<3>();
    out.X_TB = X_TB_;
    return out;
  }
  FrameMotion toolMotion(const JointState& q, const BodyMotion& P) const {
    return carriedFrame(robot_.model(), q, P, X_PL0_, interaction_.world->link,
                        interaction_.world->X_link);
  }

  const Interaction& interaction_;
  MovingRobot robot_;
  Transform X_PL0_;
  VehicleEquations vehicle_;
  std::int64_t now_ = 0;           // [ns] start of the interval
  std::optional<Transform> X_TB_;  // of the target, in the tool's grip
  ContactWatch contacts_;
  std::optional<BegunPush> push_;
  mutable std::optional<JointVector> composite_of_;
  mutable RigidBody composite_L0_;
};

struct Diverges {};

using State = std::vector<double>;

State stateOf(const VectorXd& y) { return {y.begin(), y.end()}; }
VectorXd vectorOf(const State& state) {
  return VectorXd::Map(state.data(), static_cast<Eigen::Index>(state.size()));
}

struct Rates {
  const Equations* equations;
  void operator()(const State& y, State& y_dot, double t) const {
    VectorXd rates(static_cast<Eigen::Index>(y.size()));
    equations->derivative(t, vectorOf(y), rates);
    if (!rates.allFinite()) throw Diverges();
    VectorXd::Map(y_dot.data(), rates.size()) = rates;
  }
};

/// Runge and Kutta's steps, of fifth order as Cash and Karp have it, as long as the tolerance lets
/// them be.
class Solver {
 public:
  Solver(const Equations& equations, const InteractionOptions& options)
      : rates_{&equations},
        controlled_(Checker(options.tolerance * equations.milli(), options.tolerance, 1.0, 0.0)) {}

  /// [s] of the next step, at most.
  void startWith(double length) { length_ = length; }

  /// A step on from `now`, to `until` at most; returns where it ends.
  double step(double now, double until, VectorXd& y) {
    for (;;) {
      const bool last = now + length_ >= until;
      double then = now, length = last ? until - now : length_;
      State state = stateOf(y);
      const bool taken = controlled_.try_step(rates_, state, then, length) ==
                         odeint::controlled_step_result::success;
      // What is left of an interval says nothing of how long the next step may be.
      length_ = taken && last ? std::max(length_, length) : length;
      if (!taken && now + length_ > now) continue;
      if (!taken) throw Diverges();
      y = vectorOf(state);
      return last ? until : then;
    }
  }

  /// One of that length, however large its error.
  void leap(double now, double length, VectorXd& y) {
    State state = stateOf(y);
    Stepper().do_step(rates_, state, now, length);
    y = vectorOf(state);
  }

 private:
  using Stepper = odeint::runge_kutta_cash_karp54<State>;
  using Checker =
      odeint::default_error_checker<double, odeint::range_algebra, odeint::default_operations>;

  Rates rates_;
  odeint::controlled_runge_kutta<Stepper, Checker> controlled_;
  double length_ = 1e-3;  // [s]
};

/// Bulirsch and Stoer's steps, many times as long, and what is asked for between their ends.
class LongSteps {
 public:
  /// An interval that begins at y.
  LongSteps(const Equations& equations, const InteractionOptions& options, const VectorXd& y)
      : rates_{&equations},
        stepper_(kOfLong * options.tolerance * equations.milli(), kOfLong * options.tolerance, 1.0,
                 0.0, kLongest, true) {
    stepper_.initialize(stateOf(y), 0.0, kFirst);
  }

  /// `later` [s] in it, no earlier than what was asked last.
  void advance(double later, VectorXd& y) {
    while (stepper_.current_time() < later) step();
    State state(static_cast<std::size_t>(y.size()));
    stepper_.calc_state(later, state);
    y = vectorOf(state);
  }

 private:
  static constexpr double kOfLong = 0.1;  // [-] of the tolerance that is asked for
  // A short first step would be of low order; a long one where all stands sees too little.
  static constexpr double kFirst = 0.05, kLongest = 0.25;  // [s]

  void step() {
    try {
      stepper_.do_step(rates_);
    } catch (const odeint::no_progress_error&) {
      throw Diverges();
    }
  }

  Rates rates_;
  odeint::bulirsch_stoer_dense_out<State> stepper_;
};

/// The interval of `over` [s], step by step: every one is seen, and ends where the tool begins or
/// ceases to touch.
void passContacts(Solver& solver, Equations& equations, double over, VectorXd& y) {
  constexpr double kSame = 1e-12;      // [s]
  constexpr double kInContact = 1e-3;  // [s], or
  constexpr double kShare = 0.05;  // [-] of its duration so far: a peak is seen to 1 part in 1000
  double now = 0.0;
  solver.startWith(std::min(over, kInContact));
  bool touches = equations.touched(now, y).least < 0.0;
  equations.see(now, y);
  while (now < over) {
    const double before = now;
    const VectorXd from = y;
    const double most = std::max(kInContact, kShare * equations.contact().duration);
    now = solver.step(now, touches ? std::min(over, now + most) : over, y);
    if ((equations.touched(now, y).least < 0.0) != touches) {
      // One step of just that length, by halves.
      double low = 0.0, high = now - before;
      const auto leap = [&](double length) {
        y = from;
        solver.leap(before, length, y);
      };
      while (high - low > kSame) {
        const double middle = 0.5 * (low + high);
        if (!(middle > low && middle < high)) break;
        leap(middle);
        ((equations.touched(before + middle, y).least < 0.0) == touches ? low : high) = middle;
      }
      leap(high);
      now = before + high;
      touches = !touches;
      solver.startWith(std::min(kInContact, over));
    }
    equations.see(now, y);
  }
}

/// [ns] where actions begin and end, in order, and one past all others. The motion is smooth
/// between them, and a push begins and ends with an interval.
std::vector<std::int64_t> kinksOf(const std::vector<TimedAction>& actions) {
  std::vector<std::int64_t> out{INT64_MAX};
  for (const TimedAction& one : actions) {
    out.push_back(one.start);
    out.push_back(one.start + std::llround(durationOf(one.action) * 1e9));
  }
  std::sort(out.begin(), out.end());
  return out;
}

std::int64_t nextStep(std::int64_t now, const InteractionOptions& options) {
  return (now / options.step + 1) * options.step;
}

}  // namespace

MatrixXd augmentedModalMass(const ModalModel& base, const RigidBody& robot_P) {
  const auto Phi_u = base.Phi.topRows<3>(), Phi_l = base.Phi.bottomRows<3>();
  const double m_1 = robot_P.mass;
  const Mat3 Rx = skew(robot_P.p_BoBcm_B);  // (3.10), of P_c
  return MatrixXd::Identity(base.Phi.cols(), base.Phi.cols()) + Phi_u.transpose() * m_1 * Phi_u +
         Phi_l.transpose() * robot_P.I_Bcm_B * Phi_l - Phi_u.transpose() * m_1 * Rx * Phi_l +
         Phi_l.transpose() * Rx * m_1 * Phi_u - Phi_l.transpose() * Rx * m_1 * Rx * Phi_l;
}

std::vector<InteractionPoint> simulate(const Interaction& interaction,
                                       const InteractionOptions& options) {
  Equations equations(interaction, options);
  VectorXd y = equations.start();

  Solver solver(equations, options);
  std::vector<InteractionPoint> out{equations.point(0, y)};
  const auto keep = [&](std::int64_t time) {
    if (time % options.step == 0) out.push_back(equations.point(time, y));
  };
  const auto pass = [&](std::int64_t now, std::int64_t until) {
    const auto since = [&](std::int64_t time) {
      return static_cast<double>(time - now) * kSecondPerNanosecond;
    };
    if (equations.hasWorld()) {
      passContacts(solver, equations, since(until), y);
    } else if (equations.holdsAStep()) {
      for (double later = 0.0; later < since(until);) later = solver.step(later, since(until), y);
    } else {
      LongSteps steps(equations, options, y);
      for (std::int64_t at = nextStep(now, options); at < until; at += options.step) {
        steps.advance(since(at), y);
        keep(at);
      }
      steps.advance(since(until), y);
    }
    keep(until);
  };
  const std::int64_t end = options.duration - options.duration % options.step;
  const std::vector<std::int64_t> kinks = kinksOf(interaction.actions);
  auto next = interaction.actions.begin();
  for (std::int64_t now = 0; now < end;) {
    equations.begin(now, now / options.step, y);
    for (; next != interaction.actions.end() && next->start <= now; ++next)
      equations.begin(next->action, y);
    std::int64_t until = std::min(end, *std::upper_bound(kinks.begin(), kinks.end(), now));
    if (equations.holdsAStep()) until = std::min(until, nextStep(now, options));
    try {
      pass(now, until);
    } catch (const Diverges&) {
      throw std::domain_error(
          "the tolerance cannot be kept: the motion grows without bound, or "
          "too small a tolerance is asked");
    }
    now = until;
  }
  return out;
}

}  // namespace ves
