// SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <random>

#include "support/poses.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/config/experiment.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/math/dense.hpp"
#include "ves/robot/newton_euler.hpp"
#include "ves/srms/modes.hpp"

namespace ves {
namespace {

constexpr double kT = 0.01;  // [s]

using test::experiment;

Mat6 randomDefinite(unsigned seed, double scale) {
  std::mt19937 random(seed);
  std::normal_distribution<double> n;
  Mat6 A;
  for (int i = 0; i < 36; ++i) A(i) = n(random);
  return scale * (A * A.transpose() + Mat6::Identity());
}

// --- Force measurement, calibration, gravity compensation ---------------------------------------

TEST(ForceMeasurement, UndoesSensorAndFrames) {  // (2.6) forward, (C.1) back
  const Experiment e = experiment("puma_tilt");
  const Mat6 S_proc = e.plant.sensor.S_proc();
  for (const Pose& x : test::poses(50)) {
    const Mat3 R_IP = rotation(x.rpy);
    const Wrench F_Po_I{Vec3(30.0, -20.0, 100.0), Vec3(9.0, 12.0, -3.0)};
    // Inertial to platform, to the sensor's origin, to the sensor's axes, written out.
    const Vec3 f_P = R_IP.transpose() * F_Po_I.f, n_P = R_IP.transpose() * F_Po_I.n;
    const Vec3 p = e.controller.sensor.X_PS.p;
    const Vec3 n_So = n_P - p.cross(f_P);
    Vec6 W_S;
    W_S << f_P.x(), -f_P.y(), -f_P.z(), n_So.x(), -n_So.y(), -n_So.z();  // 180 degrees about x
    const Vec6 bias = Vec6::Constant(37.0);
    const Vec6 counts = S_proc * W_S + bias;
    AdcCounts adc{};
    for (int i = 0; i < 6; ++i)
      adc[static_cast<std::size_t>(i)] = static_cast<int>(std::lround(counts(i)));
    const Wrench out = forceMeasurement(e.controller.sensor, bias, adc, R_IP);
    // Half a count in each channel is 0.023 N (x, y), 0.09 N (z), 0.009 N m at gain 1000.
    ASSERT_LT((out.f - F_Po_I.f).norm(), 0.11);
    ASSERT_LT((out.n - F_Po_I.n).norm(), 0.03);
  }
}

// Covariance is of what a count in each channel makes of the wrench, by the measurement itself.
TEST(ForceMeasurement, TurnsTheNoiseOfItsChannelsWithIt) {
  const ForceSensor& sensor = test::puma().sensor;
  const Mat3 R_IP = rotation(Vec3(0.3, -0.2, 1.1));
  SensorNoise noise;
  noise.variance << 4.0, 9.0, 1.0, 0.0, 25.0, 2.0;
  noise.correlation = 2.5;
  const Vec6 none = forceMeasurement(sensor, Vec6::Zero(), {}, R_IP).stacked();
  Mat6 expected = Mat6::Zero();
  for (int i = 0; i < 6; ++i) {
    AdcCounts one{};
    one[static_cast<std::size_t>(i)] = 1;
    const Vec6 d = forceMeasurement(sensor, Vec6::Zero(), one, R_IP).stacked() - none;
    expected += 2.5 * noise.variance(i) * d * d.transpose();
  }
  EXPECT_LT((wrenchNoise(sensor, noise, R_IP) - expected).norm(), 1e-12 * expected.norm());
}

TEST(ChannelStatistics, GivesMeanAndStandardDeviation) {
  ChannelStatistics calibration;
  std::mt19937 random(2);
  std::uniform_int_distribution<int> u(-1000, 1000);
  std::vector<double> x;
  const Vec6 load = Vec6::Constant(10.0);
  while (!calibration.complete()) {
    AdcCounts adc{};
    adc[2] = 20000 + u(random);
    x.push_back(adc[2] - 10.0);
    calibration.add(adc, load);
  }
  ASSERT_EQ(x.size(), 100u);
  double mean = 0.0, variance = 0.0;
  for (double v : x) mean += v / 100;
  for (double v : x) variance += (v - mean) * (v - mean) / 99;
  EXPECT_NEAR(calibration.mean()(2), mean, 1e-9);
  EXPECT_NEAR(calibration.deviation()(2), std::sqrt(variance), 1e-9);
  EXPECT_NEAR(calibration.mean()(0), -10.0, 1e-12);
  EXPECT_NEAR(calibration.deviation()(0), 0.0, 1e-12);
}

// Two batches of ten that differ by 2 d: their mean is known to d.
TEST(ChannelStatistics, KnowsTheMeanAsWellAsItsBatchesAgree) {
  ChannelStatistics calibration;
  for (int n = 0; n < 20; ++n) {
    AdcCounts adc{};
    adc[2] = n < 10 ? 100 : 140;
    calibration.add(adc, Vec6::Zero());
    if (n == 18) {
      EXPECT_EQ(calibration.standardError(), Vec6(Vec6::Zero()));
    }
  }
  EXPECT_NEAR(calibration.standardError()(2), 20.0, 1e-12);
}

TEST(GravityCompensation, IsTheSumOfWeightsAtKdlsPositions) {
  for (const auto& [scenario, urdf] :
       {std::pair{"puma_tilt", "puma560"}, {"doss_on_table_4_1", "doss"}}) {
    const Experiment e = experiment(scenario);
    const Payload& load = e.controller.payload;
    const KDL::Chain chain = test::kdlChain(urdf);
    KDL::ChainFkSolverPos_recursive solver(chain);
    const Vec3 g_I(0.0, 0.0, -9.81);
    std::mt19937 random(4);
    std::uniform_real_distribution<double> u(-3.0, 3.0);
    for (const Pose& x : test::poses(100)) {
      const Mat3 R_IP = rotation(x.rpy);
      JointVector q = JointVector::Zero();
      KDL::JntArray kdl_q(chain.getNrOfJoints());
      for (unsigned i = 0; i < chain.getNrOfJoints(); ++i) q(i) = kdl_q(i) = u(random);
      Vec3 f = Vec3::Zero(), n = Vec3::Zero();
      const auto add = [&](double mass, const Vec3& p_PC_P) {
        f += mass * g_I;
        n += (R_IP * p_PC_P).cross(mass * g_I);
      };
      const Vec3 p_PL0 = load.X_PR.p + load.X_RL0.p;  // plates and mount are not turned
      add(load.robot.base.mass, p_PL0 + load.robot.base.p_BoBcm_B);
      for (unsigned i = 0; i < chain.getNrOfSegments(); ++i) {
        KDL::Frame frame;
        solver.JntToCart(kdl_q, frame, static_cast<int>(i) + 1);
        const KDL::RigidBodyInertia& body = chain.getSegment(i).getInertia();
        const KDL::Vector c = frame * body.getCOG();
        add(body.getMass(), p_PL0 + Vec3(c.x(), c.y(), c.z()));
      }
      add(16.0, load.X_PR.p);
      add(5.0, load.X_PS.p + Vec3(0.0, 0.0, 0.031));  // the top plate, above the sensor's origin
      const Wrench out = gravityCompensation(load, R_IP, staticWrench(load, q, R_IP, g_I));
      ASSERT_LT((out.f - f).norm() + (out.n - n).norm(), 1e-9);
    }
  }
}

TEST(GravityCompensation, IsTheHandSumAtHome) {  // m g, and r x m g of each plate and link
  const Experiment e = experiment("puma_tilt");
  JointVector zero = JointVector::Zero();
  const Payload& load = e.controller.payload;
  const Wrench F_Po = gravityCompensation(
      load, Mat3::Identity(), staticWrench(load, zero, Mat3::Identity(), {0, 0, -9.81}));
  EXPECT_NEAR(F_Po.f.z(), -9.81 * (52.45 + 16.0 + 5.0), 1e-9);
  EXPECT_NEAR(F_Po.f.head<2>().norm(), 0.0, 1e-9);
  // AKB pose of zeros: moment of links 1 to 6 about frame 0 is (60.31978, -36.98581), of the
  // support on the robot; link 0 adds 20 kg at y = -0.015. The plates are centred.
  EXPECT_NEAR(F_Po.n.x(), -60.31978 + 20.0 * 9.81 * 0.015, 1e-4);
  EXPECT_NEAR(F_Po.n.y(), 36.98581, 1e-4);
}

TEST(GravityCompensation, VanishesInSpace) {
  const Experiment e = experiment("puma_tilt");
  const Mat3 R_IP = rotation({0.3, 0.2, 0.1});
  const Wrench F_So_S =
      staticWrench(e.controller.payload, e.plant.task.initial_joints, R_IP, Vec3::Zero());
  EXPECT_EQ(gravityCompensation(e.controller.payload, R_IP, F_So_S).stacked().norm(), 0.0);
}

// --- Admittance model ---------------------------------------------------------------------------

/// exp([A B; 0 0] T) of M x'' + C x' + K x = W, all six coordinates at once.
class HoldOracle {
 public:
  HoldOracle(const Mat6& M, const Mat6& C, const Mat6& K, double T) {
    Eigen::Matrix<double, 18, 18> A = Eigen::Matrix<double, 18, 18>::Zero();
    const Mat6 inverse = ves::inverse(M);
    A.block<6, 6>(0, 6).setIdentity();
    A.block<6, 6>(6, 0) = -inverse * K;
    A.block<6, 6>(6, 6) = -inverse * C;
    A.block<6, 6>(6, 12) = inverse;
    E_ = exponential(A * T);
  }
  void step(const Vec6& W) {
    Eigen::Matrix<double, 18, 1> s;
    s << x, x_dot, W;
    s = (E_ * s).eval();
    x = s.head<6>();
    x_dot = s.segment<6>(6);
  }
  Vec6 x = Vec6::Zero(), x_dot = Vec6::Zero();

 private:
  Eigen::Matrix<double, 18, 18> E_;
};

struct Base {
  const char* name;
  Mat6 M, C, K;
};
std::ostream& operator<<(std::ostream& out, const Base& base) { return out << base.name; }

std::vector<Base> bases() {
  Vec6 M, C, K, soft;
  M << 500, 500, 500, 250, 250, 250;
  C << 500, 500, 500, 250, 250, 250;
  K << 1500, 2500, 4000, 1500, 1000, 2000;
  soft << 0, 2500, 0, 1500, 0, 0;
  const Mat6 Md = M.asDiagonal(), Cd = C.asDiagonal(), Kd = K.asDiagonal(), zero = Mat6::Zero();
  const Mat6 Mr = randomDefinite(1, 50), Kr = randomDefinite(2, 400), Cr = randomDefinite(3, 60);
  return {{"table_4_1", Md, Cd, Kd},
          {"full_proportional", Mr, Mat6(0.3 * Mr + 0.01 * Kr), Kr},
          {"not_proportional", Mr, Cr, Kr},
          {"overdamped_not_proportional", Mr, Mat6(20 * Cr), Kr},
          {"undamped", Mr, zero, Kr},
          {"partly_free", Md, Cd, Mat6(soft.asDiagonal())},
          {"free_floating", Mr, zero, zero},
          {"free_with_damper", Mr, Cr, zero},
          {"critical", Md, Mat6((2 * (M.array() * K.array()).sqrt()).matrix().asDiagonal()), Kd}};
}

class Admittance : public testing::TestWithParam<Base> {};

TEST_P(Admittance, StepsAsTheMatrixExponential) {
  const auto& [name, M, C, K] = GetParam();
  AdmittanceModel model(modesOf(M, C, K), kT);
  HoldOracle oracle(M, C, K, kT);
  oracle.x << 0.1, -0.08, 0.06, 0.1, -0.1, 0.2;
  model.reset(oracle.x);
  std::mt19937 random(5);
  std::normal_distribution<double> n(0.0, 20.0);
  for (int i = 0; i < 2000; ++i) {
    Vec6 W;
    for (int j = 0; j < 6; ++j) W(j) = n(random);
    model.step(Wrench::from(W));
    oracle.step(W);
    const double scale = 1.0 + oracle.x.norm();
    ASSERT_LT((model.motion().x - oracle.x).norm(), 1e-10 * scale) << "step " << i;
    ASSERT_LT((model.motion().x_dot - oracle.x_dot).norm(), 1e-9 * scale) << "step " << i;
    const Vec6 acceleration = inverse(M) * (W - C * oracle.x_dot - K * oracle.x);  // (C.7)
    ASSERT_LT((model.motion().x_ddot - acceleration).norm(), 1e-7 * scale) << "step " << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Bases, Admittance, testing::ValuesIn(bases()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(AdmittanceModel, KeepsWhatFewModesCannotExpress) {
  ModalModel model;
  model.Phi = Vec6::Unit(2) / std::sqrt(500.0);
  model.stiffness = Eigen::VectorXd::Constant(1, 8.0);
  model.damping = Eigen::MatrixXd::Zero(1, 1);
  AdmittanceModel admittance(model, kT);
  Vec6 x;
  x << 0.01, 0.02, 0.03, 0.04, 0.05, 0.06;
  admittance.reset(x);
  for (int i = 1; i <= 100; ++i) {
    admittance.step({});
    Vec6 expected = x;
    expected(2) = 0.03 * std::cos(std::sqrt(8.0) * kT * i);
    ASSERT_LT((admittance.motion().x - expected).norm(), 1e-12);
  }
}

TEST(AdmittanceModel, IsWhereItIsResetBeforeItsFirstStep) {
  const ControllerConfig c = experiment("puma_on_table_4_1").controller;
  const Vec6 x = Vec6::LinSpaced(-0.03, 0.02);
  for (const double ahead : {0.0, 0.02}) {
    AdmittanceModel model(c.vehicle, kT);
    model.step(Wrench::from(Vec6::Constant(10.0)));
    model.reset(x, Mat6::Zero(), ahead);
    EXPECT_EQ(model.motion().x, x);
    EXPECT_EQ(model.motion().x_dot, Vec6::Zero());
  }
}

TEST(AdmittanceModel, ASlowedStepGoesThatShareOfTheWay) {
  const ControllerConfig c = experiment("puma_on_table_4_1").controller;
  AdmittanceModel model(c.vehicle, kT);
  model.reset(Vec6::LinSpaced(-0.02, 0.03));
  for (int n = 0; n < 40; ++n) model.step(Wrench::from(Vec6::LinSpaced(30.0, -20.0)));
  const PathPoint<6> before = model.motion();
  model.step({});
  const PathPoint<6> after = model.motion();
  const double share = 0.3;
  model.slow(share);
  const PathPoint<6>& slowed = model.motion();
  EXPECT_LT((slowed.x - before.x - share * (after.x - before.x)).norm(), 1e-14);
  EXPECT_LT((slowed.x_dot - share * after.x_dot).norm(), 1e-13);
  EXPECT_LT((slowed.x_ddot - (slowed.x_dot - before.x_dot) / kT).norm(), 1e-11);
}

TEST(Modes, AreMassNormalised) {
  const Mat6 M = randomDefinite(1, 50), K = randomDefinite(2, 400);
  const ModalModel modes = modesOf(M, Mat6::Zero(), K);
  EXPECT_LT((modes.Phi.transpose() * M * modes.Phi - Mat6::Identity()).norm(), 1e-12);
  const Mat6 stiffness = modes.stiffness.asDiagonal();
  EXPECT_LT((modes.Phi.transpose() * K * modes.Phi - stiffness).norm(), 1e-10 * stiffness.norm());
}

TEST(Modes, KeepDampingThatCouples) {
  const ModalModel modes =
      modesOf(randomDefinite(1, 50), randomDefinite(3, 60), randomDefinite(2, 400));
  EXPECT_FALSE(modes.damping.isDiagonal(1e-6));
}

// --- Trajectory generation, leg communication ---------------------------------------------------

TEST(TrajectoryGeneration, RampsAndSinesAreTheReportsEquations) {
  Trajectory trajectory = test::sine(2, 0.1, 0.5, 1.0).trajectory;
  trajectory.motion[0] = AxisMotion::kRamp;
  trajectory.final(0) = 0.2;
  Vec6 initial;
  initial << 0.05, 0.01, -0.02, 0.0, 0.0, 0.3;
  const std::int64_t N = 250;
  Vec6 x = initial;
  for (std::int64_t n = 1; n <= N; ++n) {
    x(0) += (0.2 - 0.05) / 250;  // (C.8), (C.9) accumulated
    x(2) = -0.02 + 0.1 * std::sin(2 * M_PI * 0.5 * 0.01 * static_cast<double>(n));  // (C.10)
    const PathPoint<6> p = trajectoryGeneration(trajectory, initial, n, N, kT);
    ASSERT_LT((p.x - x).norm(), 1e-13);
  }
  EXPECT_EQ(trajectoryGeneration(trajectory, initial, N, N, kT).x(0), 0.2);
  EXPECT_EQ(trajectoryGeneration(trajectory, initial, N + 7, N, kT).x(0), 0.2);
}

TEST(TrajectoryGeneration, RatesAreDerivatives) {
  Trajectory trajectory = test::sine(4, 0.3, 1.5, 1.0).trajectory;
  trajectory.motion[0] = AxisMotion::kRamp;
  trajectory.final(0) = 0.2;
  const auto at = [&](std::int64_t n) {
    return trajectoryGeneration(trajectory, Vec6::Zero(), n, 100000, 1e-5);
  };
  for (std::int64_t n = 10; n < 90000; n += 1000) {
    EXPECT_LT((at(n).x_dot - (at(n + 1).x - at(n - 1).x) / 2e-5).norm(), 1e-6);
    EXPECT_LT((at(n).x_ddot - (at(n + 1).x_dot - at(n - 1).x_dot) / 2e-5).norm(), 1e-5);
  }
}

TEST(LegCommunication, RoundTripsWithinHalfACount) {
  LegCodec codec;
  codec.offset.setConstant(0.9);
  codec.scale.setConstant(0.0254 / 363.6);
  std::mt19937 random(6);
  std::uniform_real_distribution<double> u(1.2, 1.85);
  for (int k = 0; k < 1000; ++k) {
    Vec6 L;
    for (int i = 0; i < 6; ++i) L(i) = u(random);
    ASSERT_LE((legLengths(codec, legCounts(codec, L)) - L).cwiseAbs().maxCoeff(),
              0.5 * 0.0254 / 363.6 * (1 + 1e-9));
  }
}

}  // namespace
}  // namespace ves
