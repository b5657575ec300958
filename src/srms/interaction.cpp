// SPDX-License-Identifier: BSD-3-Clause
#include "ves/srms/interaction.hpp"

#include <gsl/gsl_odeiv2.h>

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "gsl_errors.hpp"
#include "vehicle_equations.hpp"

namespace ves {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct FreeDriver {
  void operator()(gsl_odeiv2_driver* d) const { gsl_odeiv2_driver_free(d); }
};

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
      if (loads) each([&](const auto& v) { v.load(riding(q, seconds(now_)), P, y); });
    }
  }

  /// [ns] when the push ends that lasts now; `otherwise`: none does.
  std::int64_t pushEnds(std::int64_t otherwise) const {
    return pushing() ? std::min(otherwise, push_->end()) : otherwise;
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
  RidingRobot riding(const JointState& q, double t) const { return {robot_.model(), X_PL0_, q, t}; }
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
};

/// The interval of `over` [s], step by step: every one is seen, and ends where the tool begins or
/// ceases to touch.
int passContacts(gsl_odeiv2_driver& driver, Equations& equations, double over, VectorXd& y) {
  constexpr double kSame = 1e-12;      // [s]
  constexpr double kInContact = 1e-3;  // [s], or
  constexpr double kShare = 0.05;  // [-] of its duration so far: a peak is seen to 1 part in 1000
  double now = 0.0, h = std::min(over, kInContact);
  bool touches = equations.touched(now, y).least < 0.0;
  equations.see(now, y);
  while (now < over) {
    const double before = now;
    const VectorXd from = y;
    const double most = std::max(kInContact, kShare * equations.contact().duration);
    const double until = touches ? std::min(over, now + most) : over;
    const int status = gsl_odeiv2_evolve_apply(driver.e, driver.c, driver.s, driver.sys, &now,
                                               until, &h, y.data());
    if (status != GSL_SUCCESS) return status;
    if (!(now > before)) return GSL_FAILURE;
    if ((equations.touched(now, y).least < 0.0) != touches) {
      // One step of just that length, by halves.
      VectorXd error(y.size());
      double low = 0.0, high = now - before;
      const auto step = [&](double length) {
        y = from;
        gsl_odeiv2_step_reset(driver.s);
        return gsl_odeiv2_step_apply(driver.s, before, length, y.data(), error.data(), nullptr,
                                     nullptr, driver.sys);
      };
      while (high - low > kSame) {
        const double middle = 0.5 * (low + high);
        if (!(middle > low && middle < high)) break;
        if (const int failed = step(middle); failed != GSL_SUCCESS) return failed;
        ((equations.touched(before + middle, y).least < 0.0) == touches ? low : high) = middle;
      }
      if (const int failed = step(high); failed != GSL_SUCCESS) return failed;
      now = before + high;
      touches = !touches;
      h = std::min(kInContact, over);
      gsl_odeiv2_evolve_reset(driver.e);
    }
    equations.see(now, y);
  }
  return GSL_SUCCESS;
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

  gsl_odeiv2_system system;
  system.function = [](double later, const double state[], double rates[], void* self) -> int {
    const auto& e = *static_cast<const Equations*>(self);
    const auto n = static_cast<Eigen::Index>(e.size());
    VectorXd derivative(n);
    e.derivative(later, VectorXd::Map(state, n), derivative);
    VectorXd::Map(rates, n) = derivative;
    return derivative.allFinite() ? GSL_SUCCESS : GSL_EBADFUNC;
  };
  system.jacobian = nullptr;
  system.dimension = equations.size();
  system.params = &equations;
  const std::unique_ptr<gsl_odeiv2_driver, FreeDriver> driver(
      gsl_odeiv2_driver_alloc_y_new(&system, gsl_odeiv2_step_rk8pd, 1e-3,
                                    options.tolerance * equations.milli(), options.tolerance));

  returnGslErrors();
  std::vector<InteractionPoint> out;
  auto next = interaction.actions.begin();
  std::int64_t now = 0;
  for (std::int64_t step = 0; now <= options.duration; ++step) {
    out.push_back(equations.point(now, y));
    const std::int64_t end = (step + 1) * options.step;
    while (now < end) {
      equations.begin(now, step, y);
      for (; next != interaction.actions.end() && next->start <= now; ++next)
        equations.begin(next->action, y);
      std::int64_t until = end;
      if (next != interaction.actions.end()) until = std::min(until, next->start);
      until = equations.pushEnds(until);
      double later = 0.0;
      gsl_odeiv2_driver_reset(driver.get());
      const double over = static_cast<double>(until - now) * kSecondPerNanosecond;
      const int status = equations.hasWorld()
                             ? passContacts(*driver, equations, over, y)
                             : gsl_odeiv2_driver_apply(driver.get(), &later, over, y.data());
      if (status != GSL_SUCCESS)
        throw std::domain_error(
            "the tolerance cannot be kept: the motion grows without bound, or "
            "too small a tolerance is asked");
      now = until;
    }
  }
  return out;
}

}  // namespace ves
