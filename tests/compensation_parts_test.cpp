// SPDX-License-Identifier: BSD-3-Clause
//
// The parts of the compensation, each alone: a body on the modal base, the motion ahead of its
// time, the servo's feed-forward and observer.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <functional>
#include <random>

#include "support/leg.hpp"
#include "support/poses.hpp"
#include "support/rig.hpp"
#include "ves/control/port_work.hpp"
#include "ves/math/dense.hpp"
#include "ves/plant/nominal_servo.hpp"

namespace ves {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::experiment;
using test::kCompensated;
using test::kTick;
using test::Leg;

// The base with a body on it

/// Damped in proportion, or by a damper that couples the modes too. It turns about x alone, where
/// the fixed angles' rates are the body's however far it goes.
ModalModel base(int k, bool coupled = false) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  ModalModel m;
  m.Phi = MatrixXd::NullaryExpr(6, k, [&] { return 0.05 * u(random); });
  m.Phi.bottomRows<2>().setZero();
  m.stiffness = VectorXd::LinSpaced(k, 10.0, 900.0);
  m.damping = (0.04 * m.stiffness.cwiseSqrt()).asDiagonal();
  if (coupled) m.damping += 0.3 * MatrixXd::Ones(k, k);
  return m;
}

Mat6 body() {
  RigidBody b;
  b.mass = 90.0;
  b.p_BoBcm_B = {0.1, -0.05, 0.7};
  b.I_Bcm_B = Vec3(9.0, 8.0, 4.0).asDiagonal();
  return spatialMass(b);
}

/// [eta, eta'] after `time` under F, by the matrix exponential of (I + Phi^T M Phi) eta'' + ..
VectorXd exact(const ModalModel& m, const Mat6& M, const VectorXd& state, const Vec6& F,
               double time) {
  const Eigen::Index k = m.stiffness.size();
  const MatrixXd I = MatrixXd::Identity(k, k);
  const MatrixXd A_inverse = solvePositive(I + m.Phi.transpose() * M * m.Phi, I);
  MatrixXd S = MatrixXd::Zero(2 * k + 1, 2 * k + 1);
  S.block(0, k, k, k).setIdentity();
  S.block(k, 0, k, k) = -A_inverse * m.stiffness.asDiagonal();
  S.block(k, k, k, k) = -A_inverse * m.damping;
  S.block(k, 2 * k, k, 1) = A_inverse * m.Phi.transpose() * F;
  VectorXd z(2 * k + 1);
  z << state, 1.0;
  return (exponential(S * time) * z).head(2 * k);
}

TEST(BodyOnTheBase, MovesAsTheAugmentedModalMassSays) {  // (3.11), to rounding
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(-50.0, 50.0);
  for (const bool coupled : {false, true}) {
    const ModalModel m = base(6, coupled);
    AdmittanceModel model(m, 0.01);
    model.reset(Vec6::Zero());
    VectorXd z = VectorXd::Zero(12);
    for (int n = 0; n < 500; ++n) {
      const Vec6 F = Vec6::NullaryExpr([&] { return u(random); });
      const double dt = n % 3 == 0 ? 0.0 : 0.004 * (1 + n % 7);  // samples that jitter, or are late
      model.step(Wrench::from(F), body(), dt, 0.0);
      z = exact(m, body(), z, F, dt);
      ASSERT_LT((model.motion().x - m.Phi * z.head(6)).norm(), 1e-13) << n;
      ASSERT_LT((model.motion().x_dot - m.Phi * z.tail(6)).norm(), 1e-12) << n;
    }
    EXPECT_GT((m.Phi * z.head(6)).norm(), 1e-3);
  }
}

/// eta'' of Lagrange's equations with a body M on the base that turns as its fixed angles say:
/// eta'' + C eta' + K eta = J^T (F - d/dt(M J eta')), J = {Phi_u, E Phi_l}.
VectorXd turning(const ModalModel& m, const Mat6& M, const VectorXd& eta, const VectorXd& eta_dot,
                 const Vec6& F) {
  const auto jacobian = [&](const VectorXd& at) {
    MatrixXd J = m.Phi;
    J.bottomRows<3>() = angleRateMap(m.Phi.bottomRows<3>() * at) * m.Phi.bottomRows<3>();
    return J;
  };
  constexpr double h = 1e-5;  // [s]
  const MatrixXd J = jacobian(eta),
                 J_dot = (jacobian(eta + h * eta_dot) - jacobian(eta - h * eta_dot)) / (2.0 * h);
  return solvePositive(MatrixXd::Identity(eta.size(), eta.size()) + J.transpose() * M * J,
                       J.transpose() * (F - M * J_dot * eta_dot) - m.stiffness.cwiseProduct(eta) -
                           m.damping * eta_dot);
}

TEST(BodyOnTheBase, TurnsByItsOwnRatesHoweverFar) {  // 20 degrees; the step is of second order
  ModalModel m = base(6);
  std::mt19937 random(8);
  std::uniform_real_distribution<double> u(-0.1, 0.1);
  m.Phi = MatrixXd::NullaryExpr(6, 6, [&] { return u(random); });
  const Vec6 F = (Vec6() << 30.0, -20.0, 10.0, 15.0, 25.0, -20.0).finished();
  const VectorXd start = VectorXd::LinSpaced(6, 1.5, -2.0);
  const auto off = [&](double T, double& most) {
    AdmittanceModel model(m, T);
    model.reset(m.Phi * start);
    VectorXd eta = start, eta_dot = VectorXd::Zero(6);
    double worst = 0.0;
    for (int n = 0; n < std::lround(1.0 / T); ++n) {
      model.step(Wrench::from(F), body(), T, 0.0);
      constexpr int kParts = 5;  // Runge and Kutta
      for (int i = 0; i < kParts; ++i) {
        const double h = T / kParts;
        const auto a = [&](const VectorXd& y, const VectorXd& v) {
          return turning(m, body(), y, v, F);
        };
        const VectorXd a1 = a(eta, eta_dot), v2 = eta_dot + 0.5 * h * a1,
                       a2 = a(eta + 0.5 * h * eta_dot, v2), v3 = eta_dot + 0.5 * h * a2,
                       a3 = a(eta + 0.5 * h * v2, v3), v4 = eta_dot + h * a3,
                       a4 = a(eta + h * v3, v4);
        eta += h / 6.0 * (eta_dot + 2.0 * v2 + 2.0 * v3 + v4);
        eta_dot += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
      }
      worst = std::max(worst, (model.motion().x - m.Phi * eta).norm());
      most = std::max(most, (m.Phi * eta).tail<3>().cwiseAbs().maxCoeff());
    }
    return worst;
  };
  double most = 0.0;
  const double fine = off(0.005, most), coarse = off(0.01, most);
  EXPECT_GT(most, 20.0 * kDegree);
  EXPECT_LT(coarse, 1e-3);
  EXPECT_LT(fine, 0.4 * coarse);
}

TEST(BodyOnTheBase, PassesItsMomentumOn) {  // arms that are drawn in turn a floating base faster
  constexpr double kInertia = 12.0;         // [kg m^2]
  ModalModel m;
  m.Phi = MatrixXd::Identity(6, 6) / std::sqrt(kInertia);
  m.stiffness = VectorXd::Zero(6);
  m.damping = MatrixXd::Zero(6, 6);
  AdmittanceModel model(m, 0.01);
  model.reset(Vec6::Zero());
  const auto arms = [](double reach) {
    return spatialMass({20.0, {0.0, 0.0, 0.4}, Vec3(1.0, 1.0, 20.0 * reach * reach).asDiagonal()});
  };
  Mat6 M = arms(0.9);
  model.step({{}, {0.0, 0.0, 3.0}}, M, 0.1, 0.0);
  const auto momentum = [&] { return (kInertia + M(5, 5)) * model.motion().x_dot(5); };
  EXPECT_NEAR(momentum(), 0.3, 1e-12);
  const double slow = model.motion().x_dot(5);
  for (int n = 1; n <= 50; ++n) {
    const Mat6 drawn = arms(0.9 - 0.01 * n);
    model.step({}, {M, drawn}, 0.01, 0.0);
    M = drawn;
    EXPECT_NEAR(momentum(), 0.3, 1e-12);
  }
  EXPECT_GT(model.motion().x_dot(5), 1.5 * slow);
}

TEST(BodyOnTheBase, StepsModesOfManyFrequenciesAndFreeOnes) {
  for (const int k : {1, 12, 40}) {
    ModalModel m = base(k);
    m.stiffness = VectorXd::LinSpaced(k, 0.0, std::pow(2.0 * M_PI * 60.0, 2));
    m.damping = (0.04 * m.stiffness.cwiseSqrt()).asDiagonal();
    AdmittanceModel model(m, 0.01);
    model.reset(Vec6::Zero());
    VectorXd z = VectorXd::Zero(2 * k);
    const Vec6 F = Vec6::LinSpaced(-20.0, 30.0);
    double most = 0.0;
    for (int n = 0; n < 100; ++n) {
      model.step(Wrench::from(F), body(), 0.01, 0.0);
      z = exact(m, body(), z, F, 0.01);
      most = std::max(most, (m.Phi * z.head(k)).norm());
      ASSERT_LT((model.motion().x - m.Phi * z.head(k)).norm(), 2e-11 * most) << k << " " << n;
    }
  }
}

TEST(BodyOnTheBase, LosesNoEnergyThatTheBaseDoesNot) {  // undamped: for minutes
  ModalModel m = base(6);
  m.damping.setZero();
  AdmittanceModel model(m, 0.01);
  const Mat6 M = body();
  const Vec6 x0 = m.Phi * VectorXd::LinSpaced(6, 0.1, -0.2);
  model.reset(x0);
  // Potential and kinetic, the body's included, at the ends of steps.
  const auto energy = [&] {
    const Vec6& v = model.motion().x_dot;
    return model.energy() + 0.5 * v.dot(M * v);
  };
  const double first = energy();
  double low = first, high = first;
  for (int n = 0; n < 20'000; ++n) {
    model.step({}, M, 0.01, 0.0);
    if (n < 10'000) continue;
    low = std::min(low, energy());
    high = std::max(high, energy());
  }
  EXPECT_GT(low, (1.0 - 1e-9) * first);
  EXPECT_LT(high, (1.0 + 1e-9) * first);
}

TEST(Ahead, AFreeRunIsThatFromRestWhereItWasReset) {  // with the body on the base
  constexpr double kAhead = 0.02;
  for (const bool coupled : {false, true}) {
    const ModalModel m = base(6, coupled);
    AdmittanceModel model(m, 0.01);
    VectorXd z = VectorXd::Zero(12);
    z.head(6) = leastSquares(m.Phi, m.Phi * VectorXd::LinSpaced(6, 0.1, -0.2));
    model.reset(m.Phi * z.head(6), body(), kAhead);
    for (int n = 0; n < 100; ++n) {
      model.step({}, body(), 0.01, kAhead);
      z = exact(m, body(), z, Vec6::Zero(), 0.01);
      ASSERT_LT((model.motion().x - m.Phi * z.head(6)).norm(), 1e-13) << n << coupled;
      ASSERT_LT((model.motion().x_dot - m.Phi * z.tail(6)).norm(), 1e-12) << n << coupled;
    }
  }
}

TEST(Ahead, AHeavilyDampedModeStartsWhereItIs) {  // its way back would be longer than the world
  ModalModel m = base(6);
  m.damping(0, 0) = 2000.0;
  AdmittanceModel model(m, 0.01);
  const Vec6 x = m.Phi * VectorXd::Constant(6, 0.1);
  model.reset(x, Mat6::Zero(), 0.02);
  model.step({}, Mat6(Mat6::Zero()), 0.01, 0.02);
  EXPECT_LT((model.motion().x - x).norm(), 0.05 * x.norm());
  const VectorXd eta = VectorXd::Constant(6, 0.1);
  EXPECT_LT(model.energy(), 2.0 * eta.dot(m.stiffness.cwiseProduct(eta)));
}

TEST(Ahead, MotionIsThatMuchLaterUnderTheSameWrench) {
  for (const bool coupled : {false, true}) {
    const ModalModel m = base(6, coupled);
    AdmittanceModel model(m, 0.01);
    model.reset(Vec6::Zero());
    VectorXd z = VectorXd::Zero(12);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> u(-50.0, 50.0);
    for (int n = 0; n < 200; ++n) {
      const Vec6 F = Vec6::NullaryExpr([&] { return u(random); });
      const double ahead = 0.001 * (n % 60);
      model.step(Wrench::from(F), body(), 0.01, ahead);
      z = exact(m, body(), z, F, 0.01);
      const VectorXd later = exact(m, body(), z, F, ahead);
      ASSERT_LT((model.motion().x - m.Phi * later.head(6)).norm(), 1e-13);
      ASSERT_LT((model.motion().x_dot - m.Phi * later.tail(6)).norm(), 1e-12);
      const VectorXd eta_ddot =
          solvePositive(MatrixXd::Identity(6, 6) + m.Phi.transpose() * body() * m.Phi,
                        m.Phi.transpose() * F - m.stiffness.cwiseProduct(later.head(6)) -
                            m.damping * later.tail(6));
      ASSERT_LT((model.motion().x_ddot - m.Phi * eta_ddot).norm(), 1e-10);
    }
  }
}

TEST(ModalHold, CouplingDampingBesideStiffModesKeepsItsDigits) {
  // Modes of 1 to 100 Hz, all damped by one damper: beside the exponential of many short steps.
  ModalModel m = base(6);
  for (int i = 0; i < 6; ++i) m.stiffness(i) = std::pow(2.0 * M_PI * (1.0 + 19.8 * i), 2);
  const VectorXd shape = VectorXd::LinSpaced(6, 1.0, 0.3);
  m.damping = 0.8 * shape * shape.transpose();
  const ModalHold whole = modalHold(m, 0.01);
  constexpr int kParts = 256;
  Eigen::Matrix<long double, -1, -1> A = Eigen::Matrix<long double, -1, -1>::Zero(18, 18);
  A.block(0, 6, 6, 6).setIdentity();
  A.block(6, 0, 6, 6) = -MatrixXd(m.stiffness.asDiagonal()).cast<long double>();
  A.block(6, 6, 6, 6) = -m.damping.cast<long double>();
  A.block(6, 12, 6, 6).setIdentity();
  Eigen::Matrix<long double, -1, -1> step = A, term = A;
  step.setIdentity();
  term.setIdentity();
  for (int j = 1; j < 30; ++j) {
    term = (term * A * (0.01L / kParts / j)).eval();
    step += term;
  }
  Eigen::Matrix<long double, -1, -1> all = step;
  for (int n = 1; n < kParts; ++n) all = (all * step).eval();
  const MatrixXd due = all.cast<double>();
  // Each block beside its own size: displacements are a thousandth of the rates.
  const auto off = [&](const auto& found, const auto& expected) {
    return (found - expected).norm() / expected.norm();
  };
  EXPECT_LT(off(whole.Phi.topLeftCorner(6, 6), due.block(0, 0, 6, 6)), 1e-13);
  EXPECT_LT(off(whole.Phi.topRightCorner(6, 6), due.block(0, 6, 6, 6)), 1e-13);
  EXPECT_LT(off(whole.Phi.bottomLeftCorner(6, 6), due.block(6, 0, 6, 6)), 1e-13);
  EXPECT_LT(off(whole.Phi.bottomRightCorner(6, 6), due.block(6, 6, 6, 6)), 1e-13);
  EXPECT_LT(off(whole.Gamma.topRows(6), due.block(0, 12, 6, 6)), 1e-13);
  EXPECT_LT(off(whole.Gamma.bottomRows(6), due.block(6, 12, 6, 6)), 1e-13);
}

// The servo

TEST(FeedForward, LegFollowsASineWithoutItsLag) {  // both directions; published: 18 and 27 percent
  const Experiment e = experiment("z_sine", kCompensated);
  for (const double hertz : {0.5, 2.0}) {
    const double w = 2.0 * M_PI * hertz, amplitude = 0.4 / w, T = 0.01, middle = 1.5;
    Leg leg(e.plant, middle);
    const Vec6 one = Vec6::Ones();
    double most = 0.0;
    for (int n = 0; n * T < 3.0; ++n) {
      const double t = n * T, c = std::cos(w * t), s = std::sin(w * t);
      // From rest: the first half second is the start.
      const LegMotion legs{(middle + amplitude * s) * one, amplitude * w * c * one,
                           -amplitude * w * w * s * one};
      if (t > 0.5) most = std::max(most, std::abs(leg.actuator.length() - legs.L(0)));
      const Vec6 r = feedForward(e.controller.servo, legs, 0.0, T, 1.0);
      leg.run(legCounts(e.controller.legs, r)[0], T);
    }
    EXPECT_LT(most, (hertz < 1.0 ? 0.01 : 0.02) * amplitude) << hertz;
  }
}

TEST(FeedForward, NeverAsksForMoreThanTheRail) {
  const ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  for (const double v : {-50.0, -1.0, 0.3, 2.0, 80.0}) {
    LegMotion legs;
    legs.L.setConstant(1.5);
    legs.L_dot.setConstant(v);
    const Vec6 r = feedForward(servo, legs, 0.0, 0.01, 1.0);
    const double A = 0.005 + 0.5 * servo.update - servo.reading_age;
    const double E = std::abs(r(0) - 1.5 - A * v);
    EXPECT_LE(E, servo.rail * (1.0 + 1e-12)) << v;
  }
}

TEST(FeedForward, LeadsARampByItsDelayToo) {
  const ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  ServoModel late = servo;
  late.delay.setConstant(0.004);
  for (const double v : {-0.3, 0.2}) {
    const LegMotion legs{Vec6::Constant(1.5), Vec6::Constant(v), Vec6::Zero()};
    const Vec6 more =
        feedForward(late, legs, 0.0, 0.01, 1.0) - feedForward(servo, legs, 0.0, 0.01, 1.0);
    EXPECT_LT((more.array() - 0.004 * v).abs().maxCoeff(), 1e-12) << v;
  }
}

/// A valve whose edges are both open at null by `open`, or overlap, as (2.11) has them under
/// constant pressure: what the supply's edge lets in less what the return's lets out.
double orifices(double up, double down, double open, double E) {
  const double rest = open * (down - up) / (up + down),  // where as much goes in as out
      x = E + rest;
  return up * std::max(0.0, open + x) - down * std::max(0.0, open - x);
}

TEST(ServoModel, OfAnOpenValveIsWhatItsOrificesPass) {
  ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  for (const double open : {0.0, 5e-5, 3e-4}) {
    servo.opening.setConstant(open);
    const double up = servo.extend(2), down = servo.retract(2);
    for (double E = -2e-3; E <= 2e-3; E += 1.7e-5) {
      const double v = speedOf(servo, 2, E);
      EXPECT_NEAR(v, orifices(up, down, open, E), 1e-12) << open << " " << E;
      EXPECT_NEAR(differenceOf(servo, 2, v), E, 1e-12) << open << " " << E;
      const double d = 1e-7,
                   slope = (speedOf(servo, 2, E + d) - speedOf(servo, 2, E - d)) / (2 * d);
      if (open == 0.0 || nearNull(servo, 2, E - d) != nearNull(servo, 2, E + d)) continue;
      EXPECT_NEAR(slope,
                  nearNull(servo, 2, E) ? up + down
                  : E > 0.0             ? up
                                        : down,
                  0.01 * up)
          << open << " " << E;
    }
    double most = 0.0;
    for (double E = -2e-3; E < 2e-3; E += 1e-5)
      most = std::max(most, (speedOf(servo, 2, E + 1e-6) - speedOf(servo, 2, E)) / 1e-6);
    EXPECT_NEAR(steepest(servo)(2), most, 1e-6 * most) << open;
    EXPECT_EQ(speedOf(servo, 2, 0.0), 0.0);
    EXPECT_EQ(differenceOf(servo, 2, 0.0), 0.0);
  }
}

TEST(ServoModel, OfEdgesThatOverlapIsWhatPassesBeyond) {
  ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  servo.opening.setConstant(-3e-4);
  const double up = servo.extend(2), down = servo.retract(2);
  double last = -HUGE_VAL, steepest_way = 0.0;
  for (double E = -2e-3; E <= 2e-3; E += 1.7e-5) {
    const double v = speedOf(servo, 2, E), K = E > 0.0 ? up : down;
    EXPECT_NEAR(v, orifices(up, down, -3e-4, E), 1e-12) << E;
    EXPECT_EQ(isLapped(servo, 2, E), v == 0.0) << E;
    // The way back is steep, not a jump, and exact beyond.
    const double lap = 6e-4 * (E > 0.0 ? down : up) / (up + down);
    if (std::abs(v) > K * lap / (kThroughLap - 1.0)) {
      EXPECT_NEAR(differenceOf(servo, 2, v), E, 1e-12) << E;
    }
  }
  for (double v = -0.05; v <= 0.05; v += 1e-5) {
    const double E = differenceOf(servo, 2, v), K = v > 0.0 ? up : down;
    EXPECT_GT(E, last) << v;
    steepest_way = std::max(steepest_way, std::abs(E / v) * K);
    last = E;
  }
  EXPECT_NEAR(steepest_way, kThroughLap, 1e-9);
  EXPECT_EQ(differenceOf(servo, 2, 0.0), 0.0);
  EXPECT_EQ(steepest(servo)(2), std::max(up, down));
}

TEST(SealFriction, IsFeltWhileATurnIsNew) {
  ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  servo.friction.setConstant(2e-4);
  servo.friction_time = 0.05;
  servo.friction_way = 1e-6;
  // Turned at once from -1 to 1, z_T follows: h = 2 e^{-t/T}, whatever the steps.
  for (const double dt : {1e-3, 1e-2}) {
    SealFriction seals;
    for (int n = 0; n < 1000; ++n) seals.turn(servo, Vec6::Constant(-0.1), dt);
    double area = 0.0;
    for (double t = 0.0; t < 0.2 - 1e-9; t += dt) {
      const Vec6 h = seals.turn(servo, Vec6::Constant(0.1), dt);
      if (t > 0.0) {
        EXPECT_NEAR(h(3), 4e-4 * std::exp(-(t + 0.5 * dt) / 0.05), 0.2 * 4e-4 * dt / 0.05) << t;
      }
      area += dt * h(3);
    }
    EXPECT_NEAR(area, 4e-4 * 0.05 * (1.0 - std::exp(-4.0)), 0.11 * 4e-4 * 0.05) << dt;
    // At rest the bristles stay bent, and what is felt of it fades.
    seals.turn(servo, Vec6::Constant(-0.1), dt);
    const double bent = seals.turn(servo, Vec6::Zero(), dt)(0);
    EXPECT_NEAR(seals.turn(servo, Vec6::Zero(), dt)(0), bent * std::exp(-dt / 0.05), 0.02 * -bent);
    seals.settle();
    EXPECT_EQ(seals.turn(servo, Vec6::Zero(), dt)(0), 0.0);
    seals.turn(servo, Vec6::Constant(0.1), dt);
    seals.reset();
    EXPECT_EQ(seals.turn(servo, Vec6::Zero(), dt)(0), 0.0);
  }
  // Over its way as the bristles of LuGre without viscosity.
  servo.friction_way = 1e-4;
  servo.friction_time = 1e6;
  SealFriction seals;
  double s = 0.0;
  for (int n = 0; n < 40; ++n, s += 1e-5) {
    const double h = seals.turn(servo, Vec6::Constant(0.01), 1e-3)(1);
    EXPECT_NEAR(h, 2e-4 * (1.0 - std::exp(-(s + 0.5e-5) / 1e-4)), 2e-7) << n;
  }
}

/// A leg with friction, by Euler's steps so small that they do not matter.
struct RubbingLeg {
  const ServoModel& servo;
  double L = 1.5, v = 0.0, z = 0.0, settled = 0.0;
  void run(double reference, double T) {
    constexpr double dt = 2e-6;
    for (double t = 0.0; t < T - 0.5 * dt; t += dt) {
      const double E = reference - L - servo.friction(0) * (z - settled);
      const double v_end = E * (E > 0.0 ? servo.extend(0) : servo.retract(0));
      settled += dt / servo.friction_time * (z - settled);
      z += dt * (v - std::abs(v) * z) / servo.friction_way;
      L += dt * v;
      v += dt / servo.tau(0) * (v_end - v);
    }
  }
};

TEST(FeedForward, TakesALegThroughItsTurns) {
  ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  servo.readings.scale.setConstant(1e-9);
  servo.derivative = servo.reading_age = 0.0;
  servo.delay.setZero();
  servo.update = 1e-4;
  servo.friction.setConstant(4e-4);
  const double T = 0.01, w = 2.0 * M_PI * 0.7, size = 0.01;
  const auto error = [&](bool believed) {
    ServoModel belief = servo;
    if (!believed) belief.friction.setZero();
    RubbingLeg leg{servo};
    SealFriction seals;
    ModelledServos model(belief, T, 0.5);
    model.reset(Vec6::Constant(1.5), 0);
    double squares = 0.0, model_off = 0.0;
    for (int k = 0; k < 600; ++k) {
      const double t = k * T, grows = std::min(1.0, 0.5 * t);
      const LegMotion at{Vec6::Constant(1.5 + size * grows * std::sin(w * t)),
                         Vec6::Constant(size * grows * w * std::cos(w * t)),
                         Vec6::Constant(-size * grows * w * w * std::sin(w * t))};
      Vec6 v = at.L_dot + commandDelay(belief, 0, 0.0, T) * at.L_ddot;
      const Vec6 reference = feedForward(belief, at, 0.0, T, 1.0, seals.turn(belief, v, T));
      if (k > 300) squares += std::pow(leg.L - at.L(0), 2);
      leg.run(reference(0), T);
      model.send(reference, k, k * kTick);
      model.advance((k + 1) * kTick);
      if (k > 300) model_off = std::max(model_off, std::abs(model.length()(0) - leg.L));
    }
    return std::pair(std::sqrt(squares / 299.0), model_off);
  };
  const auto [with, modelled] = error(true);
  const auto [without, not_modelled] = error(false);
  EXPECT_LT(with, 0.25 * without) << with << " " << without;
  EXPECT_LT(modelled, 0.05 * not_modelled) << modelled << " " << not_modelled;
  EXPECT_GT(not_modelled, 5e-5);
}

TEST(FeedForward, ShareZeroIsTheReportsReference) {
  const ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  const LegMotion legs{Vec6::Constant(1.5), Vec6::Constant(0.3), Vec6::Constant(-2.0)};
  EXPECT_EQ(feedForward(servo, legs, 0.01, 0.01, 0.0), legs.L);
}

class Derivative : public testing::TestWithParam<int> {};  // K_D of the LegSlave

TEST_P(Derivative, ServoObserverKnowsSpeedAndLengthBelowACount) {
  Experiment e = experiment("z_sine", kCompensated);
  e.plant.leg_slave.K_D = GetParam();
  e.controller.servo.derivative =
      plant::nominalServo(e.plant.leg_slave, e.plant.actuator, e.plant.transducer).derivative;
  const double T = 0.01, scale = e.plant.transducer.scale;
  Leg leg(e.plant, 1.5);
  ServoObserver observer(e.controller.servo, T);
  observer.reset(Vec6::Constant(1.5), 0);
  std::mt19937 random(11);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  double length = 0.0, speed = 0.0, fastest = 0.0, rate = 0.0;
  int n = 0;
  for (int k = 0; k < 2000; ++k) {
    rate = 0.98 * rate + 0.002 * u(random);  // [m/s]
    const double r = 1.5 + 0.02 * std::sin(0.004 * k) + rate;
    const LegCounts counts = legCounts(e.controller.legs, Vec6::Constant(r));
    leg.run(counts[0], T);
    observer.send(legLengths(e.controller.legs, counts), k, k * kTick);
    observer.advance((k + 1) * kTick);
    LegCounts read{};
    read.fill(e.plant.transducer.count(leg.actuator.length()));
    observer.correct(legLengths(e.controller.legs, read), (k + 1) * kTick);
    ++n;
    length += std::pow(observer.length()(0) - leg.actuator.length(), 2);
    speed += std::pow(observer.velocity()(0) - leg.actuator.velocity(), 2);
    fastest = std::max(fastest, std::abs(leg.actuator.velocity()));
  }
  EXPECT_LT(std::sqrt(length / n), 0.15 * scale);  // a count alone says 0.29
  EXPECT_LT(std::sqrt(speed / n), 0.02 * fastest);
}

INSTANTIATE_TEST_SUITE_P(Gains, Derivative, testing::Values(0, 3000),
                         testing::PrintToStringParamName());

TEST(ServoObserver, RoundingIsThatOfTheReading) {
  const Experiment e = experiment("z_sine", kCompensated);
  const double scale = e.plant.transducer.scale, edge = e.plant.transducer.offset + 9000 * scale;
  ServoObserver observer(e.controller.servo, 0.01);
  for (const double part : {-0.45, -0.2, 0.0, 0.3, 0.45}) {
    observer.reset(Vec6::Constant(edge + part * scale), 0);
    const Vec6 rounding = observer.rounding(Vec6::Zero(), 0.0);
    EXPECT_LT((rounding.array() + part * scale).abs().maxCoeff(), 1e-9 * scale) << part;
  }
  // Over many counts it has no mean.
  Vec6 mean = Vec6::Zero();
  for (int n = 0; n < 200; ++n) {
    observer.reset(Vec6::Constant(edge + n * 0.371 * scale), 0);
    mean += observer.rounding(Vec6::Constant(0.3), 0.0) / 200;
  }
  EXPECT_LT(mean.cwiseAbs().maxCoeff(), 0.05 * scale);
}

TEST(ServoObserver, RoundingIsOfWhereTheLegsAreByThen) {
  const Experiment e = experiment("z_sine", kCompensated);
  const double scale = e.plant.transducer.scale;
  ServoObserver observer(e.controller.servo, 0.01);
  observer.reset(Vec6::Constant(1.5), 0);
  observer.send(Vec6::Constant(1.51), 0, 0);
  observer.advance(10 * kTick);
  const double later = 0.3 * scale / observer.velocity()(0);
  ASSERT_LT(later, 0.005);
  const double turned =
      (observer.rounding(Vec6::Zero(), later) - observer.rounding(Vec6::Zero(), 0.0))(0) / scale;
  EXPECT_NEAR(turned - std::floor(turned), 0.7, 1e-6);  // 0.3 of a count less, but for whole ones
}

TEST(ServoObserver, RestsWhereItIsReset) {
  const Experiment e = experiment("z_sine", kCompensated);
  ServoObserver observer(e.controller.servo, 0.01);
  observer.reset(Vec6::Constant(1.5), 0);
  observer.send(Vec6::Constant(1.6), 0, 0);
  observer.advance(20 * kTick);
  EXPECT_GT(observer.velocity()(0), 0.02);
  observer.reset(Vec6::Constant(1.4), 20 * kTick);
  EXPECT_EQ(observer.velocity(), Vec6::Zero());
  for (int k = 21; k < 26; ++k) {
    observer.advance(k * kTick);
    EXPECT_LT((observer.length().array() - 1.4).abs().maxCoeff(), e.plant.transducer.scale);
  }
}

TEST(ServoObserver, ReadingBoundsItWhateverTheModel) {
  Experiment e = experiment("z_sine", kCompensated);
  e.controller.servo.extend *= 1.5;
  e.controller.servo.jitter = 0.0;
  ServoObserver observer(e.controller.servo, 0.01);
  observer.reset(Vec6::Constant(1.5), 0);
  for (int k = 0; k < 50; ++k) {
    observer.send(Vec6::Constant(1.5 + 0.001 * k), k, k * kTick);
    observer.advance((k + 1) * kTick);
    const Vec6 read = Vec6::Constant(1.5 + 0.0003 * k);
    observer.correct(read, (k + 1) * kTick);
    EXPECT_LE((observer.length() - read).cwiseAbs().maxCoeff(),
              0.5 * e.plant.transducer.scale * (1 + 1e-9));
  }
}

/// A machine and its servo model side by side over two seconds of a wavy reference; what the
/// sensor's filter makes of the machine's own acceleration, by small steps. Looks at the model
/// after each tick.
struct SideBySide {
  using Look = std::function<void(int tick, const ServoObserver&)>;
  explicit SideBySide(
      const ServoModel& servo, std::int64_t late = 0,
      const Look& look = [](int, const ServoObserver&) {})
      : e(experiment("z_sine", kCompensated)), leg(e.plant, 1.5), observer(servo, 0.01) {
    observer.reset(Vec6::Constant(1.5), 0);
    Butterworth2<1> filter(e.plant.sensor.cutoff);
    const auto step = filter.prepare(kStep * 1e-9);
    double v = 0.0;
    for (int k = 0; k < 200; ++k) {
      const LegCounts counts = legCounts(
          e.controller.legs, Vec6::Constant(1.5 + 0.004 * std::sin(0.25 * k) * std::cos(0.03 * k)));
      observer.send(legLengths(e.controller.legs, counts), k, k * kTick);
      for (std::int64_t t = k * kTick; t < (k + 1) * kTick; t += kStep) {
        if (t == k * kTick + late) reference = counts[0];
        leg.run(reference, kStep * 1e-9);
        const Butterworth2<1>::Channels a((leg.actuator.velocity() - v) / (kStep * 1e-9));
        v = leg.actuator.velocity();
        filter.jump(a);
        filter.advance(step, a);
        felt.push_back(filter.output()(0));
        length.push_back(leg.actuator.length());
      }
      if (late > 0) observer.arrived(k, k * kTick + late);
      observer.advance((k + 1) * kTick);
      LegCounts read{};
      read.fill(e.plant.transducer.count(leg.actuator.length()));
      observer.correct(legLengths(e.controller.legs, read), (k + 1) * kTick);
      modelled.push_back(observer.filteredAcceleration((k + 1) * kTick)(0));
      earlier.push_back(observer.filteredAcceleration((k + 1) * kTick - 3'700'000)(0));
      look(k, observer);
    }
  }
  /// The machine's at `time` [ns], or its mean over `window` before.
  double due(std::int64_t time, std::int64_t window) const {
    const auto end = static_cast<std::size_t>(time / kStep);
    if (window == 0) return felt[end - 1];
    double sum = 0.0;
    const auto n = static_cast<std::size_t>(window / kStep);
    for (std::size_t i = end - n; i < end; ++i) sum += felt[i] / static_cast<double>(n);
    return sum;
  }
  /// Rms of what the model shows at the ticks' ends less `ago`, beside the machine's, over its rms.
  double off(const std::vector<double>& found, std::int64_t window, std::int64_t ago = 0) const {
    double apart = 0.0, size = 0.0;
    for (std::size_t k = 20; k < found.size(); ++k) {
      const double a = due((static_cast<std::int64_t>(k) + 1) * kTick - ago, window);
      apart += std::pow(found[k] - a, 2);
      size += a * a;
    }
    return std::sqrt(apart / size);
  }

  static constexpr std::int64_t kStep = 50'000;  // [ns]
  Experiment e;
  Leg leg;
  ServoObserver observer;
  std::int32_t reference = legCounts(e.controller.legs, Vec6::Constant(1.5))[0];
  std::vector<double> felt, length, modelled, earlier;
};

TEST(ServoObserver, FeelsWhatTheSensorFeelsAtOnceAndOnAverage) {
  ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  const SideBySide at_once(servo);
  servo.sensor_window = 0.01;
  const SideBySide mean(servo);
  // The LegSlave's phase is unknown to the model; a mean hides most of what that does.
  EXPECT_LT(at_once.off(at_once.modelled, 0), 0.04);
  EXPECT_LT(at_once.off(at_once.earlier, 0, 3'700'000), 0.04);
  EXPECT_LT(mean.off(mean.modelled, kTick), 0.02);
  EXPECT_LT(mean.off(mean.earlier, kTick, 3'700'000), 0.02);
  // One and the other are not the same, by far.
  EXPECT_GT(mean.off(mean.modelled, 0), 0.1);
}

TEST(ServoObserver, ASensorThatIsLaterShowsWhatWas) {
  ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  for (const std::int64_t window : {std::int64_t{0}, kTick})
    for (const double delay : {-4e-4, 4e-4}) {
      servo.sensor_window = static_cast<double>(window) * 1e-9;
      servo.sensor_delay = delay;
      const SideBySide late(servo);
      const std::int64_t ago = std::llround(delay * 1e9);
      std::vector<double> found(late.modelled.begin(), late.modelled.end() - 1);
      EXPECT_LT(late.off(found, window, ago), 0.05) << delay;
      EXPECT_GT(late.off(found, window, -ago), 1.5 * late.off(found, window, ago)) << delay;
    }
}

// A force that swings pushes the platform up and down while all legs move alike: its work by small
// steps, and from what the sensor's filter lets through, a mean a tick or a reading.
TEST(PortWork, IsThatOfTheForceBeforeTheSensorsFilter) {
  ControllerConfig config = experiment("z_sine", kCompensated).controller;
  const Geometry& g = config.geometry;
  const double foot =
      (legLengths(g, g.fromHome({})).cwiseAbs2().array() - g.home_height * g.home_height)
          .mean();  // [m^2] of a leg's way across
  const auto height = [&](double L) { return std::sqrt(L * L - foot); };
  const Transform X_IP{Mat3::Identity(), {0.0, 0.0, height(1.5)}};
  const double dt = SideBySide::kStep * 1e-9;
  constexpr std::size_t kSteps = kTick / SideBySide::kStep, kAll = 200 * kSteps;
  for (const bool mean : {false, true})
    for (const double delay : {0.0, 4e-3})
      for (const double phase : {0.0, 1.0, 2.0, 3.0}) {
        config.servo.sensor_window = mean ? kTick * 1e-9 : 0.0;
        config.servo.sensor_delay = delay;
        const auto force = [&](std::size_t i) {  // from rest to rest
          const double t = dt * static_cast<double>(i), s = t / 1.9;
          return s < 1.0 ? std::pow(std::sin(M_PI * s), 2) * std::cos(3.0 * t) *
                               std::sin(25.0 * t + phase)
                         : 0.0;
        };
        Butterworth2<1> filter(config.servo.sensor_cutoff);
        const auto step = filter.prepare(dt);
        std::vector<double> shown(static_cast<std::size_t>(std::lround(delay / dt)), 0.0);
        for (std::size_t i = 1; i <= kAll; ++i) {
          filter.advance(step, Butterworth2<1>::Channels(force(i)));
          shown.push_back(filter.output()(0));
        }
        PortWork port(config);
        double newest = 0.0, settled = 0.0, unfiltered = 0.0, length_before = 1.5;
        const SideBySide run(config.servo, 0, [&](int k, const ServoObserver& servo) {
          const auto end = static_cast<std::size_t>(k + 1) * kSteps;
          double sum = 0.0;
          for (std::size_t i = end - kSteps; i < end; ++i) sum += shown[i];
          Wrench F;
          F.f.z() = mean ? sum / kSteps : shown[end - 1];
          const PortWork::Work work = port.take(F, (k + 1) * kTick, X_IP, servo);
          newest += work.newest;
          settled += work.settled;
          const double length = servo.length()(0);
          unfiltered += F.f.z() * (height(length) - height(length_before));
          length_before = length;
        });
        double due = 0.0, all = 0.0;
        for (std::size_t i = 1; i < run.length.size(); ++i) {
          const double work = force(i) * (height(run.length[i]) - height(run.length[i - 1]));
          due += work;
          all += std::abs(work);
        }
        EXPECT_NEAR(settled, due, 0.01 * all) << mean << " " << delay << " " << phase;
        EXPECT_NEAR(newest, due, 0.015 * all) << mean << " " << delay << " " << phase;
        EXPECT_GT(std::abs(unfiltered - due), 0.05 * all);
      }
}

// As exact as its polynomials, whatever the times of its readings: a force that is a cubic of time,
// or a mean of one that is a parabola, on a platform that sinks at full speed.
TEST(PortWork, IsExactForPolynomialsOfTime) {
  ControllerConfig config = experiment("z_sine", kCompensated).controller;
  const double w = config.servo.sensor_cutoff;
  const Geometry& g = config.geometry;
  const auto seconds = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-9; };
  for (const bool mean : {false, true}) {
    const std::int64_t window = mean ? kTick : 0;
    config.servo.sensor_window = seconds(window);
    ServoObserver servo(config.servo, 0.01);
    servo.reset(Vec6::Constant(1.6), 0);
    servo.send(Vec6::Constant(1.3), 0, 0);
    const double c_2 = -2e5, c_3 = mean ? 0.0 : 3e7;  // about 115 ms
    const auto S = [&](double t) {                    // as read
      const double s = t - 0.115;
      return 5.0 + c_2 * (s * s + seconds(window) * seconds(window) / 12.0) + c_3 * s * s * s;
    };
    const auto F = [&](double t) {
      const double s = t - 0.115;
      return 5.0 + c_2 * s * s + c_3 * s * s * s +
             M_SQRT2 / w * (2.0 * c_2 * s + 3.0 * c_3 * s * s) +
             (2.0 * c_2 + 6.0 * c_3 * s) / (w * w);
    };
    PortWork port(config);
    const std::int64_t middles[] = {100'000'000, 109'000'000, 121'000'000, 130'500'000};
    std::array<double, 4> z{};
    PortWork::Work work;
    for (std::size_t i = 0; i < 4; ++i) {
      servo.advance(middles[i]);
      const Transform X_IP = forwardPose(g, servo.length(), g.fromHome({})).X_IP;
      z[i] = X_IP.p.z();
      EXPECT_EQ(work.settled, 0.0);
      Wrench reading;
      reading.f.z() = S(seconds(middles[i]));
      const std::int64_t read = middles[i] + window / 2;
      work = port.take(reading, read, X_IP, servo);
      EXPECT_EQ(work.newest == 0.0, i < 2);
      const PortWork::Work again = port.take(reading, read, X_IP, servo);  // it is not new
      EXPECT_EQ(again.newest, 0.0);
      EXPECT_EQ(again.settled, 0.0);
    }
    ASSERT_LT(z[2] - z[1], -1e-3);
    // Simpson's rule: F is a cubic.
    const double due = (z[2] - z[1]) / 6.0 * (F(0.109) + 4.0 * F(0.115) + F(0.121));
    const double unfiltered = (z[2] - z[1]) / 6.0 * (S(0.109) + 4.0 * S(0.115) + S(0.121));
    EXPECT_NEAR(work.settled, due, 0.02 * std::abs(due))
        << mean;  // and the speed is not quite constant
    EXPECT_GT(std::abs(unfiltered - due), 0.5 * std::abs(due));
    // Of what the servo model has not reached yet it knows no motion.
    EXPECT_TRUE(servo.moments(middles[3] + 1'000'000, middles[3] + 9'000'000).isZero(0.0));
    // After a gap the readings before it say nothing.
    const std::int64_t later = middles[3] + 40'000'000;
    servo.advance(later);
    work = port.take({}, later, g.fromHome({}), servo);
    EXPECT_EQ(work.newest, 0.0);
    EXPECT_EQ(work.settled, 0.0);
  }
}

TEST(ServoObserver, ACommandCountsFromWhenTheMachineSaysItCame) {
  ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  servo.sensor_window = 0.01;
  const SideBySide told(servo, 4'000'000);
  EXPECT_LT(told.off(told.modelled, kTick), 0.02);
  // Of another tick, or from elsewhere, it is not about these.
  using Arrival = std::pair<std::int64_t, std::int64_t>;
  const auto lengthAfter = [&](const std::vector<Arrival>& arrivals) {
    ServoObserver observer(servo, 0.01);
    observer.reset(Vec6::Constant(1.5), 0);
    observer.send(Vec6::Constant(1.51), 7, 0);
    for (const auto& [tick, time] : arrivals) observer.arrived(tick, time);
    observer.advance(2 * kTick);
    return observer.length();
  };
  const Vec6 plain = lengthAfter({});
  for (const Arrival& other : {Arrival(6, 5'000'000), Arrival(8, 5'000'000), Arrival(7, 50'000'000),
                               Arrival(7, -50'000'000), Arrival(-1, 0)})
    EXPECT_EQ(lengthAfter({other}), plain) << other.first << " " << other.second;
  EXPECT_LT(lengthAfter({{7, 5'000'000}})(0), plain(0) - 1e-5);
}

// What is learnt of a servo takes the place of what was believed, in every number.
TEST(ModelledServos, TakeGainsAsIfTheyHadAlwaysHadThem) {
  ServoModel before = experiment("z_sine", kCompensated).controller.servo, after = before;
  for (int i = 0; i < kLegs; ++i) {
    after.extend(i) *= 1.1 + 0.01 * i;
    after.retract(i) *= 0.9 - 0.01 * i;
    after.delay(i) += 0.004 + 0.001 * i;
  }
  const auto lengthOf = [](ModelledServos servos) {
    servos.reset(Vec6::Constant(1.5), 0);
    for (int k = 0; k < 20; ++k) {
      servos.send(Vec6::Constant(1.5 + 0.01 * std::sin(0.8 * k)), k, k * kTick);
      servos.advance((k + 1) * kTick);
    }
    return servos.length();
  };
  ModelledServos changed(before, 0.01, 0.5);
  EXPECT_GT((lengthOf(changed) - lengthOf(ModelledServos(after, 0.01, 0.5))).norm(), 1e-4);
  changed.use({after.extend, after.retract, after.delay});
  EXPECT_EQ(lengthOf(changed), lengthOf(ModelledServos(after, 0.01, 0.5)));
}

// Feed-forward is exact for what it knows: a steady acceleration, of a leg that answers late.
TEST(FeedForward, ALegThatAnswersLateFollowsAParabola) {
  ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  servo.readings.scale.setConstant(1e-9);
  servo.derivative = servo.reading_age = 0.0;
  servo.update = 1e-5;
  servo.friction.setZero();
  servo.friction_way = 1e-3;
  servo.delay.setConstant(0.03);  // three ticks
  const double T = 0.01, a = 0.05;
  RubbingLeg leg{servo};
  std::vector<double> references;
  double off = 0.0;
  for (int k = 0; k < 200; ++k) {
    const double t = k * T;
    const LegMotion at{Vec6::Constant(1.5 + 0.5 * a * t * t), Vec6::Constant(a * t),
                       Vec6::Constant(a)};
    references.push_back(feedForward(servo, at, 0.0, T, 1.0, Vec6::Zero())(0));
    if (k > 100) off += (leg.L - at.L(0)) / 99.0;
    leg.run(references[static_cast<std::size_t>(std::max(0, k - 3))], T);
  }
  EXPECT_LT(std::abs(off), 2e-6);  // the term with the acceleration is 3e-5 m here
}

// int t^n dL over two parts is that over the whole, counted from another start.
TEST(ServoObserver, MomentsOfAMotionShiftAsIntegralsDo) {
  ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  servo.friction.setZero();
  ServoObserver observer(servo, 0.01);
  observer.reset(Vec6::Constant(1.5), 0);
  std::vector<Vec6> lengths{observer.length()};
  std::vector<std::pair<std::int64_t, Vec6>> between;
  for (int k = 0; k < 10; ++k) {
    observer.send(Vec6::Constant(1.5 + 0.01 * std::sin(0.9 * k)), k, k * kTick);
    ServoObserver stops = observer;
    const std::int64_t at = k * kTick + 1'100'000 + 870'000 * k;
    stops.advance(at);
    between.emplace_back(at, stops.length());
    observer.advance((k + 1) * kTick);
    lengths.push_back(observer.length());
  }
  const auto over = [&](int from, int to) { return observer.moments(from * kTick, to * kTick); };
  const Motions whole = over(7, 10), first = over(7, 9), rest = over(9, 10);
  const double s = 0.02;
  EXPECT_LT((whole.col(0) - (lengths[10] - lengths[7])).norm(), 1e-15);
  EXPECT_LT((first.col(0) - (lengths[9] - lengths[7])).norm(), 1e-15);
  EXPECT_GT(rest.col(0).norm(), 1e-4);
  for (int k = 7; k < 10; ++k) {  // where no instant is remembered
    const auto& [at, length] = between[static_cast<std::size_t>(k)];
    EXPECT_LT((observer.moments(7 * kTick, at).col(0) - (length - lengths[7])).norm(), 1e-8) << k;
  }
  EXPECT_LT((whole.col(1) - (first.col(1) + rest.col(1) + s * rest.col(0))).norm(), 1e-15);
  EXPECT_LT(
      (whole.col(2) - (first.col(2) + rest.col(2) + 2.0 * s * rest.col(1) + s * s * rest.col(0)))
          .norm(),
      1e-17);
  EXPECT_LT((whole.col(3) - (first.col(3) + rest.col(3) + 3.0 * s * rest.col(2) +
                             3.0 * s * s * rest.col(1) + s * s * s * rest.col(0)))
                .norm(),
            1e-19);
}

TEST(ServoObserver, AReadingIsComparedWithTheModelAtItsOwnTime) {
  Experiment e = experiment("z_sine", kCompensated);
  e.controller.servo.jitter = 0.0;
  ServoObserver observer(e.controller.servo, 0.01);
  observer.reset(Vec6::Constant(1.5), 0);
  observer.send(Vec6::Constant(1.52), 0, 0);
  observer.advance(5 * kTick);
  const Vec6 then = observer.length();
  observer.advance(5 * kTick + 4'000'000);
  const Vec6 now = observer.length();
  ASSERT_GT(now(0) - then(0), 3.0 * e.plant.transducer.scale);
  observer.correct(then, 5 * kTick);  // agrees with what was, so nothing changes
  EXPECT_LT((observer.length() - now).cwiseAbs().maxCoeff(), 1e-12);
  const double more = e.plant.transducer.scale;
  observer.correct(then.array() + more, 5 * kTick);  // half a count of it is slack
  EXPECT_LT((observer.length() - now).array().abs().maxCoeff() - 0.5 * more, 1e-12);
  EXPECT_GT((observer.length() - now).minCoeff(), 0.49 * more);
  const Vec6 corrected = observer.length();
  observer.correct(then.array() + more, 5 * kTick);  // it is known by now
  EXPECT_LT((observer.length() - corrected).cwiseAbs().maxCoeff(), 1e-12);
}

// A leg that moves is elsewhere by as much as the time of its reading may be wrong.
TEST(ServoObserver, AReadingsTimeMayBeWrongByItsJitter) {
  ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  servo.jitter = 2e-3;
  constexpr std::int64_t kThen = 3 * kTick + 137'000;  // between two of what the model remembers
  ServoObserver observer(servo, 0.01), twin(servo, 0.01);
  for (ServoObserver* one : {&observer, &twin}) {
    one->reset(Vec6::Constant(1.5), 0);
    one->send(Vec6::Constant(1.52), 0, 0);
  }
  twin.advance(kThen);
  const Vec6 L = twin.length(), slack = 0.5 * servo.readings.scale + servo.jitter * twin.velocity();
  ASSERT_GT(slack(0), 2.0 * servo.readings.scale(0));
  observer.advance(4 * kTick);
  const Vec6 now = observer.length();
  observer.correct(L + 0.98 * slack, kThen);
  EXPECT_EQ(observer.length(), now);
  observer.correct(L + 1.02 * slack, kThen);
  EXPECT_LT((observer.length() - now - 0.02 * slack).cwiseAbs().maxCoeff(), 0.005 * slack(0));
}

TEST(AdmittanceModel, TakesAChangeOfTheRobotOnceWhereNoSampleComes) {
  // The body shrinks while it turns; the ticks after it have no new sample.
  ModalModel m;
  m.Phi = Mat6::Identity() / 10.0;
  m.stiffness = Vec6::Constant(4.0);
  m.damping = Mat6::Zero();
  FreeBodyModel body;
  body.body_P = {80.0, {0.1, 0.0, -0.5}, Vec3(10.0, 20.0, 25.0).asDiagonal()};
  const Mat6 large = spatialMass({50.0, {0.1, 0.0, 0.9}, Vec3(8.0, 8.0, 2.0).asDiagonal()}),
             small = spatialMass({50.0, {0.1, 0.0, 0.3}, Vec3(4.0, 4.0, 2.0).asDiagonal()});
  for (const VehicleModel& vehicle : {VehicleModel(m), VehicleModel(body)}) {
    AdmittanceModel model(vehicle, 0.01);
    model.reset(Vec6::Zero());
    for (int n = 0; n < 100; ++n) model.step({{5.0, 3.0, 0.0}, {3.0, 2.0, 4.0}}, large, 0.01, 0.0);
    model.step({}, {large, small}, 0.01, 0.0);
    const PathPoint<6> once = model.motion();
    for (int n = 0; n < 3; ++n) model.step({}, {large, small}, 0.0, 0.0);
    EXPECT_GT(once.x_dot.tail<3>().norm(), 0.01);
    // Where the fixed angles are taken moves on by half a tick.
    EXPECT_LT((model.motion().x_dot - once.x_dot).norm(), 1e-6);
    EXPECT_LT((model.motion().x - once.x).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace ves
