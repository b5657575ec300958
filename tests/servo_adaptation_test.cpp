// SPDX-License-Identifier: BSD-3-Clause
//
// The servos' gains and delay, learnt beside the simulated machine's own LegSlaves and cylinders.
#include "ves/control/servo_adaptation.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "support/leg.hpp"
#include "support/rig.hpp"
#include "ves/control/leg_estimator.hpp"

namespace ves {
namespace {

using test::kTick;

constexpr double kPeriod = 0.01;  // [s]
const AdaptationSettings kSettings = {0.05, 5e-4, 1.5, 60.0};

/// A leg of the machine that swings, and what is learnt of it. All six readings are of this leg.
class Learning {
 public:
  /// Gains `extend` and `retract` times the believed ones, commands `late` [s] on the way.
  Learning(double extend, double retract, double late,
           const AdaptationSettings& settings = kSettings, int K_D = 0)
      : e_(test::experiment("z_sine", {"legs.K_D=" + std::to_string(K_D)})),
        late_(late),
        leg_(machine(e_.plant, extend, retract), kMiddle),
        learns_(e_.controller.servo, settings, kPeriod) {
    learns_.reset(Vec6::Constant(kMiddle), 0);
    counts_ = leg_.config.transducer.count(kMiddle);
  }

  /// On by `time` [s], the reference swinging by `amplitude` [m] in two frequencies.
  void swing(double time, double amplitude) {
    for (const std::int64_t end = k_ + std::lround(time / kPeriod); k_ < end; ++k_) {
      const double t = static_cast<double>(k_) * kPeriod;
      const double r = kMiddle + amplitude * (std::sin(2.0 * M_PI * 0.9 * t) +
                                              0.3 * std::sin(2.0 * M_PI * 2.3 * t));
      const LegCounts counts = legCounts(e_.controller.legs, Vec6::Constant(r));
      learns_.send(legLengths(e_.controller.legs, counts), k_, k_ * kTick);
      leg_.run(counts_, late_);
      counts_ = counts[0];
      leg_.run(counts_, kPeriod - late_);
      if (echoes) learns_.arrived(k_, k_ * kTick + std::llround(late_ * 1e9));
      learns_.learn(Vec6::Constant(reading()), (k_ + 1) * kTick);
    }
  }
  double reading() const {
    LegCounts read{};
    read.fill(leg_.config.transducer.count(leg_.actuator.length()));
    return legLengths(e_.controller.legs, read)(0);
  }

  /// At rest, the cylinder's gains change by a factor.
  void become(double factor) {
    leg_.config.actuator.gain_extend *= factor;
    leg_.config.actuator.gain_retract *= factor;
    leg_.actuator = plant::Actuator(leg_.config.actuator, leg_.actuator.length());
  }

  const ServoModel& believed() const { return e_.controller.servo; }
  double extend() const { return learns_.gains().extend(0) / believed().extend(0); }
  double retract() const { return learns_.gains().retract(0) / believed().retract(0); }
  double delay() const { return learns_.gains().delay(0) - believed().delay(0); }
  ServoAdaptation& learns() { return learns_; }
  bool echoes = false;  // the machine says when a command came
  std::int64_t time() const { return k_ * kTick; }

 private:
  static constexpr double kMiddle = 1.5;  // [m]
  static plant::PlantConfig machine(plant::PlantConfig p, double extend, double retract) {
    p.actuator.gain_extend *= extend;
    p.actuator.gain_retract *= retract;
    return p;
  }
  Experiment e_;
  double late_;
  test::Leg leg_;
  ServoAdaptation learns_;
  std::int32_t counts_ = 0;
  std::int64_t k_ = 0;
};

TEST(ServoAdaptation, FindsWhatTheServosAreOffBy) {
  for (const auto& [extend, retract, late] :
       {std::tuple{1.05, 0.97, 0.0}, std::tuple{0.95, 0.95, 3e-4}, std::tuple{1.0, 1.06, 6e-4},
        std::tuple{1.0, 1.0, 0.0}}) {
    Learning one(extend, retract, late);
    one.swing(20.0, 0.02);  // what is of second order, 0.05^2, is left
    EXPECT_NEAR(one.extend(), extend, 0.006) << extend << retract << late;
    EXPECT_NEAR(one.retract(), retract, 0.006) << extend << retract << late;
    // A LegSlave looks anywhere in its update of 0.7 ms; the model takes the middle.
    EXPECT_NEAR(one.delay(), late, 3e-4) << extend << retract << late;
  }
}

class Valves : public testing::TestWithParam<double> {};  // [m] opening

TEST_P(Valves, ServoAdaptationKnowsTheirEdges) {
  // Against servos of the same kind whose gains are off, slow enough to spend half of its time
  // there.
  ServoModel believed = test::experiment("z_sine").controller.servo;
  believed.opening.setConstant(GetParam());
  ServoModel truth = believed;
  truth.extend *= 1.05;
  truth.retract *= 0.96;
  ModelledServos machine(truth, kPeriod, 0.5);
  ServoAdaptation learns(believed, kSettings, kPeriod);
  const Vec6 middle = Vec6::Constant(1.5);
  machine.reset(middle, 0);
  learns.reset(middle, 0);
  for (std::int64_t k = 0; k < 4000; ++k) {
    const double t = static_cast<double>(k) * kPeriod;
    const Vec6 r = middle + Vec6::Constant(0.004 * std::sin(2.0 * M_PI * 0.5 * t) +
                                           0.0015 * std::sin(2.0 * M_PI * 2.3 * t));
    machine.send(r, k, k * kTick);
    learns.send(r, k, k * kTick);
    machine.advance((k + 1) * kTick);
    learns.learn(machine.length(), (k + 1) * kTick);
  }
  EXPECT_NEAR(learns.gains().extend(0) / believed.extend(0), 1.05, 0.01);
  EXPECT_NEAR(learns.gains().retract(0) / believed.retract(0), 0.96, 0.01);
}
INSTANTIATE_TEST_SUITE_P(OpenAndLapped, Valves, testing::Values(3e-4, -3e-4, -1e-3));

TEST(ServoAdaptation, KnowsTheDerivativeGainAndTheRail) {
  Learning derivative(1.05, 0.96, 0.0, kSettings, 3000);
  derivative.swing(20.0, 0.02);
  EXPECT_NEAR(derivative.extend(), 1.05, 0.006);
  EXPECT_NEAR(derivative.retract(), 0.96, 0.006);
  // At the rail a leg goes as quickly as it can, whatever it is away by.
  Learning rail(1.05, 0.96, 0.0);
  ASSERT_GT(2.0 * M_PI * 0.9 * 0.18, rail.believed().retract(0) * rail.believed().rail);
  rail.swing(20.0, 0.18);
  EXPECT_NEAR(rail.extend(), 1.05, 0.006);
  EXPECT_NEAR(rail.retract(), 0.96, 0.006);
}

TEST(ServoAdaptation, ACommandCountsFromWhenTheMachineSaysItCame) {
  // 4 ms on the way: told so, it is no delay of the servos.
  Learning told(1.0, 1.0, 0.004), untold(1.0, 1.0, 0.004);
  told.echoes = true;
  for (Learning* one : {&told, &untold}) one->swing(5.0, 0.02);
  EXPECT_NEAR(told.delay(), 0.0, 3e-4);
  EXPECT_NEAR(untold.delay(), 1.5 * kSettings.delay, 1e-12);
}

TEST(ServoAdaptation, FollowsServosThatChange) {
  AdaptationSettings quick = kSettings;
  quick.forgetting = 5.0;
  Learning one(1.05, 1.05, 0.0, quick), slow(1.05, 1.05, 0.0);
  for (Learning* each : {&one, &slow}) each->swing(10.0, 0.02);
  EXPECT_NEAR(one.extend(), 1.05, 0.006);
  for (Learning* each : {&one, &slow}) {
    each->swing(1.0, 0.0);
    each->become(0.96 / 1.05);
    each->swing(20.0, 0.02);
  }
  EXPECT_NEAR(one.extend(), 0.96, 0.01);
  EXPECT_GT(slow.extend(), 0.975);  // ten seconds of the past weigh a third of what has come since
}

TEST(ServoAdaptation, KeepsWhatItHasWhileNothingMoves) {
  Learning one(1.05, 0.97, 0.0);
  one.swing(10.0, 0.02);
  one.swing(2.0, 0.0);  // comes to rest
  const ServoGains before = one.learns().gains();
  one.swing(100.0, 0.0);
  EXPECT_EQ(one.learns().gains().extend, before.extend);
  EXPECT_EQ(one.learns().gains().retract, before.retract);
  EXPECT_EQ(one.learns().gains().delay, before.delay);
  EXPECT_GT(one.extend(), 1.03);
  one.learns().reset(Vec6::Constant(1.5), one.time());  // a new start of the legs changes nothing
  EXPECT_EQ(one.learns().gains().extend, before.extend);
}

TEST(ServoAdaptation, GoesNoFurtherThanItMay) {
  for (const double factor : {0.8, 1.25}) {
    Learning one(factor, factor, 0.0);
    for (int k = 0; k < 40; ++k) {
      one.swing(0.5, 0.004);
      EXPECT_LE(std::abs(one.extend() - 1.0), 0.05 * 1.5 + 1e-12);
      EXPECT_LE(std::abs(one.retract() - 1.0), 0.05 * 1.5 + 1e-12);
      EXPECT_LE(std::abs(one.delay()), 5e-4 * 1.5 + 1e-12);
    }
    EXPECT_NEAR(one.extend(), factor < 1.0 ? 0.925 : 1.075, 1e-12);
  }
}

TEST(ServoAdaptation, AReadingThatNoServoExplainsTeachesNothing) {
  Learning one(1.03, 1.03, 0.0);
  one.swing(5.0, 0.02);
  const ServoGains before = one.learns().gains();
  one.learns().learn(Vec6::Constant(one.reading() + 0.02), one.time() + 1'000'000);
  one.learns().learn(Vec6::Constant(std::numeric_limits<double>::quiet_NaN()),
                     one.time() + 2'000'000);
  one.learns().learn(Vec6::Constant(one.reading() + 0.001), one.time() - kTick);  // in the past
  EXPECT_EQ(one.learns().gains().extend, before.extend);
  EXPECT_EQ(one.learns().gains().delay, before.delay);
}

TEST(ServoAdaptation, AReadingCountsUpToFiveOfItsDeviations) {
  const ServoModel believed = test::experiment("z_sine").controller.servo;
  AdaptationSettings settings = kSettings;
  settings.gain = 1e-9;  // of the delay alone is there doubt
  const auto learntFrom = [&](double deviations) {
    ModelledServos twin(believed, kPeriod, 0.5);
    ServoAdaptation learns(believed, settings, kPeriod);
    twin.reset(Vec6::Constant(1.5), 0);
    learns.reset(Vec6::Constant(1.5), 0);
    for (std::int64_t k = 0; k < 100; ++k) {
      const double t = static_cast<double>(k) * kPeriod;
      const Vec6 r = Vec6::Constant(1.5 + 0.02 * std::sin(2.0 * M_PI * 0.9 * t));
      twin.send(r, k, k * kTick);
      learns.send(r, k, k * kTick);
      twin.advance((k + 1) * kTick);
      const double v = twin.velocity()(0), count = believed.readings.scale(0);
      const double variance = 4.0 * count * count / 12.0 +  // of two roundings' mean
                              std::pow(believed.jitter * v, 2) + std::pow(settings.delay * v, 2);
      const double off = k == 99 ? deviations * std::sqrt(variance) : 0.0;
      learns.learn(twin.length().array() + off, (k + 1) * kTick);
    }
    return std::abs(learns.gains().delay(0) - believed.delay(0)) > 1e-9;
  };
  for (const double sign : {1.0, -1.0}) {
    EXPECT_TRUE(learntFrom(4.9 * sign));
    EXPECT_FALSE(learntFrom(5.1 * sign));
  }
}

/// Six legs of the machine that go alike, as a controller that adapts reads them.
class Adapting {
 public:
  /// Legs whose gains are `factor` times the believed ones.
  void become(double factor) {
    leg_.config.actuator.gain_extend = factor * e_.plant.actuator.gain_extend;
    leg_.config.actuator.gain_retract = factor * e_.plant.actuator.gain_retract;
    leg_.actuator = plant::Actuator(leg_.config.actuator, leg_.actuator.length());
  }
  /// A tick with the legs told to be at r [m]; by us, where they follow.
  void tick(double r, bool following) {
    const LegCounts counts = legCounts(e_.controller.legs, Vec6::Constant(r));
    if (following) estimator_.sent(counts, k_, k_ * kTick);
    leg_.run(counts[0], kPeriod);
    Sample s;
    s.sequence = k_;
    s.time = s.legs_time = s.wrench_time = ++k_ * kTick;
    s.legs.fill(leg_.config.transducer.count(leg_.actuator.length()));
    samples_.update(s, s.time, following, false);
    estimator_.update(samples_, {k_, k_, 0, 0, 0}, following, nothing_);
  }
  void swing(double about, double seconds) {
    for (int n = 0; n < std::lround(seconds / kPeriod); ++n) {
      const double t = n * kPeriod;
      tick(about + 0.008 * std::sin(2.0 * M_PI * 0.9 * t) + 0.002 * std::sin(2.0 * M_PI * 2.3 * t),
           true);
    }
  }
  double extend() const { return estimator_.gains().extend(0) / e_.controller.servo.extend(0); }

 private:
  Experiment e_ = test::experiment("z_sine", {"controller.compensation.feed_forward=true",
                                              "controller.compensation.observer=true",
                                              "controller.compensation.adaptation=true"});
  test::Leg leg_{e_.plant, 1.5};
  SampleStream samples_{kTick};
  LegCommander nothing_{e_.controller};
  LegEstimator estimator_{e_.controller};
  std::int64_t k_ = 0;
};

TEST(ServoAdaptation, GoesOnAfterSomebodyElseHasMovedTheLegs) {
  Adapting one;
  one.become(1.04);
  for (int n = 0; n < 10; ++n) one.tick(1.5, false);
  one.swing(1.5, 20.0);
  EXPECT_NEAR(one.extend(), 1.04, 0.015);
  for (int n = 0; n < 100; ++n) one.tick(1.6, false);
  EXPECT_NEAR(one.extend(), 1.04, 0.015);
  one.become(0.97);
  one.swing(1.6, 90.0);
  EXPECT_NEAR(one.extend(), 0.97, 0.02);
}

TEST(ServoAdaptation, WithoutDoubtOfTheBeliefNothingIsLearnt) {
  AdaptationSettings sure = kSettings;
  sure.gain = sure.delay = 0.0;
  Learning one(1.05, 1.05, 0.0, sure);
  one.swing(5.0, 0.02);
  EXPECT_EQ(one.extend(), 1.0);
  EXPECT_EQ(one.delay(), 0.0);
}

}  // namespace
}  // namespace ves
