// SPDX-License-Identifier: BSD-3-Clause
//
// A vehicle that nothing holds, in the admittance model and in free space (chapter 3), against
// closed forms and conservation laws.
#include <gsl/gsl_integration.h>
#include <gsl/gsl_sf_elljac.h>
#include <gtest/gtest.h>

#include <random>

#include "support/momentum.hpp"
#include "support/orbit.hpp"
#include "support/rig.hpp"
#include "ves/evaluation/summary.hpp"
#include "ves/kinematics/stewart.hpp"
#include "ves/math/dense.hpp"
#include "ves/robot/momentum.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {
namespace {

using Eigen::VectorXd;

constexpr double kTick = 0.01;  // [s]

/// A body whose principal axes are those of P.
FreeBodyModel asymmetric(const Vec3& center) {
  FreeBodyModel out;
  out.body_P = {80.0, center, Vec3(10.0, 20.0, 25.0).asDiagonal()};
  return out;
}

/// What lies on the vehicle at attitudes before and after a step.
CarriedBody carriedFrom(const Mat3& R_before, const Mat3& R_IP, const RigidBody& before_P,
                        const RigidBody& body_P) {
  CarriedBody out(spatialMass(rotated(R_before, before_P)), spatialMass(rotated(R_IP, body_P)));
  out.R_IP_before = R_before;
  out.R_IP = R_IP;
  return out;
}

/// Euler's free top, L^2 > 2 E I_2: w_1 = a_1 cn, w_2 = a_2 sn, w_3 = a_3 dn of u = rate t.
struct Top {
  Vec3 I, a;
  double rate, m, L;

  /// With w_2 = 0 at first.
  Top(const Vec3& inertia, double w_1, double w_3) : I(inertia) {
    const double E2 = I.x() * w_1 * w_1 + I.z() * w_3 * w_3;
    L = std::hypot(I.x() * w_1, I.z() * w_3);
    const double L2 = L * L;
    a = {w_1, std::sqrt((E2 * I.z() - L2) / (I.y() * (I.z() - I.y()))), w_3};
    rate = std::sqrt((I.z() - I.y()) * (L2 - E2 * I.x()) / (I.x() * I.y() * I.z()));
    m = (I.y() - I.x()) * (E2 * I.z() - L2) / ((I.z() - I.y()) * (L2 - E2 * I.x()));
  }
  Vec3 w(double t) const {  // about the body's axes
    double sn, cn, dn;
    gsl_sf_elljac_e(rate * t, m, &sn, &cn, &dn);
    return {a.x() * cn, a.y() * sn, a.z() * dn};
  }
  /// [rad] that the body's third axis has gone round the momentum.
  double precession(double t) const {
    gsl_function f;
    f.params = const_cast<Top*>(this);
    f.function = [](double s, void* self) {
      const Top& top = *static_cast<const Top*>(self);
      const Vec3 w = top.w(s), h = top.I.cwiseProduct(w);
      return top.L * (h.x() * w.x() + h.y() * w.y()) / (h.x() * h.x() + h.y() * h.y());
    };
    gsl_integration_workspace* space = gsl_integration_workspace_alloc(4000);
    double sum = 0.0, error = 0.0;
    gsl_integration_qag(&f, 0.0, t, 1e-13, 1e-13, 4000, GSL_INTEG_GAUSS61, space, &sum, &error);
    gsl_integration_workspace_free(space);
    return sum;
  }
};

/// The body's attitude in axes whose third is the momentum; its third axis at an azimuth of zero.
Mat3 attitudeFrom(const Vec3& momentum_B) {
  const Vec3 z = momentum_B.normalized();                   // in B
  const Vec3 x = (Vec3::UnitZ() - z.z() * z).normalized();  // where the third axis leans
  Mat3 R;
  R << x.transpose(), z.cross(x).transpose(), z.transpose();
  return R;
}

TEST(FreeBody, TurnsAsEulersTopDoes) {
  for (const Vec3& center : {Vec3(0, 0, 0), Vec3(0.3, -0.2, -0.6)}) {
    FreeBodyModel model = asymmetric(center);
    const Top top(model.body_P.I_Bcm_B.diagonal(), 0.30, 0.45);
    model.w_IP_I = top.w(0.0);
    model.v_IPo_I = -model.w_IP_I.cross(center);  // the centre of mass rests
    FreeBody body(model, kTick);
    body.reset(Vec6::Zero());
    const Mat3 R_HB = attitudeFrom(top.I.cwiseProduct(top.w(0.0)));  // H: momentum's axes
    for (int n = 1; n <= 10'000; ++n) {
      body.step(Wrench{});
      if (n % 500 != 0) continue;
      const double t = n * kTick;
      const RigidState& s = body.state();
      EXPECT_LT((s.R_IP.transpose() * s.w - top.w(t)).norm(), 1e-9) << t;
      const Mat3 should = R_HB.transpose() * rotationOf(Vec3(0, 0, top.precession(t))) *
                          attitudeFrom(top.I.cwiseProduct(top.w(t)));
      EXPECT_LT((s.R_IP - should).norm(), 1e-9) << t;
      EXPECT_LT((s.p + s.R_IP * center - center).norm(), 1e-9) << t;
    }
  }
}

TEST(FreeBody, GoesAsTheEquationsOfMotionSayUnderAHeldWrench) {
  FreeBodyModel model = asymmetric({0.1, 0.2, -0.5});
  model.w_IP_I = {0.2, -0.1, 0.3};
  FreeBody body(model, kTick);
  Vec6 x;
  x << 0.1, -0.2, 0.05, 0.2, -0.3, 0.4;
  body.reset(x);
  const Wrench F{{8.0, -5.0, 3.0}, {1.0, 2.0, -4.0}};
  std::vector<RigidState> s;
  for (int n = 0; n < 200; ++n) {
    s.push_back(body.state());
    body.step(F);
  }
  const RigidBody& b = model.body_P;
  const auto at = [&](double t) { return s[static_cast<std::size_t>(std::lround(t / kTick))]; };
  const auto linear = [&](double t) -> Vec3 {
    return b.mass * (at(t).v + at(t).w.cross(at(t).R_IP * b.p_BoBcm_B));
  };
  const auto angular = [&](double t) -> Vec3 {  // about home
    const Vec3 c = at(t).R_IP * b.p_BoBcm_B;
    return at(t).R_IP * (b.I_Bcm_B * (at(t).R_IP.transpose() * at(t).w)) +
           (at(t).p + c).cross(linear(t));
  };
  const auto place = [&](double t) -> Vec3 { return at(t).p; };
  const auto attitude = [&](double t) -> Mat3 { return at(t).R_IP; };
  for (double t = 0.1; t < 1.8; t += 0.1) {
    EXPECT_LT((test::derivative(linear, t, kTick) - F.f).norm(), 1e-8);
    EXPECT_LT((test::derivative(angular, t, kTick) - F.n - at(t).p.cross(F.f)).norm(), 1e-7);
    EXPECT_LT((test::derivative(place, t, kTick) - at(t).v).norm(), 1e-8);
    EXPECT_LT((test::derivative(attitude, t, kTick) - skew(at(t).w) * at(t).R_IP).norm(), 1e-8);
  }
}

TEST(FreeBody, TellsItsAccelerationAndWhatComes) {
  FreeBodyModel model = asymmetric({0.1, 0.2, -0.5});
  model.w_IP_I = {0.2, -0.1, 0.3};
  model.v_IPo_I = {0.01, 0.02, -0.03};
  const RigidBody other{50.0, {0.1, 0.0, 0.6}, Vec3(8.0, 8.0, 2.0).asDiagonal()};
  const Wrench F{{8.0, -5.0, 3.0}, {1.0, 2.0, -4.0}};
  FreeBody ahead(model, kTick), later(model, kTick);
  std::vector<PathPoint<6>> of_ahead, of_later;
  for (FreeBody* body : {&ahead, &later}) body->reset(Vec6::Constant(0.1));
  for (int n = 0; n < 12; ++n) {
    const auto turns = [&](const FreeBody& on, double dt) {
      return carriedFrom(on.state().R_IP, rotationOf(dt * on.state().w) * on.state().R_IP, other,
                         other);
    };
    ahead.step(F, turns(ahead, kTick), kTick, kTick);
    later.step(F, turns(later, kTick), kTick, 0.0);
    of_ahead.push_back(ahead.motion());
    of_later.push_back(later.motion());
  }
  for (std::size_t n = 0; n + 1 < of_later.size(); ++n) {
    EXPECT_LT((of_ahead[n].x - of_later[n + 1].x).norm(), 1e-6);
    EXPECT_LT((of_ahead[n].x_dot - of_later[n + 1].x_dot).norm(), 1e-4);
  }
  const auto x = [&](double t) -> Vec6 {
    return of_later[static_cast<std::size_t>(std::lround(t / kTick))].x;
  };
  const auto x_dot = [&](double t) -> Vec6 {
    return of_later[static_cast<std::size_t>(std::lround(t / kTick))].x_dot;
  };
  EXPECT_LT((test::derivative(x, 5 * kTick, kTick) - of_later[5].x_dot).norm(), 2e-6);
  EXPECT_LT((test::derivative(x_dot, 5 * kTick, kTick) - of_later[5].x_ddot).norm(), 2e-5);
}

TEST(FreeBody, IsItsModesForSmallMotions) {
  // Of one size and of a tenth: the difference is one of second order.
  const FreeBodyModel model = asymmetric({0.1, 0.2, -0.5});
  const auto apart = [&](double size) {
    FreeBody body(model, kTick);
    ModalVehicle modes(linearised(model), kTick);
    body.reset(Vec6::Zero());
    modes.reset(Vec6::Zero());
    double most = 0.0;
    for (int n = 0; n < 200; ++n) {
      const Wrench F{size * Vec3(3.0, std::sin(0.1 * n), -2.0),
                     size * Vec3(1.0, 2.0, std::cos(0.07 * n))};
      body.step(F);
      modes.step(F);
      most = std::max(most, (body.motion().x - modes.motion().x).norm());
    }
    return most / size;
  };
  const double whole = apart(1.0), tenth = apart(0.1);
  EXPECT_GT(whole, 1e-4);
  EXPECT_NEAR(whole / tenth, 10.0, 1.0);
}

// The speed stays when the mass changes: what that costs is what the motion holds more.
TEST(FreeBody, AnotherMassCostsWhatItsMotionHoldsMore) {
  FreeBodyModel model = asymmetric({0.1, 0.2, -0.5});
  model.w_IP_I = {0.2, -0.1, 0.3};
  FreeBody body(model, kTick);
  body.reset(Vec6::Zero());
  for (int n = 0; n < 50; ++n) body.step({{8.0, -5.0, 3.0}, {1.0, 2.0, -4.0}});
  double before = body.kineticEnergy();
  EXPECT_GT(before, 1.0);
  for (const double mass : {1.5, 0.4, 3.0}) {
    const double cost = body.costOf({mass, 1.0, 1.0});
    body.become({mass, 1.0, 1.0});
    EXPECT_NEAR(body.kineticEnergy() - before, cost, 1e-12);
    before = body.kineticEnergy();
  }
}

// A force that was withheld moves what runs beside the vehicle as it would have moved the vehicle,
// turned as it is and with the robot on it.
TEST(FreeBody, WhatRunsBesideItHasTheMassOfAll) {
  const FreeBodyModel model = asymmetric({0.1, 0.2, -0.5});
  const Mat6 M_1 = spatialMass({50.0, {0.1, 0.0, 0.6}, Vec3(8.0, 8.0, 2.0).asDiagonal()});
  FreeBody body(model, kTick);
  Vec6 x;
  x << 0.1, -0.2, 0.05, 0.2, -0.3, 0.4;
  body.reset(x);
  const ModalDynamics& beside = body.dynamics();
  const Vec6 F = (Vec6() << 8.0, -5.0, 3.0, 1.0, 2.0, -4.0).finished();
  for (const double mass : {1.0, 2.0}) {
    body.become({mass, 1.0, 1.0});
    const ModalDynamics::Modes moved =
        beside.advance(body.body(M_1), kTick, beside.atRest(), beside.Phi().transpose() * F / mass);
    const Mat6 all = mass * spatialMass(rotated(body.state().R_IP, model.body_P)) + M_1;
    const Vec6 velocity = beside.Phi() * moved.eta_dot;
    EXPECT_LT((velocity - kTick * inverse(all) * F).norm(), 1e-12) << mass;
  }
}

TEST(FreeBody, KeepsItsBooks) {
  // What the wrench gives, less what damping takes, is in the motion of both bodies.
  const FreeBodyModel model = asymmetric({0.1, 0.2, -0.5});
  const RigidBody other{50.0, {0.1, 0.0, 0.6}, Vec3(8.0, 8.0, 2.0).asDiagonal()};
  FreeBody body(model, kTick);
  body.reset(Vec6::Zero(), spatialMass(other));
  const auto energyOf = [](const RigidBody& b, const RigidState& s) {
    const Mat6 M = spatialMass(rotated(s.R_IP, b));
    const Vec6 V = (Vec6() << s.v, s.w).finished();
    return 0.5 * V.dot(M * V);
  };
  double given = 0.0, paid = 0.0;
  for (int n = 0; n < 300; ++n) {
    const RigidState& s = body.state();
    const Wrench F{{9.0 * std::sin(0.02 * n), 6.0, -3.0}, {1.5, 3.0, 3.0 * std::cos(0.03 * n)}};
    body.step(F, carriedFrom(s.R_IP, rotationOf(kTick * s.w) * s.R_IP, other, other), kTick, 0.0,
              0.2);
    given += body.taken(F);
    paid += body.damped();
    EXPECT_NEAR(body.kineticEnergy(), energyOf(model.body_P, body.state()), 1e-12);
  }
  const double kept = energyOf(model.body_P, body.state()) + energyOf(other, body.state());
  EXPECT_GT(kept, 1.0);
  EXPECT_GT(paid, 0.3);
  EXPECT_NEAR(given - paid, kept, 2e-3 * given);
}

TEST(FreeBody, SlowedGoesAShareOfItsWayAndAsMuchSlower) {
  for (const double share : {0.0, 0.3, 1.0}) {
    FreeBodyModel model = asymmetric({0.1, 0.2, -0.5});
    model.v_IPo_I = {0.2, -0.1, 0.05};
    model.w_IP_I = {0.3, 0.5, -0.4};
    model.propulsion.size = 1;
    model.propulsion.thrusters[0].force_P = {5.0, 0.0, 0.0};
    FreeBody body(model, kTick);
    body.reset(Vec6::Constant(0.02));
    const Wrench F{{9.0, 6.0, -3.0}, {1.5, 3.0, -2.0}};
    for (int n = 0; n < 20; ++n) body.step(F);
    const BodyMotion from = body.bodyMotion();
    body.step(F);
    const BodyMotion to = body.bodyMotion();
    const double given = body.taken(F);
    body.slow(share);
    const BodyMotion& m = body.bodyMotion();
    EXPECT_LT((m.X.p - (from.X.p + share * (to.X.p - from.X.p))).norm(), 1e-15);
    const Vec3 turn = rotationVector(to.X.R * from.X.R.transpose());
    EXPECT_LT((m.X.R - rotationOf(share * turn) * from.X.R).norm(), 1e-14);
    EXPECT_EQ(m.v, Vec3(share * to.v));
    EXPECT_EQ(m.w, Vec3(share * to.w));
    EXPECT_LT((m.a - (m.v - from.v) / kTick).norm(), 1e-12);
    EXPECT_LT((m.alpha - (m.w - from.w) / kTick).norm(), 1e-12);
    EXPECT_EQ(body.state().p, m.X.p);
    EXPECT_EQ(body.state().v, m.v);
    EXPECT_EQ(body.state().w, m.w);
    EXPECT_LT((body.state().R_IP - m.X.R).norm(), 1e-15);
    EXPECT_NEAR(body.taken(F), share * given, 1e-15);
    // Its clock has waited as well.
    body.step(F);
    EXPECT_NEAR(body.thrust().time, (20.0 + share) * kTick, 1e-12);
  }
}

// --- In free space, with a robot on it -----------------------------------------------------------

/// A link of mass m at l from its joint, which is r from the body's centre of mass, all in a plane.
struct PlanarLink {
  double m0 = 90.0, m1 = 30.0, I0 = 12.0, I1 = 3.0, r = 0.4, l = 0.7;

  Interaction interaction(double q0) const {
    Interaction i;
    FreeBodyModel body;
    body.body_P = {m0, {-0.2, 0.1, -0.3}, Vec3::Constant(I0).asDiagonal()};
    i.vehicle = body;
    Link link;
    link.X_parent.p = body.body_P.p_BoBcm_B + Vec3(r, 0.0, 0.0);
    link.body = {m1, {l, 0.0, 0.0}, Vec3::Constant(I1).asDiagonal()};
    link.lower = -20.0;
    link.upper = 20.0;
    i.payload.robot.extend(link);
    i.q0(0) = q0;
    return i;
  }
  /// [rad] of the body, of the joint from 0 to phi.
  double turn(double phi) const {
    const double mu = m0 * m1 / (m0 + m1), A = I0 + I1 + mu * (r * r + l * l), B = 2.0 * mu * r * l,
                 C = I1 + mu * l * l - I0 - mu * r * r, root = std::sqrt(A * A - B * B);
    const double half = std::atan(std::sqrt((A - B) / (A + B)) * std::tan(0.5 * phi)) +
                        M_PI * std::round(0.5 * phi / M_PI);
    return -0.5 * phi - C / root * half;
  }
};

TEST(FreeSpace, APlanarLinkTurnsItsBodyAsMomentumSays) {
  const PlanarLink planar;
  for (const double to : {0.8, 2.5, 2.0 * M_PI, -1.7}) {
    Interaction i = planar.interaction(0.0);
    i.actions = {{500'000'000, RobotMove{0, to, 2.0}}};
    InteractionOptions options;
    options.duration = 4'000'000'000;
    options.tolerance = 1e-12;
    const std::vector<InteractionPoint> points = simulate(i, options);
    const double off = std::remainder(points.back().x(5) - planar.turn(to), 2.0 * M_PI);
    EXPECT_NEAR(off, 0.0, 1e-9) << to;
    // The common centre of mass stays.
    const auto center = [&](const InteractionPoint& p, double q) -> Vec3 {
      const Mat3 R = rotation(Vec3(p.x.tail<3>()));
      const Link& link = i.payload.robot.link(0);
      const RigidBody& body = std::get<FreeBodyModel>(i.vehicle.kind).body_P;
      const Vec3 of_link = link.X_parent.p + rotationOf(Vec3(0, 0, q)) * link.body.p_BoBcm_B;
      return p.x.head<3>() +
             R * (body.mass * body.p_BoBcm_B + link.body.mass * of_link) / (planar.m0 + planar.m1);
    };
    EXPECT_LT((center(points.back(), to) - center(points.front(), 0.0)).norm(), 1e-9) << to;
  }
}

TEST(FreeSpace, WhatFliesGoesStraightAndDoesNotTurn) {
  Interaction i = PlanarLink{}.interaction(0.7);
  std::get<FreeBodyModel>(i.vehicle.kind).v_IPo_I = {0.2, -0.1, 0.3};
  i.start << 1.0, -2.0, 0.5, 0.3, -0.2, 0.1;
  InteractionOptions options;
  options.duration = 100'000'000'000;
  options.step = 1'000'000'000;
  for (const InteractionPoint& p : simulate(i, options)) {
    Vec6 should = i.start;
    should.head<3>() += p.t * Vec3(0.2, -0.1, 0.3);
    EXPECT_LT((p.x - should).norm(), 1e-9) << p.t;
  }
}

TEST(FreeSpace, MomentumStaysForTenMinutesWhateverTheJointsDo) {
  Interaction i;
  {
    std::int64_t duration = 0;
    i = interactionOf(test::experiment("satellite_puma"), duration);
  }
  FreeBodyModel body = asymmetric({0.05, -0.1, -0.4});
  body.v_IPo_I = {1e-4, -2e-4, 1e-4};
  body.w_IP_I = {1e-4, 2e-4, -1e-4};
  i.vehicle = body;
  i.actions.clear();
  std::mt19937 random(3);
  std::uniform_real_distribution<double> change(-0.5, 0.5);
  const RobotModel robot = carried(i.payload);
  JointPaths joints(robot.joints, i.q0);
  std::vector<std::pair<std::int64_t, JointPaths>> paths = {{0, joints}};
  for (std::int64_t k = 0; k < 590; ++k) {
    const int joint = static_cast<int>(random() % 6);
    const std::int64_t start = 1'000'000'000 * k;
    const RobotMove move{joint, i.q0(joint) + change(random), 0.9};
    i.actions.push_back({start, move});
    joints.move(move, start);
    paths.push_back({start, joints});
  }
  InteractionOptions options;
  options.duration = 600'000'000'000;
  options.step = 100'000'000;
  const std::vector<InteractionPoint> points = simulate(i, options);
  // The common centre of mass, from poses alone, goes straight on; linear momentum from it.
  const auto center = [&](std::size_t n) -> Vec3 {
    const auto ns = static_cast<std::int64_t>(n) * options.step;
    auto path = paths.begin();
    while (path + 1 != paths.end() && (path + 1)->first <= ns) ++path;
    const JointVector q = path->second.at(ns).q;
    const Transform X{rotation(Vec3(points[n].x.tail<3>())), points[n].x.head<3>()};
    Vec3 sum = body.body_P.mass * (X * body.body_P.p_BoBcm_B);
    double mass = body.body_P.mass;
    const LinkPoses poses = linkPoses(robot, q);
    for (int k = -1; k < robot.size; ++k) {
      const Transform X_L0L = k < 0 ? Transform() : poses[k];
      const RigidBody& b = robot.bodyOf(k);
      sum += b.mass * (X * i.payload.X_PL0() * X_L0L * b.p_BoBcm_B);
      mass += b.mass;
    }
    return sum / mass;
  };
  const Vec3 first = center(0), last = center(6000), speed = (last - first) / 600.0;
  double turned = 0.0;
  for (std::size_t n = 0; n <= 6000; n += 100) {
    EXPECT_LT((center(n) - first - points[n].t * speed).norm(), 1e-9) << n;
    turned = std::max(turned, points[n].x.tail<3>().norm());
  }
  EXPECT_GT(turned, 0.05);
}

TEST(FreeBody, FollowsARobotThatSwingsOnIt) {
  // What the robot's joints lose of momentum between two ticks, and its inertia at both, lead the
  // model where the momentum of all leads it in free space.
  std::int64_t duration = 0;
  Interaction i = interactionOf(test::experiment("satellite_puma"), duration);
  i.actions.clear();
  const RobotModel robot = carried(i.payload);
  const Transform X_PL0 = i.payload.X_PL0();
  std::mt19937 random(11);
  std::uniform_real_distribution<double> change(-1.0, 1.0);
  JointPaths joints(robot.joints, i.q0);
  std::vector<JointState> q;
  for (std::int64_t k = 0; k < 48; ++k) {
    const RobotMove move{static_cast<int>(random() % 4), i.q0(0) + change(random), 2.0};
    const std::int64_t start = 2'400'000'000 * k;
    i.actions.push_back({start, move});
    joints.move(move, start);
    for (std::int64_t n = 0; n < 240; ++n) q.push_back(joints.at(start + 10'000'000 * n));
  }
  InteractionOptions options;
  options.duration = 115'000'000'000;
  options.model = InteractionModel::kWhole;
  const std::vector<InteractionPoint> truth = simulate(i, options);

  FreeBody body(std::get<FreeBodyModel>(i.vehicle.kind), kTick);
  body.reset(Vec6::Zero());
  const auto attitude = [&](std::size_t n) { return rotation(Vec3(truth[n].x.tail<3>())); };
  const auto locked = [&](std::size_t n) {
    return combine(RigidBody{}, X_PL0, compositeBody(robot, q[n].q));
  };
  const auto momentum = [&](std::size_t n) -> Vec6 {
    const Wrench of_L0 = Wrench::from(jointMomentum(robot, q[n].q, q[n].q_dot));
    return rotate(attitude(n), transfer(X_PL0, of_L0)).stacked();
  };
  double apart = 0.0, turned = 0.0, farthest = 0.0;
  for (std::size_t n = 0; n + 1 < truth.size(); ++n) {
    body.step(Wrench::from((momentum(n) - momentum(n + 1)) / kTick),
              carriedFrom(attitude(n), attitude(n + 1), locked(n), locked(n + 1)), kTick, 0.0);
    const Vec6 off = body.motion().x - truth[n + 1].x;
    farthest = std::max(farthest, off.head<3>().norm());
    apart = std::max(apart, off.tail<3>().norm());
    turned = std::max(turned, truth[n].x.tail<3>().norm());
  }
  EXPECT_GT(turned, 0.02);
  EXPECT_LT(apart, 2e-6);
  EXPECT_LT(farthest, 2e-6);
}

TEST(FreeSpace, WhatIsGraspedGoesAlongAndTurnsWithIt) {
  // A ball that drifts and tumbles, and a servicer with its arm: one body after the grip has come
  // to rest, with the momentum that the ball brought.
  std::int64_t duration = 0;
  const Experiment e = test::experiment("servicer_capture");
  Interaction i = interactionOf(e, duration);
  std::erase_if(i.actions, [](const TimedAction& one) {
    return !std::holds_alternative<GraspTarget>(one.action);
  });
  ASSERT_EQ(i.actions.size(), 1U);
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.duration = duration;
  options.tolerance = 1e-11;
  const std::vector<InteractionPoint> points = simulate(i, options);

  const RigidBody all_P = combine(std::get<FreeBodyModel>(i.vehicle.kind).body_P, Transform(),
                                  lockedRobot(i.payload, i.q0));
  const Target& target = *i.world->environment.target;
  const auto momentum = [&](const InteractionPoint& p) -> Vec6 {  // about the origin of I
    const BodyMotion P = bodyMotion(i.p_IH, Pose::from(p.x), p.x_dot, Vec6::Zero());
    const Vec6 of_Po = spatialMass(rotated(P.X.R, all_P)) * (Vec6() << P.v, P.w).finished();
    const Mat3 R_IB = p.target.q.toRotationMatrix();
    const Vec3 linear = target.mass * p.target.v,
               angular = R_IB * (target.I_Bcm_B * (R_IB.transpose() * p.target.w));
    Vec6 sum;
    sum << of_Po.head<3>() + linear,
        of_Po.tail<3>() + P.X.p.cross(Vec3(of_Po.head<3>())) + angular + p.target.p.cross(linear);
    return sum;
  };
  const Vec6 first = momentum(points.front());
  EXPECT_NEAR(first.head<3>().norm(), 100.0 * 0.02, 1e-12);
  for (std::size_t n = 0; n < points.size(); n += 10)
    EXPECT_LT((momentum(points[n]) - first).norm(), 1e-9) << points[n].t;
  const InteractionPoint& last = points.back();
  ASSERT_TRUE(last.target.X_TB);
  const BodyMotion P = bodyMotion(i.p_IH, Pose::from(last.x), last.x_dot, Vec6::Zero());
  EXPECT_LT((last.target.w - P.w).norm(), 1e-6);
  EXPECT_LT((last.target.v - P.v - P.w.cross(last.target.p - P.X.p)).norm(), 1e-6);
  EXPECT_GT(P.w.norm(), 1e-3);
}

// --- With thrusters ------------------------------------------------------------------------------

/// Both ways to a motion, without a robot: the model's steps and free space.
struct BothWays {
  std::vector<Vec6> model, truth;  // [m, rad] x, a point a tick

  BothWays(const FreeBodyModel& vehicle, double duration) {
    Interaction i;
    i.vehicle = vehicle;
    InteractionOptions options;
    options.duration = std::llround(duration * 1e9);
    options.tolerance = 1e-11;
    for (const InteractionPoint& p : simulate(i, options)) truth.push_back(p.x);
    FreeBody body(vehicle, kTick);
    body.reset(Vec6::Zero());
    model.push_back(body.motion().x);
    while (model.size() < truth.size()) {
      body.step(Wrench{});
      model.push_back(body.motion().x);
    }
  }
};

/// Of what is accelerated by `rate` from then until then, t after the start.
double way(double from, double until, double rate, double t) {
  const double on = std::clamp(t - from, 0.0, until - from);
  return rate * (0.5 * on * on + on * std::max(0.0, t - until));
}

TEST(Thrusters, PushAsLongAsTheyFire) {
  // Through the centre of mass, and a couple: half a tick more or less counts as that.
  FreeBodyModel vehicle = asymmetric({0.0, 0.0, -0.5});
  Propulsion& jets = vehicle.propulsion;
  jets.size = 3;
  jets.thrusters[0].p_PoT_P = {1.0, 0.0, -0.5};
  jets.thrusters[0].force_P = {4.0, 0.0, 0.0};
  jets.thrusters[0].firings[0] = {1.003, 2.5};
  jets.thrusters[0].size = 1;
  for (std::size_t k : {1u, 2u}) {
    const double side = k == 1 ? 1.0 : -1.0;
    jets.thrusters[k].p_PoT_P = {0.0, side * 0.6, -0.5};
    jets.thrusters[k].force_P = {-side * 0.5, 0.0, 0.0};  // n = 0.6 N m about z
    jets.thrusters[k].firings[0] = {4.0, 4.2};
    jets.thrusters[k].firings[1] = {5.0, 5.105};
    jets.thrusters[k].size = 2;
  }
  const BothWays both(vehicle, 10.0);
  for (const auto* x : {&both.model, &both.truth})
    for (std::size_t n = 0; n < x->size(); n += 7) {
      const double t = static_cast<double>(n) * kTick;
      // A mean over a tick: the impulse is exact, its moment to half a tick.
      const double slack = 1e-9 + 4.0 / 80.0 * kTick * kTick + 0.6 / 25.0 * kTick * kTick;
      EXPECT_NEAR((*x)[n](0), way(1.003, 2.5, 4.0 / 80.0, t), slack) << t;
      EXPECT_NEAR((*x)[n](5), way(4.0, 4.2, 0.6 / 25.0, t) + way(5.0, 5.105, 0.6 / 25.0, t), slack)
          << t;
    }
}

TEST(Thrusters, ADeadBandHasItsLimitCycle) {
  // Pulses of d_omega that turn +d_omega / 2 round at the band's edges: a period of 8 th / d_omega,
  // and of both pulses, and of what passes until a tick sees the edge, out and back, twice.
  for (int axis = 0; axis < 3; ++axis) {
    FreeBodyModel vehicle;
    vehicle.body_P = {80.0, Vec3::Zero(), Vec3(10.0, 20.0, 25.0).asDiagonal()};
    AttitudeHold& hold = vehicle.propulsion.hold;
    hold.dead_band = 0.02;
    hold.pulse = 0.03;
    const double step = 0.002;  // [rad/s]
    hold.torque_P = step / hold.pulse * vehicle.body_P.I_Bcm_B.diagonal();
    vehicle.w_IP_I(axis) = 0.5 * step;
    const BothWays both(vehicle, 500.0);
    for (const auto* x : {&both.model, &both.truth}) {
      std::vector<double> up;  // [s] where it comes through zero
      double most = 0.0;
      for (std::size_t n = 0; n + 1 < x->size(); ++n) {
        const double a = (*x)[n](3 + axis), b = (*x)[n + 1](3 + axis);
        most = std::max(most, std::abs(a));
        if (n > 0 && a < 0.0 && b >= 0.0)
          up.push_back(kTick * (static_cast<double>(n) + a / (a - b)));
      }
      ASSERT_GT(up.size(), 5U);
      const double period = (up.back() - up.front()) / static_cast<double>(up.size() - 1);
      const double least = 8.0 * hold.dead_band / step + 2.0 * hold.pulse;
      EXPECT_GT(period, least - 1e-6) << axis;
      EXPECT_LT(period, least + 4.0 * kTick + 1e-6) << axis;
      EXPECT_NEAR(most, hold.dead_band, 1e-3 * hold.dead_band) << axis;
    }
  }
}

TEST(Thrusters, APulseBeginsBeyondTheBandAndLastsAsLongAsItIs) {
  Propulsion jets;
  jets.hold.dead_band = 0.02;
  jets.hold.pulse = 0.025;
  jets.hold.torque_P = {3.0, 4.0, 5.0};
  const Vec3 beyond(0.03, 0.0, -0.03);
  EXPECT_TRUE(
      pulsesOf(jets.hold, {}, beyond, Vec3(-1e-3, 0.0, 1e-3)).left.isZero(0.0));  // it returns
  Pulses pulses = pulsesOf(jets.hold, {}, beyond, Vec3::Zero());                  // it stands there
  EXPECT_EQ(pulses.left, Vec3(0.025, 0.0, 0.025));
  for (const double share : {1.0, 1.0, 0.5, 0.0}) {  // of a tick
    const Vec3 n = firings(jets, pulses, {}, 0.0, 0.01).mean.n;
    EXPECT_LT((n - share * Vec3(-3.0, 0.0, 5.0)).norm(), 1e-9) << share;
    pulses = spent(pulses, 0.01);
  }
}

TEST(ReactionWheels, TurnABodyThatTumbles) {
  // About its axis of symmetry a body keeps momentum and wheel's together, here none, so that the
  // axis goes round the rest as if there were no wheel: R = Rx(w t) Rz(what the wheel has turned).
  FreeBodyModel vehicle;
  vehicle.body_P = {80.0, Vec3::Zero(), Vec3(10.0, 10.0, 25.0).asDiagonal()};
  vehicle.w_IP_I = {0.3, 0.0, 0.0};
  ReactionWheel& wheel = vehicle.propulsion.wheels[0];
  vehicle.propulsion.wheel_count = 1;
  wheel.torques[0] = {{1.0, 3.0}, 5.0};
  wheel.torques[1] = {{6.0, 7.0}, -10.0};
  wheel.size = 2;
  const BothWays both(vehicle, 20.0);
  for (const auto* x : {&both.model, &both.truth})
    for (std::size_t n = 0; n < x->size(); n += 7) {
      const double t = static_cast<double>(n) * kTick,
                   phi = way(1.0, 3.0, 0.2, t) + way(6.0, 7.0, -0.4, t);
      const Mat3 R = rotationOf(Vec3(0.3 * t, 0.0, 0.0)) * rotationOf(Vec3(0.0, 0.0, phi));
      EXPECT_LT((rotation(Vec3((*x)[n].tail<3>())) - R).norm(), 1e-8) << t;
    }
  EXPECT_NEAR(wheel.momentum(10.0), 0.0, 1e-12);
  // What the wheel puts in and takes is all that changes the body's energy.
  FreeBody body(vehicle, kTick);
  body.reset(Vec6::Zero());
  const double first = body.energy();
  const Vec6 momentum = body.momentum();  // of body and wheel
  double put_in = 0.0, most = 0.0;
  std::vector<BodyMotion> motions;
  for (int n = 0; n < 800; ++n) {
    body.step(Wrench{});
    put_in += body.shaken();
    most = std::max(most, put_in);
    EXPECT_NEAR(body.energy() - first, put_in, 1e-3 * most + 1e-12);
    EXPECT_LT((body.momentum() - momentum).norm(), 1e-8) << n;
    motions.push_back(body.bodyMotion());
  }
  for (std::size_t n = 110; n < 290; ++n)  // while the first torque lasts
    EXPECT_LT((motions[n].alpha - (motions[n + 1].w - motions[n - 1].w) / (2.0 * kTick)).norm(),
              1e-5);
  EXPECT_NEAR(most, 0.5 * 25.0 * 0.4 * 0.4, 1e-3);
}

TEST(ReactionWheels, TurnAVehicleUnderARobotAsTheTruthDoes) {
  // PUMA on half a ton, moving while wheels about two axes give and take; centre of mass elsewhere.
  const RecordedRun run = recordLockstep(test::experiment(
      "satellite_puma",
      {"sensor.noise=false",
       "base.free.wheels=[{axis: [0, 0, 1], most_nms: 20, torques_s_nm: [[1, 4.5, 0.8], [8, 11, "
       "-1.2]]}, {axis: [1, 1, 0], most_nms: 20, torques_s_nm: [[2.005, 5, 0.4]]}]"}));
  ASSERT_TRUE(run.result.good());
  const auto summary = summarise(run.series, run.result);
  const auto of = [&](const char* key) { return summary[key].get<double>(); };
  EXPECT_GT(of("emulation_travel_rad"), 0.1);
  EXPECT_LT(of("emulation_error_rms_rad"), 2e-3 * of("emulation_travel_rad"));
  EXPECT_LT(of("emulation_error_rms_m"), 2e-3 * of("emulation_travel_m"));
}

// --- In an orbit ---------------------------------------------------------------------------------

TEST(Orbit, WhatFloatsMovesAsClohessyAndWiltshireHaveIt) {
  // A quarter of a low orbit, and most of one whose rate is a hundred times that; the attitude does
  // not matter to the centre of mass.
  for (const double n : {0.0011, 0.11}) {
    FreeBodyModel vehicle = asymmetric({0.0, 0.0, 0.0});
    vehicle.orbit.rate = n;
    vehicle.v_IPo_I = {0.02, -0.03, 0.01};
    vehicle.w_IP_I = {0.01, 0.02, -0.01};
    const BothWays both(vehicle, n < 0.01 ? 1400.0 : 50.0);
    for (const auto* x : {&both.model, &both.truth})
      for (std::size_t k = 0; k < x->size(); k += 50) {
        const double t = static_cast<double>(k) * kTick;
        const Vec3 should = test::inOrbit(n, Vec3::Zero(), vehicle.v_IPo_I, t);
        EXPECT_LT(((*x)[k].head<3>() - should).norm(), 1e-9 * (1.0 + should.norm())) << t;
      }
  }
}

TEST(Orbit, ABodySwingsAboutTheEarthsDirection) {
  // Small pitch: I_z th'' = -3 n^2 (I_y - I_x) th, in axes that go round.
  FreeBodyModel vehicle;
  vehicle.body_P = {80.0, Vec3::Zero(), Vec3(10.0, 22.0, 25.0).asDiagonal()};
  const double n = vehicle.orbit.rate = 0.1, first = 1e-5,
               rate = n * std::sqrt(3.0 * (22.0 - 10.0) / 25.0);
  vehicle.w_IP_I.z() = first;
  const BothWays both(vehicle, 100.0);
  for (const auto* x : {&both.model, &both.truth})
    for (std::size_t k = 0; k < x->size(); k += 10) {
      const double t = static_cast<double>(k) * kTick;
      const Vec3 th = (*x)[k].tail<3>();
      EXPECT_LT((th - Vec3(0.0, 0.0, first / rate * std::sin(rate * t))).norm(), 1e-10) << t;
    }
}

TEST(Orbit, ASatelliteUnderARobotGoesAsTheTruthDoes) {
  // The robot's joints have momentum while the axes turn. A hundred low orbits' rate shows it.
  const RecordedRun run = recordLockstep(test::experiment(
      "satellite_puma", {"sensor.noise=false", "base.free.orbital_rate_deg_per_s=1"}));
  ASSERT_TRUE(run.result.good());
  const auto summary = summarise(run.series, run.result);
  const auto of = [&](const char* key) { return summary[key].get<double>(); };
  EXPECT_LT(of("emulation_error_rms_rad"), 2e-3 * of("emulation_travel_rad"));
  EXPECT_LT(of("emulation_error_rms_m"), 2e-3 * of("emulation_travel_m"));
}

TEST(Orbit, KeepsTheBook) {
  FreeBodyModel vehicle = asymmetric({0.1, 0.0, -0.5});
  vehicle.orbit.rate = 0.05;
  vehicle.v_IPo_I = {0.05, -0.03, 0.04};
  vehicle.w_IP_I = {0.02, 0.03, -0.04};
  FreeBody body(vehicle, kTick);
  body.reset(Vec6::Zero());
  const double first = body.energy();
  double put_in = 0.0, most = 0.0;
  for (int k = 0; k < 4000; ++k) {
    body.step(Wrench{});
    put_in += body.shaken();
    most = std::max(most, std::abs(put_in));
    ASSERT_NEAR(body.energy() - first, put_in, 5e-3 * most + 1e-9) << k;
  }
  EXPECT_GT(most, 1e-2);
}

TEST(Thrusters, KeepTheModelWhereTheyKeepTheTruth) {
  // A tumbling body, all axes at once, its pulses decided by each for itself.
  FreeBodyModel vehicle = asymmetric({0.1, 0.0, -0.5});
  vehicle.w_IP_I = {0.01, -0.02, 0.015};
  vehicle.propulsion.hold = {0.03, 0.1, {3.0, 3.0, 3.0}};
  const BothWays both(vehicle, 60.0);
  double most = 0.0, apart = 0.0;
  for (std::size_t n = 0; n < both.truth.size(); ++n) {
    most = std::max(most, both.truth[n].tail<3>().norm());
    apart = std::max(apart, (both.truth[n] - both.model[n]).norm());
  }
  EXPECT_GT(most, 0.03);
  EXPECT_LT(most, 0.08);
  EXPECT_LT(apart, 1e-4);
}

// It is slowed along the shortest turn, which is not where the fixed angles go straight.
TEST(FreeBody, IsSlowedToWhereEveryCheckPasses) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  int slowed = 0;
  for (const char* scenario : {"satellite_puma", "satellite_hold"}) {
    ControllerConfig config = test::experiment(scenario, test::kCompensated).controller;
    config.moving_frame.enabled = false;
    const Geometry& g = config.geometry;
    const PathChecks checks(config.safety, g);
    const Mat6 M_1 = 5.0 * Mat6::Identity(), noise = Mat6::Zero();
    for (int run = 0; run < 40; ++run) {
      AdmittanceControl control(config);
      ServoObserver servo(config.servo, 0.01);
      PathPoint<6> at;
      at.x << 0.02 * u(random), 0.02 * u(random), 0.02 * u(random), 0.3 * u(random),
          0.3 * u(random), 0.3 * u(random);
      Vec6 L = legLengths(g, g.fromHome(Pose::from(at.x)));
      servo.reset(L, 0);
      control.begin(at.x, M_1, 0.004, 1.0);
      for (int n = 0; n < 60; ++n) {
        Vec6 felt;
        for (double& component : felt) component = u(random);
        felt.head<3>() *= 2e4;
        felt.tail<3>() *= 1e4;
        const Wrench F = Wrench::from(felt);
        const Lesson lesson;
        const JointVector q = JointVector::Zero();
        const Transform X_IP = g.fromHome(Pose::from(at.x));
        at = control.step({F,
                           F,
                           noise,
                           CarriedBody(M_1),
                           1.0,
                           {0.01, 0.004, (n + 1) * test::kTick},
                           false,
                           lesson,
                           q,
                           L,
                           X_IP,
                           servo},
                          at, checks);
        const Vec6 next = legLengths(g, g.fromHome(Pose::from(at.x)));
        ASSERT_FALSE(checks.step(next, L, 0.01).any())
            << run << ", step " << n << " by " << (next - L).cwiseAbs().maxCoeff();
        ASSERT_FALSE(checks.pose(g.fromHome(Pose::from(at.x)), Pose::from(at.x), next).any())
            << run << ", step " << n;
        L = next;
        slowed += control.scale() < 1.0;
      }
    }
  }
  EXPECT_GT(slowed, 500);
}

}  // namespace
}  // namespace ves
