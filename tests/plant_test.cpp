// SPDX-License-Identifier: BSD-3-Clause
#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <gtest/gtest.h>

#include <complex>

#include "support/poses.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/config/experiment.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/control/leg_communication.hpp"

namespace ves::plant {
namespace {

constexpr double kUpdate = 1.023e-3;  // [s]

using test::experiment;

// --- LegSlave ------------------------------------------------------------------------------------

/// Three readings, the second of which updates.
std::int32_t update(LegSlave& slave, int first, int second, int third, int reference) {
  slave.read(first, reference);
  slave.read(second, reference);
  const std::int32_t code = slave.code();
  slave.read(third, reference);
  EXPECT_EQ(slave.code(), code);
  return code;
}

TEST(LegSlave, AveragesTwoReadingsAndIgnoresTheThird) {
  LegSlave slave({8500, 0}, 5000);
  // E = 5010 - (5000 + 5003)/2 = 8.5 counts; 8500 * 8.5 / 256 = 282.2 digits.
  EXPECT_EQ(update(slave, 5000, 5003, 99, 5010), 282);
  EXPECT_NEAR(slave.current(), 282 * 3.0517578125e-4 * 4e-3, 1e-15);  // 10 V / 2^15, 4 mA/V
}

TEST(LegSlave, DerivativeLooksFourUpdatesBack) {
  LegSlave slave({0, 2560}, 5000);
  const int x[] = {5000, 5001, 5003, 5006, 5010, 5015};
  for (int k = 0; k < 6; ++k) {
    const int before = k < 4 ? 5000 : x[k - 4];
    EXPECT_EQ(update(slave, x[k], x[k], 0, 5000), -10 * (x[k] - before));  // 2560/256 = 10
  }
}

TEST(LegSlave, SaturatesAtTenVolts) {
  LegSlave slave({8500, 0}, 5000);
  EXPECT_EQ(update(slave, 5000, 5000, 0, 16383), 32767);
  EXPECT_EQ(update(slave, 5000, 5000, 0, 0), -32767);
  EXPECT_NEAR(slave.current(), -0.04, 2e-6);  // 40 mA
}

TEST(LegSlave, UpdatesEveryThirdReading) {
  LegSlave slave({8500, 0}, 0);
  int updates = 0;
  for (int i = 0; i < 300; ++i) {
    slave.read(0, 0);
    updates += slave.updated();
  }
  EXPECT_EQ(updates, 100);
}

// --- Actuator ------------------------------------------------------------------------------------

TEST(Actuator, IsTheOdeSolvedByRungeKutta) {
  const ActuatorModel model{29.972, 19.558, 0.0064, 0.0, 10.0};
  struct Drive {
    double current, K, tau;
  };
  const auto rhs = [](double, const double y[], double f[], void* p) {
    const auto& d = *static_cast<Drive*>(p);
    f[0] = y[1];
    f[1] = (d.K * d.current - y[1]) / d.tau;
    return static_cast<int>(GSL_SUCCESS);
  };
  Actuator actuator(model, 1.5);
  double y[2] = {1.5, 0.0};
  const double currents[] = {0.01, 0.01, -0.02, 0.003, -0.001, 0.0, 0.04, -0.04};
  for (double current : currents) {
    const double dt = 0.341e-3 * 7.3;
    actuator.advance(current, dt, std::exp(-dt / model.tau));
    Drive drive{current, current > 0 ? model.gain_extend : model.gain_retract, model.tau};
    gsl_odeiv2_system system{rhs, nullptr, 2, &drive};
    gsl_odeiv2_driver* driver =
        gsl_odeiv2_driver_alloc_y_new(&system, gsl_odeiv2_step_rk8pd, 1e-5, 1e-14, 1e-14);
    double t = 0.0;
    ASSERT_EQ(gsl_odeiv2_driver_apply(driver, &t, dt, y), GSL_SUCCESS);
    gsl_odeiv2_driver_free(driver);
    EXPECT_NEAR(actuator.length(), y[0], 1e-12);
    EXPECT_NEAR(actuator.velocity(), y[1], 1e-11);
    EXPECT_NEAR(actuator.acceleration(), (drive.K * current - y[1]) / model.tau, 1e-8);
  }
}

TEST(Actuator, StopsAtItsStroke) {
  Actuator actuator({30.0, 20.0, 0.0064, 1.2, 1.3}, 1.25);
  for (int i = 0; i < 1000; ++i) actuator.advance(0.04, 1e-3, std::exp(-1e-3 / 0.0064));
  EXPECT_EQ(actuator.length(), 1.3);
  EXPECT_EQ(actuator.velocity(), 0.0);
  actuator.advance(-0.04, 1e-2, std::exp(-1e-2 / 0.0064));
  EXPECT_LT(actuator.length(), 1.3);
}

TEST(Temposonics, CountsToTheNearestAndStaysInFourteenBits) {
  const Temposonics t{0.9, kMetrePerInch / 363.6};
  EXPECT_EQ(t.count(0.9 + kMetrePerInch), 364);  // 363.6 counts an inch
  EXPECT_EQ(t.count(0.9 + 0.49 * t.scale), 0);
  EXPECT_EQ(t.count(-5.0), 0);
  EXPECT_EQ(t.count(50.0), 16383);
}

// --- One leg, closed loop: section 2.4 -----------------------------------------------------------

/// Amplitude and phase of the length's answer to a sine of `hertz`, in one direction of the valve.
std::complex<double> response(const ActuatorModel& model, double hertz) {
  const Temposonics transducer{0.0, kMetrePerInch / 363.6};
  const double mid = 0.5, amplitude = 0.002;
  LegSlave slave({8500, 0}, transducer.count(mid));
  Actuator actuator(model, mid);
  const double dt = 0.341e-3, w = 2 * M_PI * hertz;
  const int periods = 12, n = static_cast<int>(periods / hertz / dt);
  std::complex<double> in = 0, out = 0;
  for (int i = 0; i < 2 * n; ++i) {
    const double t = i * dt;
    const double reference = mid + amplitude * std::sin(w * t);
    actuator.advance(slave.current(), dt, std::exp(-dt / model.tau));
    slave.read(transducer.count(actuator.length()), transducer.count(reference));
    if (i < n) continue;
    in += (reference - mid) * std::polar(1.0, -w * t);
    out += (actuator.length() - mid) * std::polar(1.0, -w * (t + dt));
  }
  return out / in;
}

TEST(OneLeg, IsMinusNinetyDegreesNearSixToEightHertz) {
  // Linear loop Kv/(s(tau s+1)+Kv): -90 degrees at sqrt(Kv/tau)/(2 pi), 8.30 Hz extending, 6.70 Hz
  // retracting; the 1023 us update and the age of X(k) pull it lower by a few percent.
  for (const auto& [gain, claimed] : {std::pair{29.972, 8.30}, {19.558, 6.70}}) {
    const ActuatorModel model{gain, gain, 0.0064, 0.0, 1.0};
    EXPECT_GT(std::arg(response(model, 0.85 * claimed)), -M_PI / 2);
    EXPECT_LT(std::arg(response(model, 1.02 * claimed)), -M_PI / 2);
  }
}

TEST(OneLeg, HasTheVelocityGainOfTheReportsNumbers) {
  // Kv = K_P/256 * K_DA * 4 mA/V * K * K_T: 17.4 1/s extending. A ramp is followed late by v/Kv.
  const double Kv = 8500 / 256.0 * (10.0 / 32768) * 4e-3 * 29.972 * (363.6 / kMetrePerInch);
  EXPECT_NEAR(Kv, 17.4, 0.05);
  const ActuatorModel model{29.972, 29.972, 0.0064, 0.0, 10.0};
  const Temposonics transducer{0.0, kMetrePerInch / 363.6};
  LegSlave slave({8500, 0}, transducer.count(0.1));
  Actuator actuator(model, 0.1);
  const double dt = 0.341e-3, v = 0.2;
  double error = 0.0;
  for (int i = 0; i < 6000; ++i) {
    const double reference = 0.1 + v * i * dt;
    actuator.advance(slave.current(), dt, std::exp(-dt / model.tau));
    slave.read(transducer.count(actuator.length()), transducer.count(reference));
    error = reference - actuator.length();
  }
  // Beside v/Kv: the feedback is 0.17 ms old, the reference read up to 1 ms late.
  EXPECT_NEAR(error, v / Kv, v * 1.0e-3);
}

// --- Force-torque sensor -------------------------------------------------------------------------

TEST(Sensor, SettledReadingIsSprocTimesWrench) {  // (2.6)
  Experiment e = experiment("free_decay");
  ForceTorqueSensor sensor(e.plant.sensor, Noise(1));
  const Wrench W{Vec3(100.0, -50.0, 300.0), Vec3(20.0, 10.0, -5.0)};
  sensor.settle(W);
  const Vec6 expected =
      e.plant.sensor.S_proc() * W.stacked() + e.plant.sensor.bias / e.plant.sensor.volts_per_count;
  const AdcCounts adc = sensor.convert(0.0);
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(adc[static_cast<std::size_t>(i)], expected(i), 0.5);
}

TEST(Sensor, ConverterSaturates) {
  Experiment e = experiment("free_decay");
  ForceTorqueSensor sensor(e.plant.sensor, Noise(1));
  sensor.settle({Vec3(1e6, -1e6, 0.0), Vec3::Zero()});
  EXPECT_EQ(sensor.convert(0.0)[0], 32767);
  EXPECT_EQ(sensor.convert(0.0)[1], -32768);
}

TEST(Sensor, NoiseIsAsFigure41) {
  // 1 s at 100 Hz, unloaded: X and Y under about 1 N, Z up to about 3 N, moments under 1 N m. One
  // sigma is 7 mV at gain 4000, so with gain 1000 each channel must show 1.75 mV rms.
  Experiment e = experiment("z_sine");
  const Mat6 C_proc = e.controller.sensor.C_proc;
  ForceTorqueSensor sensor(e.plant.sensor, Noise(3));
  sensor.settle({});
  const auto step = sensor.prepare(kUpdate);
  for (int i = 0; i < 2000; ++i) sensor.advance(step, {}, ForceTorqueSensor::Over::kRamp);
  const Vec6 bias = e.plant.sensor.bias / e.plant.sensor.volts_per_count;
  Vec6 sum2 = Vec6::Zero(), largest = Vec6::Zero();
  const int n = 20000;
  for (int k = 0; k < n; ++k) {
    for (int i = 0; i < 10; ++i) sensor.advance(step, {}, ForceTorqueSensor::Over::kRamp);
    const Wrench W = sensorWrench(e.controller.sensor, bias, sensor.convert(0.0));
    sum2 += W.stacked().cwiseAbs2() / n;
    if (k < 100) largest = largest.cwiseMax(W.stacked().cwiseAbs());
  }
  const Vec6 rms = sum2.cwiseSqrt();
  const double volts = 1.75e-3;
  const Mat6 per_volt = C_proc / e.plant.sensor.volts_per_count;
  for (int i = 0; i < 6; ++i)
    EXPECT_NEAR(rms(i), volts * per_volt.row(i).norm(), 0.05 * rms(i)) << i;
  EXPECT_LT(largest(0), 1.2);
  EXPECT_LT(largest(1), 1.2);
  EXPECT_LT(largest(2), 4.0);
  EXPECT_GT(largest(2), 1.5);
  EXPECT_LT(largest.tail<3>().maxCoeff(), 1.0);
}

// --- The whole
// ------------------------------------------------------------------------------------

TEST(Plant, RestsWhereItIs) {
  const Experiment e = experiment("puma_tilt");
  Plant plant(e.plant);
  const Sample first = plant.sample();
  plant.advance(2'000'000'000);
  const Sample later = plant.sample();
  EXPECT_EQ(later.legs, first.legs);
  EXPECT_EQ(later.adc, first.adc);
  EXPECT_LT(plant.truth().P.v.norm() + plant.truth().P.w.norm(), 1e-12);
}

TEST(Plant, FirstSampleShowsTheInitialPose) {
  Experiment e = experiment("puma_on_table_4_1");
  Plant plant(e.plant);
  const Sample s = plant.sample();
  const Vec6 L =
      legLengths(e.controller.geometry, e.controller.geometry.fromHome(e.plant.initial_pose));
  EXPECT_LE((legLengths(e.controller.legs, s.legs) - L).cwiseAbs().maxCoeff(),
            0.5 * e.plant.transducer.scale * (1 + 1e-9));
}

TEST(Plant, IgnoresCommandsThatAreNotEngaged) {
  const Experiment e = experiment("z_sine");
  Plant plant(e.plant);
  const LegCounts before = plant.sample().legs;
  LegCommand command;
  command.counts = before;
  for (auto& c : command.counts) c += 500;
  plant.command(command);
  plant.advance(1'000'000'000);
  EXPECT_EQ(plant.sample().legs, before);
  command.engaged = true;
  plant.command(command);
  plant.advance(3'000'000'000);
  const LegCounts after = plant.sample().legs;
  for (std::size_t i = 0; i < kLegs; ++i) EXPECT_NEAR(after[i], before[i] + 500, 1.0);
}

TEST(Plant, TrueRatesAreTheDerivativesOfTheTruePose) {
  // Looked at every 50 us while the legs follow steps: rates by differences of the pose,
  // accelerations by their integral (they jump with every new current).
  const Experiment e = experiment("z_sine");
  Plant plant(e.plant);
  LegCommand command;
  command.engaged = true;
  command.counts = plant.sample().legs;
  for (std::size_t i = 0; i < kLegs; ++i) command.counts[i] += static_cast<int>(60 + 30 * i);
  plant.command(command);
  const double dt = 50e-6;
  Truth before = plant.truth();
  Vec3 dv = Vec3::Zero(), dw = Vec3::Zero();
  double fastest = 0.0;
  for (int k = 1; k <= 1200; ++k) {
    plant.advance(k * 50'000LL);
    plant.sample();
    const Truth& now = plant.truth();
    ASSERT_LT(((now.P.X.p - before.P.X.p) / dt - 0.5 * (now.P.v + before.P.v)).norm(), 4e-4);
    const Mat3 W = (now.P.X.R * before.P.X.R.transpose() - Mat3::Identity()) / dt;
    ASSERT_LT((Vec3(W(2, 1), W(0, 2), W(1, 0)) - 0.5 * (now.P.w + before.P.w)).norm(), 8e-4);
    dv += dt * now.P.a;  // means since the last look
    dw += dt * now.P.alpha;
    fastest = std::max(fastest, now.P.v.norm());
    ASSERT_LT((now.P.v - dv).norm() + (now.P.w - dw).norm(), 0.03 * fastest + 1e-3);
    before = now;
  }
  EXPECT_GT(fastest, 0.02);
}

TEST(Plant, PlatesCountedIntoTheRobotsBaseWeighTheSame) {
  // Once as the plant does it, once part by part.
  Experiment e = experiment("puma_on_table_4_1");
  Plant plant(e.plant);
  LegCommand command;
  command.engaged = true;
  for (int k = 0; k < 100; ++k) {
    const Geometry& g = e.controller.geometry;
    const double s = 0.03 * std::sin(0.1 * k);
    command.counts =
        legCounts(e.controller.legs, legLengths(g, g.fromHome({{s, 0.0, s}, {s, -s, 0.0}})));
    plant.command(command);
    plant.advance((k + 1) * 10'000'000LL);
    plant.sample();
    const Truth& truth = plant.truth();
    const Payload& load = e.plant.payload;
    const auto part = [&](const Transform& X_PB, const Wrench& on_body) {
      return rotate(truth.P.X.R, transfer(X_PB, Wrench{} - on_body));
    };
    const Wrench oracle =
        part(load.X_PL0(), newtonEuler(load.robot, truth.joints,
                                       properMotion(truth.P, load.X_PL0(), e.plant.gravity))
                               .F_L0o_L0) +
        part(load.X_PR,
             inertialWrench(load.adapter_R, properMotion(truth.P, load.X_PR, e.plant.gravity))) +
        part(load.X_PS,
             inertialWrench(load.top_plate_S, properMotion(truth.P, load.X_PS, e.plant.gravity)));
    ASSERT_LT((truth.F_Po_I - oracle).stacked().norm(), 1e-9);
  }
}

TEST(Plant, FiltersDelayTheOutputsOnly) {
  // Filter 1 is 47 ms late at low frequency (sqrt(2)/30 s); the Temposonics do not see it.
  const auto poseAfterRamp = [](const char* filters) {
    const Experiment e = experiment("z_sine", {std::string("legs.filters=") + filters});
    Plant plant(e.plant);
    LegCommand command;
    command.engaged = true;
    for (int k = 0; k < 150; ++k) {
      const Geometry& g = e.controller.geometry;
      command.counts = legCounts(e.controller.legs,
                                 legLengths(g, g.fromHome({{0.0, 0.0, 0.001 * k}, Vec3::Zero()})));
      plant.command(command);
      plant.advance((k + 1) * 10'000'000LL);
    }
    const Sample s = plant.sample();
    return std::pair{plant.truth().x.p.z(), s.legs};
  };
  const auto [plain, counts_plain] = poseAfterRamp("none");
  const auto [filtered, counts_filtered] = poseAfterRamp("outputs");
  EXPECT_EQ(counts_plain, counts_filtered);
  EXPECT_NEAR(plain - filtered, 0.1 * M_SQRT2 / 30.0, 2e-4);  // 0.1 m/s
}

TEST(Plant, JointsFollowAFifthOrderPolynomial) {
  Experiment e = experiment("puma_tilt");
  Plant plant(e.plant);
  EXPECT_TRUE(plant.moveRobot({0, 30 * kDegree, 5.0}));
  for (int k = 1; k <= 600; ++k) {
    plant.advance(k * 10'000'000LL);
    const Sample s = plant.sample();
    const double u = std::min(1.0, k * 0.01 / 5.0);
    ASSERT_NEAR(s.q(0), 30 * kDegree * u * u * u * (10 - 15 * u + 6 * u * u), 1e-12);
  }
  EXPECT_FALSE(plant.moveRobot({6, 0.0, 1.0}));
  EXPECT_FALSE(plant.moveRobot({0, NAN, 1.0}));
  EXPECT_FALSE(plant.moveRobot({0, 1.0, 0.0}));
}

TEST(Plant, CuesCountFromTheSegmentsFirstCommand) {
  Experiment e = experiment("puma_on_table_4_1");
  e.plant.robot_events = {{{2, 500'000'000}, {0, 0.5, 1.0}}};
  e.plant.faults = {{{2, 300'000'000}, 100'000'000, plant::Fault::kFloorMat}};
  Plant plant(e.plant);
  LegCommand command;
  command.engaged = true;
  command.counts = plant.sample().legs;
  for (int k = 0; k < 400; ++k) {
    command.segment = k < 100 ? 1 : 2;  // segment 2 begins at 1 s
    plant.command(command);
    plant.advance((k + 1) * 10'000'000LL);
    const Sample s = plant.sample();
    const double t = (k + 1) * 0.01;
    ASSERT_EQ(s.q(0) != 0.0, t > 1.5) << t;
    ASSERT_EQ((s.switches & kFloorMatClosed) == 0, t > 1.295 && t < 1.395) << t;
  }
}

TEST(Plant, SameSeedSameBytesOtherSeedOthers) {
  const auto run = [](const char* seed) {
    const Experiment e = experiment("puma_on_table_4_1", {seed});
    Plant plant(e.plant);
    std::vector<AdcCounts> out;
    for (int k = 1; k <= 50; ++k) {
      plant.advance(k * 10'000'000LL);
      out.push_back(plant.sample().adc);
    }
    return out;
  };
  EXPECT_EQ(run("seed=5"), run("seed=5"));
  EXPECT_NE(run("seed=5"), run("seed=6"));
}

TEST(Plant, SamplingMoreOftenChangesNothingButTheSensorsSteps) {
  // Legs do not know when they are looked at.
  const Experiment e = experiment("puma_tilt");
  Plant often(e.plant), seldom(e.plant);
  LegCommand command;
  command.engaged = true;
  command.counts = often.sample().legs;
  seldom.sample();
  for (auto& c : command.counts) c += 300;
  often.command(command);
  seldom.command(command);
  for (int k = 1; k <= 1000; ++k) {
    often.advance(k * 777'777LL);
    often.sample();
  }
  seldom.advance(777'777'000);
  const Sample a = often.sample(), b = seldom.sample();
  EXPECT_EQ(a.legs, b.legs);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(a.adc[i], b.adc[i], 30);
}

}  // namespace
}  // namespace ves::plant
