// SPDX-License-Identifier: BSD-3-Clause
//
// The parts of the compensation, each alone: a body on the modal base, the motion ahead of its
// time, the servo's feed-forward and observer.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "support/poses.hpp"
#include "support/rig.hpp"
#include "ves/math/dense.hpp"
#include "ves/plant/nominal_servo.hpp"

namespace ves {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

const std::vector<std::string> kAll = {"controller.compensation.feed_forward=true",
                                       "controller.compensation.observer=true",
                                       "controller.compensation.inertia=true"};

Experiment experiment(const std::string& name, const std::vector<std::string>& set) {
  return test::experiment(name, set);
}

// The base with a body on it

ModalModel base(int k) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  ModalModel m;
  m.Phi = MatrixXd::NullaryExpr(6, k, [&] { return 0.05 * u(random); });
  m.stiffness = VectorXd::LinSpaced(k, 10.0, 900.0);
  m.damping = (0.04 * m.stiffness.cwiseSqrt()).asDiagonal();
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
  const MatrixXd A_inverse = (MatrixXd::Identity(k, k) + m.Phi.transpose() * M * m.Phi).inverse();
  MatrixXd S = MatrixXd::Zero(2 * k + 1, 2 * k + 1);
  S.block(0, k, k, k).setIdentity();
  S.block(k, 0, k, k) = -A_inverse * m.stiffness.asDiagonal();
  S.block(k, k, k, k) = -A_inverse * m.damping;
  S.block(k, 2 * k, k, 1) = A_inverse * m.Phi.transpose() * F;
  VectorXd z(2 * k + 1);
  z << state, 1.0;
  return (exponential(S * time) * z).head(2 * k);
}

/// Largest error of the commanded motion over two seconds of a constant wrench.
double errorWithBody(double period) {
  const ModalModel m = base(6);
  const Vec6 F = Vec6::LinSpaced(-20.0, 30.0);
  AdmittanceModel model(m, period);
  model.reset(Vec6::Zero());
  double most = 0.0;
  for (int n = 1; n * period < 2.0; ++n) {
    model.step(Wrench::from(F), body(), 0.0);
    const VectorXd z = exact(m, body(), VectorXd::Zero(12), F, n * period);
    most = std::max(most, (model.motion().x - m.Phi * z.head(6)).norm());
  }
  return most;
}

TEST(BodyOnTheBase, MovesAsTheAugmentedModalMassSays) {  // (3.11), second order in the period
  const ModalModel m = base(6);
  const double most = errorWithBody(0.01);
  const Vec6 still = m.Phi * m.stiffness.cwiseInverse().asDiagonal() * m.Phi.transpose() *
                     Vec6::LinSpaced(-20.0, 30.0);
  EXPECT_LT(most, 0.01 * still.norm());
  EXPECT_NEAR(most / errorWithBody(0.005), 4.0, 0.3);
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
    model.step({}, M, 0.0);
    if (n < 10'000) continue;
    low = std::min(low, energy());
    high = std::max(high, energy());
  }
  EXPECT_GT(low, 0.99 * first);
  EXPECT_LT(high, 1.01 * first);
}

TEST(Ahead, AFreeRunIsThatFromRestWhereItWasReset) {
  for (const bool coupled : {false, true}) {
    ModalModel m = base(6);
    if (coupled) m.damping += 0.3 * MatrixXd::Ones(6, 6);
    AdmittanceModel model(m, 0.01, 0.02);
    VectorXd z = VectorXd::Zero(12);
    z.head(6) = VectorXd::LinSpaced(6, 0.1, -0.2);
    model.reset(m.Phi * z.head(6));
    for (int n = 0; n < 100; ++n) {
      model.step({}, Mat6::Zero(), 1.0);
      z = exact(m, Mat6::Zero(), z, Vec6::Zero(), 0.01);
      ASSERT_LT((model.motion().x - m.Phi * z.head(6)).norm(), 1e-10) << n << coupled;
      ASSERT_LT((model.motion().x_dot - m.Phi * z.tail(6)).norm(), 1e-9) << n << coupled;
    }
  }
}

TEST(Ahead, AHeavilyDampedModeStartsWhereItIs) {  // its way back would be longer than the world
  ModalModel m = base(6);
  m.damping(0, 0) = 2000.0;
  AdmittanceModel model(m, 0.01, 0.02);
  const Vec6 x = m.Phi * VectorXd::Constant(6, 0.1);
  model.reset(x);
  model.step({}, Mat6::Zero(), 1.0);
  EXPECT_LT((model.motion().x - x).norm(), 0.05 * x.norm());
}

TEST(Ahead, MotionIsThatMuchLaterUnderTheSameWrench) {
  for (const bool coupled : {false, true}) {
    ModalModel m = base(6);
    if (coupled) m.damping += 0.3 * MatrixXd::Ones(6, 6);
    constexpr double kAhead = 0.016;
    AdmittanceModel model(m, 0.01, kAhead);
    model.reset(Vec6::Zero());
    VectorXd z = VectorXd::Zero(12);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> u(-50.0, 50.0);
    for (int n = 0; n < 200; ++n) {
      const Vec6 F = Vec6::NullaryExpr([&] { return u(random); });
      model.step(Wrench::from(F), Mat6::Zero(), 1.0);
      z = exact(m, Mat6::Zero(), z, F, 0.01);
      const VectorXd later = exact(m, Mat6::Zero(), z, F, kAhead);
      ASSERT_LT((model.motion().x - m.Phi * later.head(6)).norm(), 1e-12);
      ASSERT_LT((model.motion().x_dot - m.Phi * later.tail(6)).norm(), 1e-11);
      const VectorXd eta_ddot = m.Phi.transpose() * F - m.stiffness.cwiseProduct(later.head(6)) -
                                m.damping * later.tail(6);
      ASSERT_LT((model.motion().x_ddot - m.Phi * eta_ddot).norm(), 1e-10);
    }
  }
}

// The servo

/// One leg of the machine: LegSlave, valve, cylinder, counts, as the plant runs them.
struct Leg {
  explicit Leg(const plant::PlantConfig& p, double L)
      : config(p), actuator(p.actuator, L), slave(p.leg_slave, p.transducer.count(L)) {}

  void run(std::int32_t reference, double time) {
    const double to = now + time;
    while (next_reading <= to) {
      pass(next_reading - now);
      slave.read(config.transducer.count(actuator.length()), reference);
      next_reading += 341e-6;
    }
    pass(to - now);
  }
  void pass(double dt) {
    actuator.advance(slave.current(), dt, std::exp(-dt / config.actuator.tau));
    now += dt;
  }

  plant::PlantConfig config;
  plant::Actuator actuator;
  plant::LegSlave slave;
  double now = 0.0, next_reading = 150e-6;
};

TEST(FeedForward, LegFollowsASineWithoutItsLag) {  // both directions; published: 18 and 27 percent
  const Experiment e = experiment("z_sine", kAll);
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
  const ServoModel servo = experiment("z_sine", kAll).controller.servo;
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
  const ServoModel servo = experiment("z_sine", kAll).controller.servo;
  ServoModel late = servo;
  late.delay.setConstant(0.004);
  for (const double v : {-0.3, 0.2}) {
    const LegMotion legs{Vec6::Constant(1.5), Vec6::Constant(v), Vec6::Zero()};
    const Vec6 more =
        feedForward(late, legs, 0.0, 0.01, 1.0) - feedForward(servo, legs, 0.0, 0.01, 1.0);
    EXPECT_LT((more.array() - 0.004 * v).abs().maxCoeff(), 1e-12) << v;
  }
}

TEST(FeedForward, ShareZeroIsTheReportsReference) {
  const ServoModel servo = experiment("z_sine", kAll).controller.servo;
  const LegMotion legs{Vec6::Constant(1.5), Vec6::Constant(0.3), Vec6::Constant(-2.0)};
  EXPECT_EQ(feedForward(servo, legs, 0.01, 0.01, 0.0), legs.L);
}

class Derivative : public testing::TestWithParam<int> {};  // K_D of the LegSlave

TEST_P(Derivative, ServoObserverKnowsSpeedAndLengthBelowACount) {
  Experiment e = experiment("z_sine", kAll);
  e.plant.leg_slave.K_D = GetParam();
  e.controller.servo.derivative =
      plant::nominalServo(e.plant.leg_slave, e.plant.actuator, e.plant.transducer).derivative;
  const double T = 0.01, scale = e.plant.transducer.scale;
  Leg leg(e.plant, 1.5);
  ServoObserver observer(e.controller.servo, T);
  observer.reset(Vec6::Constant(1.5));
  std::mt19937 random(11);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  double length = 0.0, speed = 0.0, fastest = 0.0, rate = 0.0;
  int n = 0;
  for (int k = 0; k < 2000; ++k) {
    rate = 0.98 * rate + 0.002 * u(random);  // [m/s]
    const double r = 1.5 + 0.02 * std::sin(0.004 * k) + rate;
    const LegCounts counts = legCounts(e.controller.legs, Vec6::Constant(r));
    leg.run(counts[0], T);
    observer.advance(legLengths(e.controller.legs, counts));
    LegCounts read{};
    read.fill(e.plant.transducer.count(leg.actuator.length()));
    observer.correct(legLengths(e.controller.legs, read));
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
  const Experiment e = experiment("z_sine", kAll);
  const double scale = e.plant.transducer.scale, edge = e.plant.transducer.offset + 9000 * scale;
  ServoObserver observer(e.controller.servo, 0.01);
  for (const double part : {-0.45, -0.2, 0.0, 0.3, 0.45}) {
    observer.reset(Vec6::Constant(edge + part * scale));
    const Vec6 rounding = observer.rounding(Vec6::Zero());
    EXPECT_LT((rounding.array() + part * scale).abs().maxCoeff(), 1e-9 * scale) << part;
  }
  // Over many counts it has no mean.
  Vec6 mean = Vec6::Zero();
  for (int n = 0; n < 200; ++n) {
    observer.reset(Vec6::Constant(edge + n * 0.371 * scale));
    mean += observer.rounding(Vec6::Constant(0.3)) / 200;
  }
  EXPECT_LT(mean.cwiseAbs().maxCoeff(), 0.05 * scale);
}

TEST(ServoObserver, RestsWhereItIsReset) {
  const Experiment e = experiment("z_sine", kAll);
  ServoObserver observer(e.controller.servo, 0.01);
  observer.reset(Vec6::Constant(1.5));
  for (int k = 0; k < 20; ++k) observer.advance(Vec6::Constant(1.6));
  EXPECT_GT(observer.velocity()(0), 0.02);
  observer.reset(Vec6::Constant(1.4));
  EXPECT_EQ(observer.velocity(), Vec6::Zero());
  for (int k = 0; k < 5; ++k) {
    observer.advance(Vec6::Constant(1.4));
    EXPECT_LT((observer.length().array() - 1.4).abs().maxCoeff(), e.plant.transducer.scale);
  }
}

TEST(ServoObserver, ReadingBoundsItWhateverTheModel) {
  Experiment e = experiment("z_sine", kAll);
  e.controller.servo.extend *= 1.5;
  e.controller.servo.jitter = 0.0;
  ServoObserver observer(e.controller.servo, 0.01);
  observer.reset(Vec6::Constant(1.5));
  for (int k = 0; k < 50; ++k) {
    observer.advance(Vec6::Constant(1.5 + 0.001 * k));
    const Vec6 read = Vec6::Constant(1.5 + 0.0003 * k);
    observer.correct(read);
    EXPECT_LE((observer.length() - read).cwiseAbs().maxCoeff(),
              0.5 * e.plant.transducer.scale * (1 + 1e-9));
  }
}

}  // namespace
}  // namespace ves
