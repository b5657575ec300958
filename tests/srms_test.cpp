// SPDX-License-Identifier: BSD-3-Clause
//
// The beam model against closed forms, and chapter 3 against conservation laws.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <unsupported/Eigen/MatrixFunctions>

#include "support/momentum.hpp"
#include "support/rig.hpp"
#include "ves/config/base.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

const BeamSection kTube{5.5e6, 2.1e6, 1.0e8, 4.0, 0.16};

BeamModel::Point straightBeam(BeamModel& model, const Vec3& to, int elements,
                              BeamModel::Point from = BeamModel::ground(Vec3::Zero())) {
  const Vec3 start = from.p;
  for (int i = 1; i <= elements; ++i) {
    const BeamModel::Point next = model.node(start + to * i / elements);
    model.beam(from, next, kTube);
    from = next;
  }
  return from;
}

/// A root of f in [lo, hi].
template <class F>
double root(F f, double lo, double hi) {
  const bool up = f(lo) < 0.0;
  for (int i = 0; i < 100; ++i) {
    const double mid = 0.5 * (lo + hi);
    ((f(mid) < 0.0) == up ? lo : hi) = mid;
  }
  return lo;
}

// --- Beam model ----------------------------------------------------------------------------------

TEST(BeamModel, CantileverHasTheFrequenciesOfTheClosedForms) {
  const Vec3 along = Vec3(3.0, -4.0, 12.0);  // 13 m, askew
  const double L = along.norm(), m = kTube.mass_per_length;
  BeamModel model;
  straightBeam(model, along, 30);
  const VectorXd omega = eigenmodes(model.M(), model.K()).stiffness.cwiseSqrt();

  std::vector<double> expected;
  const auto bending = [](double x) { return std::cos(x) * std::cosh(x) + 1.0; };
  for (const auto& [lo, hi] : {std::pair{1.5, 2.5}, {4.0, 5.5}, {7.0, 8.5}, {10.5, 11.5}}) {
    const double beta = root(bending, lo, hi) / L;
    for (int plane = 0; plane < 2; ++plane)
      expected.push_back(beta * beta * std::sqrt(kTube.EI / m));
  }
  for (int n = 1; n <= 2; ++n) {
    expected.push_back((2 * n - 1) * M_PI / (2 * L) * std::sqrt(kTube.EA / m));
    expected.push_back((2 * n - 1) * M_PI / (2 * L) *
                       std::sqrt(kTube.GJ / (m * kTube.radius * kTube.radius)));
  }
  // Linear shape functions in stretch and twist err by (k h)^2/24: 1.03e-3 for the second of each.
  for (double w : expected)
    EXPECT_LT((omega.array() / w - 1.0).abs().minCoeff(), 1.1e-3) << w / (2 * M_PI) << " Hz";
  std::sort(expected.begin(), expected.end());
  EXPECT_NEAR(omega(0) / expected[0], 1.0, 1e-6);
  EXPECT_NEAR(omega(1) / expected[1], 1.0, 1e-6);
}

TEST(BeamModel, CantileverYieldsAtItsTipAsTheClosedFormsSay) {
  const double L = 13.0;
  ArmDescription arm;
  arm.chain = {ArmBeam{{L, 0, 0}, kTube, 5}};
  const Mat6 C = tipCompliance(assemble(arm));
  Mat6 expected = Mat6::Zero();
  expected.diagonal() << L / kTube.EA, L * L * L / (3 * kTube.EI), L * L * L / (3 * kTube.EI),
      L / kTube.GJ, L / kTube.EI, L / kTube.EI;
  expected(1, 5) = expected(5, 1) = L * L / (2 * kTube.EI);
  expected(2, 4) = expected(4, 2) = -L * L / (2 * kTube.EI);
  EXPECT_LT((C - expected).cwiseAbs().maxCoeff(), 1e-10 * expected.cwiseAbs().maxCoeff());
}

TEST(BeamModel, HingeAddsItsOwnComplianceAndNothingElse) {
  const double L = 13.0, k = 2e5;
  ArmDescription stiff, hinged;
  stiff.chain = {ArmBeam{{L, 0, 0}, kTube, 4}};
  hinged.chain = {ArmJoint{"", Vec3::UnitZ(), 0.0, k}, stiff.chain[0]};
  Mat6 expected = tipCompliance(assemble(stiff));
  expected(1, 1) += L * L / k;
  expected(1, 5) += L / k;
  expected(5, 1) += L / k;
  expected(5, 5) += 1 / k;
  const Mat6 C = tipCompliance(assemble(hinged));
  EXPECT_LT((C - expected).cwiseAbs().maxCoeff(), 1e-9 * expected.cwiseAbs().maxCoeff());
}

TEST(BeamModel, FreeFrameHasSixRigidModesAndTheMassOfItsParts) {
  BeamModel model;
  const BeamModel::Point start = model.node({0.5, 0.2, -0.1});
  const BeamModel::Point corner = straightBeam(model, {4, 0, 0}, 4, start);
  const RigidBody housing{30.0, {0.1, -0.2, 0.05}, Vec3(1, 2, 1.5).asDiagonal()};
  model.lump(corner, housing);
  const BeamModel::Point end = straightBeam(model, {0, 3, 1}, 3, corner);
  const Eigenmodes modes = eigenmodes(model.M(), model.K());
  EXPECT_LT(std::sqrt(modes.stiffness(5)), 1e-3 * std::sqrt(modes.stiffness(6)));
  EXPECT_LT(std::sqrt(modes.stiffness(5)) / (2 * M_PI), 1e-2);

  // Rigid displacement of every node about the origin: M must weigh it as rods and housing do.
  MatrixXd rigid = MatrixXd::Zero(model.dofs(), 6);
  const auto fill = [&](const BeamModel::Point& p) {
    for (const auto& share : p.shares) {
      Eigen::Matrix<double, 6, 6> D = Mat6::Identity();
      D.topRightCorner<3, 3>() = -skew(p.p);
      rigid.row(share.dof) = share.displacement.transpose() * D;
    }
  };
  fill(start);
  for (int i = 1; i <= 4; ++i) {
    BeamModel::Point p = start;
    p.p += Vec3(i, 0, 0);
    for (auto& s : p.shares) s.dof += 6 * i;
    fill(p);
  }
  for (int i = 1; i <= 3; ++i) {
    BeamModel::Point p = corner;
    p.p += Vec3(0, 3, 1) * i / 3.0;
    for (auto& s : p.shares) s.dof += 6 * i;
    fill(p);
  }
  EXPECT_LT((model.K() * rigid).cwiseAbs().maxCoeff(), 1e-6 * model.K().cwiseAbs().maxCoeff());
  const auto rod = [](const Vec3& from, const Vec3& to) {  // slender, closed form
    const Vec3 d = to - from;
    const double m = kTube.mass_per_length * d.norm();
    RigidBody b{m, 0.5 * (from + to),
                m / 12.0 * (d.squaredNorm() * Mat3::Identity() - d * d.transpose())};
    b.I_Bcm_B += m * kTube.radius * kTube.radius * d * d.transpose() / d.squaredNorm();
    return b;
  };
  RigidBody moved = housing;
  moved.p_BoBcm_B += corner.p;
  const Mat6 expected =
      spatialMass(rod(start.p, corner.p)) + spatialMass(rod(corner.p, end.p)) + spatialMass(moved);
  const Mat6 M = rigid.transpose() * model.M() * rigid;
  EXPECT_LT((M - expected).cwiseAbs().maxCoeff(), 1e-10 * expected.cwiseAbs().maxCoeff());
}

TEST(BeamModel, AllModesTogetherAreTheStaticCompliance) {
  const ArmModel arm = *loadBase(test::configDir() + "/bases/srms_deploy.yaml", {}).arm;
  const ModalModel all = tipModes(arm, 0.02);
  EXPECT_EQ(all.stiffness.size(), 132);
  const Mat6 C = all.Phi * all.stiffness.cwiseInverse().asDiagonal() * all.Phi.transpose();
  const Mat6 expected = tipCompliance(arm);
  EXPECT_LT((C - expected).cwiseAbs().maxCoeff(), 1e-7 * expected.cwiseAbs().maxCoeff());
}

TEST(Srms, TurningTheShoulderTurnsNothingElse) {
  const std::string file = test::configDir() + "/bases/srms_capture.yaml";
  const ModalModel a = loadBase(file, {"keep_modes=20"}).modes;
  const ModalModel b = loadBase(file, {"keep_modes=20", "arm.pose_deg.shoulder_yaw=75"}).modes;
  EXPECT_LT((a.stiffness.cwiseQuotient(b.stiffness).array() - 1.0).abs().maxCoeff(), 1e-6);
  EXPECT_LT((a.Phi - b.Phi).cwiseAbs().maxCoeff(), 1e-5);  // the tip's own axes turn along
}

TEST(Srms, StiffnessScalesEveryFrequencyAlike) {
  const std::string file = test::configDir() + "/bases/srms_unberth.yaml";
  const ModalModel one = loadBase(file, {}).modes;
  const ModalModel half = loadBase(file, {"arm.stiffness_scale=0.5"}).modes;
  EXPECT_LT((half.stiffness.cwiseQuotient(one.stiffness).array() - 0.5).abs().maxCoeff(), 1e-6);
}

TEST(Srms, PayloadOfTheModelIsThePayloadPutOnByHand) {
  const std::string file = test::configDir() + "/bases/srms_capture.yaml";
  const ModalModel bare = loadBase(file, {"keep_modes=132"}).modes;
  const ModalModel loaded =
      loadBase(file, {"keep_modes=132",
                      "arm.payload={mass_kg: 150, center_m: [0.1, -0.2, 0.6], inertia_kg_m2: [20, "
                      "25, 15, 1, -2, 0.5]}"})
          .modes;
  RigidBody payload{150, {0.1, -0.2, 0.6}, Mat3::Zero()};
  payload.I_Bcm_B << 20, 1, -2, 1, 25, 0.5, -2, 0.5, 15;
  // In the modes of the bare arm: (3.11) without rates.
  const Eigenmodes by_hand =
      eigenmodes(augmentedModalMass(bare, payload), MatrixXd(bare.stiffness.asDiagonal()));
  for (int i = 0; i < 20; ++i)
    EXPECT_NEAR(by_hand.stiffness(i) / loaded.stiffness(i), 1.0, 1e-5) << i;
}

TEST(Srms, StraightArmIsNearWhatWasPublished) {
  // The heavy payload's size is a guess, its mass the one that the stiffnesses were fitted with.
  const PublishedArm published = loadPublished(test::configDir() + "/arms/straight_arm.yaml");
  const PublishedFrequencies& heavy = published.rows.at(1);
  const Vec6 ours = masslessFrequencies(published.arm, heavy.payload_P);
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(ours(i) / heavy.frequency(i), 1.0, 0.15) << i;
  EXPECT_NEAR(ours(5) / heavy.frequency(5), 1.0, 0.35);
}

// --- Chapter 3 -----------------------------------------------------------------------------------

Interaction interaction(const std::string& scenario, const std::vector<std::string>& set = {}) {
  std::int64_t duration = 0;
  return interactionOf(test::experiment(scenario, set), duration);
}

RigidBody lockedInP(const Interaction& i, const JointVector& q) {
  return combine(RigidBody{}, i.payload.X_PL0(), compositeBody(carried(i.payload), q));
}

TEST(Interaction, AugmentedMassIsTheModalMassOfBaseAndRobot) {  // (3.11)
  const Interaction i = interaction("srms_deploy_puma", {"base.keep_modes=8"});
  const RigidBody robot = lockedInP(i, i.q0);
  const MatrixXd expected =
      MatrixXd::Identity(8, 8) + i.base.Phi.transpose() * spatialMass(robot) * i.base.Phi;
  EXPECT_LT((augmentedModalMass(i.base, robot) - expected).cwiseAbs().maxCoeff(), 1e-12);
}

/// Kinetic energy of base and rigid robot, and what the base's springs hold.
double energy(const Interaction& i, const InteractionPoint& p, const RigidBody& robot_P,
              const Mat3& R_IP) {
  const Vec6 twist = i.base.Phi * p.eta_dot;
  const Mat6 M = spatialMass(rotated(R_IP, robot_P));
  return 0.5 *
         (p.eta_dot.squaredNorm() + i.base.stiffness.dot(p.eta.cwiseAbs2()) + twist.dot(M * twist));
}

/// Undamped and let go from a large deflection: 0.1 rad, 0.2 m.
Interaction letGo(InteractionOptions& options) {
  Interaction i = interaction("srms_unberth_doss", {"base.keep_modes=6"});
  i.base.damping.setZero();
  i.moves.clear();
  options.duration = 10'000'000'000;
  options.tolerance = 1e-11;
  options.eta = VectorXd::Zero(6);
  options.eta << 1.5, -1.0, 2.0, 1.0, 0.5, 0.4;
  return i;
}

TEST(Interaction, WholeModelConservesEnergyWhenTheRobotStandsStill) {
  InteractionOptions options;
  const Interaction i = letGo(options);
  options.model = InteractionModel::kWhole;
  const std::vector<InteractionPoint> points = simulate(i, options);
  const RigidBody robot = lockedInP(i, i.q0);
  const double at_start = energy(i, points[0], robot, points[0].R_IP);
  double most = 0.0, turned_most = 0.0;
  for (const InteractionPoint& p : points) {
    most = std::max(most, std::abs(energy(i, p, robot, p.R_IP) - at_start));
    turned_most = std::max(turned_most, p.x.tail<3>().norm());
  }
  EXPECT_GT(turned_most, 0.1);
  EXPECT_LT(most, 1e-8 * at_start);
}

TEST(Interaction, SplitGainsTheWorkOfItsCentripetalTermAndNoMore) {
  // (3.11) keeps the robot's axes and its centripetal force but not how A turns with the base:
  // energy changes by the work of that force on the translation, and by nothing else.
  InteractionOptions options;
  const Interaction i = letGo(options);
  options.step = 1'000'000;
  const std::vector<InteractionPoint> points = simulate(i, options);
  const RigidBody robot = lockedInP(i, i.q0);
  const auto power = [&](const InteractionPoint& p) {
    const Vec6 twist = i.base.Phi * p.eta_dot;
    const Vec3 w = twist.tail<3>();
    return robot.mass * twist.head<3>().dot(w.cross(robot.p_BoBcm_B.cross(w)));
  };
  const double at_start = energy(i, points[0], robot, Mat3::Identity());
  double work = 0.0, most_work = 0.0;
  for (std::size_t k = 2; k < points.size(); k += 2) {  // Simpson
    work += 1e-3 / 3.0 * (power(points[k - 2]) + 4.0 * power(points[k - 1]) + power(points[k]));
    most_work = std::max(most_work, std::abs(work));
    ASSERT_NEAR(energy(i, points[k], robot, Mat3::Identity()), at_start + work, 1e-8 * at_start);
  }
  EXPECT_GT(most_work, 1e-5 * at_start);  // there is something to account for
}

TEST(Interaction, SmallMotionIsTheMatrixExponential) {
  InteractionOptions options;
  Interaction i = letGo(options);
  options.eta *= 1e-6;
  i.base.damping = (0.04 * i.base.stiffness.cwiseSqrt()).asDiagonal();
  const std::vector<InteractionPoint> points = simulate(i, options);
  const MatrixXd A = augmentedModalMass(i.base, lockedInP(i, i.q0));
  MatrixXd S = MatrixXd::Zero(12, 12);
  S.topRightCorner(6, 6).setIdentity();
  S.bottomLeftCorner(6, 6) = -A.inverse() * MatrixXd(i.base.stiffness.asDiagonal());
  S.bottomRightCorner(6, 6) = -A.inverse() * i.base.damping;
  for (const std::size_t k : {1u, 100u, 500u, 1000u}) {
    VectorXd start = VectorXd::Zero(12);
    start.head(6) = options.eta;
    const VectorXd expected = ((S * points[k].t).exp() * start).head(6);
    EXPECT_LT((points[k].eta - expected).norm(), 1e-6 * options.eta.norm()) << points[k].t;
  }
}

TEST(Interaction, MomentumOfAFreeBaseAndItsRobotStaysZero) {
  // A free rigid base of 300 kg: the robot's swing must turn and push it exactly against itself.
  Interaction i = interaction("srms_unberth_doss");
  i.base.Phi = MatrixXd::Zero(6, 6);
  const double mass = 300.0;
  const Vec3 inertia(40.0, 60.0, 50.0);
  i.base.Phi.diagonal() << Vec3::Constant(1.0 / std::sqrt(mass)),
      inertia.cwiseSqrt().cwiseInverse();
  i.base.stiffness = VectorXd::Zero(6);
  i.base.damping = MatrixXd::Zero(6, 6);
  i.moves = {{0, {2, -0.3, 2.0}}, {500'000'000, {0, 0.8, 2.0}}};
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.step = 1'000'000;
  options.duration = 2'600'000'000;
  options.tolerance = 1e-12;
  const std::vector<InteractionPoint> points = simulate(i, options);

  const RobotModel robot = carried(i.payload);
  JointPaths joints(robot.joints, i.q0);
  joints.move(i.moves[0].move, 0);
  JointPaths later = joints;
  later.move(i.moves[1].move, i.moves[1].start);
  const auto index = [](double t) { return static_cast<std::size_t>(std::lround(t * 1e3)); };
  const auto X_IL0 = [&](double t) {
    const InteractionPoint& p = points[index(t)];
    return Transform{p.R_IP, p.x.head<3>()} * i.payload.X_PL0();
  };
  const auto q = [&](double t) {
    const auto ns = std::llround(t * 1e9);
    return (ns < i.moves[1].start ? joints : later).at(ns).q;
  };
  double most_linear = 0.0, most_angular = 0.0;
  for (double t = 0.1; t < 2.5; t += 0.1) {
    const InteractionPoint& p = points[index(t)];
    const Vec6 twist = i.base.Phi * p.eta_dot;
    const Vec3 P_base = mass * twist.head<3>();
    const Vec3 H_base = inertia.cwiseProduct(twist.tail<3>()) + p.x.head<3>().cross(P_base);
    const Vec6 of_robot = test::momentum(robot, X_IL0, q, t, 1e-3);
    most_linear = std::max(most_linear, P_base.norm());
    most_angular = std::max(most_angular, H_base.norm());
    EXPECT_LT((of_robot.head<3>() + P_base).norm(), 1e-5) << t;
    EXPECT_LT((of_robot.tail<3>() + H_base).norm(), 1e-5) << t;
  }
  EXPECT_GT(most_linear, 1.0);
  EXPECT_GT(most_angular, 1.0);
}

TEST(Interaction, SplitIsWrongByTheOrderOfTheBasesMobility) {
  // A base a hundred times as heavy and stiff moves a hundredth as far; what the split leaves out
  // is a product of that motion with the robot's, so relative to the motion it is a hundredth too.
  const auto error = [](double heavier) {
    Interaction i = interaction("srms_capture_doss", {"base.keep_modes=4"});
    i.base.Phi /= std::sqrt(heavier);
    InteractionOptions options;
    options.tolerance = 1e-12;
    const std::vector<InteractionPoint> split = simulate(i, options);
    options.model = InteractionModel::kWhole;
    const std::vector<InteractionPoint> whole = simulate(i, options);
    double most = 0.0, apart = 0.0;
    for (std::size_t k = 0; k < split.size(); ++k) {
      most = std::max(most, whole[k].x.norm());
      apart = std::max(apart, (split[k].x - whole[k].x).norm());
    }
    return apart / most;
  };
  const double light = error(1.0), heavy = error(100.0);
  EXPECT_LT(light, 0.01);
  EXPECT_GT(light / heavy, 30.0);
  EXPECT_LT(light / heavy, 300.0);
}

TEST(Interaction, KeepingTheMassForNStepsErrsInProportionToN) {  // the report's shortcut
  const Interaction i = interaction("srms_capture_doss");
  const auto run = [&](int hold) {
    InteractionOptions options;
    options.hold_mass = hold;
    options.duration = 8'000'000'000;
    return simulate(i, options);
  };
  const std::vector<InteractionPoint> exact = run(0);
  const auto error = [&](int hold) {
    const std::vector<InteractionPoint> kept = run(hold);
    double apart = 0.0;
    for (std::size_t k = 0; k < kept.size(); ++k)
      apart = std::max(apart, (kept[k].x - exact[k].x).norm());
    return apart;
  };
  const double one = error(1), ten = error(10);
  EXPECT_GT(one, 0.0);
  EXPECT_NEAR(ten / one, 10.0, 3.0);
}

TEST(Interaction, SaysWhenTheToleranceCannotBeKept) {
  Interaction i = interaction("srms_unberth_doss");
  i.base.stiffness.setConstant(NAN);
  EXPECT_THROW(simulate(i, {}), std::domain_error);
}

}  // namespace
}  // namespace ves
