// SPDX-License-Identifier: BSD-3-Clause
#include "ves/srms/interaction.hpp"

#include <gsl/gsl_odeiv2.h>

#include <algorithm>
#include <memory>
#include <stdexcept>

#include "gsl_errors.hpp"
#include "ves/kinematics/stewart.hpp"
#include "ves/math/dense.hpp"
#include "ves/robot/newton_euler.hpp"

namespace ves {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

struct FreeDriver {
  void operator()(gsl_odeiv2_driver* d) const { gsl_odeiv2_driver_free(d); }
};

/// The equations of motion, y = {eta, eta'}, and where there is a world {p, q, v, w} of what floats
/// in it.
class Equations {
 public:
  Equations(const Interaction& interaction, const InteractionOptions& options)
      : interaction_(interaction),
        base_(interaction.base),
        robot_(carried(interaction.payload), interaction.q0),
        X_PL0_(interaction.payload.X_PL0()),
        options_(options) {}

  Eigen::Index modes() const { return base_.stiffness.size(); }
  std::size_t size() const {
    return static_cast<std::size_t>(2 * modes() + (interaction_.world ? kFloating : 0));
  }

  VectorXd start() const {
    const Eigen::Index k = modes();
    VectorXd y = VectorXd::Zero(static_cast<Eigen::Index>(size()));
    if (options_.eta.size()) y.head(k) = options_.eta;
    if (options_.eta_dot.size()) y.segment(k, k) = options_.eta_dot;
    if (interaction_.world) {
      const std::optional<Target>& target = interaction_.world->environment.target;
      const Floating f = target ? target->start : Floating{};
      y.tail<kFloating>() << f.p, f.q.coeffs(), f.v, f.w;
    }
    return y;
  }

  /// The interval that begins now, `step` steps after the start.
  void begin(std::int64_t now, std::int64_t step) {
    now_ = now;
    if (options_.hold_mass > 0 && step % options_.hold_mass == 0 && step != held_at_) {
      held_at_ = step;
      held_ = compositeBody(robot_.model(), robot_.at(now_).q);
    }
  }
  void begin(const RobotAction& action, const VectorXd& y) {
    if (const auto* push = std::get_if<Push>(&action)) {
      push_ = BegunPush{*push, now_};
      return;
    }
    if (std::holds_alternative<GraspTarget>(action)) {
      Floating target = floating(y);
      if (interaction_.world &&
          grasp(interaction_.world->environment, toolMotion(robot_.at(now_), platform(y)), target))
        X_TB_ = target.X_TB;
    } else if (std::holds_alternative<Release>(action) && X_TB_) {
      X_TB_.reset();
    } else {
      robot_.begin(action, now_);
    }
  }

  /// [ns] when the push ends that lasts now; `otherwise`: none does.
  std::int64_t pushEnds(std::int64_t otherwise) const {
    return pushing() ? std::min(otherwise, push_->end()) : otherwise;
  }

  void derivative(double later, const VectorXd& y, VectorXd& dy) const {
    const Eigen::Index k = modes();
    const auto eta = y.head(k), eta_dot = y.segment(k, k);
    const JointState q = robot_.at(now_, later);
    dy.head(k) = eta_dot;
    VectorXd right = -base_.stiffness.cwiseProduct(eta) - base_.damping * eta_dot;
    MatrixXd A;
    if (options_.model == InteractionModel::kSplit)
      split(q, eta_dot, A, right);
    else
      whole(q, y, A, right);
    Wrench on_target_Bo_I;
    if (pushing()) {
      const BodyMotion P = platform(y);
      const Push& push = push_->push;
      const Transform X_IB = interaction_.world ? floating(y).X_IB() : Transform();
      const Vec3 at = pushedPoint(push, P.X, X_PL0_, robot_.model(), q.q, X_IB);
      if (push.on == Push::On::kTarget)
        on_target_Bo_I = {push.force_I, (at - X_IB.p).cross(push.force_I)};
      else
        right += jacobian(y).transpose() *
                 Wrench{push.force_I, (at - P.X.p).cross(push.force_I)}.stacked();
    }
    if (interaction_.world) {
      const BodyMotion P = platform(y);
      const FrameMotion tool = toolMotion(q, P);
      const Touch touched = touch(interaction_.world->environment, tool, floating(y));
      right += jacobian(y).transpose() * shift(touched.on_tool_To_I, P.X.p - tool.X.p).stacked();
      const FloatingRates f = rates(interaction_.world->environment, floating(y),
                                    touched.on_target_Bo_I + on_target_Bo_I);
      dy.tail<kFloating>() << f.p, f.q, f.v, f.w;
    }
    dy.segment(k, k) = solvePositive(A, right);
  }

  InteractionPoint point(std::int64_t now, const VectorXd& y) const {
    const Eigen::Index k = modes();
    InteractionPoint p;
    p.t = static_cast<double>(now) * kSecondPerNanosecond;
    p.eta = y.head(k);
    p.eta_dot = y.segment(k, k);
    p.x = coordinates(y);
    p.x_dot = base_.Phi * p.eta_dot;
    if (interaction_.world) {
      p.target = floating(y);
      p.touch =
          touch(interaction_.world->environment, toolMotion(robot_.at(now), platform(y)), p.target);
      p.contacts = contacts_;
    }
    return p;
  }

  /// What touches, `later` [s] in the interval.
  Touch touched(double later, const VectorXd& y) const {
    return touch(interaction_.world->environment, toolMotion(robot_.at(now_, later), platform(y)),
                 floating(y));
  }
  const Contact& contact() const { return contacts_.last(); }
  bool hasWorld() const { return interaction_.world.has_value(); }
  void see(double later, const VectorXd& y) {
    contacts_.see(static_cast<double>(now_) * kSecondPerNanosecond + later, touched(later, y));
  }

 private:
  static constexpr int kFloating = 13;

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
  /// Where P is, and how it moves.
  BodyMotion platform(const VectorXd& y) const {
    const Eigen::Index k = modes();
    const Vec6 x_dot = base_.Phi * y.segment(k, k);
    return bodyMotion(interaction_.p_IH, Pose::from(coordinates(y)), x_dot, Vec6::Zero());
  }
  Vec6 coordinates(const VectorXd& y) const {
    return interaction_.rest + base_.Phi * y.head(modes());
  }
  /// {v, w} of P per eta'.
  MatrixXd jacobian(const VectorXd& y) const {
    MatrixXd J = base_.Phi;
    J.bottomRows<3>() = angleRateMap(coordinates(y).tail<3>()) * base_.Phi.bottomRows<3>();
    return J;
  }
  FrameMotion toolMotion(const JointState& q, const BodyMotion& P) const {
    return carriedFrame(robot_.model(), q, P, X_PL0_, interaction_.world->link,
                        interaction_.world->X_link);
  }

  /// What the base feels of the robot, about Po in P.
  Wrench reaction(const JointState& q, const ProperMotion& L0) const {
    return transfer(X_PL0_, Wrench{} - newtonEuler(robot_.model(), q, L0).F_L0o_L0);
  }

  RigidBody lockedInP(const JointVector& q) const {
    return combine(RigidBody{}, X_PL0_,
                   options_.hold_mass > 0 ? held_ : compositeBody(robot_.model(), q));
  }

  /// (3.11): A, and what stands beside stiffness and damping on its right.
  void split(const JointState& q, const VectorXd& eta_dot, MatrixXd& A, VectorXd& right) const {
    const RigidBody robot = lockedInP(q.q);
    A = augmentedModalMass(base_, robot);
    const auto Phi_u = base_.Phi.topRows<3>(), Phi_l = base_.Phi.bottomRows<3>();
    const Mat3 Rx = skew(robot.p_BoBcm_B);
    const Vec3 w = Phi_l * eta_dot;
    const Vec3 centripetal = robot.mass * w.cross(Rx * w);
    right += (Phi_u.transpose() + Phi_l.transpose() * Rx) * centripetal;
    right += base_.Phi.transpose() * reaction(q, ProperMotion{}).stacked();
  }

  void whole(const JointState& q, const VectorXd& y, MatrixXd& A, VectorXd& right) const {
    const Eigen::Index k = modes();
    const BodyMotion P = platform(y);
    // The wrench is affine in the base's acceleration: this much without, the locked mass with it.
    const Wrench F_Po_P = reaction(q, properMotion(P, X_PL0_, Vec3::Zero()));
    const MatrixXd J = jacobian(y);
    right += J.transpose() * rotate(P.X.R, F_Po_P).stacked();
    const Mat6 M_1 = spatialMass(
        rotated(P.X.R, combine(RigidBody{}, X_PL0_, compositeBody(robot_.model(), q.q))));
    A = MatrixXd::Identity(k, k) + J.transpose() * M_1 * J;
  }

  const Interaction& interaction_;
  const ModalModel& base_;
  MovingRobot robot_;
  Transform X_PL0_;
  const InteractionOptions& options_;
  std::int64_t now_ = 0;       // [ns] start of the interval
  std::int64_t held_at_ = -1;  // [-] step that A was last computed for
  RigidBody held_;
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
  const double milli = 1e-3 / interaction.base.Phi.cwiseAbs().maxCoeff();  // of eta, at the tip
  const std::unique_ptr<gsl_odeiv2_driver, FreeDriver> driver(gsl_odeiv2_driver_alloc_y_new(
      &system, gsl_odeiv2_step_rk8pd, 1e-3, options.tolerance * milli, options.tolerance));

  returnGslErrors();
  std::vector<InteractionPoint> out;
  auto next = interaction.actions.begin();
  std::int64_t now = 0;
  for (std::int64_t step = 0; now <= options.duration; ++step) {
    out.push_back(equations.point(now, y));
    const std::int64_t end = (step + 1) * options.step;
    while (now < end) {
      equations.begin(now, step);
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
