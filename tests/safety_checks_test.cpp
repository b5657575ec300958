// SPDX-License-Identifier: BSD-3-Clause
//
// The safety checks one by one: just inside holds, just past trips, NaN trips; and the monitors
// that they read.
#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <random>
#include <set>
#include <sstream>

#include "support/poses.hpp"
#include "support/rig.hpp"
#include "ves/control/safety_monitor.hpp"

namespace ves {
namespace {

constexpr double kPeriod = 0.01;  // [s]

using test::experiment;
using test::kNan;

// Those of a pose.
bool clearAt(const SafetyLimits& limits, const Geometry& g, const Transform& X_IP) {
  return collideCheck(limits, g, X_IP, legLines(g, X_IP));
}
bool conditionedAt(const SafetyLimits& limits, const Geometry& g, const Transform& X_IP) {
  return conditioningCheck(limits, legLines(g, X_IP), jointRadius(g));
}
bool inCones(const JointAxes& axes, const SafetyLimits& limits, const Geometry& g,
             const Transform& X_IP) {
  return axes.check(limits, X_IP.R, legLines(g, X_IP));
}

class SafetyChecks : public testing::Test {
 protected:
  const Experiment e_ = experiment("z_sine");
  const SafetyLimits& l_ = e_.controller.safety;
  const Geometry& g_ = e_.controller.geometry;
  const Vec6 L_ = legLengths(g_, g_.fromHome({}));
};

TEST_F(SafetyChecks, Velocity) {
  for (int i = 0; i < 6; ++i) {
    for (double sign : {-1.0, 1.0}) {
      EXPECT_TRUE(velocityCheck(l_, L_ + sign * 0.999 * l_.leg_velocity * kPeriod * Vec6::Unit(i),
                                L_, kPeriod));
      EXPECT_FALSE(velocityCheck(l_, L_ + sign * 1.001 * l_.leg_velocity * kPeriod * Vec6::Unit(i),
                                 L_, kPeriod));
    }
    EXPECT_FALSE(velocityCheck(l_, L_ + kNan * Vec6::Unit(i), L_, kPeriod));
  }
}

TEST_F(SafetyChecks, PositionError) {  // scaled with speed
  for (int i = 0; i < 6; ++i) {
    for (double speed : {0.0, 0.1, 0.4, 0.7, 5.0}) {
      const Vec6 v = speed * Vec6::Unit(i);
      const double allowed = std::min(0.10, 0.010 + 0.12 * speed);  // config/ves.yaml
      EXPECT_TRUE(positionErrorCheck(l_, L_, L_ + 0.999 * allowed * Vec6::Unit(i), v));
      EXPECT_FALSE(positionErrorCheck(l_, L_, L_ - 1.001 * allowed * Vec6::Unit(i), v));
      const int other = (i + 1) % 6;  // a leg's speed excuses no other leg
      EXPECT_FALSE(positionErrorCheck(l_, L_, L_ + 0.0101 * Vec6::Unit(other), v));
    }
    EXPECT_FALSE(positionErrorCheck(l_, L_, L_ + kNan * Vec6::Unit(i), Vec6::Zero()));
    EXPECT_FALSE(positionErrorCheck(l_, L_, L_ + 0.01 * Vec6::Unit(i), kNan * Vec6::Ones()));
  }
}

TEST_F(SafetyChecks, EveryLegsJointsHaveACone) {
  // Either joint of one leg alone is elsewhere: that leg leans, the others as they did.
  const JointAxes axes(g_);
  for (std::size_t i = 0; i < kLegs; ++i)
    for (const bool base : {true, false}) {
      Geometry leans = g_;
      (base ? leans.p_IBi_I : leans.p_PPi_P)[i] += Vec3(0.9, 0.9, 0.0);
      SafetyLimits limits = l_;
      limits.joint_cone = 25 * kDegree;
      EXPECT_TRUE(inCones(axes, limits, g_, g_.fromHome({})));
      EXPECT_FALSE(inCones(axes, limits, leans, g_.fromHome({}))) << "leg " << i + 1;
    }
}

TEST_F(SafetyChecks, EveryLegAndEveryPairOfThemIsKeptClear) {
  const Transform home = g_.fromHome({});
  ASSERT_TRUE(clearAt(l_, g_, home));
  SafetyLimits slopes = l_, distances = l_;
  slopes.leg_clearance = 0.0;
  distances.plate_angle = 0.0;
  for (std::size_t i = 0; i < kLegs; ++i) {
    Geometry flat = g_;  // one leg alone, far out: nearly level
    flat.p_IBi_I[i] += 40.0 * flat.p_IBi_I[i].normalized();
    EXPECT_FALSE(clearAt(slopes, flat, home)) << "leg " << i + 1;
    for (std::size_t j = i + 1; j < kLegs; ++j) {
      Geometry near = g_;  // one beside the other
      const Vec3 beside(0.1 * l_.leg_clearance, 0.0, 0.0);
      near.p_IBi_I[j] = g_.p_IBi_I[i] + beside;
      near.p_PPi_P[j] = g_.p_PPi_P[i] + beside;
      EXPECT_FALSE(clearAt(distances, near, home)) << "legs " << i + 1 << " and " << j + 1;
    }
  }
}

TEST_F(SafetyChecks, MotionLimits) {
  for (int i = 0; i < 6; ++i) {
    const double limit = i < 3 ? 0.305 : 30 * kDegree;
    for (double sign : {-1.0, 1.0}) {
      EXPECT_TRUE(motionLimitsCheck(l_, Pose::from(sign * 0.999 * limit * Vec6::Unit(i))));
      EXPECT_FALSE(motionLimitsCheck(l_, Pose::from(sign * 1.001 * limit * Vec6::Unit(i))));
    }
    EXPECT_FALSE(motionLimitsCheck(l_, Pose::from(kNan * Vec6::Unit(i))));
  }
}

TEST_F(SafetyChecks, ActuatorLimits) {
  for (int i = 0; i < 6; ++i) {
    Vec6 L = L_;
    L(i) = l_.leg_max - 1e-6;
    EXPECT_TRUE(actuatorLimitsCheck(l_, L));
    for (double bad : {l_.leg_max + 1e-6, l_.leg_min - 1e-6, kNan}) {
      L(i) = bad;
      EXPECT_FALSE(actuatorLimitsCheck(l_, L)) << bad;
    }
  }
}

TEST_F(SafetyChecks, FlowLimits) {
  const double extend = l_.flow / l_.bore_area * kPeriod,
               retract = l_.flow / l_.rod_side_area * kPeriod;
  for (int i = 0; i < 6; ++i) {
    EXPECT_TRUE(flowLimitsCheck(l_, L_ + 0.999 * extend * Vec6::Unit(i), L_, kPeriod));
    EXPECT_FALSE(flowLimitsCheck(l_, L_ + 1.001 * extend * Vec6::Unit(i), L_, kPeriod));
    EXPECT_TRUE(flowLimitsCheck(l_, L_ - 0.999 * retract * Vec6::Unit(i), L_, kPeriod));
    EXPECT_FALSE(flowLimitsCheck(l_, L_ - 1.001 * retract * Vec6::Unit(i), L_, kPeriod));
    EXPECT_FALSE(flowLimitsCheck(l_, L_ + kNan * Vec6::Unit(i), L_, kPeriod));
  }
}

TEST_F(SafetyChecks, JointLimits) {
  const JointAxes axes(g_);
  SafetyLimits limits = l_;
  // A pure tilt turns the platform's joints by the tilt, and the legs a little.
  const Transform tilted = g_.fromHome({Vec3::Zero(), {20 * kDegree, 0.0, 0.0}});
  limits.joint_cone = 30 * kDegree;
  EXPECT_TRUE(inCones(axes, limits, g_, tilted));
  limits.joint_cone = 15 * kDegree;
  EXPECT_FALSE(inCones(axes, limits, g_, tilted));
  // A pure shift turns both ends alike: the angle of the most turned leg, by its cosine.
  const Transform shifted = g_.fromHome({{0.2, 0.0, 0.0}, Vec3::Zero()});
  double most = 0.0;
  for (std::size_t i = 0; i < kLegs; ++i) {
    const Vec3 a = g_.fromHome({}) * g_.p_PPi_P[i] - g_.p_IBi_I[i], b = a + Vec3(0.2, 0.0, 0.0);
    most = std::max(most, std::acos(a.dot(b) / a.norm() / b.norm()));
  }
  limits.joint_cone = most * 1.001;
  EXPECT_TRUE(inCones(axes, limits, g_, shifted));
  limits.joint_cone = most * 0.999;
  EXPECT_FALSE(inCones(axes, limits, g_, shifted));
  EXPECT_FALSE(inCones(axes, l_, g_, {Mat3::Identity(), {kNan, 0.0, 1.35}}));
}

TEST_F(SafetyChecks, SegmentDistanceIsTheSmallestOfManyPoints) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  const auto point = [&] { return Vec3(u(random), u(random), u(random)); };
  for (int k = 0; k < 300; ++k) {
    const Vec3 a = point(), b = point(), c = point(), d = k % 5 ? point() : Vec3(c + 0.7 * (b - a));
    double least = 1e9;
    constexpr int kGrid = 200;
    for (int i = 0; i <= kGrid; ++i)
      for (int j = 0; j <= kGrid; ++j)
        least = std::min(least, (a + (b - a) * i / kGrid - c - (d - c) * j / kGrid).norm());
    const double distance = segmentDistance(a, b, c, d);
    ASSERT_LE(distance, least + 1e-12);
    ASSERT_GE(distance, least - 0.02);  // of the grid
  }
}

TEST_F(SafetyChecks, Collide) {
  const Transform home = g_.fromHome({});
  SafetyLimits limits = l_;
  double least = 1e9;
  for (std::size_t i = 0; i < kLegs; ++i)
    for (std::size_t j = i + 1; j < kLegs; ++j)
      least = std::min(least, segmentDistance(g_.p_IBi_I[i], home * g_.p_PPi_P[i], g_.p_IBi_I[j],
                                              home * g_.p_PPi_P[j]));
  limits.leg_clearance = least * 0.999;
  EXPECT_TRUE(clearAt(limits, g_, home));
  limits.leg_clearance = least * 1.001;
  EXPECT_FALSE(clearAt(limits, g_, home));
  EXPECT_FALSE(clearAt(l_, g_, {Mat3::Identity(), {kNan, 0.0, 1.35}}));
}

TEST_F(SafetyChecks, TheWorkspaceItselfIsFreeOfTrips) {  // every coordinate alone, to its ends
  const JointAxes axes(g_);
  for (int i = 0; i < 6; ++i)
    for (double share = -0.99; share < 1.0; share += 0.09) {
      const Pose x = Pose::from(share * (i < 3 ? 0.305 : 30 * kDegree) * Vec6::Unit(i));
      const Transform X = g_.fromHome(x);
      EXPECT_TRUE(actuatorLimitsCheck(l_, legLengths(g_, X))) << x.stacked().transpose();
      EXPECT_TRUE(clearAt(l_, g_, X)) << x.stacked().transpose();
      EXPECT_TRUE(inCones(axes, l_, g_, X)) << x.stacked().transpose();
    }
}

TEST(TrippedSet, FirstIsTheHighestPriority) {
  Tripped t;
  EXPECT_EQ(t.first(), Check::kCount);
  t.require(Check::kFlow, false);
  t.require(Check::kCollide, false);
  t.require(Check::kPanicButton, true);
  EXPECT_EQ(t.first(), Check::kCollide);
  EXPECT_TRUE(t.has(Check::kFlow));
  EXPECT_FALSE(t.has(Check::kPanicButton));
}

TEST(PathChecks, ConditionNumberIsTheFrobeniusOneOfTheJacobian) {
  const Geometry g = test::geometry();
  SafetyLimits limits;
  for (const Pose& x : test::poses(200)) {
    const Transform X = g.fromHome(x);
    // The Jacobian by central differences of the lengths; its inverse by the SVD.
    Mat6 J;
    constexpr double h = 1e-6;
    for (int k = 0; k < 6; ++k) {
      const auto at = [&](double s) {
        Transform Y = X;
        if (k < 3)
          Y.p(k) += s;
        else
          Y.R = rotationOf(s * Vec3::Unit(k - 3)) * Y.R;
        return legLengths(g, Y);
      };
      J.col(k) = (at(h) - at(-h)) / (2.0 * h) / (k < 3 ? 1.0 : 0.55);  // the joints' circle
    }
    const Eigen::JacobiSVD<Mat6> svd(J);
    const Vec6 s = svd.singularValues();
    const double expected = s.norm() * s.cwiseInverse().norm() / 6.0;
    ASSERT_NEAR(conditionNumber(g, X), expected, 1e-6 * expected);
    limits.condition = expected * 1.001;
    EXPECT_TRUE(conditionedAt(limits, g, X));
    limits.condition = expected * 0.999;
    EXPECT_FALSE(conditionedAt(limits, g, X));
  }
  EXPECT_FALSE(conditionedAt(limits, g, {Mat3::Identity(), {NAN, 0.0, 1.35}}));
  // Flat: the legs cannot hold it.
  EXPECT_FALSE(conditionedAt(limits, g, {Mat3::Identity(), {0.0, 0.0, 0.0}}));
}

TEST(PathChecks, NoLegLiesDownOnAPlate) {
  const Geometry g = test::geometry();
  SafetyLimits limits;
  limits.leg_clearance = 0.0;
  const Transform home = g.fromHome({});
  double least = 1e9;
  for (std::size_t i = 0; i < kLegs; ++i) {
    const Vec3 leg = home * g.p_PPi_P[i] - g.p_IBi_I[i];
    least = std::min(least, std::asin(leg.z() / leg.norm()));
  }
  limits.plate_angle = least - 1e-6;
  EXPECT_TRUE(clearAt(limits, g, home));
  limits.plate_angle = least + 1e-6;
  EXPECT_FALSE(clearAt(limits, g, home));
}

/// A tick in which all is well: the platform stands at home, its sample is true.
struct Tick {
  ControllerConfig config = experiment("puma_on_table_4_1").controller;
  Proposal proposal = inverseKinematics(config.geometry, {atRest(Vec6::Zero())});
  LegContext context{proposal.legs.L, proposal.legs.L};
  Sample sample;
  Oscillation oscillation;
  Elapsed elapsed;
  bool conflict = false;
  int fresh = 1;                      // [-] samples, a tick apart, the last for each tick after it
  int silent = 0;                     // [-] ticks after the last sample
  Vec6 static_counts = Vec6::Zero();  // [count] of each sample more than of the one before

  Tick() {
    sample.sequence = 0;
    sample.switches = kPanicButtonClosed | kFloorMatClosed;
    sample.adc[kWrenchChannels] = (config.safety.pressure_min + config.safety.pressure_max) / 2;
    sample.legs = legCounts(config.legs, proposal.legs.L);
  }
  Tripped tripped() const {
    SampleStream samples(config.period);
    LegEstimator legs(config);
    SafetyMonitor monitor(config.safety, config.geometry, kPeriod);
    const LegCommander commander(config);
    Sample s = sample;
    for (int i = 0; i < fresh + silent; ++i) {
      if (i < fresh && i > 0) ++s.sequence;
      s.time = s.legs_time = s.wrench_time = s.joints_time = i * config.period;
      samples.update(s, s.time, true, conflict);
      legs.update(samples, elapsed, true, commander);
      monitor.watch(elapsed, samples, i * static_counts);
    }
    return monitor.check(proposal, {context, samples, legs, {}, oscillation, conflict}).tripped();
  }
};

/// Spoils what `check` alone is there for.
void spoil(Tick& t, Check check) {
  SafetyLimits& limits = t.config.safety;
  switch (check) {
    case Check::kPanicButton: t.sample.switches &= ~kPanicButtonClosed; return;
    case Check::kFloorMat: t.sample.switches &= ~kFloorMatClosed; return;
    case Check::kFinite: t.proposal.x.x_ddot(2) = kNan; return;
    case Check::kStale: t.silent = limits.stale_ticks + 1; return;
    case Check::kDevice: t.sample.faults = kRobotPiece; return;
    case Check::kOverrun: t.elapsed.missed = limits.stall_ticks + 1; return;
    case Check::kLeftAlone: limits.alone = 0.5 * kPeriod; return;
    case Check::kLegReading: limits.reading_patience = -1; return;
    case Check::kForwardKinematics: t.sample.legs = {0, 16383, 0, 16383, 0, 16383}; return;
    case Check::kPositionError: t.context.expected(3) += 2.0 * limits.position_error; return;
    case Check::kPressure: t.sample.adc[kWrenchChannels] = limits.pressure_max + 1; return;
    case Check::kSensorSaturated: t.sample.adc[2] = 32767; return;
    case Check::kSensorFrozen:
      t.fresh = limits.frozen_samples + 2;
      t.static_counts(0) = limits.frozen_counts;
      return;
    case Check::kOscillation: limits.growing_windows = 0; return;
    case Check::kMotionLimits: limits.translation = -1.0; return;
    case Check::kActuatorLimits: limits.leg_max = 0.0; return;
    case Check::kJointLimits: limits.joint_cone = kNan; return;
    case Check::kCollide: limits.leg_clearance = 10.0; return;
    case Check::kConditioning: limits.condition = 1.0; return;
    case Check::kVelocity: limits.leg_velocity = -1.0; return;
    case Check::kFlow: limits.flow = -1.0; return;
    case Check::kConflictingNode: t.conflict = true; return;
    case Check::kCount: return;
  }
}

TEST(SafetyMonitor, AsksEveryCheck) {
  EXPECT_FALSE(Tick().tripped().any()) << name(Tick().tripped().first());
  for (const CheckMeaning& one : kChecks) {
    Tick tick;
    spoil(tick, one.check);
    EXPECT_TRUE(tick.tripped().has(one.check)) << one.name;
    // What has no pose has no length either.
    if (one.check == Check::kForwardKinematics) continue;
    EXPECT_EQ(tick.tripped().bits(), 1u << static_cast<unsigned>(one.check)) << one.name;
  }
}

TEST(SafetyMonitor, TheLimitsOfACheckAreKeys) {
  SafetyLimits l;
  std::set<std::string> keys;
  std::apply([&](const auto&... limit) { (keys.insert(limit.key), ...); }, limitTable(l, 1.0));
  for (const CheckMeaning& one : kChecks) {
    std::istringstream words{std::string(one.limits)};
    for (std::string key; words >> key;) EXPECT_TRUE(keys.count(key)) << one.name << ": " << key;
  }
}

TEST(SafetyMonitor, NothingThatIsNotFinitePasses) {
  const ControllerConfig c = experiment("puma_on_table_4_1").controller;
  const Proposal good = inverseKinematics(c.geometry, {atRest(Vec6::Zero())});
  const auto finite = [&](const Proposal& p, const Sample& sample, const Wrench& dynamic) {
    SampleStream samples(c.period);
    samples.update(sample, 0, false, false);
    const SafetyMonitor monitor(c.safety, c.geometry, kPeriod);
    const LegContext context{good.legs.L, good.legs.L};
    return !monitor.check(p, {context, samples, LegEstimator(c), dynamic, Oscillation(), false})
                .tripped()
                .has(Check::kFinite);
  };
  Sample sample;
  sample.sequence = 0;
  EXPECT_TRUE(finite(good, sample, {}));
  for (const double bad : {kNan, HUGE_VAL, -HUGE_VAL})
    for (int i = 0; i < 6; ++i) {
      for (Vec6 PathPoint<6>::*part :
           {&PathPoint<6>::x, &PathPoint<6>::x_dot, &PathPoint<6>::x_ddot}) {
        Proposal p = good;
        (p.x.*part)(i) = bad;
        EXPECT_FALSE(finite(p, sample, {})) << i;
      }
      Proposal p = good;
      p.legs.L(i) = bad;
      EXPECT_FALSE(finite(p, sample, {})) << i;
      Vec6 wrench = Vec6::Zero();
      wrench(i) = bad;
      EXPECT_FALSE(finite(good, sample, Wrench::from(wrench))) << i;
      Sample joint = sample;
      joint.q(i) = bad;
      EXPECT_FALSE(finite(good, joint, {})) << i;
    }
}

// --- Monitors ------------------------------------------------------------------------------------

TEST(Overruns, OneStallOrTooManyInASecondAndNoMoreAfterIt) {
  SafetyLimits limits;
  limits.stall_ticks = 3;
  limits.overruns = 2;
  Overruns overruns;
  overruns.take(10, 3);
  EXPECT_TRUE(overruns.good(limits, 100));
  overruns.take(20, 4);  // one stall too long
  EXPECT_FALSE(overruns.good(limits, 100));
  overruns.take(21, 0);
  EXPECT_TRUE(overruns.good(limits, 100));
  overruns.take(30, 1);  // the third in a second
  EXPECT_FALSE(overruns.good(limits, 100));
  overruns.take(110, 0);  // the first is 100 ticks ago: still within the second
  EXPECT_FALSE(overruns.good(limits, 100));
  overruns.take(111, 0);
  EXPECT_TRUE(overruns.good(limits, 100));
}

TEST(Oscillation, NeedsGrowthInEveryWindowAboveItsFloorWhileTheRobotStands) {
  SafetyLimits limits;
  limits.growing_windows = 4;
  limits.window = 0.5;
  limits.window_growth = 1.2;
  limits.growth_floor = 0.05;
  const double period = 0.01;
  const auto windows = [&](double first, double factor, int n, double moved = 0.0) {
    Oscillation o;
    JointVector q = JointVector::Zero();
    double energy = first;
    for (int w = 0; w < n; ++w, energy *= factor)
      for (int i = 0; i < 50; ++i) {
        q(0) += moved;
        o.take(limits, energy, false, q, 1e-3, period);
      }
    return o.good(limits);
  };
  EXPECT_FALSE(windows(1.0, 1.3, 6));
  EXPECT_TRUE(windows(1.0, 1.3, 4));         // the first window has none before it
  EXPECT_TRUE(windows(1.0, 1.15, 20));       // grows, but by less than a fifth
  EXPECT_TRUE(windows(1e-6, 1.3, 20));       // below the floor
  EXPECT_TRUE(windows(1.0, 1.3, 6, 2e-3));   // the robot moves: that is where the energy is from
  EXPECT_FALSE(windows(1.0, 1.3, 6, 1e-6));  // as good as standing
}

TEST(Oscillation, SwingingOnAgainstTheEnvelopeCountsAsGrowth) {
  SafetyLimits limits;
  limits.growing_windows = 4;
  limits.window = 0.5;
  limits.window_growth = 1.2;
  limits.growth_floor = 0.05;
  Oscillation o;
  for (int i = 0; i < 4 * 50 + 1; ++i)
    o.take(limits, 1.0, i % 50 == 7, JointVector::Zero(), 1e-3, 0.01);
  EXPECT_FALSE(o.good(limits));
  o.reset();
  EXPECT_TRUE(o.good(limits));
}

TEST(FrozenSensor, TripsWhenTheWeightTurnsUnderEqualReadings) {
  SafetyLimits limits;
  limits.frozen_samples = 3;
  limits.frozen_counts = 50.0;
  FrozenSensor sensor;
  AdcCounts adc{};
  sensor.take(adc, Vec6::Zero());
  for (int n = 0; n < 10; ++n) sensor.take(adc, Vec6::Zero());
  EXPECT_TRUE(sensor.good(limits));  // nothing should have changed
  sensor.take(adc, 51.0 * Vec6::Unit(3));
  EXPECT_FALSE(sensor.good(limits));
  adc[6] += 1;  // the pressure is no part of it
  sensor.take(adc, 51.0 * Vec6::Unit(3));
  EXPECT_FALSE(sensor.good(limits));
  adc[2] += 1;
  sensor.take(adc, 51.0 * Vec6::Unit(3));
  EXPECT_TRUE(sensor.good(limits));
}

TEST(LegReadings, AllowsWhatALegCanDoAndOneErrorInARow) {
  SafetyLimits limits;
  limits.reading_jump = 0.002;
  limits.reading_speed = 1.5;
  limits.reading_patience = 1;
  LegReadings readings;
  const Vec6 at = Vec6::Constant(1.5), still = Vec6::Zero();
  readings.take(limits, at, still, 0.01);
  EXPECT_EQ(readings.take(limits, Vec6(at + 0.0019 * Vec6::Unit(0)), still, 0.01)(0), 1.5019);
  const Vec6 jumped = at + 0.01 * Vec6::Unit(4);
  EXPECT_NE(readings.take(limits, jumped, still, 0.01), jumped);
  EXPECT_TRUE(readings.good(limits));
  EXPECT_NE(readings.take(limits, jumped, still, 0.01), jumped);
  EXPECT_FALSE(readings.good(limits));
  readings.reset();
  EXPECT_EQ(readings.take(limits, jumped, still, 0.01), jumped);
  EXPECT_TRUE(readings.good(limits));
  // A leg that was told 0.4 m/s may come 6 mm further in 10 ms, beside the jump.
  EXPECT_EQ(readings.take(limits, Vec6(jumped + 0.0079 * Vec6::Unit(1)), Vec6::Constant(0.4), 0.01),
            Vec6(jumped + 0.0079 * Vec6::Unit(1)));
  EXPECT_NE(readings.take(limits, Vec6(jumped + 0.0165 * Vec6::Unit(1)), Vec6::Constant(0.4), 0.01),
            Vec6(jumped + 0.0165 * Vec6::Unit(1)));
}

}  // namespace
}  // namespace ves
