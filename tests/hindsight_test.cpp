// SPDX-License-Identifier: BSD-3-Clause
//
// Hindsight: what a wrench would have done to the base, had it been known in time, is made good.
#include <gtest/gtest.h>

#include "ves/control/hindsight.hpp"

namespace ves {
namespace {

constexpr double kStep = 0.01;  // [s]

/// Two damped modes, along x and about y.
AdmittanceModel twoModes() {
  ModalModel out;
  out.Phi.setZero(6, 2);
  out.Phi(0, 0) = out.Phi(4, 1) = 0.1;
  out.stiffness = Eigen::Vector2d(9.0, 40.0);
  out.damping = Eigen::Vector2d(0.6, 1.0).asDiagonal();
  return AdmittanceModel(out, kStep);
}

/// A model that feels what happens, and one that is told of it later.
struct Pair {
  AdmittanceModel feels = twoModes(), learns = twoModes();
  Hindsight hindsight{kStep};
  int displaced = 0;

  Pair() {
    for (AdmittanceModel* model : {&feels, &learns}) model->reset(Vec6::Zero());
    hindsight.reset(learns, Lesson());
  }
  void step(const Wrench& happens, const Lesson& lesson) {
    feels.step(happens, Mat6(Mat6::Zero()), kStep, 0.0);
    learns.step({}, Mat6(Mat6::Zero()), kStep, 0.0);
    hindsight.step(learns, Mat6::Zero(), kStep, lesson);
    if (!hindsight.any()) return;
    ++displaced;
    learns.displace(hindsight.due());
  }
  double apart() const { return (feels.motion().x - learns.motion().x).norm(); }
};

constexpr int kReplayed = 4 * Lesson::kGroup;
const Wrench kTouch{{20.0, 0.0, 0.0}, {0.0, 5.0, 0.0}};

void withhold(Pair& pair) {
  for (int i = 0; i < kReplayed; ++i) {
    Lesson lesson;
    lesson.withheld = kTouch;
    lesson.group_ends = i % Lesson::kGroup == Lesson::kGroup - 1;
    if (i == kReplayed - 1) lesson.replay = kReplayed;
    pair.step(kTouch, lesson);
  }
}

TEST(Hindsight, WhatWasWithheldIsMadeGood) {
  Pair pair;
  withhold(pair);
  EXPECT_GT(pair.apart(), 1e-4);
  for (int i = 0; i < 40; ++i) pair.step({}, Lesson());
  EXPECT_GT(pair.feels.motion().x.norm(), 1e-3);
  EXPECT_LT(pair.apart(), 1e-15);
  EXPECT_EQ(pair.displaced, 20);  // by and by, over 0.2 s, and then no more
  EXPECT_FALSE(pair.hindsight.any());
}

TEST(Hindsight, ABaseThatBeginsAnewIsOwedNothing) {
  Pair pair;
  withhold(pair);
  ASSERT_TRUE(pair.hindsight.any());
  pair.hindsight.reset(pair.learns, Lesson());
  EXPECT_FALSE(pair.hindsight.any());
  pair.displaced = 0;
  for (int i = 0; i < 40; ++i) pair.step({}, Lesson());
  EXPECT_EQ(pair.displaced, 0);
  // Nor is what was withheld before then what is replayed.
  Lesson lesson;
  lesson.replay = kReplayed;
  const Vec6 before = pair.learns.motion().x;
  Pair quiet;
  quiet.step({}, lesson);
  EXPECT_EQ(quiet.hindsight.due().eta.norm(), 0.0);
  pair.hindsight.step(pair.learns, Mat6::Zero(), kStep, lesson);
  EXPECT_EQ(pair.hindsight.due().eta.norm(), 0.0);
  EXPECT_EQ(pair.learns.motion().x, before);
}

TEST(Hindsight, NothingIsDueInNoTime) {
  Pair pair;
  withhold(pair);
  ASSERT_TRUE(pair.hindsight.any());
  Lesson lesson;
  lesson.withheld = kTouch;
  pair.hindsight.step(pair.learns, Mat6::Zero(), 0.0, lesson);
  EXPECT_FALSE(pair.hindsight.any());
  for (int i = 0; i < 40; ++i) pair.step({}, Lesson());
  EXPECT_LT(pair.apart(), 1e-15);  // the rest of it came later, and no more than that
}

/// With so much of one parameter more in the robot, whose momentum goes to and fro.
double learntApart(double parameter, double stiffness) {
  ModalModel base;
  base.Phi = 0.1 * Vec6::Unit(0);
  base.stiffness.setConstant(1, stiffness);
  base.damping.setConstant(1, 1, 0.5);
  AdmittanceModel feels(base, kStep), learns(base, kStep);
  Hindsight hindsight(kStep);
  Lesson lesson;
  lesson.momentum.setZero(6, 1);
  for (AdmittanceModel* model : {&feels, &learns}) model->reset(Vec6::Zero());
  hindsight.reset(learns, lesson);
  const auto momentum = [](int n) { return 3.0 * (1.0 - std::cos(2.0 * n * kStep)); };
  constexpr int kTicks = 300, kTold = 150;
  for (int n = 1; n <= kTicks; ++n) {
    const Wrench reaction{{-parameter * (momentum(n) - momentum(n - 1)) / kStep, 0.0, 0.0}, {}};
    feels.step(reaction, Mat6(Mat6::Zero()), kStep, 0.0);
    learns.step(n > kTold ? reaction : Wrench{}, Mat6(Mat6::Zero()), kStep, 0.0);
    lesson.momentum(0, 0) = momentum(n);
    lesson.learnt.resize(0);
    if (n == kTold) lesson.learnt = MassVector::Constant(1, parameter);
    hindsight.step(learns, Mat6::Zero(), kStep, lesson);
    if (hindsight.any()) learns.displace(hindsight.due());
  }
  return (feels.motion().x - learns.motion().x).norm() / feels.motion().x.norm();
}

TEST(Hindsight, OfAMassThatIsLearntTheBaseIsWhereItWouldBe) {
  EXPECT_LT(learntApart(4.0, 6.0), 0.02);
  // A mode faster than the step follows at once: what it is owed stays bounded.
  EXPECT_LT(learntApart(4.0, 9e4), 2.0);
}

// --- What masses do to a body that floats --------------------------------------------------------

/// A tumbling body with another on it, rigidly, of `scale` times its mass.
struct Tumbling {
  static constexpr double kTick = 0.002;  // [s]

  FreeBody vehicle;
  Mat6 M_1P;

  Tumbling(double scale, bool fires) : vehicle(model(fires), kTick) {
    RigidBody body;
    body.mass = 20.0;
    body.p_BoBcm_B = Vec3(0.4, -0.2, 0.5);
    body.I_Bcm_B = Vec3(2.0, 1.0, 1.5).asDiagonal();
    M_1P = scale * spatialMass(body);
    vehicle.reset(Vec6::Zero(), M_1P);
  }
  static FreeBodyModel model(bool fires) {
    FreeBodyModel out;
    out.body_P.mass = 100.0;
    out.body_P.p_BoBcm_B = Vec3(0.0, 0.1, -0.3);
    out.body_P.I_Bcm_B = Vec3(20.0, 30.0, 25.0).asDiagonal();
    out.v_IPo_I = Vec3(50.0, 0.0, -10.0);
    out.w_IP_I = Vec3(0.3, 0.1, -0.2);
    if (fires) {
      Thruster& jet = out.propulsion.thrusters[0];
      jet.p_PoT_P = Vec3(0.5, 0.0, -0.3);
      jet.force_P = Vec3(0.0, 4.0, 1.0);
      jet.firings[0] = {1.0, 3.0};
      jet.size = 1;
      out.propulsion.size = 1;
    }
    return out;
  }
  Mat6 M_1() const { return rotated(vehicle.state().R_IP, M_1P); }
  void step() {
    CarriedBody carried(M_1());
    carried.R_IP_before = carried.R_IP = vehicle.state().R_IP;
    vehicle.step({}, carried, kTick, 0.0);
  }
};

// One that counts from the beginning, and one from where the vehicle becomes heavier.
TEST(Sensitivity, OfABodyThatFloatsIsTheDifferenceOfTwoThatTumble) {
  for (const bool fires : {false, true})
    for (const double heavier : {1.0, 1.5}) {
      constexpr double kMore = 1e-5;  // [-]
      constexpr int kSteps = 3000, kMiddle = 1500;
      Tumbling one(1.0, fires), other(1.0 + kMore, fires), later(1.0, fires);
      Sensitivity s;
      for (Sensitivity::Columns* columns : {&s.eta, &s.eta_dot, &s.momentum}) columns->resize(6, 2);
      const auto momentum = [&] {
        const RigidState& at = one.vehicle.state();
        const Vec6 own = one.M_1() * (Vec6() << at.v - one.vehicle.letGo(), at.w).finished();
        MassColumns out(6, 2);
        out << own, own;
        return out;
      };
      begin(s, one.vehicle, momentum(), 0, 2);
      for (int i = 0; i < kSteps; ++i) {
        if (i == kMiddle) {
          for (Tumbling* t : {&one, &other, &later}) t->vehicle.become({heavier, 1.0, 1.0});
          later.M_1P *= 1.0 + kMore;
          begin(s, one.vehicle, momentum(), 1, 1);
        }
        for (Tumbling* t : {&one, &other, &later}) t->step();
        advance(s, one.vehicle, momentum(), {}, Tumbling::kTick);
      }
      const RigidState& a = one.vehicle.state();
      for (int j = 0; j < 2; ++j) {
        const RigidState& b = (j == 0 ? other : later).vehicle.state();
        Vec6 moved, faster;
        moved << b.p - a.p, rotationVector(b.R_IP * a.R_IP.transpose());
        faster << b.v - a.v, b.w - a.w;
        EXPECT_GT(moved.head<3>().norm(), 0.002 * kMore) << j;
        EXPECT_GT(moved.tail<3>().norm(), 0.002 * kMore) << j;
        EXPECT_LT((moved / kMore - s.eta.col(j)).norm(), 0.01 * s.eta.col(j).norm())
            << j << fires << heavier << '\n'
            << (moved / kMore).transpose() << '\n'
            << s.eta.col(j).transpose();
        EXPECT_LT((faster / kMore - s.eta_dot.col(j)).norm(), 0.01 * s.eta_dot.col(j).norm())
            << j << fires << heavier;
      }
    }
}

}  // namespace
}  // namespace ves
