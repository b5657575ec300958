// SPDX-License-Identifier: BSD-3-Clause
//
// Beyond the report: the servos' lag and the robot's inertia taken out of the emulation.
#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/LU>
#include <filesystem>
#include <random>

#include "support/poses.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/analysis/gate.hpp"
#include "ves/config/servo.hpp"
#include "ves/identification/servo_identification.hpp"
#include "ves/results/comparison.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

const std::vector<std::string> kPublished;
const std::vector<std::string> kAll = {"controller.compensation.feed_forward=true",
                                       "controller.compensation.observer=true",
                                       "controller.compensation.inertia=true"};

Experiment experiment(const std::string& name, std::vector<std::string> set,
                      const std::vector<std::string>& more = {}) {
  set.insert(set.end(), more.begin(), more.end());
  return test::experiment(name, set);
}

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
    const Experiment e = experiment(name, kAll);
    const Axis axis = e.controller.program.segments[1].trajectory[static_cast<std::size_t>(i)];
    const Series series = run(e);
    ASSERT_TRUE(result_.good());
    const Vec6 error = settledError(series, 1, [&, i = i](double t) -> Vec6 {
      return axis.amplitude * std::sin(2.0 * M_PI * axis.frequency * (t + 0.01)) * Vec6::Unit(i);
    });
    EXPECT_LT(error(i), 0.01 * axis.amplitude) << name;
  }
}

TEST_F(Emulation, FreeDecayOfTable41IsTheClosedFormsOwn) {
  const Series series = run(experiment("free_decay", kAll));
  ASSERT_TRUE(result_.good());
  const double m[] = {500, 500, 500, 250, 250, 250}, k[] = {1500, 2500, 4000, 1500, 1000, 2000};
  Vec6 offset;
  offset << 0.10, -0.08, 0.06, 8 * kDegree, -6 * kDegree, 10 * kDegree;
  const Vec6 error = settledError(series, 3, [&](double t) {
    Vec6 x;
    for (int i = 0; i < 6; ++i) {
      const double wd = std::sqrt(k[i] / m[i] - 0.25);  // c/m is 1 for all
      x(i) = offset(i) * std::exp(-0.5 * t) * (std::cos(wd * t) + 0.5 / wd * std::sin(wd * t));
    }
    return x;
  });
  for (int i = 0; i < 6; ++i) EXPECT_LT(error(i), 0.02 * std::abs(offset(i))) << i;
}

TEST_F(Emulation, DossOnTheShuttlesArmMovesAsTheMovingBaseDoes) {
  // Without noise: the counts of legs and A/D converter are in it, and are what is left.
  for (const char* configuration : {"unberth", "low_hover", "deploy", "capture"})
    for (const bool six : {false, true}) {
      std::vector<std::string> more = {"sensor.noise=false"};
      if (six) more.push_back("base.keep_modes=6");
      const Experiment e = assessed(std::string("srms_") + configuration + "_doss", kAll, more);
      EXPECT_EQ(e.controller.stability, Stability::kStable) << e.name;
      const Series series = run(e);
      ASSERT_TRUE(result_.good()) << e.name;
      std::int64_t duration = 0;
      const Interaction interaction = interactionOf(e, duration);
      InteractionOptions options;
      options.model = InteractionModel::kWhole;
      options.duration = duration;
      const Motion truth = motion(simulate(interaction, options));
      EXPECT_LT(distance(actual(series), truth).rms_position,
                (six ? 0.05 : 0.02) * travel(truth).peak_position)
          << e.name << " " << six;
    }
}

/// A base in space whose every frequency is `hertz` and which weighs a `ratio`-th of the robot.
std::vector<std::string> lightBase(double ratio, double hertz, double zeta) {
  std::string m, c, k;
  for (int i = 0; i < 6; ++i) {
    const double mass = (i < 3 ? 73.45 : 40.0) / ratio, w = 2.0 * M_PI * hertz;
    m += (i ? "," : "") + std::to_string(mass);
    c += (i ? "," : "") + std::to_string(2.0 * zeta * w * mass);
    k += (i ? "," : "") + std::to_string(w * w * mass);
  }
  return {"gravity_m_per_s2=0", "sensor.noise=false",
          "base={mass_diagonal: [" + m + "], damping_diagonal: [" + c + "], stiffness_diagonal: [" +
              k + "]}",
          "program=[{move: {}}, {calibration: {}}, {move: {to: {x_m: 0.04, z_m: 0.03}}}, "
          "{admittance: {duration_s: 12}}]"};
}

TEST_F(Emulation, MassRatioOfFiveDecaysAsItShould) {  // Appendix E ends at one
  const std::vector<std::string> set = lightBase(5.0, 0.5, 0.02);
  const Experiment published = assessed("puma_on_table_4_1", kPublished, set);
  EXPECT_EQ(published.controller.stability, Stability::kUnstable);
  EXPECT_FALSE(runLockstep(published, nullptr, nullptr).good());

  const Experiment e = assessed("puma_on_table_4_1", kAll, set);
  EXPECT_EQ(e.controller.stability, Stability::kStable);
  const Series series = run(e);
  ASSERT_TRUE(result_.good());
  std::int64_t duration = 0;
  const Interaction interaction = interactionOf(e, duration);
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.duration = duration;
  const Vec6 x0 = (Vec6() << 0.04, 0.0, 0.03, 0.0, 0.0, 0.0).finished();
  options.eta = interaction.base.Phi.partialPivLu().solve(x0);
  options.eta_dot = VectorXd::Zero(6);
  const Motion truth = motion(simulate(interaction, options));
  EXPECT_LT(distance(actual(series), truth).rms_position, 0.02 * x0.norm());
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
      Experiment e = experiment(scenario, kAll,
                                {"base.keep_modes=6", "sensor.noise=false", "gravity_m_per_s2=0"});
      const Loop right =
          loopOf(e.controller, e.plant, e.plant.initial_joints, Direction::kSwinging);

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

TEST_F(Emulation, ComesInWithoutABump) {
  // From arming on, held still: no leg leaves its place by more than a count while the share rises.
  const Experiment e =
      experiment("puma_on_table_4_1", kAll, {"program=[{calibration: {}}]", "initial_pose={}"});
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
      "puma_on_table_4_1", kAll,
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
  const Experiment e = assessed("srms_deploy_doss", kAll, {"base.keep_modes=6"});
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
      "z_sine", kAll,
      {"program=[{trajectory: {duration_s: 3, z: {sine: {amplitude_m: 0.2, frequency_hz: 0.5}}}, "
       "faults: [{at_s: 1.0, duration_s: 5, fault: valve_stuck, which: 3}]}]"});
  const RunResult result = runLockstep(e, nullptr, nullptr);
  EXPECT_EQ(result.phase, Phase::kStopped);
  EXPECT_EQ(result.cause, Check::kPositionError);
}

TEST_F(Emulation, StopEndsWhereTheLegsWereTold) {  // a freeze in the middle of a fast motion
  const Experiment e = experiment(
      "z_sine", kAll,
      {"program=[{trajectory: {duration_s: 3, z: {sine: {amplitude_m: 0.2, frequency_hz: 0.5}}}, "
       "faults: [{at_s: 2.0, duration_s: 5, fault: panic_button}]}]"});
  const Series series = run(e);
  EXPECT_EQ(result_.phase, Phase::kStopped);
  const Row& last = series.rows.back();
  EXPECT_EQ(last.state.latched, 1 << static_cast<int>(Check::kPanicButton));
  for (int i = 0; i < 6; ++i)
    EXPECT_NEAR(last.truth.leg[i], last.state.reference[i], 2.0 * e.plant.transducer.scale);
}

// Identification of the servo

TEST(ServoIdentification, FindsWhatTheMachineIs) {
  for (const auto& [set, extend, retract, tau] :
       {std::tuple{"seed=1", 1.0, 1.0, 1.0},
        std::tuple{"plant_mismatch={gain_extend: 1.1, gain_retract: 0.92, tau: 1.3}", 1.1, 0.92,
                   1.3},
        std::tuple{"plant_mismatch={gain_extend: 0.85, gain_retract: 1.05, tau: 0.7}", 0.85, 1.05,
                   0.7}}) {
    const Experiment e = experiment("servo_identification", {set});
    const ServoModel& nominal = e.controller.servo;
    LegRecord record;
    TestPlatform platform(e.controller);
    plant::Plant plant(e.plant);
    TickInput in;
    in.order.request = Request::kStart;
    for (bool done = false; !done; ++in.tick) {
      in.sample = plant.sample();
      const TickState& state = platform.tick(in);
      done = test::done(state);
      if (state.command.engaged) {
        record.reference.push_back(legLengths(e.controller.legs, state.command.counts));
        record.length.push_back(legLengths(e.controller.legs, in.sample.legs));
      }
      plant.command(state.command);
      plant.advance((in.tick + 1) * e.controller.period);
    }
    const ServoEstimate found = identifyServo(nominal, 0.01, record);
    const auto near = [&](Vec6 ServoModel::*value, double factor) {
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
    const ServoRecord kept{0, found.servo, found.deviation};
    const Value text = parseDocument(write(kept), "servo.yaml");
    const ServoModel read = withRecord(nominal, readServo(Section(text, "")));
    EXPECT_EQ(read.extend, found.servo.extend);
    EXPECT_EQ(read.delay, found.servo.delay);
  }
}

TEST(ServoIdentification, RefusesLegsThatStand) {
  const Experiment e = experiment("servo_identification", {});
  LegRecord record;
  record.reference.assign(200, Vec6::Constant(1.5));
  record.length = record.reference;
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
