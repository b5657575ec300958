// SPDX-License-Identifier: BSD-3-Clause
//
// The books of the port between robot and platform, and the passivity controller.
#include <gtest/gtest.h>

#include <random>

#include "support/rig.hpp"
#include "ves/control/energy_account.hpp"
#include "ves/math/dense.hpp"

namespace ves {
namespace {

ControllerConfig config(bool passive, double reserve = 0.0) {
  ControllerConfig c;
  c.servo.sensor_cutoff = 2.0 * M_PI * 50.0;
  c.passivity = {passive, reserve, 10.0};
  return c;
}

ModelWork took(double taken, double paid = 0.0) {
  ModelWork work;
  work.taken = taken;
  work.paid = paid;
  work.kinetic = 1.0;
  return work;
}

// What the model took of a wrench and what the wrench did are compared for the same tick: the
// latter is settled a tick later, and damping does not wait for that.
TEST(EnergyAccount, IsTheDifferenceOfTwoWorks) {
  EnergyAccount account(config(true));
  account.take(took(0.3), {});
  EXPECT_EQ(account.putIn(), 0.0);
  EXPECT_NEAR(account.damping(), 2.0, 1e-12);  // 0.3 owed
  account.take(took(0.2), {0.5, 0.1});
  EXPECT_NEAR(account.putIn(), 0.3 - 0.1, 1e-15);
  EXPECT_EQ(account.damping(), 0.0);  // and no more
  account.take(took(0.0), {-0.4, 0.7});
  EXPECT_NEAR(account.putIn(), 0.2 + 0.2 - 0.7, 1e-15);
  account.take(took(0.0), {0.0, -0.4});
  EXPECT_NEAR(account.putIn(), 0.1, 1e-15);
  account.take(took(0.7), {});
  account.reset();
  account.take(took(0.0), {});
  EXPECT_EQ(account.putIn(), 0.0);
}

TEST(EnergyAccount, DampsOnlyWhileInDebtAndWithoutSteps) {
  const ControllerConfig c = config(true, 0.5);
  EnergyAccount account(c);
  const auto put = [&](double energy, double paid) {  // with the platform at rest
    account.take(took(energy, paid), {});
    return account.damping();
  };
  put(0.0, 0.0);
  put(0.0, 0.0);
  EXPECT_EQ(put(0.4, 0.0), 0.0);  // of the reserve
  double before = 0.0;
  for (int i = 0; i < 10; ++i) {  // and now beyond it, by 0.4 for good
    const double now = put(i == 0 ? 0.5 : 0.0, 0.0);
    EXPECT_GE(now, before);
    EXPECT_LE(now - before, 2.0 + 1e-12) << "of 10 in 50 ms";
    before = now;
  }
  EXPECT_NEAR(before, 10.0 * 0.4, 1e-9);  // the share of the kinetic energy that is owed
  put(0.0, 0.4);
  for (int i = 0; i < 10; ++i) put(0.0, 0.0);
  EXPECT_EQ(account.damping(), 0.0);
  // What is taken out fills the tank to its reserve and no further.
  put(-100.0, 0.0);
  for (int i = 0; i < 20; ++i) put(i == 0 ? 0.6 : 0.0, 0.0);
  EXPECT_NEAR(account.damping(), 10.0 * 0.1, 1e-9);
  EXPECT_NEAR(account.paid(), 0.4, 1e-12);
  EXPECT_NEAR(account.putIn(), 0.4 + 0.5 - 100.0 + 0.6, 1e-9);
  account.reset();
  EXPECT_EQ(account.putIn(), 0.0);
  EXPECT_EQ(account.damping(), 0.0);
}

// What the base's own damping takes pays a debt, and what the sensor's noise gives is none.
TEST(EnergyAccount, OwesNeitherWhatIsDissipatedNorWhatNoiseGives) {
  EnergyAccount account(config(true));
  ModelWork work = took(0.3);
  work.dissipated = 0.1;
  work.noise = 0.05;
  account.take(work, {});
  EXPECT_NEAR(account.damping(), 10.0 * 0.1, 1e-12);  // noise counts at either end
  account.take(took(0.0), {});
  EXPECT_NEAR(account.putIn(), 0.25, 1e-15);
  work = took(0.0);
  work.dissipated = 0.2;
  account.take(work, {});
  EXPECT_EQ(account.damping(), 0.0);
  EXPECT_EQ(account.paid(), 0.0);
  account.take(took(0.1), {});  // nothing of it was kept: there is no reserve
  EXPECT_NEAR(account.damping(), 1.0, 1e-12);
}

// The model's own books: what it took of the wrench is what is in it, and what was damped away.
TEST(AdmittanceModel, KeepsItsBooksUnderDamping) {
  ModalModel base;
  base.Phi = Mat6::Identity() * 0.05;
  base.stiffness = Vec6(4.0, 9.0, 1.0, 2.0, 0.0, 25.0);
  Mat6 M_1 = Mat6::Zero();
  M_1.diagonal() << 70.0, 70.0, 70.0, 8.0, 8.0, 3.0;
  M_1(0, 4) = M_1(4, 0) = 20.0;
  Mat6 coupling = Mat6::Identity() * 0.1;
  coupling(0, 1) = coupling(1, 0) = 0.05;
  for (const auto& [with_robot, own] : {std::pair{false, Mat6(Mat6::Zero())},
                                        {true, Mat6(Mat6::Zero())},
                                        {false, Mat6(Mat6::Identity() * 0.1)},
                                        {true, Mat6(Mat6::Identity() * 0.1)},
                                        {true, coupling}}) {
    base.damping = own;
    AdmittanceModel model(base, 0.01);
    double taken = 0.0, damped = 0.0, dissipated = 0.0;
    const auto energy = [&, with_robot = with_robot] {
      const Vec6 x_dot = with_robot ? Vec6(model.motion().x_dot) : Vec6(Vec6::Zero());
      return model.energy() + 0.5 * x_dot.dot(M_1 * x_dot);
    };
    for (int k = 0; k < 400; ++k) {
      const Wrench F{Vec3(30.0 * std::sin(0.05 * k), 10.0, 0.0), Vec3(0.0, 5.0, 0.0)};
      if (with_robot)
        model.step(F, M_1, 0.01, 0.0, k > 100 ? 5.0 : 0.0);
      else
        model.step(F, k > 100 ? 5.0 : 0.0);
      taken += model.taken(F);
      damped += model.damped();
      dissipated += model.dissipated();
      if (k == 100) {
        EXPECT_EQ(damped, 0.0);
      }
      // The speed is no line: off by the square of a step's share in the fastest period.
      EXPECT_NEAR(energy(), taken - damped - dissipated, 1e-9 * (1.0 + taken) + 1e-3 * dissipated)
          << with_robot << " " << k;
    }
    EXPECT_GT(damped, 0.3 * (taken - dissipated));
    EXPECT_EQ(dissipated > 0.01 * taken, !own.isZero(0.0));
  }
}

// Of a wrench that is noise alone, the model takes on average what it says.
TEST(AdmittanceModel, KnowsWhatItTakesOfNoise) {
  ModalModel base;
  base.Phi = Mat6::Identity() * 0.05;
  base.Phi(0, 4) = 0.03;
  base.stiffness = Vec6(4.0, 9.0, 1.0, 2.0, 0.0, 25.0);
  base.damping = Mat6::Identity() * 2.0;
  Mat6 M_1 = Mat6::Zero();
  M_1.diagonal() << 70.0, 70.0, 70.0, 8.0, 8.0, 3.0;
  Mat6 root = Vec6(3.0, 1.0, 2.0, 0.5, 0.2, 0.1).asDiagonal();
  root(0, 4) = 0.3;
  for (const bool with_robot : {false, true}) {
    AdmittanceModel model(base, 0.01);
    std::mt19937 engine(3);
    std::normal_distribution<double> normal;
    double taken = 0.0, said = 0.0;
    constexpr int kSteps = 200000;  // 100 times the longest mode's memory, and more
    for (int k = 0; k < kSteps; ++k) {
      Vec6 one;
      for (int i = 0; i < 6; ++i) one(i) = normal(engine);
      const Wrench F = Wrench::from(root * one);
      if (with_robot)
        model.step(F, M_1, 0.01, 0.0);
      else
        model.step(F);
      taken += model.taken(F);
      said += model.takenOfNoise(root * root.transpose());
    }
    EXPECT_NEAR(taken / said, 1.0, 0.03) << with_robot;
  }
}

// Nobody touches a base whose robot stands still: for ten minutes its noise is not paid for.
TEST(EnergyAccount, DampsNothingThatIsNoise) {
  for (const char* robot : {"puma", "doss"}) {
    const Experiment e = test::experiment(
        fmt::format("srms_unberth_{}", robot),
        {"controller.passivity.enabled=true", "controller.compensation.feed_forward=true",
         "controller.compensation.observer=true", "controller.compensation.inertia=true",
         "sensor.readings_per_tick=4",
         "program=[{calibration: {}}, {admittance: {duration_s: 600}}]"});
    Lockstep machine(e.controller, e.plant);
    machine.step({Request::kStart, {}, {}});
    int ticks = 0, damped = 0;
    while (!test::done(machine.state())) {
      const TickState& s = machine.step();
      if (s.kind != SegmentKind::kAdmittance || s.phase != Phase::kRunning) continue;
      ++ticks;
      damped += s.passivity_damping > 0.0;
    }
    EXPECT_GT(ticks, 59000) << robot;
    EXPECT_LT(damped, ticks / 100) << robot;
  }
}

// Damping takes momentum from base and robot alike: what is afloat, coupled or not, keeps going its
// way and loses the same share of its speed each step. So gently that its attitude does not turn
// what it carries.
TEST(AdmittanceModel, IsDampedAlongItsWay) {
  ModalModel base;
  base.Phi = Mat6::Identity() * 0.05;
  base.Phi(0, 4) = 0.02;
  base.stiffness = Vec6::Zero();
  base.damping = Mat6::Zero();
  Mat6 M_1 = Mat6::Zero();
  M_1.diagonal() << 700.0, 700.0, 700.0, 80.0, 80.0, 30.0;
  M_1(0, 4) = M_1(4, 0) = 200.0;
  const double T = 0.01, rate = 5.0;
  for (const bool with_robot : {false, true}) {
    AdmittanceModel model(base, T);
    const auto step = [&](const Wrench& F, double damping) {
      if (with_robot)
        model.step(F, M_1, T, 0.0, damping);
      else
        model.step(F, damping);
      return Vec6(model.motion().x_dot);
    };
    const Vec6 start = step({Vec3(3e-6, -2e-6, 1e-6), Vec3(5e-7, 1e-7, -7e-7)}, 0.0);
    ASSERT_GT(start.norm(), 1e-11);
    double left = 1.0;
    for (int k = 0; k < 50; ++k) {
      left *= 1.0 - rate * T;  // held over the step
      EXPECT_LT((step({}, rate) - left * start).norm(), 1e-12 * start.norm()) << with_robot;
    }
  }
}

/// A ball of 100 kg against the PUMA on a base of 500 kg afloat.
Experiment meeting(bool passive, bool compensated, double stiffness = 4e4, double reserve = 1e-3) {
  return test::experiment(
      "puma_on_table_4_1",
      {"gravity_m_per_s2=0", "sensor.noise=false", "initial_pose={}",
       "base.damping_diagonal=[0, 0, 0, 0, 0, 0]", "base.stiffness_diagonal=[0, 0, 0, 0, 0, 0]",
       fmt::format("controller.compensation.feed_forward={}", compensated),
       fmt::format("controller.compensation.observer={}", compensated),
       fmt::format("controller.compensation.inertia={}", compensated),
       fmt::format("sensor.readings_per_tick={}", compensated ? 4 : 1),
       fmt::format("controller.passivity.enabled={}", passive),
       fmt::format("controller.passivity.reserve_j={}", reserve),
       "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 2}}]",
       fmt::format("environment={{tool: [{{radius_m: 0.02}}], contact: {{stiffness: {}}}, target: "
                   "{{mass_kg: 100, from_tool_m: [0.324, 0, 0], velocity_m_per_s: [-0.03, 0, 0], "
                   "ball: {{radius_m: 0.3}}}}}}",
                   stiffness)});
}

struct Books {
  double energy = 0.0, put_in = 0.0, paid = 0.0;  // [J]; at the start: the ball's
  double most_step = 0.0;                         // [m/s^2] between two ticks' accelerations
};
Books books(const Experiment& e) {
  const Mat6 M_1 =
      spatialMass(combine(RigidBody{}, e.plant.payload.X_PL0(),
                          compositeBody(carried(e.plant.payload), e.plant.task.initial_joints)));
  const Eigen::MatrixXd inverse =
      leastSquares(linearised(e.controller.vehicle).Phi, Mat6::Identity());
  Lockstep machine(e.controller, e.plant);
  machine.step({Request::kStart, {}, {}});
  Books out;
  Vec6 begun = Vec6::Zero(), before = Vec6::Zero();
  int ticks = 0;
  while (!test::done(machine.state())) {
    const TickState& s = machine.step();
    if (s.kind != SegmentKind::kAdmittance || s.phase != Phase::kRunning) continue;
    const plant::Truth& t = machine.plant().truth();
    ++ticks;
    out.put_in = s.energy_put_in;
    out.paid = s.energy_paid;
    if (ticks > 120)
      out.most_step = std::max(out.most_step, (s.motion.x_ddot - before).head<3>().norm());
    before = s.motion.x_ddot;
    if (ticks == 170) begun = t.x.stacked();
    if (ticks != 190) continue;
    const Vec6 x_dot = (t.x.stacked() - begun) / (20 * e.controller.periodSeconds());
    const Eigen::VectorXd eta_dot = inverse * x_dot;
    const Target& ball = *e.plant.task.world->environment.target;
    out.energy =
        0.5 * (eta_dot.squaredNorm() + x_dot.dot(M_1 * x_dot) +
               ball.mass * t.target.v.squaredNorm() + t.target.w.dot(ball.I_Bcm_B * t.target.w)) -
        0.5 * ball.mass * 0.03 * 0.03;
  }
  return out;
}

// The machine gives energy at a stiff contact; its own books say how much, and it can be taken
// back.
TEST(EnergyAccount, SaysWhatAMachineGivesAndTakesItBack) {
  constexpr double kBall = 0.5 * 100.0 * 0.03 * 0.03;  // [J]
  for (const bool compensated : {false, true}) {
    const Books free = books(meeting(false, compensated));
    EXPECT_GT(free.energy, compensated ? 1e-3 : 0.02) << compensated;
    // A mean over the tick tells a short contact better than one reading in it.
    EXPECT_NEAR(free.put_in, free.energy, (compensated ? 0.025 : 0.04) * kBall) << compensated;
    EXPECT_EQ(free.paid, 0.0);
    const Books passive = books(meeting(true, compensated));
    EXPECT_LT(passive.energy, 0.25 * free.energy + 1e-3) << compensated;
    EXPECT_GT(passive.paid, 0.5 * free.energy) << compensated;
    EXPECT_LT(passive.most_step, 0.1) << compensated;
  }
  // In a soft contact too, where legs that move in whole counts shake the robot.
  const Books soft = books(meeting(false, false, 1e3));
  EXPECT_NEAR(soft.put_in, soft.energy, 0.05 * kBall);
}

// However stiff it is, up to the sensor's range: without a reserve no contact gains energy, and the
// soft ones lose less than 0.4 of what the ball brought.
TEST(EnergyAccount, LetsNoContactGainEnergy) {
  constexpr double kBall = 0.5 * 100.0 * 0.03 * 0.03;  // [J]
  for (const bool compensated : {false, true})
    for (const double stiffness : {1e3, 1e4, 4e4, 1.3e5, 2.5e5}) {
      const double gain = books(meeting(true, compensated, stiffness, 0.0)).energy;
      EXPECT_LT(gain, 0.0) << compensated << " " << stiffness;
      if (stiffness < 2e4) {
        EXPECT_GT(gain, -0.4 * kBall) << compensated << " " << stiffness;
      }
    }
}

}  // namespace
}  // namespace ves
