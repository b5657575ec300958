// SPDX-License-Identifier: BSD-3-Clause
//
// A laboratory that flies along with its vehicle (control/moving_frame.hpp): against the vehicle in
// free space, which knows of no laboratory, and closed forms.
#include <gtest/gtest.h>

#include "support/rig.hpp"
#include "ves/control/moving_frame.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/kinematics/stewart.hpp"
#include "ves/plant/lockstep.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

BodyMotion anyMotion(double seed) {
  const auto vec = [&](double k) {
    return Vec3(std::sin(seed + k), std::cos(2.0 * seed + k), std::sin(3.0 * seed - k));
  };
  return {{rotationOf(vec(0.1)), vec(0.2)}, vec(0.3), vec(0.4), vec(0.5), vec(0.6)};
}

TEST(RelativeMotion, HasTheRatesOfItsPoses) {
  // Of two frames whose accelerations are held, by differences of where their poses put each other.
  constexpr double kStep = 1e-4;  // [s]
  for (double seed = 0.0; seed < 6.0; seed += 0.7) {
    const BodyMotion AB = anyMotion(seed), BC = anyMotion(seed + 0.31), AC = composed(AB, BC);
    const auto at = [&](double t) { return later(AB, t).X * later(BC, t).X; };
    const Transform before = at(-kStep), now = at(0.0), after = at(kStep);
    EXPECT_LT((AC.X.R - now.R).norm() + (AC.X.p - now.p).norm(), 1e-14);
    EXPECT_LT((AC.v - (after.p - before.p) / (2.0 * kStep)).norm(), 1e-6);
    EXPECT_LT((AC.a - (after.p - 2.0 * now.p + before.p) / (kStep * kStep)).norm(), 1e-5);
    const Vec3 on = rotationVector(after.R * now.R.transpose()),
               back = rotationVector(before.R * now.R.transpose());
    EXPECT_LT((AC.w - (on - back) / (2.0 * kStep)).norm(), 1e-6);
    EXPECT_LT((AC.alpha - (on + back) / (kStep * kStep)).norm(), 1e-5);

    const BodyMotion again = relative(AB, AC);
    EXPECT_LT((again.X.R - BC.X.R).norm() + (again.X.p - BC.X.p).norm(), 1e-13);
    EXPECT_LT((again.v - BC.v).norm() + (again.w - BC.w).norm(), 1e-13);
    EXPECT_LT((again.a - BC.a).norm() + (again.alpha - BC.alpha).norm(), 1e-12);
  }
}

ControllerConfig flying() {
  ControllerConfig c;
  c.period = 10'000'000;
  c.moving_frame.enabled = true;
  c.safety.translation = 0.2;
  c.safety.rotation = 20.0 * kDegree;
  return c;
}

TEST(MovingFrame, WhatCoastsIsShownAtRest) {
  // A tumbling body whose centre is far from the platform, a minute long; and the platform's place
  // on it goes round in circles.
  FreeBodyModel vehicle;
  vehicle.body_P = {80.0, {0.3, -0.2, -0.9}, Vec3(10.0, 20.0, 25.0).asDiagonal()};
  vehicle.v_IPo_I = {30.0, 0.0, -4.0};
  vehicle.w_IP_I = {0.3, 0.02, 0.1};
  FreeBody body(vehicle, kTick);
  MovingFrame frame(flying());
  body.reset(Vec6::Zero());
  frame.begin(body.bodyMotion());
  PathPoint<6> shown;
  double turned = 0.0;
  for (int k = 0; k < 6000; ++k) {
    frame.step(shown, body.coasting(), 1.0, kTick);
    body.step(Wrench{});
    shown = frame.shown(body.bodyMotion());
    turned += kTick * body.bodyMotion().w.norm();
    ASSERT_LT(shown.x.norm(), 1e-3) << k;  // it holds its acceleration for a period
    ASSERT_LT(shown.x_dot.norm(), 1e-3) << k;
  }
  EXPECT_GT(turned, 4.0 * M_PI);
  EXPECT_GT(body.bodyMotion().X.p.norm(), 1700.0);
}

TEST(MovingFrame, BringsThePlatformHomeAsADampedSpringWould) {
  // Kicked once; small enough for the laboratory to follow without its limits: v t exp(-k t).
  const ControllerConfig c = flying();
  const MovingFrameSettings& f = c.moving_frame;
  const double k = std::sqrt(f.acceleration / (f.share * c.safety.translation)),
               k_turn = std::sqrt(f.angular_acceleration / (f.share * c.safety.rotation));
  const Vec3 v(0.01, -0.005, 0.003), w(0.002, 0.0, 0.0);
  MovingFrame frame(c);
  frame.begin({});
  BodyMotion E_P;
  E_P.v = v;
  E_P.w = w;
  PathPoint<6> shown = frame.shown(E_P);
  for (int n = 0; n < 3000; ++n) {
    frame.step(shown, E_P, 1.0, kTick);
    E_P = later(E_P, kTick);
    shown = frame.shown(E_P);
    const double t = kTick * (n + 1);
    // To first order in the step, which holds what the laboratory does.
    ASSERT_LT((shown.x.head<3>() - t * std::exp(-k * t) * v).norm(), 1e-2 * v.norm() / k) << t;
    ASSERT_NEAR(shown.x(3), t * std::exp(-k_turn * t) * w.x(), 1e-2 * w.x() / k_turn) << t;
  }
}

TEST(MovingFrame, FollowsNoFasterThanItMay) {
  const ControllerConfig c = flying();
  MovingFrame frame(c);
  frame.begin({});
  BodyMotion E_P;
  E_P.v = {0.1, 0.05, 0.0};
  E_P.w = {0.0, 0.05, 0.08};
  PathPoint<6> shown = frame.shown(E_P);
  double most = 0.0, most_turn = 0.0;
  for (int n = 0; n < 3000; ++n) {
    frame.step(shown, E_P, 1.0, kTick);
    E_P = later(E_P, kTick);
    shown = frame.shown(E_P);
    const BodyMotion P = bodyMotion(Vec3::Zero(), Pose::from(shown.x), shown.x_dot, shown.x_ddot);
    most = std::max(most, P.a.norm());
    most_turn = std::max(most_turn, P.alpha.norm());
  }
  // The acceleration was chosen for where the platform was at the beginning of the period.
  EXPECT_NEAR(most, c.moving_frame.acceleration, 0.02 * c.moving_frame.acceleration);
  EXPECT_NEAR(most_turn, c.moving_frame.angular_acceleration,
              0.02 * c.moving_frame.angular_acceleration);
  EXPECT_LT(shown.x.head<3>().norm(), 0.02);
  // Without any following it only coasts.
  frame.rest();
  const Vec3 before = frame.laboratory().X.p;
  frame.step({}, {}, 0.0, kTick);
  EXPECT_EQ(frame.laboratory().X.p, before);
}

/// Where the vehicle is emulated to be, each tick of admittance control.
std::vector<Transform> emulatedPoses(const Series& series) {
  std::vector<Transform> out;
  for (const Row& row : series.rows)
    if (inAdmittance(row.state)) out.push_back(emulatedPose(row.state));
  return out;
}

/// [m], [rad]
double apart(const Transform& a, const Transform& b) {
  return (a.p - b.p).norm() + rotationVector(a.R * b.R.transpose()).norm();
}

/// Of the platform from the vehicle in free space, where the laboratory shows that.
Distance offTruth(const Series& series) {
  const std::optional<Emulation> e = emulation(series);
  return e ? distance(e->platform, e->base) : Distance{HUGE_VAL, HUGE_VAL, HUGE_VAL, HUGE_VAL};
}

TEST(Flight, ThreeTurnsAndAMileAreShownInAHandsBreadth) {
  for (const char* noise : {"true", "false"}) {
    const RecordedRun run = recordLockstep(test::experiment(
        "satellite_tumbling",
        {std::string("sensor.noise=") + noise, "base.free.velocity_m_per_s=[30, 0, 0]"}));
    ASSERT_TRUE(run.result.good());
    const Distance off = offTruth(run.series);
    EXPECT_LT(off.peak_position, 1e-4);  // [m]
    EXPECT_LT(off.peak_attitude, 1e-2 * kDegree);
    double turned = 0.0, most = 0.0;
    const std::vector<Transform> poses = emulatedPoses(run.series);
    for (std::size_t k = 1; k < poses.size(); ++k)
      turned += rotationVector(poses[k].R * poses[k - 1].R.transpose()).norm();
    for (const Row& row : run.series.rows)
      most = std::max(most, Vec6::Map(row.state.x).head<3>().norm());
    EXPECT_GT(turned, 2.9 * 2.0 * M_PI);
    EXPECT_GT(poses.back().p.norm(), 1700.0);  // [m]
    EXPECT_LT(most, 0.05);
  }
}

// A robot 5 % heavier than believed, whose masses are learnt in flight: what they have done to a
// vehicle that tumbles is taken back to second order, however fast it flies.
TEST(Flight, WhatAWrongMassHasDoneIsTakenBack) {
  const auto off = [](const char* learns, const char* speed) {
    const RecordedRun run = recordLockstep(test::experiment(
        "satellite_tumbling", {std::string("controller.compensation.learns_masses=") + learns,
                               "sensor.noise=false", "plant_mismatch={mass: 1.05}",
                               fmt::format("base.free.velocity_m_per_s=[{}, -3, 0]", speed)}));
    EXPECT_TRUE(run.result.good());
    return offTruth(run.series);
  };
  const Distance believed = off("false", "1"), learnt = off("true", "1"), fast = off("true", "50");
  EXPECT_GT(believed.rms_position, 0.05);
  EXPECT_LT(learnt.rms_position, 0.06 * believed.rms_position);
  EXPECT_LT(learnt.rms_attitude, 0.06 * believed.rms_attitude);
  EXPECT_NEAR(fast.rms_position, learnt.rms_position, 2e-5);
  EXPECT_NEAR(fast.rms_attitude, learnt.rms_attitude, 2e-3 * kDegree);
}

TEST(Flight, TheEnergyThatIsPutInIsThatOfTheVehiclesWay) {
  // The same motion at 0 and at 50 m/s: forces do other work, and what the emulation adds to it is
  // the same.
  const auto putIn = [](const char* name, const char* velocity) {
    const RecordedRun run = recordLockstep(
        test::experiment(name, {"controller.moving_frame.enabled=true", "sensor.noise=false",
                                std::string("base.free.velocity_m_per_s=") + velocity}));
    std::vector<double> out;
    for (const Row& row : run.series.rows)
      if (inAdmittance(row.state)) out.push_back(row.state.energy_put_in);
    return out;
  };
  const std::vector<double> slow = putIn("satellite_puma", "[0, 0, 0]"),
                            fast = putIn("satellite_puma", "[50, 0, 0]");
  ASSERT_EQ(slow.size(), fast.size());
  for (std::size_t k = 0; k < slow.size(); k += 10) EXPECT_NEAR(slow[k], fast[k], 1e-3) << k;
  for (const double tumbling : putIn("satellite_tumbling", "[50, 0, 0]"))
    EXPECT_LT(std::abs(tumbling), 2e-3);
}

TEST(Flight, EmulatesWhatALaboratoryThatRestsDoes) {
  // Small enough for both; with thrusters and an attitude hold, and another period.
  for (const auto& [name, set] : std::vector<std::pair<std::string, std::vector<std::string>>>{
           {"satellite_puma", {}},
           {"satellite_hold", {}},
           {"satellite_puma", {"controller.period_ns=20000000"}}}) {
    std::vector<std::string> rests = set, flies = set;
    flies.push_back("controller.moving_frame.enabled=true");
    const RecordedRun one = recordLockstep(test::experiment(name, rests)),
                      other = recordLockstep(test::experiment(name, flies));
    ASSERT_TRUE(one.result.good() && other.result.good()) << name;
    const std::vector<Transform> a = emulatedPoses(one.series), b = emulatedPoses(other.series);
    ASSERT_EQ(a.size(), b.size());
    double most = 0.0, way = 0.0, shown = 0.0;
    for (std::size_t k = 0; k < a.size(); ++k) {
      most = std::max(most, apart(a[k], b[k]));
      way = std::max(way, a[k].p.norm());
    }
    for (const Row& row : other.series.rows)
      shown = std::max(shown, Vec6::Map(row.state.x).head<3>().norm());
    EXPECT_LT(most, 3e-4) << name << set.size();
    EXPECT_GT(way, 0.01) << name;
    EXPECT_LT(shown, 0.9 * way) << name;  // it has flown
  }
}

TEST(Flight, APlatformAtItsLimitsLeavesTheVehicleAlone) {
  // Thrusters that push harder than the laboratory may follow: it yields, and the vehicle goes on.
  const RecordedRun run = recordLockstep(test::experiment(
      "satellite_puma",
      {"controller.moving_frame.enabled=true",
       "base.free.thrusters=[{at_m: [0, 0, -0.6], force_n: [60, 0, 0], firings_s: [[1, 6]]}]",
       "program=!replace [{move: {}}, {calibration: {}}, {admittance: {duration_s: 20}}]"}));
  ASSERT_TRUE(run.result.good());
  double least = 1.0, most = 0.0;
  for (const Row& row : run.series.rows) {
    if (!inAdmittance(row.state)) continue;
    least = std::min(least, row.state.envelope_scale);
    most = std::max(most, std::abs(row.state.x[0]));
  }
  EXPECT_LT(least, 1.0);
  EXPECT_LE(most, run.series.experiment.controller.safety.translation);
  // The commanded flight against free space; of the hard braking a little is taken for a touch.
  const std::vector<Transform> poses = emulatedPoses(run.series);
  ReferenceMotions references;
  const auto truth = baseMotion(run.series.experiment, letGoOf(run.series), references);
  ASSERT_TRUE(truth);
  for (std::size_t k = 0; k + 1 < truth->x.size() && k < poses.size(); k += 10) {
    const Pose x = Pose::from(truth->x[k + 1]);
    EXPECT_LT(apart(poses[k], {rotation(x.rpy), x.p}), 1e-3 + 2e-3 * x.p.norm()) << k;
  }
  EXPECT_GT(poses.back().p.x(), 5.0);
}

TEST(Flight, WhatItTakesHoldOfIsWhereTheVehicleIs) {
  // A ball that flies along, and is no nearer for the speed of both: the grip's events are those of
  // a laboratory that rests, and its momentum is.
  const std::vector<std::string> quiet = {"sensor.noise=false"};
  std::vector<std::string> flies = quiet;
  flies.insert(flies.end(),
               {"controller.moving_frame.enabled=true", "base.free.velocity_m_per_s=[5, 2, 0]",
                "environment.target.velocity_m_per_s=[4.98, 2, 0]"});
  const RecordedRun one = recordLockstep(test::experiment("servicer_capture", quiet)),
                    other = recordLockstep(test::experiment("servicer_capture", flies));
  ASSERT_TRUE(one.result.good() && other.result.good());
  const auto last = [](const Series& series) {
    const truth_t* out = nullptr;
    for (const Row& row : series.rows)
      if (inAdmittance(row.state)) out = &row.truth;
    return *out;
  };
  const truth_t a = last(one.series), b = last(other.series);
  const Vec3 speed(5.0, 2.0, 0.0);
  EXPECT_LT((Vec3::Map(a.target_v) + speed - Vec3::Map(b.target_v)).norm(), 3e-3);
  EXPECT_LT((Vec3::Map(a.target_w) - Vec3::Map(b.target_w)).norm(), 5e-3);
  int gripped[2] = {0, 0};
  for (const Row& row : one.series.rows) gripped[0] += row.truth.gripped;
  for (const Row& row : other.series.rows) gripped[1] += row.truth.gripped;
  EXPECT_GT(gripped[0], 1000);
  EXPECT_EQ(gripped[0], gripped[1]);
}

TEST(Flight, WhatIsHeldStopsWithTheLaboratory) {
  // The ball is in the hand when the flight ends: the grip feels no more than while it flew, and
  // a ball that floats beside the hand goes on beside it.
  for (const std::string grasp : {"{at_s: 1.3, grasp: {target: true}}", ""}) {
    const RecordedRun run = recordLockstep(test::experiment(
        "servicer_capture",
        {"controller.moving_frame.enabled=true", "sensor.noise=false",
         "base.free.velocity_m_per_s=[5, 2, 0]", "base.free.rate_deg_per_s=[0, 0, 3]",
         "environment.target.velocity_m_per_s=[4.98, 2, 0]",
         "program=!replace [{move: {}}, {calibration: {}}, {admittance: {duration_s: 4}, robot: [" +
             grasp + "]}, {monitor: {duration_s: 1, interval_s: 1}}]"}));
    ASSERT_TRUE(run.result.good());
    double most[2] = {0.0, 0.0};  // [N] in flight and after it
    Vec3 v = Vec3::Zero();        // [m/s] of the ball, at last
    for (const Row& row : run.series.rows) {
      if (row.state.phase != static_cast<std::int8_t>(Phase::kRunning)) continue;
      const bool flies = inAdmittance(row.state);
      double& force = most[flies ? 0 : 1];
      force = std::max(force, Vec3::Map(row.truth.contact).norm());
      if (!flies) v = Vec3::Map(row.truth.target_v);
    }
    EXPECT_LT(most[1], 1.5 * most[0] + 1.0) << grasp;
    EXPECT_LT(v.norm(), 0.2) << grasp;  // five metres a second are the laboratory's
  }
}

TEST(Flight, WhatFloatsIsWhereItWasForAnotherController) {
  // One leaves a laboratory that has flown and turned, and the next counts from another place.
  const Experiment e = test::experiment("servicer_capture");
  plant::Plant plant(e.plant);
  LegCommand command;
  const auto beside = [&]() -> std::array<Vec3, 4> {  // p, an axis, v, w in the laboratory
    const Transform X_HE = inverse(command.laboratory.E_H.X);
    const Floating& ball = plant.truth().target;
    return {X_HE * Vec3(ball.p - e.plant.geometry.home()), X_HE.R * (ball.q * Vec3(Vec3::UnitX())),
            X_HE.R * ball.v, X_HE.R * ball.w};
  };
  const std::array<Vec3, 4> first = beside();
  for (const Vec3& turn : {Vec3(0.3, -2.0, 1.0), Vec3(Vec3::Zero()), Vec3(1.0, 0.0, 0.0)}) {
    command.laboratory.time = 1;
    command.laboratory.E_H.X = {rotationOf(turn), 1000.0 * turn};
    plant.command(command);
    for (std::size_t k = 0; k < first.size(); ++k)
      EXPECT_LT((beside()[k] - first[k]).norm(), 1e-11) << k;
  }
  // Or the one before was still flying.
  command.laboratory.E_H.v = Vec3(5.0, 0.0, 0.0);
  plant.command(command);
  command.laboratory.E_H = {};
  plant.command(command);
  for (std::size_t k = 0; k < 2; ++k) EXPECT_LT((beside()[k] - first[k]).norm(), 1e-7) << k;
}

TEST(Flight, ATripLeavesWhatFloatsWhereItWasBesideTheTool) {
  const Experiment e = test::experiment(
      "servicer_capture",
      {"controller.moving_frame.enabled=true", "base.free.velocity_m_per_s=[5, 0, 0]",
       "environment.target.velocity_m_per_s=[5, 0, 0]",
       "environment.target.turning_deg_per_s=[0, 0, 0]",
       "program=!replace [{move: {}}, {calibration: {}}, {admittance: {duration_s: 8}}]"});
  Lockstep loop(e.controller, e.plant);
  loop.step({Request::kStart, {}, {}});
  const auto clearance = [&] { return loop.plant().truth().clearance; };
  for (int i = 0; i < 400; ++i) loop.step();
  const double before = clearance();
  ASSERT_EQ(loop.state().kind, SegmentKind::kAdmittance);
  ASSERT_GT(before, 0.01);
  loop.disturb = [](Sample& s) { s.switches = 0; };
  for (int i = 0; i < 20; ++i) {
    loop.step();
    EXPECT_NEAR(clearance(), before, 1e-3) << i;
  }
  EXPECT_EQ(loop.state().phase, Phase::kStopped);
}

// Without a laboratory that flies the platform is at its limits soon, and noise pushes it along
// them, and a little beyond where braking would lead back.
TEST(Envelope, HoldsWhatDriftsAlongALimit) {
  for (const auto& [seed, period] : {std::pair(1, 13333333), std::pair(5, 10000000)}) {
    const RecordedRun run = recordLockstep(test::experiment(
        "satellite_tumbling",
        {"controller.moving_frame.enabled=false", "controller.compensation.inertia=false",
         "controller.compensation.observer=false", "controller.compensation.feed_forward=false",
         "controller.compensation.wrench=raw", fmt::format("seed={}", seed),
         fmt::format("controller.period_ns={}", period)}));
    EXPECT_TRUE(run.result.good()) << seed << ": " << name(run.result.cause);
    double least = 1.0;
    for (const Row& row : run.series.rows) least = std::min(least, row.state.envelope_scale);
    EXPECT_LT(least, 0.5);
  }
}

TEST(Flight, TheLaboratoryRestsWhereNothingIsEmulated) {
  const RecordedRun run = recordLockstep(test::experiment(
      "satellite_tumbling",
      {"program=!replace [{move: {}}, {calibration: {}}, {admittance: {duration_s: 3}}, {monitor: "
       "{duration_s: 2, interval_s: 1}}, {admittance: {duration_s: 3}}]"}));
  ASSERT_TRUE(run.result.good());
  const state_t* before = nullptr;
  bool flown = false;
  double shown = 0.0;  // [m] without a robot that moves
  for (const Row& row : run.series.rows) {
    const state_t& s = row.state;
    if (inAdmittance(s)) {
      flown = true;
      shown = std::max(shown, Vec6::Map(s.x).head<3>().norm());
      EXPECT_GT(Vec3::Map(s.laboratory_w).norm(), 0.3);
    } else {
      EXPECT_EQ(Vec3::Map(s.laboratory_v).norm() + Vec3::Map(s.laboratory_w).norm(), 0.0);
      if (before && !inAdmittance(*before)) {
        EXPECT_EQ(Vec3::Map(s.laboratory_p), Vec3::Map(before->laboratory_p));
      }
    }
    before = &s;
  }
  EXPECT_TRUE(flown);
  EXPECT_LT(shown, 5e-4);
  EXPECT_GT(Vec3::Map(before->laboratory_p).norm(), 5.0);  // it is not taken back
}

TEST(Flight, TicksThatComeLateShowNoLeap) {
  // At 50 m/s a tick that is 3 ms late, or missed, is a way of decimetres; the laboratory flies it
  // too.
  const Experiment e =
      test::experiment("satellite_tumbling", {"base.free.velocity_m_per_s=[50, 0, 0]"});
  Lockstep loop(e.controller, e.plant);
  const TickState* state = &loop.step({Request::kStart, {}, {}});
  double most = 0.0;
  int emulated = 0;
  for (int i = 0; i < 1500 && !test::done(*state); ++i) {
    if (state->kind == SegmentKind::kAdmittance && i % 97 == 0) loop.advance(1);
    state = &loop.step();
    if (state->kind != SegmentKind::kAdmittance) continue;
    ++emulated;
    most = std::max(most, state->motion.x.head<3>().norm());
    EXPECT_EQ(state->envelope_scale, 1.0) << i;
  }
  EXPECT_GT(emulated, 1000);
  EXPECT_LT(most, 0.03);  // [m] what the robot's motion shows
}

TEST(Flight, APushOnWhatFloatsIsInTheLaboratory) {
  const Experiment e = test::experiment(
      "servicer_capture",
      {"controller.moving_frame.enabled=true", "base.free.rate_deg_per_s=[0, 0, 20]",
       "program=!replace [{move: {}}, {calibration: {}}, {admittance: {duration_s: 8}}]"});
  Lockstep loop(e.controller, e.plant);
  loop.step({Request::kStart, {}, {}});
  for (int i = 0; i < 600; ++i) loop.step();
  const Mat3 R_EI = loop.state().command.laboratory.E_H.X.R;
  ASSERT_GT(rotationVector(R_EI).norm(), 1.0);
  const Floating before = loop.plant().truth().target;
  constexpr double kForce = 10.0, kTime = 0.1, kOff = 0.2;  // [N], [s], [m]
  // Somewhat off the centre, along the force: it does not turn.
  const Vec3 at = kOff * (before.q.conjugate() * R_EI.col(0));
  ASSERT_TRUE(
      loop.plant().moveRobot(Push{Push::On::kTarget, -1, at, kForce * Vec3::UnitX(), kTime}));
  for (int i = 0; i < 20; ++i) loop.step();
  const Target& target = *e.plant.task.world->environment.target;
  const Floating& after = loop.plant().truth().target;
  const double dv = kForce * kTime / target.mass;
  EXPECT_LT((after.v - before.v - dv * R_EI.col(0)).norm(), 0.05 * dv);
  EXPECT_LT((after.w - before.w).norm(), 0.1 * kOff * kForce * kTime / target.I_Bcm_B(0, 0));
}

TEST(Flight, WhatIsFeltIsKnownAfterACalibration) {
  const std::string steady = "controller.moving_frame.steady_in_contact=true",
                    program = "program=!replace [{move: {}}, {admittance: {duration_s: 5}}]";
  EXPECT_NO_THROW(test::experiment("satellite_tumbling", {steady}));
  EXPECT_NO_THROW(test::experiment("satellite_tumbling", {program}));
  EXPECT_THROW(test::experiment("satellite_tumbling", {steady, program}), InputError);
}

TEST(Flight, KeepsSteadyWhileSomethingIsFelt) {
  const RecordedRun run = recordLockstep(
      test::experiment("servicer_capture",
                       {"controller.moving_frame.enabled=true",
                        "controller.moving_frame.steady_in_contact=true", "sensor.noise=false"}));
  ASSERT_TRUE(run.result.good());
  int felt = 0, followed = 0;
  const state_t* before = nullptr;
  for (const Row& row : run.series.rows) {
    const state_t& s = row.state;
    if (!inAdmittance(s)) continue;
    // The vehicle at rest does not coast anywhere: what the laboratory does then is to follow.
    const double follows = Vec3::Map(s.laboratory_a).norm();
    if (before && !s.withholds) {
      ++felt;
      EXPECT_LT(follows, 1e-3);
    } else if (follows > 1e-3) {
      ++followed;
    }
    before = &s;
  }
  EXPECT_GT(felt, 100);
  EXPECT_GT(followed, 100);
}

}  // namespace
}  // namespace ves
