// SPDX-License-Identifier: BSD-3-Clause
//
// The machine's legs: LegSlave, valve and cylinder, transducer, the loop of section 2.4, and what
// they do when nobody commands them.
#include <gsl/gsl_errno.h>
#include <gsl/gsl_odeiv2.h>
#include <gtest/gtest.h>

#include "support/rig.hpp"
#include "ves/contract/leg_communication.hpp"
#include "ves/plant/nominal_servo.hpp"
#include "ves/plant/one_leg.hpp"

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

TEST(NominalServo, IsTheLegSlavesArithmetic) {
  // Two readings a Temposonics period apart are half of it old; the derivative looks four updates
  // back.
  const Experiment e = experiment("z_sine");
  const LegSlaveGains gains{8500, 1700};
  const ServoModel servo = nominalServo(gains, e.plant.actuator, e.plant.transducer);
  EXPECT_NEAR(servo.reading_age, 0.5 * 341e-6, 1e-12);
  EXPECT_NEAR(servo.derivative, 4 * kUpdate * 0.2, 1e-12);
}

// --- One leg, closed loop: section 2.4 -----------------------------------------------------------

TEST(OneLeg, IsMinusNinetyDegreesNearSixToEightHertz) {
  // Linear loop Kv/(s(tau s+1)+Kv): -90 degrees at sqrt(Kv/tau)/(2 pi), 8.30 Hz extending, 6.70 Hz
  // retracting; the 1023 us update and the age of X(k) pull it lower by a few percent.
  PlantConfig p = experiment("z_sine").plant;
  p.leg_slave = {8500, 0};
  p.actuator.tau = 0.0064;
  for (const auto& [gain, claimed] : {std::pair{29.972, 8.30}, {19.558, 6.70}}) {
    EXPECT_GT(respond(p, gain, 0.85 * claimed, 0.002).phase, -M_PI / 2);
    EXPECT_LT(respond(p, gain, 1.02 * claimed, 0.002).phase, -M_PI / 2);
  }
}

TEST(OneLeg, HasTheVelocityGainOfTheReportsNumbers) {
  // Kv = K_P/256 * K_DA * 4 mA/V * K * K_T: 17.4 1/s extending. A ramp is followed late by v/Kv.
  const double Kv = 8500 / 256.0 * (10.0 / 32768) * 4e-3 * 29.972 * (363.6 / kMetrePerInch);
  EXPECT_NEAR(Kv, 17.4, 0.05);
  const ActuatorModel model{29.972, 29.972, 0.0064, 0.0, 10.0};
  const Temposonics transducer{0.0, kMetrePerInch / 363.6};
  OneLeg leg({8500, 0}, model, transducer, 0.1);
  const double v = 0.2;
  double error = 0.0;
  for (int i = 0; i < 6000; ++i) {
    const double reference = 0.1 + v * i * OneLeg::kStep;
    leg.step(reference);
    error = reference + v * OneLeg::kStep - leg.length();
  }
  // Beside v/Kv: the feedback is 0.17 ms old, the reference read up to 1 ms late.
  EXPECT_NEAR(error, v / Kv, v * 1.0e-3);
}

}  // namespace
}  // namespace ves::plant

namespace ves {
namespace {

using test::experiment;
using test::Rig;
using test::sine;

// --- Silent legs ---------------------------------------------------------------------------------

class Silence : public testing::Test {
 protected:
  Silence()
      : e_(experiment("z_sine", {"initial_pose={x_m: 0.05, z_m: 0.08, gamma_deg: 3}"})),
        plant_(e_.plant) {
    LegCommand c;
    c.engaged = true;
    c.park = true;
    c.counts =
        legCounts(e_.controller.legs,
                  legLengths(e_.plant.geometry, e_.plant.geometry.fromHome(e_.plant.initial_pose)));
    c.rest = c.counts;
    command_ = c;
  }
  double away() {
    plant_.sample();
    return plant_.truth().x.stacked().norm();
  }
  static constexpr std::int64_t kSecond = 1'000'000'000;
  /// In steps: a leap of the plant's time would count as time that was commanded.
  void wait(int seconds) {
    for (int s = 0; s < seconds; ++s) plant_.advance(plant_.time() + kSecond);
  }
  Experiment e_;
  plant::Plant plant_;
  LegCommand command_;
};

TEST_F(Silence, LegsHoldAndThenGoHomeSlowly) {
  plant_.command(command_);
  const double start = away();
  for (int s = 1; s < 10; ++s) {
    plant_.advance(s * kSecond);
    EXPECT_NEAR(away(), start, 1e-3) << s;
  }
  double fastest = 0.0;
  for (std::int64_t t = 10 * kSecond; t < 31 * kSecond; t += kSecond / 100) {
    plant_.advance(t);
    plant_.sample();
    fastest = std::max(fastest, plant_.truth().P.v.norm());
  }
  EXPECT_LT(away(), 1e-3);
  EXPECT_LT(fastest, 0.05);
  EXPECT_TRUE(plant_.truth().parking);
}

TEST_F(Silence, LegsStayWhenTheLastCommandSaidSo) {
  command_.park = false;  // a stop by a check
  plant_.command(command_);
  const double start = away();
  wait(40);
  EXPECT_NEAR(away(), start, 1e-3);
}

TEST_F(Silence, LegsStayWhileASafetyLoopIsOpen) {
  command_.segment = 0;
  e_.plant.faults = {{{0, kSecond}, 100 * kSecond, plant::Fault::kPanicButton, 0, 0.0}};
  plant::Plant plant(e_.plant);
  plant.command(command_);
  for (int s = 1; s < 40; ++s) {
    plant.advance(s * kSecond);
    plant.sample();
  }
  EXPECT_NEAR(plant.truth().x.stacked().norm(), e_.plant.initial_pose.stacked().norm(), 1e-3);
}

TEST_F(Silence, ACommandTakesTheLegsBackWithoutAStep) {
  plant_.command(command_);
  wait(20);
  const Sample s = plant_.sample();
  EXPECT_TRUE(plant_.truth().parking);
  command_.counts = command_.rest = s.legs;
  plant_.command(command_);
  const double then = away();
  wait(1);
  EXPECT_NEAR(away(), then, 1e-3);
  EXPECT_FALSE(plant_.truth().parking);
}

}  // namespace
}  // namespace ves
