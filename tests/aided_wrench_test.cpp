// SPDX-License-Identifier: BSD-3-Clause
//
// The modelled reaction of the joints, and what of a residual is let pass.
#include "ves/control/aided_wrench.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <limits>
#include <random>

#include "support/rig.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/math/dense.hpp"

namespace ves {
namespace {

using test::kTick;

const std::vector<std::string> kAided = {
    "controller.compensation.feed_forward=true", "controller.compensation.observer=true",
    "controller.compensation.inertia=true", "controller.compensation.wrench=aided"};

ControllerConfig config(const std::vector<std::string>& more = {}) {
  std::vector<std::string> set = kAided;
  set.insert(set.end(), more.begin(), more.end());
  return test::experiment("puma_on_table_4_1", set).controller;
}

// The reaction of the joints

constexpr double kMass = 12.0, kReach = 0.7, kInertia = 0.9;  // [kg], [m], [kg m^2] about z
constexpr double kSwing = 0.6, kRate = 2.0 * M_PI * 0.8;      // [rad], [rad/s]
const Vec3 kAxle(0.2, -0.1, 0.5);                             // [m] in P

/// One link that turns about z at kAxle.
ControllerConfig pendulum(ControllerConfig c) {
  Payload& payload = c.payload;
  payload = {};
  payload.X_PR.p = kAxle;
  payload.robot.size = payload.robot.joints = 1;
  Link& link = payload.robot.links[0];
  link.body.mass = kMass;
  link.body.p_BoBcm_B = {kReach, 0.0, 0.0};
  link.body.I_Bcm_B = Vec3(0.1, kInertia, kInertia).asDiagonal();
  return c;
}

double angle(double t) { return kSwing * std::sin(kRate * t); }

/// Momentum about Po on a platform at rest, written out: a mass on a circle, and what turns it.
Vec6 momentum(double t) {
  const double q = angle(t), rate = kSwing * kRate * std::cos(kRate * t);
  const Vec3 radial(std::cos(q), std::sin(q), 0.0), tangent(-std::sin(q), std::cos(q), 0.0);
  const Vec3 P = kMass * kReach * rate * tangent;
  return (Vec6() << P, (kAxle + kReach * radial).cross(P) + kInertia * rate * Vec3::UnitZ())
      .finished();
}

/// F_Po_P of it on a platform that turns at w_IP_P.
Vec6 reaction(double t, const Vec3& w) {
  constexpr double h = 1e-5;  // [s]
  const Vec6 H = momentum(t);
  const Vec6 turned = (Vec6() << w.cross(H.head<3>()), w.cross(H.tail<3>())).finished();
  return -(momentum(t + h) - momentum(t - h)) / (2.0 * h) - turned;
}

/// Behind w^2 / (s^2 + sqrt(2) w s + w^2) by small Runge-Kutta steps, averaged over `window` [s] up
/// to `until`.
Vec6 filtered(double w, double until, double window, const Vec3& turning = Vec3::Zero()) {
  constexpr double h = 4e-4;
  Vec6 y = Vec6::Zero(), v = Vec6::Zero(), sum = Vec6::Zero();
  int n = 0;
  const auto a = [&](double t, const Vec6& y_, const Vec6& v_) -> Vec6 {
    return w * w * (reaction(t, turning) - y_) - M_SQRT2 * w * v_;
  };
  for (int k = 0; k * h < until - 0.5 * h; ++k) {
    const double t = k * h;
    const Vec6 k1 = a(t, y, v), v2 = v + 0.5 * h * k1, k2 = a(t + 0.5 * h, y + 0.5 * h * v, v2),
               v3 = v + 0.5 * h * k2, k3 = a(t + 0.5 * h, y + 0.5 * h * v2, v3), v4 = v + h * k3,
               k4 = a(t + h, y + h * v3, v4);
    const Vec6 before = y;
    y += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
    v += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    if (t > until - window - 0.5 * h) sum += 0.5 * (before + y), ++n;
  }
  return n > 0 ? Vec6(sum / n) : y;
}

TEST(JointMomentum, IsWhatTheSensorShowsOfALinkThatSwings) {
  for (const auto& [averaged, late, turning] :
       {std::tuple{false, 0.0, Vec3(0.0, 0.0, 0.0)}, std::tuple{true, 0.0, Vec3(0.0, 0.0, 0.0)},
        std::tuple{false, 0.002, Vec3(0.0, 0.0, 0.0)},
        std::tuple{true, 0.002, Vec3(0.4, -0.7, 0.5)},
        std::tuple{false, 0.0, Vec3(0.4, -0.7, 0.5)}}) {
    ControllerConfig c =
        pendulum(config({averaged ? "sensor.readings_per_tick=4" : "sensor.readings_per_tick=1"}));
    c.servo.sensor_delay = late;
    KnownPayload known(c);
    JointMomentum joints(c);
    Vec6 most = Vec6::Zero(), off = Vec6::Zero();
    for (int k = 0; k <= 150; ++k) {
      Sample s;
      s.time = s.wrench_time = s.joints_time = k * kTick;
      s.q(0) = angle(1e-2 * k);
      joints.update(known, s, Mat3::Identity(), Mat3::Identity(), 1e-2);
      const Vec6 F = joints.shown(turning).stacked();
      if (k < 50 || k % 5 != 0) continue;
      const Vec6 should =
          filtered(c.servo.sensor_cutoff, 1e-2 * k - late, averaged ? 1e-2 : 0.0, turning);
      most = most.cwiseMax(should.cwiseAbs());
      off = off.cwiseMax((F - should).cwiseAbs());
    }
    for (int i = 0; i < 6; ++i) EXPECT_LE(off(i), 0.005 * most(i) + 1e-9) << i << averaged << late;
  }
}

TEST(JointMomentum, KnowsSamplesThatComeUnevenlyAndAWrenchThatIsOlder) {
  const ControllerConfig c = pendulum(config());
  KnownPayload known(c);
  JointMomentum joints(c);
  std::mt19937 random(5);
  std::uniform_int_distribution<std::int64_t> jitter(-2'000'000, 2'000'000);
  double off = 0.0, most = 0.0;
  for (int k = 1; k <= 200; ++k) {
    Sample s;
    s.time = s.joints_time = k * kTick + jitter(random);
    s.wrench_time = s.joints_time - 4'000'000;
    s.q(0) = angle(1e-9 * static_cast<double>(s.joints_time));
    joints.update(known, s, Mat3::Identity(), Mat3::Identity(), 1e-2);
    const double F = joints.shown(Vec3::Zero()).f(1);
    if (k < 50 || k % 10 != 0) continue;
    const double should =
        filtered(c.servo.sensor_cutoff, 1e-9 * static_cast<double>(s.wrench_time), 0.0)(1);
    off = std::max(off, std::abs(F - should));
    most = std::max(most, std::abs(should));
  }
  EXPECT_LT(off, 0.01 * most);
}

TEST(JointMomentum, JointsThatStandGiveNoneAndAPauseBeginsAnew) {
  const ControllerConfig c = pendulum(config());
  KnownPayload known(c);
  JointMomentum joints(c);
  for (int k = 0; k < 20; ++k) {
    Sample s;
    s.wrench_time = s.joints_time = k * kTick;
    s.q(0) = 0.7;
    joints.update(known, s, Mat3::Identity(), Mat3::Identity(), 1e-2);
    EXPECT_EQ(joints.shown(Vec3::Zero()).stacked(), Vec6(Vec6::Zero()));
    EXPECT_EQ(joints.force().stacked(), Vec6(Vec6::Zero()));
  }
  joints.reset(JointVector::Zero());
  for (int k = 0; k < 2; ++k) {  // where it was before the pause is no speed
    Sample s;
    s.wrench_time = s.joints_time = (500 + k) * kTick;
    s.q(0) = -0.7 + 0.1 * k;
    joints.update(known, s, Mat3::Identity(), Mat3::Identity(), 1e-2);
    EXPECT_EQ(joints.shown(Vec3::Zero()).stacked(), Vec6(Vec6::Zero()));
    EXPECT_EQ(joints.force().stacked(), Vec6(Vec6::Zero()));
  }
}

TEST(JointMomentum, StaysWhereADriverOfTheJointsIsSlowerThanTheTick) {
  for (const bool averaged : {false, true})
    for (const int every : {2, 3}) {  // [-] ticks
      const ControllerConfig c = pendulum(
          config({averaged ? "sensor.readings_per_tick=4" : "sensor.readings_per_tick=1"}));
      KnownPayload known(c);
      JointMomentum joints(c);
      double off = 0.0, most = 0.0;
      for (int k = 0; k <= 150; ++k) {
        Sample s;
        s.time = s.wrench_time = k * kTick;
        s.joints_time = k / every * every * kTick;
        s.q(0) = angle(1e-2 * (k / every * every));
        joints.update(known, s, Mat3::Identity(), Mat3::Identity(), 1e-2);
        const double F = joints.shown(Vec3::Zero()).f(1);
        if (k < 50) continue;
        const double should = filtered(c.servo.sensor_cutoff, 1e-2 * k, averaged ? 1e-2 : 0.0)(1);
        off = std::max(off, std::abs(F - should));
        most = std::max(most, std::abs(should));
      }
      // A line through the last two reactions, up to twice that far ahead.
      EXPECT_LT(off, 0.02 * every * every * most) << averaged << every;
    }
}

TEST(JointMomentum, AnglesThatAreOlderBeginAnew) {
  const ControllerConfig c = pendulum(config());
  KnownPayload known(c);
  JointMomentum joints(c);
  for (const std::int64_t time : {0, 1, 2, 2, 3, 1, 2, 3}) {
    Sample s;
    s.wrench_time = s.joints_time = time * kTick;
    s.q(0) = angle(1e-2 * static_cast<double>(time));
    joints.update(known, s, Mat3::Identity(), Mat3::Identity(), 1e-2);
    EXPECT_TRUE(joints.shown(Vec3::Zero()).stacked().allFinite()) << time;
    EXPECT_TRUE(joints.force().stacked().allFinite()) << time;
  }
}

// A reading that is older or younger than the wrench is carried there, as fast as of late, wherever
// inertia is compensated.
TEST(JointMomentum, CarriesReadingsToTheTimeOfTheWrench) {
  for (const bool compensated : {false, true}) {
    ControllerConfig c = pendulum(config());
    c.compensation.inertia = compensated;
    KnownPayload known(c);
    JointMomentum joints(c);
    Sample s;
    for (int k = 0; k < 60; ++k) {
      s.time = s.wrench_time = k * kTick;
      s.joints_time = (k * kTick) / 13'000'000 * 13'000'000;  // every 13 ms
      s.q(0) = 0.3 + 0.4e-9 * static_cast<double>(s.joints_time);
      const double now = 0.3 + 0.4e-9 * static_cast<double>(s.time);
      joints.update(known, s, Mat3::Identity(), Mat3::Identity(), 1e-2);
      if (k > 3) {
        EXPECT_NEAR(joints.at(s)(0), compensated ? now : s.q(0), 1e-12) << k;
      }
    }
    s.joints_time = s.wrench_time;  // as old as the wrench: the reading
    EXPECT_EQ(joints.at(s), s.q);
    // A wrench that is a mean over a window that ended before is older.
    s.joints_time = s.time + kTick;
    s.wrench_time = s.joints_time - 8'000'000;
    s.q(0) = 0.3 + 0.4e-9 * static_cast<double>(s.joints_time);
    joints.update(known, s, Mat3::Identity(), Mat3::Identity(), 1e-2);
    const double then = 0.3 + 0.4e-9 * static_cast<double>(s.wrench_time);
    EXPECT_NEAR(joints.at(s)(0), compensated ? then : s.q(0), 1e-12);
    // Of a reading that is older than others, or that was there already, nothing is divided.
    s.joints_time -= 13'000'000;
    EXPECT_TRUE(joints.at(s).allFinite());
    joints.update(known, s, Mat3::Identity(), Mat3::Identity(), 1e-2);
    EXPECT_EQ(joints.at(s), s.q);
  }
}

// Readings that scatter make a momentum that scatters no more than is reckoned with, and no less
// than a quarter of it.
TEST(JointMomentum, ScattersAsItsReadingsAreBelievedTo) {
  constexpr double kScatter = 1e-4;                                  // [rad]
  for (const std::int64_t interval : {0, 13'000'000, 20'000'000}) {  // [ns]
    ControllerConfig c = pendulum(config({"sensor.readings_per_tick=4"}));
    c.joints.interval = 1e-9 * static_cast<double>(interval);
    c.joints.deviation(0) = kScatter;
    KnownPayload known(c);
    JointMomentum joints(c);
    std::mt19937 random(3);
    std::normal_distribution<double> scatter(0.0, kScatter);
    double squares = 0.0, q = 0.0;
    std::int64_t read = -1;
    constexpr int kTicks = 5000;
    for (int k = 0; k < kTicks; ++k) {
      Sample s;
      s.time = s.wrench_time = k * kTick;
      s.joints_time = interval > 0 ? s.time / interval * interval : s.time;
      if (s.joints_time != read) q = scatter(random);
      read = s.joints_time;
      s.q(0) = q;
      joints.update(known, s, Mat3::Identity(), Mat3::Identity(), 1e-2);
      if (k >= 10) squares += std::pow(joints.q_dot()(0), 2) / (kTicks - 10);
    }
    const double foretold = kScatter * JointParabola(c).speed;
    EXPECT_LT(std::sqrt(squares), foretold) << interval;
    EXPECT_GT(std::sqrt(squares), foretold / 4.0) << interval;
  }
}

// So many readings that their scatter and a steady jerk put the speed at their end off alike: both
// by a fit of its own.
TEST(JointParabola, IsLaidThroughAsManyReadingsAsNoiseAndJerkAskFor) {
  ControllerConfig c = config({"sensor.readings_per_tick=4"});
  int most = 0;
  for (const double period : {0.01, 0.02})
    for (const double scatter : {1e-6, 1e-5, 1e-4, 1e-3})
      for (const double jerk : {3.0, 30.0, 300.0}) {
        c.joints.interval = period;
        c.joints.deviation.setConstant(scatter);
        c.compensation.joint_jerk = jerk;
        // Of a parabola through n readings, the newest at 0: the speed there of 1/6 jerk t^3 and of
        // readings that scatter.
        const auto offBy = [&](int n) {
          Eigen::MatrixXd powers(n, 3);
          Eigen::VectorXd cubic(n);
          for (int i = 0; i < n; ++i) {
            const double t = -i * period;
            powers.row(i) << 1.0, t, t * t;
            cubic(i) = jerk * t * t * t / 6.0;
          }
          const Eigen::MatrixXd fit =
              powers.colPivHouseholderQr().solve(Eigen::MatrixXd::Identity(n, n));
          return std::pair(std::abs(fit.row(1).dot(cubic)), scatter * fit.row(1).norm());
        };
        const int n = JointParabola(c).readings;
        SCOPED_TRACE(fmt::format("{} s, {} rad, {} rad/s^3: {}", period, scatter, jerk, n));
        most = std::max(most, n);
        if (n < JointParabola::kMost) {
          EXPECT_GT(offBy(n).first, 0.7 * offBy(n).second);
        }
        if (n > 3) {
          EXPECT_LT(offBy(n - 1).first, 1.4 * offBy(n - 1).second);
        }
      }
  EXPECT_GT(most, 20);
}

// The gate

// Means of the simulated sensor's readings scatter as the filter's model foretells.
TEST(SensorNoise, BehindAFilterIsCorrelatedAsTheFilterSays) {
  for (const int readings : {1, 4}) {
    const Experiment e = test::experiment("puma_on_table_4_1",
                                          {fmt::format("sensor.readings_per_tick={}", readings)});
    plant::ForceTorqueSensor sensor(e.plant.sensor, plant::Noise(3));
    const double period = e.controller.periodSeconds();
    constexpr int kSteps = 20;  // [-] of a period
    const auto step = sensor.prepare(period / kSteps);
    const Vec6 bias = e.plant.sensor.bias / e.plant.sensor.volts_per_count;
    sensor.settle({});
    constexpr int kMeans = 4000, kSamples = 50;
    double once = 0.0, of_means = 0.0;  // [count^2]
    for (int k = 0; k < kMeans; ++k) {
      Vec6 mean = Vec6::Zero();
      for (int i = 0; i < kSamples; ++i) {
        Vec6 sample = Vec6::Zero();
        for (int r = 0; r < readings; ++r) {
          for (int j = 0; j < kSteps / readings; ++j)
            sensor.advance(step, {}, plant::ForceTorqueSensor::Over::kConstant);
          const AdcCounts adc = sensor.convert(0.0);
          for (int c = 0; c < kWrenchChannels; ++c)
            sample(c) += (adc[static_cast<std::size_t>(c)] - bias(c)) / readings;
        }
        once += sample.squaredNorm() / kSamples / kMeans;
        mean += sample / kSamples;
      }
      of_means += mean.squaredNorm() / kMeans;
    }
    const double foretold = filteredCorrelation(e.controller.servo, period);
    EXPECT_NEAR(kSamples * of_means / once, foretold, 0.06 * foretold) << readings;
  }
}

/// [count] deviations of 5, the mean of a calibration independent samples' mean.
ResidualNoise noiseOfFive() {
  ResidualNoise n;
  n.sensor.variance.setConstant(25.0);
  return n;
}

TEST(ResidualGate, PassesWhatIsMoreThanNoiseAndWhatIsNotKnown) {
  const ResidualGate gate(config());
  const auto exceeds = [&](int samples, double mean, double unknown, int channel) {
    return gate.exceeds(samples, mean * Vec6::Unit(channel), noiseOfFive(),
                        Vec6::Constant(unknown));
  };
  // Bounds: 4.5 * sqrt(25 / n + unknown) for means of n.
  for (const auto& [samples, unknown, most] :
       {std::tuple{1, 0.0, 22.5}, std::tuple{1, 0.25, 22.612}, std::tuple{5, 0.25, 10.312},
        std::tuple{20, 0.25, 5.511}, std::tuple{200, 0.25, 2.756}, std::tuple{200, 25.0, 22.556}})
    for (const int channel : {0, 5}) {
      EXPECT_FALSE(exceeds(samples, 0.999 * most, unknown, channel)) << samples;
      EXPECT_FALSE(exceeds(samples, -0.999 * most, unknown, channel)) << samples;
      EXPECT_TRUE(exceeds(samples, 1.001 * most, unknown, channel)) << samples;
      EXPECT_TRUE(exceeds(samples, -1.001 * most, unknown, channel)) << samples;
      const Vec6 two = 1.5 * most * Vec6::Unit(channel) - 0.4 * most * Vec6::Unit(2);
      EXPECT_NEAR(gate.excess(samples, two, noiseOfFive(), Vec6::Constant(unknown)), 1.5, 1e-3);
    }
}

TEST(ResidualGate, ANumberThatIsNonePasses) {  // so that the safety checks see it
  const ResidualGate gate(config());
  Vec6 residual = Vec6::Zero();
  residual(4) = std::numeric_limits<double>::quiet_NaN();
  for (const int samples : ResidualGate::kMeans)
    EXPECT_TRUE(gate.exceeds(samples, residual, noiseOfFive(), Vec6::Zero()));
}

TEST(ResidualGate, AllowsForTheLegsAndTheWeight) {
  const ControllerConfig c = config();
  const ResidualGate gate(c);
  const auto passes = [&](double residual, const ResidualNoise& noise) {
    return gate.exceeds(1, residual * Vec6::Unit(0), noise, Vec6::Constant(0.25));
  };
  ResidualNoise noise = noiseOfFive();
  noise.weight.setConstant(75.0);  // 4.5 sqrt(100.25)
  EXPECT_FALSE(passes(45.0, noise));
  EXPECT_TRUE(passes(45.1, noise));
  noise = noiseOfFive();
  const double one = largestFelt(c.servo, 0.01, 1);
  noise.legs.setConstant(10.0 / one);
  EXPECT_FALSE(passes(22.6 + 9.9, noise));
  EXPECT_TRUE(passes(22.7 + 10.1, noise));
}

TEST(AidedWrench, KnowsWhatRoundedLegsMakeOfWeightAndInertia) {
  // A leg's length that is off by a little turns the platform for the controller, not for the
  // sensor: what gravity compensation then leaves, by the routines of the tick themselves.
  const ControllerConfig c = config({"controller.still.bias_v=9"});
  const Transform X_IP = c.geometry.fromHome({{0.03, -0.02, 0.01}, {0.1, -0.15, 0.2}});
  const JointVector q = c.payload.robot.joints > 0 ? JointVector(JointVector::Constant(0.3))
                                                   : JointVector(JointVector::Zero());
  const Wrench F_So_S = staticWrench(c.payload, q, X_IP.R, c.gravity);
  AdcCounts adc{};
  const Vec6 counts = inverse(c.sensor.C_proc) * F_So_S.stacked();
  const auto left = [&](const Transform& believed) -> Vec6 {  // [count]
    const Wrench F = rotate(believed.R, transfer(c.sensor.X_PS, F_So_S)) -
                     gravityCompensation(c.payload, believed.R,
                                         staticWrench(c.payload, q, believed.R, c.gravity));
    return inverse(c.sensor.C_proc) *
           transfer(inverse(c.sensor.X_PS), rotate(X_IP.R.transpose(), F)).stacked();
  };
  const RigidBody robot =
      combine(RigidBody{}, c.payload.X_PL0(), compositeBody(carried(c.payload), q));
  const Mat6 M_1 = spatialMass(rotated(X_IP.R, robot));
  Vec6 weight = Vec6::Zero(), legs = Vec6::Zero();
  const Vec6 L = legLengths(c.geometry, X_IP);
  for (int i = 0; i < kLegs; ++i) {
    constexpr double kStep = 1e-6;  // [m]
    const auto moved = [&](double by) {
      return forwardPose(c.geometry, L + by * Vec6::Unit(i), X_IP).X_IP;
    };
    weight += ((left(moved(kStep)) - left(moved(-kStep))) / (2.0 * kStep)).cwiseAbs2();
    const Transform up = moved(kStep), down = moved(-kStep);
    Vec6 twist;
    const Mat3 turn = (up.R * down.R.transpose() - down.R * up.R.transpose()) / 2.0;
    twist << up.p - down.p, turn(2, 1), turn(0, 2), turn(1, 0);
    twist /= 2.0 * kStep;
    const double K = std::max(c.servo.extend(i), c.servo.retract(i)) * c.servo.readings.scale(i);
    const Wrench inertial = Wrench::from(M_1 * twist);
    legs += (K * (inverse(c.sensor.C_proc) *
                  transfer(inverse(c.sensor.X_PS), rotate(X_IP.R.transpose(), inertial)).stacked()))
                .cwiseAbs2();
  }
  weight *= std::pow(c.servo.readings.scale(0), 2) / 12.0;

  // Calibrated at once: a hundred samples of what the sensor reads.
  SensorBias bias(c);
  bias.beginCalibration();
  for (int i = 0; i < kWrenchChannels; ++i)
    adc[static_cast<std::size_t>(i)] = static_cast<int>(std::lround(counts(i)));
  SampleStream samples(c.period);
  JointMomentum joints(c);
  AidedWrench aided(c);
  Sample s;
  s.q = q;
  s.adc = adc;
  for (int k = 0; k <= kCalibrationSamples; ++k) {
    s.sequence = k;
    s.time = s.legs_time = s.wrench_time = s.joints_time = k * kTick;
    samples.update(s, s.time, true, false);
    bias.calibrate(s, true, counts);
  }
  ASSERT_TRUE(bias.calibrated());
  const Wrench static_wrench = gravityCompensation(c.payload, X_IP.R, F_So_S);
  LegMotion standing;
  standing.L = L;
  RobotInertia inertia(c);
  inertia.update(KnownPayload(c), 0, q, 0.0, X_IP, X_IP.R, standing, true, 1.0);
  joints.reset(q);
  aided.update({Wrench{}, static_wrench, carried(c.payload), inertia, joints, samples, bias, X_IP,
                Emulated{}, 1.0, false},
               true);
  EXPECT_LT((aided.noise().weight - weight).norm(), 1e-4 * weight.norm());
  EXPECT_LT((aided.noise().legs - legs.cwiseSqrt()).norm(), 1e-4 * legs.cwiseSqrt().norm());
}

TEST(AidedWrench, PassesEverythingBeforeACalibration) {
  test::Rig rig(test::experiment(
      "srms_low_hover_puma",
      {kAided[0], kAided[1], kAided[2], kAided[3], "sensor.noise=false",
       "sensor.bias_v=[0, 0, 0, 0, 0, 0]", "program=[{admittance: {duration_s: 2}}]"}));
  rig.tick(Request::kStart);
  for (int i = 0; i < 500 && !test::done(rig.state()); ++i) EXPECT_FALSE(rig.tick().withholds);
  EXPECT_EQ(rig.state().phase, Phase::kParked);
}

// Afloat, nothing touches: when the joints stand again, so does the base, and it is where its mass
// and the robot's let it be. The sensor's noise makes no difference.
TEST(AidedWrench, LosesNoMomentumAfloat) {
  for (const char* noise : {"false", "true"}) {
    const Experiment e = test::experiment(
        "puma_on_table_4_1",
        {kAided[0], kAided[1], kAided[2], kAided[3], "sensor.readings_per_tick=4",
         std::string("sensor.noise=") + noise, "gravity_m_per_s2=0", "initial_pose={}",
         "base.mass_diagonal=[500, 500, 500, 120, 120, 120]",
         "base.damping_diagonal=[0, 0, 0, 0, 0, 0]", "base.stiffness_diagonal=[0, 0, 0, 0, 0, 0]",
         "program=[{calibration: {}}, {admittance: {duration_s: 9}, robot: ["
         "{at_s: 1, duration_s: 2, joint: joint_2, to_deg_or_m: -60},"
         "{at_s: 1.5, duration_s: 2, joint: joint_1, to_deg_or_m: 40},"
         "{at_s: 5, duration_s: 2, joint: joint_1, to_deg_or_m: -20},"
         "{at_s: 5.3, duration_s: 2, joint: joint_3, to_deg_or_m: 120}]}]"});
    test::Rig rig(e);
    rig.run(20);
    rig.tick(Request::kStart);
    double most = 0.0;
    TickState last;
    rig.until([&](const TickState& s) {
      if (s.kind == SegmentKind::kAdmittance && s.phase == Phase::kRunning) {
        most = std::max(most, s.motion.x_dot.head<3>().norm());
        last = s;
      }
      return test::done(s);
    });
    EXPECT_GT(most, 1e-3);
    EXPECT_LT(last.motion.x_dot.head<3>().norm(), 5e-5) << noise;  // [m/s]
    EXPECT_LT(last.motion.x_dot.tail<3>().norm(), 5e-4) << noise;
  }
}

TEST(LargestFelt, IsTheLagsAloneBehindAQuickFilterAndTheWholeStepOverALongTime) {
  ServoModel servo = config({"sensor.readings_per_tick=4"}).servo;
  const double tau = servo.tau(0);
  // All of 1 m/s in two seconds; the filter overshoots by 4.3 %, behind the lag by less.
  EXPECT_GT(largestFelt(servo, 0.01, 200), 1.0 / 2.0);
  EXPECT_LT(largestFelt(servo, 0.01, 200), 1.043 / 2.0);
  servo.sensor_cutoff = 1e4;
  EXPECT_NEAR(largestFelt(servo, 0.01, 1), (1.0 - std::exp(-0.01 / tau)) / 0.01, 0.5);
  servo.sensor_window = 0.0;
  EXPECT_NEAR(largestFelt(servo, 0.01, 1), 1.0 / tau, 0.03 / tau);  // of the first instant
}

}  // namespace
}  // namespace ves
