// SPDX-License-Identifier: BSD-3-Clause
//
// What was reset is as new: used, reset and used otherwise it says bit for bit what one says that
// was never used before.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "support/rig.hpp"
#include "ves/control/energy_account.hpp"
#include "ves/control/hindsight.hpp"
#include "ves/control/joint_momentum.hpp"
#include "ves/control/monitors.hpp"
#include "ves/control/moving_frame.hpp"
#include "ves/control/port_work.hpp"
#include "ves/control/sensor_bias.hpp"
#include "ves/control/servo_adaptation.hpp"
#include "ves/control/test_platform.hpp"
#include "ves/control/wrench_filter.hpp"
#include "ves/plant/force_torque_sensor.hpp"

namespace ves {
namespace {

using test::experiment;
using test::kCompensated;
using test::kTick;

/// Numbers by chance, and what an object has said.
struct Use {
  explicit Use(unsigned seed) : random(seed) {}
  std::mt19937 random;
  std::vector<double> said;

  double in(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(random); }
  Vec6 vec(double size) {
    Vec6 v;
    for (double& x : v) x = in(-size, size);
    return v;
  }
  Wrench wrench(double size) { return Wrench::from(vec(size)); }
  Mat3 turned(double angle) {
    return Eigen::AngleAxisd(in(-angle, angle), vec(1.0).head<3>().normalized()).toRotationMatrix();
  }
  void say(double x) { said.push_back(x); }
  template <class Derived>
  void say(const Eigen::DenseBase<Derived>& m) {
    for (const double x : m.derived().eval().reshaped()) said.push_back(x);
  }
  void say(const BodyMotion& m) {
    say(m.X.p);
    say(m.X.R);
    say(m.v);
    say(m.w);
    say(m.a);
    say(m.alpha);
  }
};

/// `begin` resets, `step` uses it once, the n-th time since.
template <class T, class Begin, class Step>
void expectAsNew(const T& made, const Begin& begin, const Step& step) {
  constexpr int kUses = 60;
  T used = made, fresh = made;
  const auto use = [&](T& one, unsigned seed, int times) {
    Use how(seed);
    begin(one);
    for (int n = 0; n < times; ++n) step(one, how, n);
    return how.said;
  };
  use(used, 1, kUses);
  use(used, 2, 7);  // and again, for what only a short use leaves
  const std::vector<double> again = use(used, 3, kUses), once = use(fresh, 3, kUses);
  ASSERT_FALSE(once.empty());
  EXPECT_NE(*std::max_element(once.begin(), once.end()),
            *std::min_element(once.begin(), once.end()));
  EXPECT_EQ(again, once);
  EXPECT_NE(use(used, 4, kUses), once);
}

ServoModel servoWithAll() {
  ServoModel servo = experiment("z_sine", kCompensated).controller.servo;
  servo.opening << 1e-4, 1e-4, 0.0, -1e-4, -1e-4, 2e-4;
  servo.friction.setConstant(2e-4);
  servo.delay << 0.0, 1e-3, 2e-3, 2e-3, 1e-3, 0.0;
  servo.sensor_window = 0.01;
  return servo;
}
const Vec6 kMiddle = Vec6::Constant(1.5);

/// A tick of servos that are told something, `n` after a reset at 0.
template <class Servos>
void drive(Servos& servos, Use& use, int n) {
  servos.send(kMiddle + use.vec(0.02), n, n * kTick);
  servos.arrived(n, n * kTick + std::llround(use.in(0.0, 3e6)));
}

TEST(ResetIsAsNew, ModelledServos) {
  expectAsNew(
      ModelledServos(servoWithAll(), 0.01, 0.5),
      [](ModelledServos& servos) { servos.reset(kMiddle, 0); },
      [](ModelledServos& servos, Use& use, int n) {
        drive(servos, use, n);
        servos.advance((n + 1) * kTick - 1'234'567);
        use.say(servos.length());
        use.say(servos.velocity());
        use.say(servos.acceleration());
        use.say(servos.difference());
        use.say(servos.toUpdate());
      });
}

TEST(ResetIsAsNew, ServoObserver) {
  expectAsNew(
      ServoObserver(servoWithAll(), 0.01),
      [](ServoObserver& observer) { observer.reset(kMiddle, 0); },
      [](ServoObserver& observer, Use& use, int n) {
        drive(observer, use, n);
        const std::int64_t now = (n + 1) * kTick;
        observer.advance(now);
        observer.correct(observer.length() + use.vec(1e-4), now - 3'000'000);
        use.say(observer.length());
        use.say(observer.filteredAcceleration(now - 2'000'000));
        use.say(observer.moments(now - 12'000'000, now - 1'000'000));
        use.say(observer.rounding(use.vec(0.1), 0.004));
      });
}

TEST(ResetIsAsNew, ServoAdaptationButForWhatItHasLearnt) {
  // It may learn nothing: then nothing but its model is left to be seen.
  ServoModel truth = servoWithAll();
  truth.extend *= 1.05;
  const auto gains = [&](int uses) {
    ServoAdaptation learns(servoWithAll(), {0.05, 5e-4, 1.25, 60.0}, 0.01);
    for (int k = 0; k < uses; ++k) {
      Use use(7);
      ModelledServos machine(truth, 0.01, 0.5);
      machine.reset(kMiddle, 0);
      learns.reset(kMiddle, 0);
      for (int n = 0; n < 300; ++n) {
        const Vec6 reference = kMiddle + use.vec(0.02);
        machine.send(reference, n, n * kTick);
        learns.send(reference, n, n * kTick);
        machine.advance((n + 1) * kTick);
        learns.learn(machine.length(), (n + 1) * kTick);
      }
    }
    return learns.gains().extend;
  };
  // The same lesson twice is that lesson with more weight: nothing that contradicts it.
  EXPECT_GT((gains(1) - servoWithAll().extend).minCoeff(), 0.0);
  EXPECT_LT((gains(2) - truth.extend).cwiseAbs().maxCoeff(),
            (gains(1) - truth.extend).cwiseAbs().maxCoeff());
}

TEST(ResetIsAsNew, PortWork) {
  struct Port {
    PortWork work;
    ServoObserver servo;
  };
  const ControllerConfig config = experiment("z_sine", kCompensated).controller;
  expectAsNew(
      Port{PortWork(config), ServoObserver(config.servo, 0.01)},
      [](Port& port) {
        port.work.reset();
        port.servo.reset(kMiddle, 0);
      },
      [](Port& port, Use& use, int n) {
        drive(port.servo, use, n);
        port.servo.advance((n + 1) * kTick);
        const auto work = port.work.take(use.wrench(50.0), (n + 1) * kTick,
                                         {use.turned(0.1), {0.0, 0.0, 1.2}}, port.servo);
        use.say(work.newest);
        use.say(work.settled);
      });
}

TEST(ResetIsAsNew, EnergyAccount) {
  const ControllerConfig config =
      experiment("puma_on_table_4_1",
                 {"controller.passivity.enabled=true", "controller.passivity.reserve_j=0.5"})
          .controller;
  expectAsNew(
      EnergyAccount(config), [](EnergyAccount& account) { account.reset(); },
      [](EnergyAccount& account, Use& use, int) {
        account.take({use.in(-1.0, 2.0), use.in(0.0, 0.1), use.in(0.0, 0.2), use.in(0.0, 0.2),
                      use.in(0.1, 1.0)},
                     {use.in(-1.0, 1.0), use.in(-1.0, 1.0)});
        use.say(account.putIn());
        use.say(account.paid());
        use.say(account.damping());
      });
}

TEST(ResetIsAsNew, WrenchFilter) {
  WrenchFilterSettings settings;
  settings.dead_band << 1.0, 2.0, 3.0, 0.1, 0.2, 0.3;
  settings.low_pass.setConstant(3.0);
  expectAsNew(
      WrenchFilter(settings, 0.01), [](WrenchFilter& filter) { filter.reset(); },
      [](WrenchFilter& filter, Use& use, int) {
        use.say(filter.update(use.wrench(20.0)).stacked());
      });
}

TEST(ResetIsAsNew, LegReadings) {
  const SafetyLimits limits = experiment("z_sine").controller.safety;
  expectAsNew(
      LegReadings(), [](LegReadings& readings) { readings.reset(); },
      [&](LegReadings& readings, Use& use, int n) {
        // The end of a use is wrong all along.
        const double leaps = n > 40 ? 0.3 : 1e-3;
        use.say(readings.take(limits, kMiddle + use.vec(leaps), Vec6::Constant(0.1), 0.01));
        use.say(readings.good(limits) ? 1.0 : 0.0);
      });
}

TEST(ResetIsAsNew, Oscillation) {
  const SafetyLimits limits = experiment("z_sine").controller.safety;
  expectAsNew(
      Oscillation(), [](Oscillation& one) { one.reset(); },
      [&](Oscillation& one, Use& use, int n) {
        one.take(limits, std::exp(0.5 * n) * use.in(0.9, 1.0), false, JointVector::Zero(), 1e-3,
                 0.4 * limits.window);
        use.say(one.good(limits) ? 1.0 : 0.0);
        use.say(use.in(0.0, 1.0));
      });
}

class ResetVehicle : public testing::TestWithParam<const char*> {};

TEST_P(ResetVehicle, IsAsNew) {
  const ControllerConfig config = experiment(GetParam()).controller;
  Mat6 M_1 = 20.0 * Mat6::Identity();
  M_1.bottomRightCorner<3, 3>() *= 0.2;
  for (const double ahead : {0.0, 0.02})
    expectAsNew(
        AdmittanceModel(config.vehicle, 0.01),
        [&](AdmittanceModel& model) { model.reset(Vec6::Constant(0.01), M_1, ahead); },
        [&](AdmittanceModel& model, Use& use, int n) {
          const Thrust thrust = model.thrust();
          use.say(thrust.time);
          use.say(thrust.left);
          use.say(thrust.on);
          use.say(model.coasting());
          use.say(model.kineticEnergy());
          if (n == 30) model.countFrom(use.vec(0.1));
          CarriedBody body(M_1, Mat6((1.0 + 0.01 * n) * M_1));
          body.joints = use.vec(0.5);
          body.mass = 20.0;
          body.moment_P << 1.0, 2.0, 3.0;
          const Wrench F = use.wrench(30.0);
          if (ahead > 0.0)
            model.step(F, body, use.in(0.005, 0.015), ahead, use.in(0.0, 0.2));
          else
            model.step(F, use.in(0.0, 0.2));
          if (n % 9 == 8) model.slow(use.in(0.5, 1.0));
          if (n == 20) {
            ThrustOrder order = ThrustOrder::Zero();
            order(0) = 0.2;
            model.fire(order);
          }
          use.say(model.motion().x);
          use.say(model.motion().x_dot);
          use.say(model.motion().x_ddot);
          use.say(model.energy());
          use.say(model.taken(F));
          use.say(model.damped());
          use.say(model.dissipated());
          use.say(model.shaken());
          use.say(model.bodyMotion());
          use.say(model.atWrench());
        });
}
INSTANTIATE_TEST_SUITE_P(Kinds, ResetVehicle,
                         testing::Values("puma_on_table_4_1", "srms_capture_doss", "satellite_hold",
                                         "satellite_jets", "satellite_tumbling", "ship_arm",
                                         "deck_puma"),
                         [](const auto& test) { return std::string(test.param); });

/// What knows of the robot by two parameters, and by four of what it may have in hand.
Lesson lessonOf(Use& use) {
  Lesson out;
  out.momentum = MassColumns::Zero(6, 6);
  for (Eigen::Index i = 0; i < 6; ++i) out.momentum.col(i) = use.vec(1.0);
  return out;
}

TEST(ResetIsAsNew, Hindsight) {
  struct Learner {
    Hindsight hindsight;
    AdmittanceModel base;
  };
  const AdmittanceModel base(experiment("puma_on_table_4_1").controller.vehicle, 0.01);
  expectAsNew(
      Learner{Hindsight(0.01), base},
      [&](Learner& one) {
        Use use(11);
        one.base.reset(Vec6::Zero());
        one.hindsight.reset(one.base, lessonOf(use));
      },
      [&](Learner& one, Use& use, int n) {
        Lesson now = lessonOf(use);
        now.withheld = use.wrench(10.0);
        now.passed = use.wrench(10.0);
        now.passing = n % 3 != 0;
        now.group_ends = n % Lesson::kGroup == Lesson::kGroup - 1;
        if (now.group_ends && n > 20) now.replay = 2 * Lesson::kGroup;
        if (n % 29 == 2) {
          now.hand = 2;
          now.was_weight = true;
        }
        if (n % 13 == 12) {
          now.learnt = use.vec(0.1);
        }
        one.base.step(use.wrench(20.0), Mat6(Mat6::Zero()), 0.01, 0.0);
        one.hindsight.step(one.base, Mat6::Zero(), 0.01, now);
        use.say(one.hindsight.due().eta);
        use.say(one.hindsight.due().eta_dot);
        use.say(one.hindsight.any() ? 1.0 : 0.0);
      });
}

class ResetControl : public testing::TestWithParam<const char*> {};

TEST_P(ResetControl, IsAsNew) {
  std::vector<std::string> set = kCompensated;
  for (const char* more : {"controller.compensation.wrench=aided",
                           "controller.passivity.enabled=true", "controller.passivity.reserve_j=0"})
    set.push_back(more);
  ControllerConfig config = experiment(GetParam(), set).controller;
  config.safety.window = 0.04;  // so short that energy may grow for many of them
  config.safety.growth_floor = 1e-12;
  config.safety.window_growth = 1.0;
  config.safety.growing_windows = 6;
  const Geometry& g = config.geometry;
  struct Emulation {
    AdmittanceControl control;
    ServoObserver servo;
    PathPoint<6> last;
  };
  Mat6 M_1 = 20.0 * Mat6::Identity();
  M_1.bottomRightCorner<3, 3>() *= 0.2;
  const PathChecks checks(config.safety, g);
  expectAsNew(
      Emulation{AdmittanceControl(config), ServoObserver(config.servo, 0.01), PathPoint<6>()},
      [&](Emulation& one) {
        one.control.end();
        one.control.begin(Vec6::Zero(), M_1, 0.004, 1.0);
        one.servo.reset(legLengths(g, g.fromHome({})), 0);
        one.last = PathPoint<6>();
      },
      [&](Emulation& one, Use& use, int n) {
        const Vec6 L = legLengths(g, g.fromHome(Pose::from(one.last.x)));
        one.servo.send(L, n, n * kTick);
        one.servo.advance((n + 1) * kTick);
        const Wrench felt = use.wrench(0.1 * std::exp(0.1 * n)), at_port = use.wrench(20.0);
        const Mat6 noise = 1e-3 * Mat6::Identity();
        Lesson lesson = lessonOf(use);
        lesson.withheld = use.wrench(1.0);
        lesson.group_ends = n % Lesson::kGroup == Lesson::kGroup - 1;
        if (lesson.group_ends && n > 20) lesson.replay = 2 * Lesson::kGroup;
        const WrenchTiming timing{n == 0 ? 0.03 : 0.01, 0.004, (n + 1) * kTick};
        const CarriedBody body(M_1);
        const JointVector q = JointVector::Zero();
        const Transform X_IP = g.fromHome(Pose::from(one.last.x));
        one.last = one.control.step(
            {felt, at_port, noise, body, 1.0, timing, false, lesson, q, L, X_IP, one.servo},
            one.last, checks);
        use.say(one.last.x);
        use.say(one.last.x_dot);
        use.say(one.last.x_ddot);
        use.say(one.control.energy().putIn());
        use.say(one.control.energy().damping());
        use.say(one.control.oscillation().good(config.safety) ? 1.0 : 0.0);
      });
}
INSTANTIATE_TEST_SUITE_P(Vehicles, ResetControl,
                         testing::Values("puma_on_table_4_1", "srms_capture_doss", "ship_arm"),
                         [](const auto& test) { return std::string(test.param); });

class ResetJoints : public testing::TestWithParam<const char*> {};

TEST_P(ResetJoints, IsAsNew) {
  std::vector<std::string> aided = kCompensated;
  aided.push_back("controller.compensation.wrench=aided");
  aided.push_back(GetParam());
  ControllerConfig config = experiment("srms_capture_doss", aided).controller;
  config.servo.sensor_delay = 0.002;
  const KnownPayload known(config);
  expectAsNew(
      JointMomentum(config), [](JointMomentum& joints) { joints.reset(JointVector::Zero()); },
      [&](JointMomentum& joints, Use& use, int n) {
        Sample s;
        s.time = s.joints_time = (n + 1) * kTick + std::llround(use.in(-1e6, 1e6));
        s.wrench_time = s.joints_time - 2'000'000;
        for (int i = 0; i < 4; ++i) s.q(i) = 0.02 * n + use.in(-0.01, 0.01);
        joints.update(known, s, use.turned(0.1), use.turned(0.2), 0.01);
        use.say(joints.q());
        use.say(joints.q_dot());
        use.say(joints.force().stacked());
        use.say(joints.emulatedForce().stacked());
        use.say(joints.emulatedMomentum());
        use.say(joints.shown(use.vec(0.1).head<3>()).stacked());
        use.say(joints.at(s));
      });
}

INSTANTIATE_TEST_SUITE_P(Encoders, ResetJoints,
                         testing::Values("seed=1", "robot.encoders={counts_per_turn: 4096}"),
                         [](const auto& test) { return test.index == 0 ? "exact" : "counts"; });

TEST(ResetIsAsNew, MovingFrame) {
  const ControllerConfig config = experiment("satellite_tumbling").controller;
  Use begins(5);
  BodyMotion start;
  start.X.R = begins.turned(1.0);
  start.v = begins.vec(0.1).head<3>();
  start.w = begins.vec(0.1).head<3>();
  expectAsNew(
      MovingFrame(config),
      [&](MovingFrame& frame) {  // where it is it stays: it is put
        frame.rest();
        frame.yield(start, PathPoint<6>());
        frame.begin(start);
      },
      [&](MovingFrame& frame, Use& use, int) {
        BodyMotion flies = start;
        flies.X.p = use.vec(0.3).head<3>();
        flies.X.R = use.turned(0.5);
        frame.step(frame.shown(flies), flies, use.in(0.5, 1.0), 0.01);
        use.say(frame.laboratory());
      });
}

TEST(ResetIsAsNew, ACalibration) {
  const ControllerConfig config = experiment("z_sine").controller;
  expectAsNew(
      Calibration(config.stillness), [](Calibration& one) { one.begin(); },
      [&](Calibration& one, Use& use, int n) {
        Sample s;
        s.sequence = n;
        for (std::size_t i = 0; i < 6; ++i)
          s.adc[i] = static_cast<std::int32_t>(std::lround(use.in(-20.0, 20.0)));
        s.q(1) = n == 30 ? 1.0 : 0.0;  // something moves
        one.add(s, use.vec(3.0));
        use.say(one.statistics().mean());
        use.say(one.statistics().deviation());
        use.say(static_cast<double>(one.status()));
        use.say(static_cast<double>(one.violation()));
        use.say(one.violationIndex());
        use.say(one.violationAmount());
      });
}

TEST(ResetIsAsNew, ATare) {
  const ControllerConfig config = experiment("z_sine").controller;
  struct Bias {
    Tare tare;
    Vec6 bias = Vec6::Zero();
  };
  expectAsNew(
      Bias{Tare(0.1, 0.01, config.stillness.bias), Vec6::Zero()},
      [](Bias& one) {
        one.tare.cancel(one.bias);
        one.bias.setZero();
        one.tare.begin();
      },
      [&](Bias& one, Use& use, int n) {
        // So many samples a tick that its average and its ramp are over within a use.
        for (int i = 0; i < 3; ++i) {
          Sample s;
          s.sequence = 3 * n + i;
          for (std::size_t k = 0; k < 6; ++k)
            s.adc[k] = static_cast<std::int32_t>(std::lround(use.in(-20.0, 20.0)));
          one.tare.step(s, true, use.vec(3.0), one.bias);
        }
        use.say(one.bias);
        use.say(one.tare.running() ? 1.0 : 0.0);
      });
}

TEST(ResetIsAsNew, ASensorThatSettles) {
  const auto model = experiment("z_sine", {"sensor.noise=false"}).plant.sensor;
  expectAsNew(
      plant::ForceTorqueSensor(model, plant::Noise(1)),
      [](plant::ForceTorqueSensor& one) {
        one.settle(Wrench{{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}});
      },
      [](plant::ForceTorqueSensor& one, Use& use, int) {
        one.advance(one.prepare(0.005), use.wrench(50.0), plant::ForceTorqueSensor::Over::kRamp);
        use.say(one.reading(1.0).stacked());
      });
}

}  // namespace
}  // namespace ves
