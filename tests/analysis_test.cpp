// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <random>
#include <unsupported/Eigen/MatrixFunctions>

#include "support/rig.hpp"
#include "ves/analysis/appendix_e.hpp"
#include "ves/analysis/loop.hpp"
#include "ves/run/run.hpp"
#include "ves/srms/modes.hpp"

namespace ves {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

std::vector<SampledOscillator> oscillators() {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> ratio(0.05, 2.0), samples(10.0, 100.0), zeta(0.0, 0.9);
  std::vector<SampledOscillator> out;
  for (int i = 0; i < 50; ++i) out.push_back({ratio(random), samples(random), zeta(random)});
  return out;
}

/// x'' + 2 zeta x' + x = r x''(t_n), by the matrix exponential of state and held force.
Eigen::Matrix3d heldExactly(const SampledOscillator& o) {
  const double r = -o.mass_ratio, z = o.damping_ratio;
  Eigen::Matrix3d A;
  A << 0, 1, 0, -1, -2 * z, 1, 0, 0, 0;
  const Eigen::Matrix3d E = (A * 2.0 * M_PI / o.frequency_ratio).exp();
  Eigen::Matrix3d phi;
  phi.topRows<2>() = E.topRows<2>();
  phi.topRightCorner<2, 1>() *= r;
  // Before the force changes: x'' = r x''(n) - 2 zeta x' - x.
  phi.row(2) = -phi.row(0) - 2 * z * phi.row(1) + Eigen::RowVector3d(0, 0, r);
  return phi;
}

TEST(AppendixE, TransitionIsTheHeldOscillators) {  // (E.9) as it should be printed
  for (const SampledOscillator& o : oscillators())
    EXPECT_LT((transition(o) - heldExactly(o)).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(AppendixE, RootsOfThePolynomialAreTheEigenvalues) {  // (E.10), (E.11)
  for (const SampledOscillator& o : oscillators()) {
    const Eigen::Vector3cd expected = heldExactly(o).eigenvalues();
    for (const std::complex<double>& z : roots(o))
      EXPECT_LT((expected.array() - z).abs().minCoeff(), 1e-7) << o.mass_ratio;
  }
}

TEST(AppendixE, GrowthOfTheSampledOscillatorIsItsLargestRoot) {
  int unstable = 0;
  for (const SampledOscillator& o : oscillators()) {
    double radius = 0.0;
    for (const std::complex<double>& z : roots(o)) radius = std::max(radius, std::abs(z));
    // Direct simulation, fine steps between samples: does it grow over 3000 of them?
    const double tau = 2.0 * M_PI / o.frequency_ratio;
    double x = 1.0, v = 0.3, a = -0.2;
    double log_size = 0.0;
    for (int n = 0; n < 3000; ++n) {
      const double held = -o.mass_ratio * a;
      const int steps = 20;
      for (int s = 0; s < steps; ++s) {  // Runge-Kutta of order four
        const double h = tau / steps;
        const auto f = [&](double p, double q) { return held - 2 * o.damping_ratio * q - p; };
        const double k1 = f(x, v), k2 = f(x + h / 2 * v, v + h / 2 * k1),
                     k3 = f(x + h / 2 * v + h * h / 4 * k1, v + h / 2 * k2),
                     k4 = f(x + h * v + h * h / 2 * k2, v + h * k3);
        x += h * v + h * h / 6 * (k1 + k2 + k3);
        v += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
      }
      a = held - 2 * o.damping_ratio * v - x;
      const double size = std::sqrt(x * x + v * v + a * a);
      log_size += std::log(size);
      x /= size;
      v /= size;
      a /= size;
    }
    unstable += radius > 1.0;
    EXPECT_NEAR(log_size / 3000, std::log(radius), 2e-3) << o.mass_ratio << " " << radius;
  }
  EXPECT_GT(unstable, 10);
  EXPECT_LT(unstable, 40);
}

TEST(AppendixE, LimitIsAMassRatioOfOne) {  // (E.14): no damping, sampled ever faster
  for (double ratio : {0.3, 0.9, 1.1, 2.0})
    EXPECT_NEAR(std::abs(roots({ratio, 1e5, 0.0})[2]), ratio, 1e-3);
}

TEST(AppendixE, MassRatiosAreThoseOfPhysicalSpace) {  // (E.18) against (E.20)
  const Experiment e = test::experiment("puma_on_table_4_1");
  const RigidBody robot = combine(RigidBody{}, e.plant.payload.X_PL0(),
                                  locked(carried(e.plant.payload), e.plant.initial_joints));
  Mat6 M = Mat6::Zero();
  M.diagonal() << 500, 500, 500, 250, 250, 250;
  VectorXd expected = (M.inverse() * spatialMass(robot)).eigenvalues().real();
  std::sort(expected.begin(), expected.end(), std::greater<>());
  EXPECT_LT((massRatios(e.controller.admittance, robot) - expected).norm(), 1e-12);
}

// --- The machine's loop --------------------------------------------------------------------------

/// The same loop by brute force: Runge-Kutta of servo and filters between samples, the base's
/// oscillators too.
double growthOf(const Loop& loop) {
  const Eigen::Index k = loop.base.stiffness.size();
  const Mat6 M_1 = spatialMass(loop.robot_P);
  const double w = loop.sensor_cutoff, f = loop.filter_cutoff;
  struct State {
    Vec6 y = Vec6::Zero(), v = Vec6::Zero();                       // servo
    Vec6 f1 = Vec6::Zero(), f2 = Vec6::Zero(), f3 = Vec6::Zero();  // Filter 3
    Vec6 s = Vec6::Zero(), s_dot = Vec6::Zero();                   // sensor
    VectorXd eta, eta_dot;
  } state;
  state.eta = VectorXd::Zero(k);
  state.eta_dot = VectorXd::Ones(k);
  Vec6 u = Vec6::Zero();
  VectorXd force = VectorXd::Zero(k);
  const auto rate = [&](const State& x) {
    State d;
    const Vec6 a = (loop.velocity_gain * (u - x.y) - x.v) / loop.tau;
    d.y = x.v;
    d.v = a;
    Vec6 felt = a;
    if (f > 0.0) {
      d.f1 = f * (a - x.f1);
      d.f2 = x.f3;
      d.f3 = f * f * (x.f1 - x.f2) - f * x.f3;
      felt = x.f2;
    }
    d.s = x.s_dot;
    d.s_dot = w * w * (felt - x.s) - M_SQRT2 * w * x.s_dot;
    d.eta = x.eta_dot;
    d.eta_dot = force - loop.base.stiffness.cwiseProduct(x.eta) - loop.base.damping * x.eta_dot;
    return d;
  };
  const auto step = [](const State& x, const State& d, double h) {
    State y = x;
    y.y += h * d.y, y.v += h * d.v, y.f1 += h * d.f1, y.f2 += h * d.f2, y.f3 += h * d.f3;
    y.s += h * d.s, y.s_dot += h * d.s_dot, y.eta += h * d.eta, y.eta_dot += h * d.eta_dot;
    return y;
  };
  const auto advance = [&](State x, double T) {
    constexpr int kSteps = 20;
    const double h = T / kSteps;
    for (int i = 0; i < kSteps; ++i) {
      const State a = rate(x), b = rate(step(x, a, h / 2)), c = rate(step(x, b, h / 2)),
                  d = rate(step(x, c, h));
      x = step(step(step(step(x, a, h / 6), b, h / 3), c, h / 3), d, h / 6);
    }
    return x;
  };
  // The base is computed one period ahead of the platform: its state at a tick is the command.
  double log_size = 0.0, counted = 0.0;
  const int ticks = 6000;
  for (int n = 0; n < ticks; ++n) {
    force = -loop.base.Phi.transpose() * (M_1 * state.s);
    const State ahead = advance(state, loop.period);
    u = loop.base.Phi * ahead.eta;
    State next = advance(state, loop.period);
    next.eta = ahead.eta;
    next.eta_dot = ahead.eta_dot;
    state = next;
    const double size =
        std::sqrt(state.eta.cwiseAbs2().dot(loop.base.stiffness) + state.eta_dot.squaredNorm());
    if (n >= ticks / 2) {
      log_size += std::log(size);
      counted += loop.period;
    }
    const double scale = 1.0 / size;
    state = step(State{Vec6::Zero(), Vec6::Zero(), Vec6::Zero(), Vec6::Zero(), Vec6::Zero(),
                       Vec6::Zero(), Vec6::Zero(), VectorXd::Zero(k), VectorXd::Zero(k)},
                 state, scale);
    u *= scale;
  }
  return log_size / counted;
}

TEST(LoopModel, GrowthIsThatOfTheSampledLoopStepByStep) {
  for (const char* name : {"srms_unberth_doss", "srms_capture_puma", "puma_on_table_4_1"})
    for (const char* filters : {"none", "outputs"}) {
      std::vector<std::string> set = {std::string("legs.filters=") + filters};
      if (std::string(name).find("srms") == 0) set.push_back("base.keep_modes=4");
      const Experiment e = test::experiment(name, set);
      const Loop loop =
          loopOf(e.controller, e.plant, e.plant.initial_joints, Direction::kExtending);
      const Slowest s = slowest(loop);
      // The size of a decaying oscillation beats; a mean over 30 s sees its trend.
      EXPECT_NEAR(growthOf(loop), s.growth, 0.02 * std::abs(s.growth) + 0.02) << name << filters;
    }
}

TEST(LoopModel, SaysWhichRunsStopThemselves) {
  struct Case {
    const char* scenario;
    const char* filters;
    int modes;
    bool stable;
  };
  for (const Case& c :
       {Case{"srms_unberth_doss", "outputs", 3, true},
        Case{"srms_unberth_doss", "outputs", 4, false}, Case{"srms_unberth_doss", "none", 5, true},
        Case{"srms_deploy_doss", "none", 6, false}, Case{"srms_capture_puma", "outputs", 2, true},
        Case{"srms_capture_puma", "outputs", 4, false}}) {
    const Experiment e = test::experiment(
        c.scenario,
        {std::string("legs.filters=") + c.filters, "base.keep_modes=" + std::to_string(c.modes)});
    EXPECT_EQ(stableModes(e.controller, e.plant, e.plant.initial_joints) == c.modes, c.stable)
        << c.scenario;
    const RunResult result = runLockstep(e, nullptr, {});
    EXPECT_EQ(result.good(), c.stable) << c.scenario << " " << c.filters << " " << c.modes;
  }
}

TEST(LoopModel, BasesKeepTheModesThatTheRuleGives) {
  for (const char* configuration : {"unberth", "low_hover", "deploy", "capture"}) {
    int stable = kMaxModes;
    int kept = 0;
    for (const char* robot : {"puma", "doss"})
      for (const char* filters : {"none", "outputs"}) {
        const std::string name = std::string("srms_") + configuration + "_" + robot;
        const auto set = std::string("legs.filters=") + filters;
        kept = static_cast<int>(test::experiment(name).controller.admittance.stiffness.size());
        const Experiment e = test::experiment(name, {set, "base.keep_modes=8"});
        stable = std::min(stable, stableModes(e.controller, e.plant, e.plant.initial_joints));
      }
    EXPECT_EQ(kept, stable) << configuration;
  }
}

}  // namespace
}  // namespace ves
