// SPDX-License-Identifier: BSD-3-Clause
//
// Beyond the report: the servos' lag and the robot's inertia taken out of the emulation.
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/QR>
#include <algorithm>
#include <filesystem>
#include <numeric>
#include <random>

#include "support/misbelief.hpp"
#include "support/poses.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/analysis/gate.hpp"
#include "ves/config/servo.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/evaluation/identified.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/identification/sensor_timing.hpp"
#include "ves/identification/servo_identification.hpp"
#include "ves/math/dense.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::experiment;
using test::kCompensated;
using test::Rig;

const std::vector<std::string> kPublished;

/// The same, with the verdict of the stability check.
Experiment assessed(const std::string& name, std::vector<std::string> set,
                    const std::vector<std::string>& more = {}) {
  set.insert(set.end(), more.begin(), more.end());
  Experiment e = test::unassessed(name, set);
  applyStabilityCheck(e);
  return e;
}

class Emulation : public testing::Test {
 protected:
  Series run(const Experiment& e) {
    RecordedRun recorded = recordLockstep(e);
    result_ = recorded.result;
    return std::move(recorded.series);
  }
  RunResult result_;
};

/// The platform's largest error in a segment after its first half second.
Vec6 settledError(const Series& series, int segment, const std::function<Vec6(double)>& should) {
  Vec6 most = Vec6::Zero();
  double start = -1.0;
  for (const Row& row : series.rows) {
    if (row.state.phase != static_cast<int>(Phase::kRunning) || row.state.segment != segment)
      continue;
    if (start < 0.0) start = row.t;
    const double t = row.t - start;
    if (t > 0.5) most = most.cwiseMax((Vec6::Map(row.truth.x) - should(t)).cwiseAbs());
  }
  return most;
}

TEST_F(Emulation, SinesOf421AreFollowedWithinAPercent) {  // noise and counts on
  for (const auto& [name, i] : {std::pair{"z_sine", 2}, std::pair{"alpha_sine", 3}}) {
    const Experiment e = experiment(name, kCompensated);
    const Trajectory& ordered = e.controller.program.segments[1].trajectory;
    const Series series = run(e);
    ASSERT_TRUE(result_.good());
    const Vec6 error = settledError(series, 1, [&, i = i](double t) -> Vec6 {
      return ordered.amplitude(i) * std::sin(2.0 * M_PI * ordered.frequency(i) * (t + 0.01)) *
             Vec6::Unit(i);
    });
    EXPECT_LT(error(i), 0.01 * ordered.amplitude(i)) << name;
  }
}

TEST_F(Emulation, FreeDecayOfTable41IsTheClosedFormsOwn) {
  const Series series = run(experiment("free_decay", kCompensated));
  ASSERT_TRUE(result_.good());
  const double m[] = {500, 500, 500, 250, 250, 250}, k[] = {1500, 2500, 4000, 1500, 1000, 2000};
  Vec6 offset;
  offset << 0.10, -0.08, 0.06, 8 * kDegree, -6 * kDegree, 10 * kDegree;
  const auto closed = [&](double t) {
    Vec6 x;
    for (int i = 0; i < 6; ++i) {
      const double wd = std::sqrt(k[i] / m[i] - 0.25);  // c/m is 1 for all
      x(i) = offset(i) * std::exp(-0.5 * t) * (std::cos(wd * t) + 0.5 / wd * std::sin(wd * t));
    }
    return x;
  };
  const Vec6 error = settledError(series, 3, closed);
  for (int i = 0; i < 6; ++i) EXPECT_LT(error(i), 0.02 * std::abs(offset(i))) << i;
  // What judges it takes the same angles: it turns by 21 degrees about several axes at once.
  const auto emulated = emulation(series);
  ASSERT_TRUE(emulated);
  for (std::size_t n = 0; n < emulated->base.t.size(); ++n)
    EXPECT_LT((emulated->base.x[n] - closed(emulated->base.t[n])).norm(), 1e-4);
  EXPECT_LT(distance(emulated->platform, emulated->base).peak_attitude, 0.5e-3);
}

/// Rms distance of the platform from the robot on its base in free space, over the base's travel.
/// The robot on its base in free space, from where this run began.
Motion freeSpace(const Experiment& e, const Series& series) {
  std::int64_t duration = 0;
  Interaction interaction = interactionOf(e, duration);
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.duration = duration;
  interaction.start = commanded(series).x.front();
  return motion(simulate(interaction, options));
}

/// [-] of its travel, by which the platform is off, rms.
double share(const Experiment& e, const Series& series) {
  const Motion truth = freeSpace(e, series);
  return distance(actual(series), truth).rms_position / travel(truth).peak_position;
}

const std::vector<std::string> kMean = {"sensor.readings_per_tick=4"};
std::vector<std::string> with(std::vector<std::string> set, const std::vector<std::string>& more) {
  set.insert(set.end(), more.begin(), more.end());
  return set;
}

TEST_F(Emulation, DossOnTheShuttlesArmMovesAsTheMovingBaseDoes) {
  // Without noise: the counts of legs and A/D converter are in it, and are what is left.
  for (const char* configuration : {"unberth", "low_hover", "deploy", "capture"})
    for (const bool six : {false, true})
      for (const bool mean : {false, true}) {
        std::vector<std::string> more = {"sensor.noise=false"};
        if (six) more.push_back("base.keep_modes=6");
        if (mean) more = with(more, kMean);
        const Experiment e =
            assessed(std::string("srms_") + configuration + "_doss", kCompensated, more);
        EXPECT_EQ(e.controller.stability, Stability::kStable) << e.name;
        const Series series = run(e);
        ASSERT_TRUE(result_.good()) << e.name;
        EXPECT_LT(share(e, series), mean ? 0.008 : 0.014) << e.name << " " << six << mean;
      }
}

TEST_F(Emulation, ABeliefThatIsAMillisecondOffCostsAPercentWhereReadingsAreAveraged) {
  // Read once a tick, in step with the command's staircase, it costs ten times as much.
  for (const double delay : {-0.001, 0.001}) {
    Experiment e = experiment("srms_deploy_doss", kCompensated,
                              with({"sensor.noise=false", "base.keep_modes=6"}, kMean));
    e.controller.servo.delay.setConstant(delay);
    const Series series = run(e);
    ASSERT_TRUE(result_.good());
    EXPECT_LT(share(e, series), 0.015) << delay;
  }
}

TEST_F(Emulation, SamplesThatComeLateAndSaySoAreUsedForWhatTheyAreWorth) {
  for (const int ticks : {1, 3}) {
    const Experiment e = assessed(
        "srms_capture_doss", kCompensated,
        with({"sensor.noise=false", "base.keep_modes=6",
              "program=[{move: {}, faults: [{at_s: 0, duration_s: 100, fault: samples_late, "
              "samples: " +
                  std::to_string(ticks) +
                  "}]}, {calibration: {}}, {admittance: {duration_s: 20}, robot: [{at_s: 0, "
                  "duration_s: 5, joint: joint_3, to_deg_or_m: -60}]}]"},
             kMean));
    const Series series = run(e);
    ASSERT_TRUE(result_.good()) << ticks;
    EXPECT_LT(share(e, series), ticks == 1 ? 0.008 : 0.010) << ticks;
  }
}

/// A base in space whose every frequency is `hertz` and which weighs a `ratio`-th of the robot, let
/// go with an acceleration of about 1.25 m/s^2.
std::vector<std::string> lightBase(double ratio, double hertz, double zeta) {
  std::string m, c, k;
  const double w = 2.0 * M_PI * hertz, amplitude = std::min(0.04, 1.25 / (w * w));
  for (int i = 0; i < 6; ++i) {
    const double mass = (i < 3 ? 73.45 : 40.0) / ratio;
    m += (i ? "," : "") + std::to_string(mass);
    c += (i ? "," : "") + std::to_string(2.0 * zeta * w * mass);
    k += (i ? "," : "") + std::to_string(w * w * mass);
  }
  return {"gravity_m_per_s2=0", "sensor.noise=false",
          "base={mass_diagonal: [" + m + "], damping_diagonal: [" + c + "], stiffness_diagonal: [" +
              k + "]}",
          "program=[{move: {}}, {calibration: {}}, {move: {to: {x_m: " + std::to_string(amplitude) +
              ", z_m: " + std::to_string(0.75 * amplitude) +
              "}}}, "
              "{admittance: {duration_s: 12}}]"};
}

TEST_F(Emulation, MassRatioOfFiveMovesAsItShouldUpToTwelveHertz) {  // Appendix E ends at one
  for (const auto& [ratio, hertz, most] :
       {std::tuple{5.0, 0.5, 0.01}, std::tuple{5.0, 3.0, 0.01}, std::tuple{5.0, 5.0, 0.01},
        std::tuple{5.0, 8.0, 0.03}, std::tuple{5.0, 12.0, 0.06}, std::tuple{10.0, 0.7, 0.01}}) {
    const std::vector<std::string> set = lightBase(ratio, hertz, 0.02);
    const Experiment published = assessed("puma_on_table_4_1", kPublished, set);
    EXPECT_EQ(published.controller.stability, Stability::kUnstable);
    EXPECT_FALSE(runLockstep(published, nullptr, nullptr).good());

    // At twelve hertz the belief has to be better than it is taken for without an identification,
    // where nothing may grow.
    EXPECT_EQ(assessed("puma_on_table_4_1", kCompensated,
                       with(with(set, kMean), {"controller.most_growth=1"}))
                  .controller.stability,
              hertz < 10.0 ? Stability::kStable : Stability::kUnstable);
    const Experiment e =
        assessed("puma_on_table_4_1", kCompensated,
                 with(with(set, kMean), {"controller.compensation.timing_error_s=1e-4",
                                         "controller.compensation.gain_error=0.02",
                                         "controller.compensation.mass_error=0.02"}));
    EXPECT_EQ(e.controller.stability, Stability::kStable);
    const Series series = run(e);
    ASSERT_TRUE(result_.good());
    EXPECT_LT(share(e, series), most) << ratio << " " << hertz;
  }
}

const std::vector<std::string> kAdapts = {"controller.compensation.adaptation=true"};
const std::vector<std::string> kAidedWrench = {"controller.compensation.wrench=aided"};

TEST_F(Emulation, GainsThatAreFivePercentOffAreLearnt) {
  for (const char* gains :
       {"{gain_extend: 1.05, gain_retract: 1.05}", "{gain_extend: 0.95, gain_retract: 0.95}",
        "{gain_extend: 1.05, gain_retract: 0.95}", "{}"}) {
    const std::vector<std::string> set =
        with(with({"sensor.noise=false", "base.keep_modes=6"}, kMean),
             {std::string("plant_mismatch=") + gains});
    const Experiment e = assessed("srms_capture_doss", with(kCompensated, kAdapts), set);
    EXPECT_EQ(e.controller.stability, Stability::kStable);
    const Series series = run(e);
    ASSERT_TRUE(result_.good());
    EXPECT_LT(share(e, series), 0.007) << gains;
  }
}

TEST_F(Emulation, GateHoldsForAllThatMayBeLearnt) {
  const Experiment e = experiment("srms_unberth_doss", with(kCompensated, kAdapts),
                                  with({"sensor.noise=false", "base.keep_modes=6"}, kMean));
  const Compensation& c = e.controller.compensation;
  const double most = 1.0 + c.adaptation_limit;  // what was learnt here, the machine there
  EXPECT_TRUE(isStable(e.controller, e.plant.task));
  Experiment limit = e;
  limit.controller.compensation.adaptation_limit = 2.0;
  EXPECT_FALSE(isStable(limit.controller, limit.plant.task));
  limit.controller.compensation.adaptation = false;
  EXPECT_TRUE(isStable(limit.controller, limit.plant.task));
  // The same by the machine itself, held as far from the belief as that: nothing grows.
  for (const double by : {-most, most}) {
    Experiment off = e;
    off.controller.compensation.adaptation = false;
    off.plant.actuator.gain_extend *= 1.0 + by * c.gain_error;
    off.plant.actuator.gain_retract *= 1.0 + by * c.gain_error;
    off.plant.sensor.cutoff = M_SQRT2 / (M_SQRT2 / off.plant.sensor.cutoff + by * c.timing_error);
    const Series series = run(off);
    ASSERT_TRUE(result_.good()) << by;
    double first = 0.0, last = 0.0;  // rates in the seconds after the arm has moved, and at the end
    std::vector<double> rates;
    for (const Row& row : series.rows)
      if (inAdmittance(row.state)) rates.push_back(Vec6::Map(row.state.x_dot).norm());
    for (std::size_t i = 600; i < rates.size(); ++i) {
      if (i < 1000) first = std::max(first, rates[i]);
      if (i + 400 >= rates.size()) last = std::max(last, rates[i]);
    }
    EXPECT_LE(last, first) << by;
  }
}

TEST_F(Emulation, AnAidedWrenchKeepsTheNoiseOut) {  // of the sensor, in motions of a millimetre
  for (const char* configuration : {"unberth", "low_hover", "deploy", "capture"}) {
    const Experiment e =
        experiment(std::string("srms_") + configuration + "_puma", with(kCompensated, kAidedWrench),
                   with({"base.keep_modes=6"}, kMean));
    const Series series = run(e);
    ASSERT_TRUE(result_.good()) << configuration;
    EXPECT_LT(share(e, series), 0.05) << configuration;
  }
}

// With masses 10 % off, a common share, the model alone would be off by 4 to 60 %.
TEST_F(Emulation, MassesThatAreTenPercentOffAreLearnt) {
  for (const char* configuration : {"srms_capture_doss", "srms_low_hover_doss"})
    for (const char* gravity : {"gravity_m_per_s2=0", "gravity_m_per_s2=9.81"})
      for (const char* mass : {"plant_mismatch={mass: 1.1}", "plant_mismatch={mass: 0.9}"}) {
        const auto off = [&](const char* learns) {
          const Experiment e = experiment(
              configuration, with(kCompensated, kAidedWrench),
              with({gravity, mass, "base.keep_modes=6", "controller.compensation.mass_error=0.1",
                    std::string("controller.compensation.learns_masses=") + learns},
                   kMean));
          const Series series = run(e);
          EXPECT_TRUE(result_.good()) << e.name;
          const auto kept = learntMasses(series);
          EXPECT_EQ(kept.has_value(), learns == std::string("true"));
          if (kept) {  // what it weighs is known after the run
            const auto weighs = [&](const Payload& payload) {
              return staticWrench(payload, e.plant.task.initial_joints, Mat3::Identity(),
                                  Vec3(0.0, 0.0, -9.81))
                  .stacked();
            };
            const Vec6 truth = weighs(e.plant.payload);
            EXPECT_LT((weighs(withMasses(e.controller.payload, *kept)) - truth).norm(),
                      0.3 * (weighs(e.controller.payload) - truth).norm())
                << configuration << gravity << mass;
          }
          return share(e, series);
        };
        EXPECT_GT(off("false"), 0.03) << configuration << gravity << mass;
        EXPECT_LT(off("true"), 0.045) << configuration << gravity << mass;
      }
}

// Encoders that are slow, or of 16 bits, cost little on Earth, and no count passes for a force.
TEST_F(Emulation, JointsThatAreReadToCountsAndSeldomCostLittle) {
  for (const auto& [encoders, most] :
       {std::tuple{"{rate_hz: 77}", 0.002}, std::tuple{"{rate_hz: 125}", 0.002},
        std::tuple{"{counts_per_turn: 65536}", 0.003},
        std::tuple{"{counts_per_turn: 65536, rate_hz: 77}", 0.02},
        std::tuple{"{counts_per_turn: 4096, noise_deg_or_m: 0.01}", 0.04}}) {
    const Experiment e =
        experiment("srms_capture_doss", with(kCompensated, kAidedWrench),
                   with({"base.keep_modes=6", fmt::format("robot.encoders={}", encoders)}, kMean));
    const Series series = run(e);
    ASSERT_TRUE(result_.good()) << encoders;
    EXPECT_LT(share(e, series), most) << encoders;
    for (const Row& row : series.rows)
      if (row.state.kind == static_cast<int>(SegmentKind::kAdmittance) &&
          row.state.phase == static_cast<int>(Phase::kRunning)) {
        ASSERT_TRUE(row.state.withholds) << encoders << " " << row.t;
      }
  }
}

// Masses off link by link: a tilt of the standing robot tells what a motion of its joints alone
// does not.
TEST_F(Emulation, ATiltTellsMassesThatAreOffLinkByLink) {
  constexpr int kDraws = 4;
  double with_tilt = 0.0, without = 0.0;
  for (const auto& [name, joint, to, most] : {std::tuple{"srms_capture_doss", "joint_3", -60, 0.02},
                                              std::tuple{"srms_capture_puma", "joint_1", 30, 0.05}})
    for (const char* gravity : {"gravity_m_per_s2=0", "gravity_m_per_s2=9.81"}) {
      std::mt19937 random(7);
      for (int k = 0; k < kDraws; ++k)
        for (const char* tilt : {"", "{excite: {tilt_deg: 4, duration_s: 9}}, "}) {
          Experiment e = experiment(
              name, with(kCompensated, kAidedWrench),
              with({gravity, "base.keep_modes=6", "controller.compensation.mass_error=0.1",
                    "controller.compensation.learns_masses=true", fmt::format("seed={}", k + 1),
                    fmt::format("program=[{{move: {{}}}}, {{calibration: {{}}}}, {}{{admittance: "
                                "{{duration_s: 20}}, robot: [{{at_s: 0, duration_s: 5, joint: {}, "
                                "to_deg_or_m: {}}}]}}]",
                                tilt, joint, to)},
                   kMean));
          std::mt19937 same = random;
          test::misbelieve(e.controller.payload, same);
          if (*tilt) random = same;
          const Series series = run(e);
          ASSERT_TRUE(result_.good()) << name << gravity << k;
          const double off = share(e, series);
          (*tilt ? with_tilt : without) += off;
          if (*tilt) {
            EXPECT_LT(off, most) << name << gravity << k;
          }
        }
    }
  EXPECT_LT(with_tilt, 0.7 * without);
}

/// An arm that takes 3 kg in hand at 6 s and swings back later; `events` besides.
Experiment takesALoad(const std::string& scenario, const std::string& swing, double to, double back,
                      const std::string& events, bool switched = false) {
  return experiment(
      scenario, with(kCompensated, kAidedWrench),
      with({"gravity_m_per_s2=9.81", "base.keep_modes=6",
            "controller.compensation.learns_masses=true",
            fmt::format("robot.gripper_switch={}", switched),
            fmt::format("program=[{{move: {{}}}}, {{calibration: {{}}}}, {{admittance: "
                        "{{duration_s: 20}}, robot: [{{at_s: 0, duration_s: 4, joint: {0}, "
                        "to_deg_or_m: {1}}}, {3}{{at_s: 8.5, duration_s: 4, joint: {0}, "
                        "to_deg_or_m: {2}}}]}}]",
                        swing, to, back, events)},
           kMean));
}

/// [s] in the run, of a time in its admittance segment.
double momentOf(const Series& series, double in_segment) {
  for (const Row& row : series.rows)
    if (row.state.kind == static_cast<int>(SegmentKind::kAdmittance)) return row.t + in_segment;
  return HUGE_VAL;
}

// Nobody tells what it is, only that the gripper moved, somewhat early or late, or in vain.
TEST_F(Emulation, AnUntoldLoadIsLearntOnceTheGripperIsToldToHaveMoved) {
  const std::string load =
      "{at_s: 6, grasp: {mass_kg: 3, center_m: [0, 0, 0.05], "
      "inertia_kg_m2: [0.01, 0.01, 0.01, 0, 0, 0]}}, ";
  const auto moved = [](double at) { return fmt::format("{{at_s: {}, gripper: true}}, ", at); };
  struct Case {
    std::string what, events;
    double doss, puma;  // [-] of the travel, at most
  };
  const Case cases[] = {{"by its switch", load, 0.01, 0.02},
                        {"now", load + moved(6.0), 0.01, 0.02},
                        {"early", moved(5.75) + load, 0.01, 0.02},
                        {"late", load + moved(6.25), 0.03, 0.15},
                        {"in vain", moved(6.0), 0.01, 0.02}};
  for (const auto& [what, events, doss, puma] : cases)
    for (const bool is_doss : {true, false}) {
      const bool tells = events == load;
      const Experiment e = is_doss
                               ? takesALoad("srms_capture_doss", "joint_3", -60, -90, events, tells)
                               : takesALoad("srms_capture_puma", "joint_1", 30, 0, events, tells);
      const Series series = run(e);
      ASSERT_TRUE(result_.good());
      EXPECT_LT(share(e, series), is_doss ? doss : puma) << e.name << what;
      // A second later the state tells the mass, and what it may be off by.
      const state_t& last = series.rows.back().state;
      const std::size_t hand = learntBodies(e).size() - 1;
      const double mass = what == std::string("in vain") ? 0.0 : 3.0;  // [kg]
      for (const Row& row : series.rows) {
        if (row.t < momentOf(series, 7.25) || row.state.phase != static_cast<int>(Phase::kRunning))
          continue;
        ASSERT_NEAR(row.state.learnt_mass[hand], mass, 0.1) << e.name << what << row.t;
      }
      EXPECT_LT(last.learnt_mass_deviation[hand], 0.02) << e.name << what;
      // Nothing stays open: the last seconds have no force.
      int withheld = 0, of = 0;
      for (const Row& row : series.rows) {
        if (row.state.segment != 2 || row.state.phase != static_cast<int>(Phase::kRunning))
          continue;
        if (++of > 1500) withheld += row.state.withholds;
      }
      EXPECT_GT(withheld, 450) << e.name << what;
    }
  const Experiment e = takesALoad("srms_capture_doss", "joint_3", -60, -90, load);
  const Series untold = run(e);
  EXPECT_GT(share(e, untold), 0.2);  // what it is about
}

/// A PUMA's first four joints, drawn one after the other, 2 s each: a list for a program.
std::string randomMoves(int count) {
  std::mt19937 random(11);
  std::string moves;
  const std::pair<double, double> ranges[] = {{-60, 60}, {-90, -20}, {60, 140}, {-60, 60}};
  for (int k = 0; k < count; ++k) {
    const std::size_t joint = random() % 4;
    std::uniform_real_distribution<double> to(ranges[joint].first, ranges[joint].second);
    moves += fmt::format("{{at_s: {:.1f}, duration_s: 2, joint: joint_{}, to_deg_or_m: {:.0f}}}, ",
                         1.0 + 2.4 * k, joint + 1, to(random));
  }
  return moves;
}

// Half a ton afloat for two minutes: sums of forces would drift, those of momenta do not.
TEST_F(Emulation, AFloatingBaseStaysWhereItsMomentumPutsIt) {
  const std::string moves = randomMoves(48);
  const Experiment e = experiment(
      "satellite_puma",
      {"program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 120}, robot: [" + moves +
       "]}]"});
  const Series series = run(e);
  ASSERT_TRUE(result_.good());
  const Motion truth = freeSpace(e, series), base = commanded(series);
  EXPECT_GT(travel(truth).peak_position, 3e-3);
  EXPECT_LT(distance(base, truth).peak_position, 1e-4);  // [m]
  EXPECT_LT(distance(base, truth).peak_attitude, 4e-4);  // [rad]
}

// Masses that are learnt on a base that floats are learnt of its motion too: what the robot's
// momentum was taken for is no motion of the base once the joints rest.
TEST_F(Emulation, WhatIsLearntLeavesAFloatingBaseNoMomentum) {
  const std::string moves = randomMoves(30);
  const Experiment e = experiment(
      "satellite_puma",
      {"controller.compensation.learns_masses=true",
       "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 75}, robot: [" + moves +
           "]}]"});
  const Series series = run(e);
  ASSERT_TRUE(result_.good());
  const Motion base = commanded(series);
  double fastest = 0.0;
  for (const Vec6& v : base.x_dot) fastest = std::max(fastest, v.head<3>().norm());
  EXPECT_GT(fastest, 5e-3);                             // [m/s]
  EXPECT_LT(base.x_dot.back().head<3>().norm(), 2e-5);  // [m/s]
  EXPECT_LT(base.x_dot.back().tail<3>().norm(), 2e-5);  // [rad/s]
}

// Legs that move fast are further off, by what an update of their LegSlaves counts for; on a body
// that floats what passes for a touch would stay for good.
TEST_F(Emulation, LegsThatMoveFastAreNoTouch) {
  for (const double mass : {100.0, 300.0, 1000.0})
    for (const bool noise : {true, false}) {
      const Series series = run(experiment(
          "satellite_puma",
          {fmt::format("robot=!replace {{from: {}/robots/doss.yaml}}", VES_TEST_CONFIG_DIR),
           fmt::format("sensor.noise={}", noise),
           fmt::format("base.free={{mass_kg: {}, inertia_kg_m2: [{}, {}, {}, 0, 0, 0]}}", mass,
                       mass / 6, mass / 6, mass / 6),
           "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 20}, robot: [{at_s: "
           "1, duration_s: 2, joint: joint_1, to_deg_or_m: 40}, {at_s: 5, duration_s: 2, joint: "
           "joint_2, to_deg_or_m: -30}, {at_s: 9, duration_s: 2, joint: joint_1, to_deg_or_m: "
           "0}]}]"}));
      ASSERT_TRUE(result_.good());
      double fastest = 0.0;
      eachTick(series, [&](const Row& row, double) {
        EXPECT_TRUE(row.state.withholds) << row.t;
        for (const double v : row.state.leg_dot) fastest = std::max(fastest, std::abs(v));
      });
      EXPECT_GT(fastest, 0.03);  // [m/s]
      const auto both = emulation(series);
      ASSERT_TRUE(both);
      // Felt as it was turned, and not as it is when that is read, which is 1.5 % off on 100 kg.
      const Distance off = distance(both->platform, both->base), moved = travel(both->base);
      EXPECT_LT(off.rms_position, 5e-4 * moved.peak_position) << mass;
      EXPECT_LT(off.rms_attitude, 5e-4 * moved.peak_attitude) << mass;
    }
}

// A grasp between two runs of the program, told by the gripper's switch alone.
TEST_F(Emulation, ALoadThatWasTakenWhileDisarmedIsLearnt) {
  const Experiment e = experiment(
      "puma_on_table_4_1", with(kCompensated, kAidedWrench),
      with({"controller.compensation.learns_masses=true", "robot.gripper_switch=true"}, kMean));
  Rig rig(e);
  rig.arm();
  rig.order(Request::kRun, test::segment(SegmentKind::kCalibration));
  rig.until(Phase::kArmed);
  rig.run(20);
  rig.disturb([](Sample& s) { s.switches &= ~kPanicButtonClosed; });
  ASSERT_EQ(rig.run(2).phase, Phase::kStopped);
  rig.disturb(nullptr);
  rig.run(5);
  rig.tick(Request::kReset);
  ASSERT_EQ(rig.tick().phase, Phase::kDisarmed);
  const RigidBody load{2.0, Vec3(0.0, 0.0, 0.05), 0.002 * Mat3::Identity()};
  ASSERT_TRUE(rig.plant().moveRobot(Grasp{e.plant.payload.robot.size - 1, load}));
  rig.run(10);
  rig.arm();
  rig.order(Request::kRun, test::segment(SegmentKind::kAdmittance, 10.0));
  rig.run(300);
  EXPECT_LT(rig.state().motion.x.head<3>().norm(), 2e-3);
}

TEST_F(Emulation, WhatIsLearntGoesByTheTimesThatTheMachineEchoes) {
  Rig rig(experiment("z_sine", with(kCompensated, kAdapts), {}));
  const std::int64_t period = 10'000'000;  // [ns]
  rig.disturb([&](Sample& s) {             // it says that they came 2 ms later than they did
    s.command_tick = s.time / period - 1;
    s.command_time = s.time - period + 2'000'000;
  });
  rig.tick(Request::kStart);
  rig.until(Phase::kParked);
  // Then they take effect sooner after that.
  for (int i = 0; i < kLegs; ++i) EXPECT_LT(rig.state().servo.delay(i), -4e-4) << i;
}

TEST_F(Emulation, AnAidedWrenchComesInAndGoesOutWithTheCompensation) {
  Rig rig(experiment("srms_low_hover_puma", with(kCompensated, kAidedWrench),
                     with({"base.keep_modes=2"}, kMean)));
  const auto admitted = [](const TickState& s) { return s.kind == SegmentKind::kAdmittance; };
  rig.tick(Request::kStart);
  int withheld = 0, between = 0;
  for (int i = 0; i < 3000 && !test::done(rig.state()); ++i) {
    const TickState& s = rig.tick();
    const Vec6 measured = (s.total - s.static_wrench + s.inertial).stacked(),
               reaction = s.reaction.stacked();
    const Vec6 should =
        s.withholds ? measured + s.compensation_share * (reaction - measured) : measured;
    ASSERT_LT((s.dynamic.stacked() - should).norm(), 1e-9) << s.tick;
    EXPECT_TRUE(!s.withholds || s.calibration == CalibrationStatus::kDone) << s.tick;
    between += s.withholds && s.compensation_share > 0.1 && s.compensation_share < 0.9;
    // The bias has just been found: what was measured beyond another one does not count.
    if (admitted(s) && i < 230) withheld += s.withholds;
    if (admitted(s) && i == 600) rig.tick(Request::kUncompensate);
  }
  EXPECT_GT(withheld, 10);
  EXPECT_GT(between, 20);
}

/// A step of one channel of the sensor, two seconds into admittance control.
struct ForceStep {
  const char* scenario;
  int channel;         // 1 to 6
  double force;        // [N]
  double duration;     // [s]
  double admitted;     // [s] of admittance control
  double grows = 0.0;  // [N] more from half of the duration on
};

/// By seed, what share of the base's motion that the step makes without noise and aid is left of it
/// with both: of x, y and z together.
std::vector<double> sharesKept(const ForceStep& step, int seeds,
                               const std::function<Series(const Experiment&)>& run) {
  const double sensitivity = step.channel == 3 ? 0.17115e-6 : 0.66719e-6,  // ves.yaml, sensor
      newton = sensitivity * 10.0 * 1000.0 * 32768.0 / 10.0;               // [count]
  const auto motion = [&](const std::vector<std::string>& more, bool steps) {
    const std::string faults =
        steps ? fmt::format(
                    ", faults: [{{at_s: 2, duration_s: {}, fault: wrench_step, which: {}, "
                    "counts: {}}}, {{at_s: {}, duration_s: {}, fault: wrench_step, which: {}, "
                    "counts: {}}}]",
                    step.duration, step.channel, step.force * newton, 2.0 + 0.5 * step.duration,
                    0.5 * step.duration, step.channel, step.grows * newton)
              : "";
    std::vector<Vec3> x;
    for (const Row& row :
         run(experiment(step.scenario, with(kCompensated, more),
                        with({"base.keep_modes=6",
                              fmt::format("program=[{{move: {{}}}}, {{calibration: {{}}}}, "
                                          "{{admittance: {{duration_s: {}}}{}}}]",
                                          step.admitted, faults)},
                             kMean)))
             .rows)
      if (inAdmittance(row.state)) x.push_back(Vec3::Map(row.state.x_desired));
    return x;
  };
  const auto effect = [&](const std::vector<std::string>& more) {
    std::vector<Vec3> out = motion(more, true);
    const std::vector<Vec3> without = motion(more, false);
    EXPECT_EQ(out.size(), without.size());
    for (std::size_t i = 0; i < std::min(out.size(), without.size()); ++i) out[i] -= without[i];
    return out;
  };
  const std::vector<Vec3> should = effect({"sensor.noise=false"});
  std::vector<double> shares;
  for (int seed = 1; seed <= seeds; ++seed) {
    const std::vector<Vec3> is = effect(with(kAidedWrench, {fmt::format("seed={}", seed)}));
    EXPECT_EQ(should.size(), is.size());
    double both = 0.0, all = 0.0;
    for (std::size_t i = 0; i < std::min(is.size(), should.size()); ++i) {
      both += is[i].dot(should[i]);
      all += should[i].squaredNorm();
    }
    shares.push_back(both / all);
  }
  return shares;
}

double meanOf(const std::vector<double>& x) {
  return std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(x.size());
}

TEST_F(Emulation, AnAidedWrenchLetsAPushThatNoModelKnowsPass) {
  const auto shares = sharesKept({"srms_low_hover_puma", 3, 20.0, 0.1, 8.0}, 4,
                                 [&](const Experiment& e) { return run(e); });
  EXPECT_GT(meanOf(shares), 0.95);
  EXPECT_LT(meanOf(shares), 1.05);
}

// What was withheld of a push before it was found is made up for, from where it began on.
TEST_F(Emulation, APushIsMadeUpForFromItsBeginning) {
  const auto kept = [&](double duration, std::initializer_list<int> channels) {
    double sum = 0.0;
    for (const char* scenario : {"srms_low_hover_puma", "srms_capture_doss"})
      for (const int channel : channels)
        sum += meanOf(sharesKept({scenario, channel, 5.0, duration, 8.0}, 4,
                                 [&](const Experiment& e) { return run(e); }));
    return sum / (2.0 * static_cast<double>(channels.size()));
  };
  EXPECT_NEAR(kept(1.0, {1, 3}), 1.0, 0.045);
  EXPECT_GT(kept(0.1, {3}), 0.7);  // 0.5 N s, beside 1 N of noise a sample
}

// 1 N for 5 s, in x with 0.25 N of noise a sample and in z with 1 N of it.
TEST_F(Emulation, AnAidedWrenchFindsASmallForceThatLasts) {
  for (const char* scenario : {"srms_low_hover_puma", "srms_capture_doss"}) {
    const auto kept = [&](int channel) {
      return sharesKept({scenario, channel, 1.0, 5.0, 12.0}, 4,
                        [&](const Experiment& e) { return run(e); });
    };
    EXPECT_NEAR(meanOf(kept(1)), 0.95, 0.15) << scenario;
    for (const double share : kept(3)) {
      EXPECT_GT(share, 0.05) << scenario;
      EXPECT_LT(share, 1.2) << scenario;
    }
  }
}

// Which only its long means show: none of the noise passes with it, it pushes along the sensor's
// axes, and where it has gone so does what passes.
TEST_F(Emulation, AForceThatOnlyLongMeansShowPassesAsItsMean) {
  const double newton = 0.66719e-6 * 10.0 * 1000.0 * 32768.0 / 10.0;  // [count], ves.yaml
  const double turned = 25.0 * kDegree;
  for (const double yaw : {-turned, turned}) {
    Vec3 mean = Vec3::Zero();
    for (int seed = 1; seed <= 3; ++seed) {
      const Series series = run(experiment(
          "satellite_puma", with(kCompensated, with(kAidedWrench, {fmt::format("seed={}", seed)})),
          with({fmt::format("program=[{{move: {{to: {{gamma_deg: {}}}}}}}, {{calibration: {{}}}}, "
                            "{{admittance: {{duration_s: 14}}, faults: [{{at_s: 1, duration_s: 6, "
                            "fault: wrench_step, which: 1, counts: {}}}]}}]",
                            yaw / kDegree, 0.6 * newton)},
               kMean)));
      std::vector<Vec3> beyond;  // [N] of the joints' reaction, tick by tick
      for (const Row& row : series.rows)
        if (inAdmittance(row.state)) {
          EXPECT_TRUE(row.state.withholds) << row.t;
          beyond.push_back(Vec3::Map(row.state.dynamic) - Vec3::Map(row.state.reaction));
        }
      ASSERT_EQ(beyond.size(), 1400u);
      mean += beyond[680] / 3.0;
      EXPECT_EQ(beyond.back().norm(), 0.0) << seed;
    }
    const double along = std::cos(yaw) * mean.x() + std::sin(yaw) * mean.y();  // the sensor's x
    EXPECT_NEAR(along, 0.55, 0.1);
    EXPECT_NEAR(std::cos(yaw) * mean.y() - std::sin(yaw) * mean.x(), 0.0, 0.12);
  }
}

// One that grows: of the time before that was found, only what it has grown by is made up for.
TEST_F(Emulation, AnAidedWrenchFindsThatAForceHasGrown) {
  for (const char* scenario : {"srms_low_hover_puma", "srms_capture_doss"})
    EXPECT_NEAR(meanOf(sharesKept({scenario, 1, 0.7, 8.0, 12.0, 0.7}, 8,
                                  [&](const Experiment& e) { return run(e); })),
                0.93, 0.07)
        << scenario;
}

// The sensor's zero has moved between two calibrations: that is no force, and no mass.
TEST_F(Emulation, ASecondCalibrationMovesTheBiasAlone) {
  for (const std::vector<std::string>& learns :
       {std::vector<std::string>{}, {"controller.compensation.learns_masses=true"}}) {
    const Series series = run(experiment(
        "srms_low_hover_puma", with(kCompensated, with(kAidedWrench, learns)),
        with({"base.keep_modes=6",
              "program=[{move: {}}, {calibration: {}}, {move: {duration_s: 2}, faults: [{at_s: 1, "
              "duration_s: 60, fault: wrench_step, which: 3, counts: 40}]}, {calibration: {}}, "
              "{admittance: {duration_s: 8}}]"},
             kMean)));
    EXPECT_TRUE(result_.good());
    int withheld = 0, all = 0;
    double most = 0.0;
    for (const Row& row : series.rows)
      if (inAdmittance(row.state)) {
        ++all;
        withheld += row.state.withholds;
        most = std::max(most, Vec3::Map(row.state.x_desired).norm());
      }
    EXPECT_EQ(withheld, all);
    EXPECT_GT(all, 700);
    EXPECT_LT(most, 1e-6);
  }
}

// And one that is tared while things run.
TEST_F(Emulation, ATareTakesADriftFromAnAidedWrenchToo) {
  Rig rig(experiment(
      "srms_low_hover_puma", with(kCompensated, kAidedWrench),
      with({"base.keep_modes=6",
            "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 30}, faults: "
            "[{at_s: 1, duration_s: 60, fault: wrench_step, which: 3, counts: 40}]}]"},
           kMean)));
  rig.tick(Request::kStart);
  int admitted = 0, withheld = 0, of = 0, passed = 0;
  while (!test::done(rig.state())) {
    const TickState& s = rig.tick(admitted == 300 ? Request::kTare : Request::kNone);
    if (s.kind != SegmentKind::kAdmittance) continue;
    ++admitted;
    passed += admitted < 300 && !s.withholds;
    if (admitted < 1500) continue;
    ++of;
    withheld += s.withholds && (s.dynamic.stacked() - s.reaction.stacked()).norm() < 1e-9;
  }
  EXPECT_EQ(rig.state().phase, Phase::kParked);
  EXPECT_GT(passed, 100);  // until it is tared it is a force
  EXPECT_GT(of, 1000);
  EXPECT_EQ(withheld, of);
}

// One that has all but gone is none: what it was does not push on. Of the first a mean shows that
// it has changed, of the second none does.
TEST_F(Emulation, AForceThatLastedDoesNotPushOn) {
  const double newton = 0.66719e-6 * 10.0 * 1000.0 * 32768.0 / 10.0;  // [count], ves.yaml
  for (const auto& [force, left] : {std::pair(1.0, 0.15), {0.45, 0.33}}) {
    int found = 0, gone = 0;
    for (int seed = 1; seed <= 4; ++seed) {
      const Series series = run(experiment(
          "srms_low_hover_puma",
          with(kCompensated, with(kAidedWrench, {fmt::format("seed={}", seed)})),
          with({"base.keep_modes=6",
                fmt::format(
                    "program=[{{move: {{}}}}, {{calibration: {{}}}}, {{admittance: {{duration_s: "
                    "14}}, faults: "
                    "[{{at_s: 2, duration_s: 12, fault: wrench_step, which: 1, counts: {}}}, "
                    "{{at_s: 6, duration_s: 12, fault: wrench_step, which: 1, counts: {}}}]}}]",
                    force * newton, (left - 1.0) * force * newton)},
               kMean)));
      std::vector<double> beyond;  // [N] of the joints' reaction, tick by tick
      for (const Row& row : series.rows)
        if (inAdmittance(row.state) && row.state.withholds)
          beyond.push_back(row.state.dynamic[0] - row.state.reaction[0]);
      ASSERT_GT(beyond.size(), 1200u);
      found += beyond[580] > 0.7 * force && beyond[580] < 1.2 * force;
      gone += std::all_of(beyond.end() - 100, beyond.end(), [](double f) { return f == 0.0; });
    }
    EXPECT_EQ(found, 4) << force;
    EXPECT_GE(gone, 3) << force;
  }
}

TEST_F(Emulation, LoopModelKnowsTheCompensation) {
  // Growth that the linear loop foresees, against the whole machine, where the controller believes
  // another mass, or another servo gain, than there is.
  int stable = 0, unstable = 0;
  const auto compare = [&](const Experiment& e, const Loop& loop, const std::string& what) {
    const DominantRoot s = dominantRoot(loop);
    if (s.growth > -0.01 && s.growth < 0.8) return;  // twenty seconds do not tell
    (s.growth > 0.0 ? unstable : stable) += 1;
    EXPECT_EQ(runLockstep(e, nullptr, nullptr).good(), s.growth < 0.0)
        << what << ": " << s.growth << " per s at " << s.frequency << " Hz";
  };
  for (const char* scenario : {"srms_deploy_doss", "srms_unberth_doss"})
    for (const double error : {0.5, 0.8, 1.2, 1.6, 2.0}) {
      const std::string what = std::string(scenario) + " " + std::to_string(error);
      Experiment e = experiment(scenario, kCompensated,
                                {"base.keep_modes=6", "sensor.noise=false", "gravity_m_per_s2=0"});
      const Loop right = loopOf(e.controller, e.plant.task.initial_joints, Direction::kSwinging);

      Experiment heavier = e;
      const auto scale = [&](RigidBody& body) {
        body.mass *= error;
        body.I_Bcm_B *= error;
      };
      Payload& payload = heavier.plant.payload;
      scale(payload.robot.base);
      for (Link& link : payload.robot.links) scale(link.body);
      scale(payload.top_plate_S);
      scale(payload.adapter_R);
      Loop loop = right;
      scale(loop.robot_P);
      compare(heavier, loop, what + " times the mass");

      Experiment faster = e;
      faster.plant.actuator.gain_extend *= error;
      faster.plant.actuator.gain_retract *= error;
      loop = right;
      loop.velocity_gain *= error;
      compare(faster, loop, what + " times the gain");
    }
  EXPECT_GT(stable, 5);
  EXPECT_GT(unstable, 1);
}

TEST_F(Emulation, LoopModelKnowsAWrenchThatIsLaterThanBelieved) {
  // A light base of 1 Hz, the converter read once a tick or averaged: the sensor's filter slower or
  // quicker than believed. Read once, what is a little early drives it.
  int stable = 0, unstable = 0;
  for (const std::vector<std::string>& readings : {kPublished, kMean})
    for (const double late : {-3e-3, -2e-3, -1e-3, 1e-3, 2e-3, 3e-3}) {
      Experiment e =
          experiment("puma_on_table_4_1", kCompensated, with(lightBase(5.0, 1.0, 0.01), readings));
      Loop loop = loopOf(e.controller, e.plant.task.initial_joints, Direction::kSwinging);
      loop.late = late;
      const DominantRoot root = dominantRoot(loop);
      e.plant.sensor.cutoff = M_SQRT2 / (M_SQRT2 / e.plant.sensor.cutoff + late);
      const Series series = run(e);
      double first = 0.0, last = 0.0;  // rates in the first and the last three seconds
      std::vector<double> rates;
      for (const Row& row : series.rows)
        if (inAdmittance(row.state)) rates.push_back(Vec6::Map(row.state.x_dot).norm());
      for (std::size_t i = 0; i < rates.size(); ++i) {
        if (i < 300) first = std::max(first, rates[i]);
        if (i + 300 >= rates.size()) last = std::max(last, rates[i]);
      }
      const bool grows = !result_.good() || last > first;
      const std::string what = std::to_string(e.plant.sensor_readings) + " readings, " +
                               std::to_string(late) + " s: " + std::to_string(root.growth);
      if (std::abs(root.growth) < 0.02) continue;  // too slow to tell in twelve seconds
      (root.growth > 0.0 ? unstable : stable) += 1;
      EXPECT_EQ(grows, root.growth > 0.0) << what;
    }
  EXPECT_GE(stable, 2);
  EXPECT_GE(unstable, 2);
}

TEST_F(Emulation, GateHoldsForWhatTheBeliefMayBeOffBy) {
  const std::vector<std::string> base = lightBase(5.0, 3.0, 0.02);
  const Experiment e = assessed("puma_on_table_4_1", kCompensated, base);
  EXPECT_EQ(e.controller.stability, Stability::kUnstable);
  const LoopVerdict v = assessStability(e.controller, e.plant.task);
  EXPECT_TRUE(v.as_believed);
  EXPECT_FALSE(v.stable);
  EXPECT_NE(explain(v).find("would decay as believed, but diverge with a wrench 0.5 ms earlier"),
            std::string::npos)
      << explain(v);
  EXPECT_EQ(assessed("puma_on_table_4_1", kCompensated,
                     with(base, {"controller.compensation.timing_error_s=0",
                                 "controller.compensation.gain_error=0",
                                 "controller.compensation.mass_error=0"}))
                .controller.stability,
            Stability::kStable);
  // Each of the three, added to what the loop bears.
  const std::vector<std::string> heavy = with(lightBase(5.0, 3.0, 0.02), kMean);
  const auto verdict = [&](const char* timing, const char* gain, const char* mass) {
    const std::string key = "controller.compensation.";
    return assessed("puma_on_table_4_1", kCompensated,
                    with(heavy, {key + "timing_error_s=" + timing, key + "gain_error=" + gain,
                                 key + "mass_error=" + mass}))
        .controller.stability;
  };
  EXPECT_EQ(verdict("0", "0.1", "0"), Stability::kStable);
  EXPECT_EQ(verdict("0", "0.4", "0"), Stability::kUnstable);
  EXPECT_EQ(verdict("0.004", "0", "0"), Stability::kUnstable);
  EXPECT_EQ(verdict("0", "0", "0.5"), Stability::kStable);
  EXPECT_EQ(verdict("0", "0.1", "0.5"), Stability::kUnstable);
  // The corner that it names is one that grows; the same with the mass to the other side decays.
  const Experiment both = experiment("puma_on_table_4_1", kCompensated,
                                     with(heavy, {"controller.compensation.timing_error_s=0",
                                                  "controller.compensation.gain_error=0.1",
                                                  "controller.compensation.mass_error=0.5"}));
  const std::array<int, 3> corner = assessStability(both.controller, both.plant.task).off;
  const auto growth = [&](double mass, double gain) {
    double most = -HUGE_VAL;
    for (const Direction direction : {Direction::kExtending, Direction::kRetracting}) {
      Loop loop = loopOf(both.controller, both.plant.task.initial_joints, direction);
      loop.robot_P.mass *= 1.0 + 0.5 * mass;
      loop.robot_P.I_Bcm_B *= 1.0 + 0.5 * mass;
      loop.velocity_gain *= 1.0 + 0.1 * gain;
      most = std::max(most, dominantRoot(loop).growth);
    }
    return most;
  };
  EXPECT_GT(growth(corner[2], corner[1]), 0.0);
  EXPECT_LT(growth(-corner[2], corner[1]), 0.0);
}

TEST_F(Emulation, ComesInWithoutABump) {
  // From arming on, held still: no leg leaves its place by more than a count while the share rises.
  const Experiment e = experiment("puma_on_table_4_1", kCompensated,
                                  {"program=[{calibration: {}}]", "initial_pose={}"});
  const Series series = run(e);
  ASSERT_TRUE(result_.good());
  bool rising = false;
  for (const Row& row : series.rows) {
    if (row.state.engaged == 0) continue;
    rising = rising || (row.state.compensation_share > 0.1 && row.state.compensation_share < 0.9);
    for (int i = 0; i < 6; ++i)
      ASSERT_NEAR(row.truth.leg[i], series.rows.front().truth.leg[i], e.plant.transducer.scale);
  }
  EXPECT_TRUE(rising);
}

TEST_F(Emulation, GoesOutAndComesBackInTheMiddleOfASwing) {
  // A decay on Table 4.1 with the PUMA. The reference leads the legs by (L' + tau L'')/K of the
  // slower direction at most: while that goes out and comes in over the ramp, it changes in a tick
  // by its own rate, and by the ramp's share of it.
  const Experiment e = experiment(
      "puma_on_table_4_1", kCompensated,
      {"gravity_m_per_s2=0", "sensor.noise=false",
       "program=[{move: {}}, {calibration: {}}, {move: {to: {x_m: 0.05, z_m: 0.04}}}, {admittance: "
       "{duration_s: 8}}]"});
  int since = 0;
  Vec6 last = Vec6::Zero();
  double most = 0.0, least = 1.0, jump = 0.0, speed = 0.0, acceleration = 0.0;
  const RunResult result = runLockstep(e, nullptr, [&](const TickState& state) -> Order {
    if (state.kind != SegmentKind::kAdmittance) return {};
    ++since;
    const Vec6 lead = state.reference - state.legs.L;
    if (since > 150) {
      jump = std::max(jump, (lead - last).cwiseAbs().maxCoeff());
      speed = std::max(speed, state.legs.L_dot.cwiseAbs().maxCoeff());
      acceleration = std::max(acceleration, state.legs.L_ddot.cwiseAbs().maxCoeff());
    }
    last = lead;
    if (since > 200 && since < 300) least = std::min(least, state.compensation_share);
    if (since > 400) most = state.compensation_share;
    if (since == 150) return {Request::kUncompensate, {}, {}};
    if (since == 300) return {Request::kCompensate, {}, {}};
    return {};
  });
  EXPECT_TRUE(result.good());
  EXPECT_EQ(least, 0.0);
  EXPECT_EQ(most, 1.0);
  const double K =
      std::min(e.controller.servo.extend.minCoeff(), e.controller.servo.retract.minCoeff());
  const double T = e.controller.periodSeconds();
  const double most_lead = (speed + e.controller.servo.tau(0) * acceleration) / K;
  EXPECT_GT(most_lead, 10 * e.plant.transducer.scale);  // a step would show
  EXPECT_LT(jump, (2.0 * acceleration * T) / K + most_lead * T / e.controller.compensation.ramp +
                      e.plant.transducer.scale);
}

TEST_F(Emulation, IsNotTakenOutOfALoopThatNeedsIt) {
  const Experiment e = assessed("srms_deploy_doss", kCompensated, {"base.keep_modes=6"});
  EXPECT_EQ(e.controller.stability, Stability::kStable);
  EXPECT_EQ(e.controller.stability_uncompensated, Stability::kUnstable);
  bool asked = false, refused = false;
  const RunResult result = runLockstep(e, nullptr, [&](const TickState& state) -> Order {
    refused = refused || (asked && state.refusal == Refusal::kUnstable);
    if (asked || state.kind != SegmentKind::kAdmittance) return {};
    asked = true;
    return {Request::kUncompensate, {}, {}};
  });
  EXPECT_TRUE(refused);
  EXPECT_TRUE(result.good());
}

TEST_F(Emulation, StuckValveStopsIt) {
  const Experiment e = experiment(
      "z_sine", kCompensated,
      {"program=[{trajectory: {duration_s: 3, z: {sine: {amplitude_m: 0.2, frequency_hz: 0.5}}}, "
       "faults: [{at_s: 1.0, duration_s: 5, fault: valve_stuck, which: 3}]}]"});
  const RunResult result = runLockstep(e, nullptr, nullptr);
  EXPECT_EQ(result.phase, Phase::kStopped);
  EXPECT_EQ(result.cause, Check::kPositionError);
}

TEST_F(Emulation, StopEndsAtTheLastCheckedLengths) {  // a freeze in the middle of a fast motion
  const Experiment e = experiment(
      "z_sine", kCompensated,
      {"program=[{trajectory: {duration_s: 3, z: {sine: {amplitude_m: 0.2, frequency_hz: 0.5}}}, "
       "faults: [{at_s: 2.0, duration_s: 5, fault: panic_button}]}]"});
  const Series series = run(e);
  EXPECT_EQ(result_.phase, Phase::kStopped);
  const Row& last = series.rows.back();
  EXPECT_EQ(last.state.latched, 1 << static_cast<int>(Check::kPanicButton));
  for (int i = 0; i < 6; ++i)
    EXPECT_NEAR(last.truth.leg[i], last.state.leg[i], 2.0 * e.plant.transducer.scale);
}

// Identification of the servo

/// A run of `e` under command.
struct Recorded {
  explicit Recorded(const Experiment& e) {
    Lockstep loop(e.controller, e.plant);
    loop.input.order.request = Request::kStart;
    for (bool done = false; !done; loop.advance()) {
      const TickState& state = loop.tick();
      loop.input.order = {};
      done = test::done(state);
      if (!state.command.engaged) continue;
      legs.reference.push_back(legLengths(e.controller.legs, state.command.counts));
      legs.length.push_back(legLengths(e.controller.legs, loop.sample().legs));
      legs.sent.push_back(loop.input.time);
      legs.read.push_back(loop.sample().legs_time);
      shake.tick.push_back(state.tick);
      shake.time.push_back(loop.input.time);
      shake.reference.push_back(legs.reference.back());
      shake.sample.push_back(loop.sample());
      shake.bias.push_back(state.bias);
    }
  }
  LegRecord legs;
  ShakeRecord shake;
};

TEST(ServoIdentification, FindsWhatTheMachineIs) {
  for (const auto& [set, extend, retract, tau] :
       {std::tuple{"seed=1", 1.0, 1.0, 1.0},
        std::tuple{"plant_mismatch={gain_extend: 1.1, gain_retract: 0.92, tau: 1.3}", 1.1, 0.92,
                   1.3},
        std::tuple{"plant_mismatch={gain_extend: 0.85, gain_retract: 1.05, tau: 0.7}", 0.85, 1.05,
                   0.7}}) {
    const Experiment e = experiment("servo_identification", {set});
    const ServoModel& nominal = e.controller.servo;
    const ServoEstimate found = identifyServo(nominal, 0.01, Recorded(e).legs);
    const auto near = [&, set = set](Vec6 ServoModel::*value, double factor) {
      for (int i = 0; i < kLegs; ++i) {
        const double error = (found.servo.*value)(i)-factor * (nominal.*value)(i);
        EXPECT_LT(std::abs(error), 3.5 * (found.deviation.*value)(i)) << set;
      }
    };
    near(&ServoModel::extend, extend);
    near(&ServoModel::retract, retract);
    near(&ServoModel::tau, tau);
    near(&ServoModel::delay, 1.0);
    EXPECT_LT(found.deviation.extend.maxCoeff(), 0.01 * nominal.extend(0)) << set;
    EXPECT_LT(found.deviation.delay.maxCoeff(), 0.5e-3) << set;
    EXPECT_LT(found.residual.maxCoeff(), 0.35 * e.plant.transducer.scale) << set;
    EXPECT_GT(found.residual.minCoeff(), 0.05 * e.plant.transducer.scale) << set;

    // Loaded, it takes the lag out of the machine as it is.
    ServoRecord kept{0, found.servo, found.deviation};
    kept.servo.sensor_delay = -2e-4;
    kept.deviation.sensor_delay = 1e-5;
    kept.servo.sensor_scale = 1.02;
    kept.deviation.sensor_scale = 1e-3;
    const Value text = parseDocument(write(kept), "servo.yaml");
    // The gate then allows for three deviations.
    const ServoRecord again = readServo(Section(text, ""));
    const Compensation allowed = withRecord(Compensation(), again);
    EXPECT_EQ(allowed.timing_error, 3.0 * 1e-5);
    EXPECT_EQ(allowed.mass_error, 3.0 * 1e-3);
    EXPECT_GT(allowed.gain_error, 2.9 * found.deviation.extend(0) / found.servo.extend(0));
    EXPECT_LT(allowed.gain_error, 0.05);
    EXPECT_TRUE(found.servo.opening.isZero(0.0)) << set;  // its valves just close
    EXPECT_FALSE(text.find("opening_m"));
    kept.servo.opening.setConstant(1.5e-4);
    kept.deviation.opening.setConstant(2e-5);
    const Value open_text = parseDocument(write(kept), "servo.yaml");
    const ServoRecord open = readServo(Section(open_text, ""));
    EXPECT_FALSE(open_text.find("friction_m"));
    EXPECT_TRUE(withRecord(nominal, open).friction.isZero(0.0));
    kept.servo.opening.setConstant(-1.5e-4);
    kept.servo.friction << 1e-4, 2e-4, 3e-4, 4e-4, 5e-4, 6e-4;
    kept.deviation.friction.setConstant(3e-5);
    kept.servo.friction_time = 0.07;
    kept.servo.friction_way = 2e-4;
    const Value rubs_text = parseDocument(write(kept), "servo.yaml");
    const ServoRecord rubs = readServo(Section(rubs_text, ""));
    EXPECT_EQ(withRecord(nominal, rubs).opening, kept.servo.opening);  // below zero too
    std::string shorter = write(kept);                                 // of who only knows how much
    for (const char* key : {"friction_s:", "friction_way_m:"}) {
      const std::size_t at = shorter.find(key);
      shorter.erase(at, shorter.find('\n', at) + 1 - at);
    }
    const Value shorter_text = parseDocument(shorter, "servo.yaml");
    const ServoModel plain = withRecord(nominal, readServo(Section(shorter_text, "")));
    EXPECT_EQ(plain.friction, kept.servo.friction);
    EXPECT_EQ(plain.friction_time, ServoModel().friction_time);
    // In place of what the keys say, but for what may be learnt.
    Compensation guessed;
    guessed.gain_error = guessed.timing_error = guessed.mass_error = 0.4;
    const Compensation known = withRecord(guessed, again);
    EXPECT_EQ(known.gain_error, allowed.gain_error);
    EXPECT_EQ(known.timing_error, allowed.timing_error);
    EXPECT_EQ(known.mass_error, allowed.mass_error);
    guessed.adaptation = true;
    EXPECT_EQ(withRecord(guessed, again).gain_error, 0.4);
    EXPECT_EQ(withRecord(guessed, again).timing_error, 0.4);
  }
}

// What the gate allows for is three of them.
TEST(ServoIdentification, ItsDeviationsAreAsLargeAsItsErrors) {
  double squares[4] = {}, n = 0.0;
  for (const double gain : {0.85, 0.93, 1.0, 1.06, 1.12})
    for (const double tau : {0.7, 0.9, 1.2}) {
      const Experiment e = experiment("servo_identification",
                                      {"plant_mismatch={gain_extend: " + std::to_string(gain) +
                                       ", gain_retract: " + std::to_string(2.0 - gain) +
                                       ", tau: " + std::to_string(tau) + "}"});
      const ServoModel& nominal = e.controller.servo;
      const ServoEstimate found = identifyServo(nominal, 0.01, Recorded(e).legs);
      const std::tuple<Vec6 ServoModel::*, double> all[] = {{&ServoModel::extend, gain},
                                                            {&ServoModel::retract, 2.0 - gain},
                                                            {&ServoModel::tau, tau},
                                                            {&ServoModel::delay, 1.0}};
      for (std::size_t p = 0; p < 4; ++p) {
        const auto& [value, factor] = all[p];
        const Vec6 error = found.servo.*value - factor * (nominal.*value);
        squares[p] += error.cwiseQuotient(found.deviation.*value).squaredNorm();
      }
      n += kLegs;
    }
  for (const double sum : squares) {
    EXPECT_GT(std::sqrt(sum / n), 0.4);
    EXPECT_LT(std::sqrt(sum / n), 1.6);
  }
}

TEST(SensorTiming, FindsALaterSensorAnEarlierOneAndAHeavierRobot) {  // with the noise, on Earth
  for (const char* readings : {"1", "4"})
    for (const double slower : {0.96, 1.0, 1.04})
      for (const double mass : {1.0, 1.05}) {
        Experiment e = experiment("servo_identification", kPublished,
                                  {std::string("sensor.readings_per_tick=") + readings,
                                   "plant_mismatch={mass: " + std::to_string(mass) + "}"});
        const double w = e.controller.servo.sensor_cutoff;
        e.plant.sensor.cutoff = w / slower;  // its delay at rest is sqrt(2)/w
        // The weight that the controller does not know moves nothing, and stays.
        const SensorEstimate found = identifySensor(e.controller, Recorded(e).shake);
        const double due = M_SQRT2 / w * (slower - 1.0);
        const std::string what = std::string(readings) + " " + std::to_string(slower);
        EXPECT_NEAR(found.delay, due, 0.15 * std::abs(due) + 4.0 * found.delay_deviation) << what;
        EXPECT_NEAR(found.scale, mass, 0.01 + 3.0 * found.scale_deviation) << what;
        EXPECT_LT(found.delay_deviation, 1.5e-4) << what;
        EXPECT_GT(found.delay_deviation, 1e-6) << what;
        EXPECT_LT(found.scale_deviation, 0.01) << what;
      }
}

TEST(SensorTiming, ItsDelayIsTheSameHoweverHeavyTheRobotIs) {
  for (const double mass : {0.75, 1.0, 1.3}) {
    Experiment e =
        experiment("servo_identification", kPublished,
                   {"sensor.noise=false", "plant_mismatch={mass: " + std::to_string(mass) + "}"});
    const double w = e.controller.servo.sensor_cutoff, due = 0.04 * M_SQRT2 / w;
    e.plant.sensor.cutoff = w / 1.04;
    const SensorEstimate found = identifySensor(e.controller, Recorded(e).shake);
    EXPECT_NEAR(found.delay, due, 0.12 * due) << mass;
  }
}

// They are of blocks of one run, and hold what is the same in every run, too.
TEST(SensorTiming, ItsDeviationsAreAboutWhatItScattersBy) {
  constexpr int kSeeds = 10;
  Eigen::Array<double, kSeeds, 2> found, said;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const Experiment e =
        experiment("servo_identification", kPublished, {"seed=" + std::to_string(seed + 1)});
    const SensorEstimate one = identifySensor(e.controller, Recorded(e).shake);
    found.row(seed) << one.scale, one.delay;
    said.row(seed) << one.scale_deviation, one.delay_deviation;
  }
  for (int k = 0; k < 2; ++k) {
    const Eigen::ArrayXd off = found.col(k) - found.col(k).mean();
    const double scatter = std::sqrt(off.square().sum() / (kSeeds - 1));
    EXPECT_GT(said.col(k).mean(), 0.5 * scatter) << k;
    EXPECT_LT(said.col(k).mean(), 4.0 * scatter) << k;
  }
}

TEST(SensorTiming, RefusesAPlatformThatStandsAndARobotThatMoves) {
  Experiment e = experiment("servo_identification", kPublished,
                            {"program=[{move: {}}, {calibration: {}}, {move: {duration_s: 2}}]"});
  const Recorded still(e);
  const auto why = [&](const ShakeRecord& record) -> std::string {
    try {
      identifySensor(e.controller, record);
    } catch (const std::domain_error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(why(still.shake), "the platform moves too little to tell the wrench's time");
  ShakeRecord moving = still.shake;
  moving.sample[150].q(1) += 0.01;
  EXPECT_EQ(why(moving), "the robot moves, want a run that shakes it standing still");
  ShakeRecord few;
  EXPECT_EQ(why(few), "fewer than 120 ticks, want a run that shakes the platform");
}

TEST(ServoIdentification, RefusesLegsThatStand) {
  const Experiment e = experiment("servo_identification", {});
  LegRecord record;
  record.reference.assign(200, Vec6::Constant(1.5));
  record.length = record.reference;
  for (std::int64_t n = 0; n < 200; ++n) {
    record.sent.push_back(n * 10'000'000);
    record.read.push_back(n * 10'000'000);
  }
  try {
    identifyServo(e.controller.servo, 0.01, record);
    ADD_FAILURE() << "of legs that stand";
  } catch (const std::domain_error& error) {
    EXPECT_EQ(std::string(error.what()).find("leg 1 moves too little"), 0u) << error.what();
  }
  record.reference.resize(10);
  record.length.resize(10);
  EXPECT_THROW(identifyServo(e.controller.servo, 0.01, record), std::domain_error);
}

TEST(CompensationConfig, InertiaNeedsTheObserver) {
  EXPECT_THROW(experiment("z_sine", {"controller.compensation.inertia=true"}), InputError);
}

}  // namespace
}  // namespace ves
