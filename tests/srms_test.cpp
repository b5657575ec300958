// SPDX-License-Identifier: BSD-3-Clause
//
// The beam model against closed forms.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "support/rig.hpp"
#include "ves/config/base.hpp"

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
  EXPECT_EQ(modes.stiffness.head(6), VectorXd::Zero(6));  // free, not on weak springs
  EXPECT_GT(std::sqrt(modes.stiffness(6)) / (2 * M_PI), 0.1);

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
  const ModalModel all = armModes(arm, 0.02).tip;
  EXPECT_EQ(all.stiffness.size(), 132);
  const Mat6 C = all.Phi * all.stiffness.cwiseInverse().asDiagonal() * all.Phi.transpose();
  const Mat6 expected = tipCompliance(arm);
  EXPECT_LT((C - expected).cwiseAbs().maxCoeff(), 1e-7 * expected.cwiseAbs().maxCoeff());
}

TEST(Srms, TurningTheShoulderTurnsNothingElse) {
  const std::string file = test::configDir() + "/bases/srms_capture.yaml";
  const ModalModel a = linearised(loadBase(file, {"keep_modes=20"}).vehicle);
  const ModalModel b =
      linearised(loadBase(file, {"keep_modes=20", "arm.pose_deg.shoulder_yaw=75"}).vehicle);
  EXPECT_LT((a.stiffness.cwiseQuotient(b.stiffness).array() - 1.0).abs().maxCoeff(), 1e-6);
  EXPECT_LT((a.Phi - b.Phi).cwiseAbs().maxCoeff(), 1e-5);  // the tip's own axes turn along
}

TEST(Srms, StiffnessScalesEveryFrequencyAlike) {
  const std::string file = test::configDir() + "/bases/srms_unberth.yaml";
  const ModalModel one = linearised(loadBase(file, {}).vehicle);
  const ModalModel half = linearised(loadBase(file, {"arm.stiffness_scale=0.5"}).vehicle);
  EXPECT_LT((half.stiffness.cwiseQuotient(one.stiffness).array() - 0.5).abs().maxCoeff(), 1e-6);
}

TEST(Srms, PayloadOfTheModelIsThePayloadPutOnByHand) {
  const std::string file = test::configDir() + "/bases/srms_capture.yaml";
  const ModalModel bare = linearised(loadBase(file, {"keep_modes=132"}).vehicle);
  const ModalModel loaded = linearised(
      loadBase(file, {"keep_modes=132",
                      "arm.payload={mass_kg: 150, center_m: [0.1, -0.2, 0.6], inertia_kg_m2: [20, "
                      "25, 15, 1, -2, 0.5]}"})
          .vehicle);
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

}  // namespace
}  // namespace ves
