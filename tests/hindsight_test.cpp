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

}  // namespace
}  // namespace ves
