// SPDX-License-Identifier: BSD-3-Clause
//
// What the loop model says of contacts: beside closed forms, and beside machines that run.
#include <gtest/gtest.h>

#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/analysis/gate.hpp"
#include "ves/analysis/leaning.hpp"
#include "ves/math/dense.hpp"
#include "ves/planning/tool_planner.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {
namespace {

constexpr double kMass = 100.0, kStiffness = 1e4;  // [kg], [N/m]

/// A free mass, on a servo that is quick, with a sensor that is: what is late is known.
struct QuickLoop {
  Loop loop;
  double delay;  // [s] of a slow motion, from the force to the platform
};
QuickLoop quick(double period, const Eigen::MatrixXd& directions = Vec6(Vec6::Unit(0))) {
  QuickLoop out;
  Loop& l = out.loop;
  l.base.Phi = directions / std::sqrt(kMass);
  l.base.stiffness = Eigen::VectorXd::Zero(directions.cols());
  l.base.damping = Eigen::MatrixXd::Zero(directions.cols(), directions.cols());
  l.period = period;
  l.velocity_gain = 100.0;
  l.tau = 1e-4;
  l.sensor_cutoff = 2.0 * M_PI * 400.0;
  l.readings = 1;
  Leaning contact;
  contact.direction = Vec6::Unit(0);
  contact.stiffness = kStiffness;
  l.contact = contact;
  // Sensor, and the servo, of type one. The command is the state a period on and is held for it;
  // the force is held in the model for as long: no delay. Between two updates, and from reading to
  // update, a leg goes on, so that it lags less.
  const double update = 1.023e-3, reading = 0.341e-3;
  out.delay = M_SQRT2 / l.sensor_cutoff + 1.0 / l.velocity_gain - 0.5 * (update + reading);
  return out;
}

// m x'' = -k x(t - tau) - c x'(t - tau) grows by (k tau - c) / 2m, to first order.
TEST(LeaningLoop, GrowsByItsDelayAndDecaysByItsDamper) {
  for (const double period : {0.001, 0.002}) {
    QuickLoop q = quick(period);
    const double omega = std::sqrt(kStiffness / kMass);
    ASSERT_LT(omega * q.delay, 0.3);
    const DominantRoot undamped = dominantRoot(q.loop);
    EXPECT_NEAR(undamped.growth, 0.5 * kStiffness * q.delay / kMass, 0.05 * undamped.growth);
    EXPECT_NEAR(undamped.frequency, omega / (2.0 * M_PI), 0.05 * omega / (2.0 * M_PI));
    // The critical damper is c = k tau. It feels the speed at the ticks, which a held command makes
    // a little less than the mean.
    for (const double share : {0.5, 0.8, 1.25}) {
      q.loop.contact->damping = share * kStiffness * q.delay;
      EXPECT_NEAR(dominantRoot(q.loop).growth, (1.0 - share) * undamped.growth,
                  0.12 * undamped.growth)
          << period << " " << share;
      EXPECT_EQ(growsLeaning(q.loop), share < 1.0) << period << " " << share;
    }
  }
}

// A hybrid contact: k, c measured and late, k_v, c_v virtual and prompt, as in the base itself.
// On the limit m s^2 + c_v s + k_v + (c s + k) e^(-s tau) has a root j w: closed form (Zebenay et
// al., arXiv:1309.3512).
TEST(LeaningLoop, HasTheClosedFormsCriticalDelay) {
  const double k = kStiffness, c = 60.0, k_v = 5e3, c_v = 40.0, m = kMass;
  // |k_v - m w^2 + j c_v w|^2 = k^2 + c^2 w^2
  const double a = m * m, b = c_v * c_v - c * c - 2.0 * k_v * m, d = k_v * k_v - k * k;
  const double w = std::sqrt((-b + std::sqrt(b * b - 4.0 * a * d)) / (2.0 * a));
  const std::complex<double> own(k_v - m * w * w, c_v * w), late(k, c * w);
  const double tau = std::arg(-late / own) / w;
  ASSERT_GT(tau, 0.002);
  // The servo is slowed until the loop stands on the limit.
  const auto grows = [&](double lag) {
    QuickLoop q = quick(0.002);
    q.delay += lag - 1.0 / q.loop.velocity_gain;
    q.loop.velocity_gain = 1.0 / lag;
    q.loop.base.stiffness.setConstant(k_v / m);
    q.loop.base.damping.setConstant(c_v / m);
    q.loop.contact->damping = c;
    return std::pair(growsLeaning(q.loop), q.delay);
  };
  double low = 2e-3, high = 0.05;
  for (int i = 0; i < 30; ++i) {
    const double middle = 0.5 * (low + high);
    (grows(middle).first ? high : low) = middle;
  }
  EXPECT_NEAR(grows(low).second, tau, 0.05 * tau);
}

// What is leant on counts by its mass: two masses on a spring.
TEST(LeaningLoop, TurnsAtTheReducedMass) {
  QuickLoop q = quick(0.002);
  q.loop.contact->inverse_mass = 1.0 / 50.0;
  const double mu = 1.0 / (1.0 / kMass + 1.0 / 50.0);
  EXPECT_NEAR(meetingMass(q.loop), mu, 1e-9);
  const DominantRoot root = dominantRoot(q.loop);
  const double omega = std::sqrt(kStiffness / mu);
  EXPECT_NEAR(2.0 * M_PI * root.frequency, omega, 0.07 * omega);
  // Only the platform's share of the relief is late.
  EXPECT_NEAR(root.growth, 0.5 * kStiffness * q.delay / kMass, 0.12 * root.growth);
}

// Any direction: the channels are turned until the first lies along it.
TEST(LeaningLoop, DoesNotDependOnTheAxes) {
  QuickLoop q = quick(0.004, Mat6::Identity());
  const double along_x = dominantRoot(q.loop).growth;
  q.loop.contact->direction = (Vec6() << 0.6, 0.0, -0.8, 0.0, 0.0, 0.0).finished();
  EXPECT_NEAR(dominantRoot(q.loop).growth, along_x, 1e-5);
  q.loop.contact->direction = -Vec6::Unit(1);
  EXPECT_NEAR(dominantRoot(q.loop).growth, along_x, 1e-5);
}

TEST(Impact, OfAPromptLoopIsThatOfFreeSpace) {
  QuickLoop q = quick(0.002);
  q.loop.velocity_gain = 400.0;
  q.loop.contact->inverse_mass = 1.0 / 200.0;
  q.loop.contact->stiffness = 200.0;  // slow beside all that is late
  const Impact one = impact(q.loop, 0.05);
  const double mu = meetingMass(q.loop), omega = std::sqrt(200.0 / mu);
  EXPECT_NEAR(one.free_space, 1.0, 1e-3);
  EXPECT_NEAR(one.peak_free_space, 0.05 * std::sqrt(200.0 * mu), 1e-3 * one.peak_free_space);
  EXPECT_NEAR(one.duration_free_space, M_PI / omega, 1e-3 * one.duration_free_space);
  EXPECT_NEAR(one.restitution, 1.0, 0.03);
  EXPECT_NEAR(one.peak, one.peak_free_space, 0.02 * one.peak);
  EXPECT_LT(std::abs(one.energy_error), 0.05);
}

// A wall of any mass that comes: e = exp(pi omega tau / 2).
TEST(Impact, GivesBackWhatTheDelaySays) {
  for (const double period : {0.002, 0.004}) {
    QuickLoop q = quick(period);
    q.loop.contact->stiffness = 2e3;
    const double omega = std::sqrt(2e3 / kMass), e = std::exp(0.5 * M_PI * omega * q.delay);
    const Impact one = impact(q.loop, 0.02);
    EXPECT_NEAR(one.free_space, 1.0, 3e-3);
    EXPECT_NEAR(one.restitution, e, 0.02 * e);
    EXPECT_NEAR(one.energy_error, e * e - 1.0, 0.1 * (e * e - 1.0));
    // A damper takes of the speed what it takes in free space.
    q.loop.contact->damping = 2.0 * 0.1 * std::sqrt(2e3 * kMass);
    const Impact damped = impact(q.loop, 0.02);
    EXPECT_NEAR(damped.free_space, std::exp(-M_PI * 0.1 / std::sqrt(1.0 - 0.01)), 0.06);
    EXPECT_LT(damped.restitution, 0.85 * one.restitution);
  }
}

/// The PUMA on a base of 500 kg afloat, a ball that drifts against its tool.
Experiment meeting(double mass, double stiffness, const std::vector<std::string>& more = {}) {
  std::vector<std::string> set = {
      "gravity_m_per_s2=0",
      "sensor.noise=false",
      "initial_pose={}",
      "base.damping_diagonal=[0, 0, 0, 0, 0, 0]",
      "base.stiffness_diagonal=[0, 0, 0, 0, 0, 0]",
      "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 1.6}}]",
      fmt::format("environment={{tool: [{{radius_m: 0.02}}], contact: {{stiffness: {}}}, target: "
                  "{{mass_kg: {}, from_tool_m: [0.324, 0, 0], velocity_m_per_s: [-0.05, 0, 0], "
                  "ball: {{radius_m: 0.3}}}}}}",
                  stiffness, mass)};
  set.insert(set.end(), more.begin(), more.end());
  return test::experiment("puma_on_table_4_1", set);
}
const std::vector<std::string> kCompensated = {
    "controller.compensation.feed_forward=true", "controller.compensation.observer=true",
    "controller.compensation.inertia=true", "sensor.readings_per_tick=4"};

// The loop model foretells how the ball leaves a machine with counts, servos and a robot on it.
TEST(ExpectedContacts, ReboundAsTheMachineDoes) {
  for (const bool compensated : {false, true})
    for (const double k : {2e3, 3e4}) {
      const Experiment e =
          meeting(100.0, k, compensated ? kCompensated : std::vector<std::string>());
      const std::vector<ExpectedContact> all = expectedContacts(e.controller, e.plant.task);
      ASSERT_EQ(all.size(), 1U);
      EXPECT_EQ(all[0].name, "target");
      EXPECT_NEAR(all[0].speed, 0.05, 1e-12);
      const Loop loop = leaning(loopOf(e.controller, all[0].q, Direction::kSwinging), all[0], k);
      const Impact foretold = impact(loop, all[0].speed);
      Lockstep machine(e.controller, e.plant);
      machine.step({Request::kStart, {}, {}});
      while (machine.plant().truth().contacts.last().separation == 0.0 &&
             !test::done(machine.state()))
        machine.step();
      const Contact& met = machine.plant().truth().contacts.last();
      EXPECT_NEAR(met.restitution(), foretold.restitution, 0.05) << compensated << " " << k;
      EXPECT_NEAR(met.peak, foretold.peak, 0.03 * met.peak) << compensated << " " << k;
      EXPECT_NEAR(met.duration, foretold.duration, 0.03 * met.duration) << compensated << " " << k;
    }
}

TEST(ExpectedContacts, AreFoundWhereTheRobotGoes) {
  const auto e = [](const std::string& program) {
    return test::experiment(
        "puma_on_table_4_1",
        {"gravity_m_per_s2=0", "initial_pose={}", program,
         "environment={tool: [{radius_m: 0.02}], contact: {stiffness: 2000, damping_s_per_m: 40}, "
         "bodies: [{from_tool_m: [0.1, 0, 0], rpy_deg: [0, -90, 0], half_space: {}}, "
         "{from_tool_m: [0, 5, 0], box: {size_m: [1, 1, 1]}}]}"});
  };
  const std::string leads =
      "program=[{{move: {{}}}}, {{{}: {{{}duration_s: 4}}, robot: [{{at_s: 1, joint: "
      "joint_2, to_deg_or_m: -80, duration_s: 2}}]}}, {{admittance: "
      "{{duration_s: 1}}}}]";
  const Experiment there = e(fmt::format(fmt::runtime(leads), "admittance", ""));
  const std::vector<ExpectedContact> all = expectedContacts(there.controller, there.plant.task);
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].name, "bodies[0]");
  EXPECT_GT(all[0].speed, 0.02);
  EXPECT_EQ(all[0].leaning.inverse_mass, 0.0);
  EXPECT_EQ(all[0].leaning.stiffness, 2000.0);
  EXPECT_LT((all[0].leaning.direction.head<3>() + Vec3::UnitX()).norm(), 1e-9);
  // The damper has the law's restitution at that speed.
  const Loop loop =
      leaning(loopOf(there.controller, all[0].q, Direction::kSwinging), all[0], 2000.0);
  const double zeta = loop.contact->damping / (2.0 * std::sqrt(2000.0 * meetingMass(loop)));
  EXPECT_NEAR(std::exp(-M_PI * zeta / std::sqrt(1.0 - zeta * zeta)),
              restitution(there.plant.task.world->environment.law, all[0].speed), 1e-9);
  // Without admittance control nothing answers.
  const Experiment elsewhere = test::experiment("puma_on_table_4_1");
  EXPECT_TRUE(expectedContacts(elsewhere.controller, elsewhere.plant.task).empty());
}

// A feeler away from the tool's origin also moves because the tool turns.
TEST(ExpectedContacts, CloseAsFastAsTheFeelerMoves) {
  const UrdfRobot puma = test::robot("puma560");
  const NamedFrame& tip = puma.frames.back();
  const ToolPlanner planner(puma.model, tip.link, tip.X_link, puma.fastest, puma.joint_names, 0.01);
  for (const Vec3& at : {Vec3(0.0, 0.0, 0.2), Vec3(0.0, 0.0, -0.2), Vec3(0.2, 0.0, 0.0)}) {
    const Experiment standing = test::experiment("puma_on_table_4_1");
    const JointVector from = standing.plant.task.initial_joints;
    const Mat3 R_PL0 = standing.controller.payload.X_PL0().R;
    const double ahead = (R_PL0 * planner.pose(from).R * at).x();  // of the tool's origin
    const Experiment e = test::experiment(
        "puma_on_table_4_1",
        {"gravity_m_per_s2=0", "initial_pose={}",
         "program=[{move: {}}, {admittance: {duration_s: 4}, robot: [{at_s: 1, joint: joint_2, "
         "to_deg_or_m: -80, duration_s: 2}]}]",
         fmt::format("environment={{tool: [{{at_m: [{}, {}, {}], radius_m: 0.4}}], contact: "
                     "{{stiffness: 2000}}, bodies: [{{from_tool_m: [{}, 0, 0], rpy_deg: [0, -90, "
                     "0], half_space: {{}}}}]}}",
                     at.x(), at.y(), at.z(), ahead + 0.401)});
    const auto x = [&](double t) {
      const double s = std::clamp((t - 1.0) / 2.0, 0.0, 1.0);
      JointVector q = from;
      q(1) += (-80.0 * kDegree - from(1)) * s * s * s * (10.0 - 15.0 * s + 6.0 * s * s);
      return (R_PL0 * (planner.pose(q) * at)).x();
    };
    double fastest = 0.0;
    for (double t = 1.0; t < 3.0; t += 1e-3)
      fastest = std::max(fastest, (x(t + 1e-4) - x(t - 1e-4)) / 2e-4);
    const std::vector<ExpectedContact> all = expectedContacts(e.controller, e.plant.task);
    ASSERT_EQ(all.size(), 1U);
    EXPECT_NEAR(all[0].speed, fastest, 5e-3 * fastest) << at.transpose();
  }
}

// From the surface of the tool's ball on.
TEST(ExpectedContacts, AreWithinReachOfTheToolsSurface) {
  const auto found = [](double radius, double away) {
    const Experiment e = test::experiment(
        "puma_on_table_4_1",
        {"gravity_m_per_s2=0", "initial_pose={}",
         "program=[{move: {}}, {admittance: {duration_s: 1}}]",
         fmt::format(
             "environment={{tool: [{{radius_m: {}}}], contact: {{stiffness: 2000}}, bodies: "
             "[{{from_tool_m: [{}, 0, 0], rpy_deg: [0, -90, 0], half_space: {{}}}}]}}",
             radius, away)});
    return !expectedContacts(e.controller, e.plant.task).empty();
  };
  EXPECT_TRUE(found(0.0, 0.04));
  EXPECT_FALSE(found(0.0, 0.15));
  EXPECT_TRUE(found(0.11, 0.15));
  EXPECT_FALSE(found(0.11, 0.26));
}

// A target that is far off may come near, and one that is near may be on its way from there.
TEST(ExpectedContacts, FollowATargetOnItsWay) {
  const auto found = [](double away, double speed) {
    const Experiment e =
        meeting(100.0, 2e3,
                {"program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 3}}]",
                 fmt::format("environment.target.from_tool_m=[{}, 0, 0]", away),
                 fmt::format("environment.target.velocity_m_per_s=[{}, 0, 0]", speed)});
    return expectedContacts(e.controller, e.plant.task);
  };
  const std::vector<ExpectedContact> comes = found(0.45, -0.06);  // touches after 2.2 s
  ASSERT_EQ(comes.size(), 1U);
  EXPECT_NEAR(comes[0].speed, 0.06, 1e-12);
  EXPECT_TRUE(found(0.45, 0.06).empty());
  EXPECT_TRUE(found(0.45, -0.02).empty());
}

// A grip holds the target at its centre, where the plant has it then.
TEST(ExpectedContacts, HoldTheTargetWhereThePlantDoes) {
  const Experiment e = test::experiment("contact_capture_puma");
  const std::vector<ExpectedContact> all = expectedContacts(e.controller, e.plant.task);
  Lockstep machine(e.controller, e.plant);
  machine.step({Request::kStart, {}, {}});
  while (!machine.plant().truth().target.X_TB && !test::done(machine.state())) machine.step();
  ASSERT_TRUE(machine.plant().truth().target.X_TB);
  const Vec3 lever =
      machine.plant().truth().target.p - e.controller.geometry.fromHome({}).p;  // [m] from Po
  int grips = 0;
  for (const ExpectedContact& one : all) {
    if (one.name.rfind("grip ", 0) != 0) continue;
    ++grips;
    const Vec3 n = one.leaning.direction.head<3>();
    if (n.isZero(0.0)) {
      EXPECT_EQ(one.leaning.direction.tail<3>().norm(), 1.0) << one.name;
      continue;
    }
    EXPECT_LT((one.leaning.direction.tail<3>() - lever.cross(n)).norm(), 0.03) << one.name;
    EXPECT_NEAR(one.leaning.inverse_mass, 1.0 / 100.0, 1e-12);
  }
  EXPECT_EQ(grips, 6);
}

// Undamped, published, stiff: leaning on it grows. Refused by name; compensated and soft it passes.
TEST(ContactGate, RefusesWhatWouldGrow) {
  const auto verdict = [](double k, std::vector<std::string> set) {
    set.insert(set.end(), {"controller.stability=unknown", "base.from=../bases/table_4_1.yaml"});
    Experiment e = test::unassessed(
        "puma_on_table_4_1",
        {"gravity_m_per_s2=0", "initial_pose={}",
         "program=[{move: {}}, {calibration: {}}, {admittance: {duration_s: 1.6}}]",
         fmt::format(
             "environment={{tool: [{{radius_m: 0.02}}], contact: {{stiffness: {}}}, target: "
             "{{mass_kg: 100, from_tool_m: [0.324, 0, 0], velocity_m_per_s: [-0.05, 0, 0], "
             "ball: {{radius_m: 0.3}}}}}}",
             k)});
    for (const std::string& one : set)
      if (one.rfind("controller.c", 0) == 0 || one.rfind("sensor", 0) == 0 ||
          one.rfind("controller.p", 0) == 0)
        applyOverride(e.source.document, one);
    Experiment again = buildExperiment(e.source.document);
    return applyStabilityCheck(again.controller, again.plant.task);
  };
  const std::string grows = verdict(3e4, {});
  EXPECT_NE(grows.find("contact with target, 3e+04 N/m"), std::string::npos) << grows;
  EXPECT_NE(grows.find("leaning on it grows"), std::string::npos) << grows;
  EXPECT_EQ(verdict(2e3, kCompensated), "");
  EXPECT_NE(verdict(3e5, kCompensated), "");
  // What it gives is taken back.
  EXPECT_EQ(verdict(3e4, {"controller.passivity.enabled=true"}), "");
}

TEST(ContactGate, SaysHowStiffItMayBe) {
  const Experiment e = meeting(100.0, 2e3, kCompensated);
  const std::vector<ContactVerdict> all = assessContacts(e.controller, e.plant.task);
  ASSERT_EQ(all.size(), 1U);
  const ContactVerdict& v = all[0];
  EXPECT_FALSE(v.grows);
  EXPECT_LT(std::abs(v.impact.energy_error), kMostEnergyError);
  ASSERT_GT(v.limits.energy, 1e4);
  ASSERT_LT(v.limits.energy, 1e6);
  // On both sides of the limit, by the same loop at its worst.
  const auto error = [&](double k) {
    double most = 0.0;
    for (const Direction d : {Direction::kExtending, Direction::kRetracting})
      most = std::max(most,
                      std::abs(impact(leaning(loopOf(e.controller, v.contact.q, d), v.contact, k),
                                      v.contact.speed)
                                   .energy_error));
    return most;
  };
  EXPECT_LE(error(v.limits.energy), kMostEnergyError);
  EXPECT_GT(error(1.2 * v.limits.energy), kMostEnergyError);
}

}  // namespace
}  // namespace ves
