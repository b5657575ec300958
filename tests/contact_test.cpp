// SPDX-License-Identifier: BSD-3-Clause
//
// Contact: the force at a point, how far surfaces are, and a body that floats against a tool.
#include <gtest/gtest.h>

#include <random>

#include "support/orbit.hpp"
#include "ves/contact/contact_watch.hpp"
#include "ves/vehicle/free_body.hpp"

namespace ves {
namespace {

/// A ball that drifts along -z towards a feeler at the origin, 1 mm away.
Environment drifting(const ContactLaw& law, double mass, double speed) {
  Environment e;
  e.tool = {{Vec3::Zero(), 0.02}};
  e.law = law;
  Target t;
  t.mass = mass;
  t.I_Bcm_B = 0.4 * mass * 0.09 * Mat3::Identity();
  t.shape = Ball{0.3};
  t.start.p = {0.0, 0.0, 0.321};
  t.start.v = {0.0, 0.0, -speed};
  e.target = t;
  return e;
}

struct Bounce {
  double restitution = 0.0, duration = 0.0, peak = 0.0;
  Floating after;
};

/// The tool stands at the origin until the ball is gone again; `dt` [s] a look, `step` [s].
Bounce bounce(const Environment& e, double dt, double step) {
  Bounce out;
  ContactWatch watch;
  Floating body = e.target->start;
  const FrameMotion still;
  const double before = -body.v.z();
  double impulse_time = 0.0;
  for (int k = 0; k < 2'000'000; ++k) {
    const Touch mean = advance(e, still, still, 0.0, dt, step, body, watch);
    out.peak = std::max(out.peak, touch(e, still, body).on_target_Bo_I.f.norm());
    if (mean.on_target_Bo_I.f.norm() > 0.0) impulse_time += dt;
    if (body.v.z() > 0.0 && mean.least > 1e-4) break;
  }
  out.restitution = body.v.z() / before;
  out.duration = impulse_time;
  out.after = body;
  return out;
}

// Half a period of mass and spring: closed form.
TEST(Contact, ASpringGivesBackWhatItTook) {
  for (const double k : {1e3, 1e4, 1e6})
    for (const double m : {50.0, 1000.0}) {
      const double v = 0.02, omega = std::sqrt(k / m), dt = 1e-3 / omega;
      const Bounce b = bounce(drifting({k, 1.0, 0.0, 0.0, 1e-3}, m, v), dt, dt);
      EXPECT_NEAR(b.restitution, 1.0, 1e-6);
      EXPECT_NEAR(b.duration, M_PI / omega, 2.0 * dt);
      EXPECT_NEAR(b.peak, v * std::sqrt(k * m), 1e-5 * b.peak);
    }
}

// m v dv/dd = -k d^n (1 + c v) has the first integral v/c - ln(1 + c v)/c^2, whatever k and n.
TEST(Contact, HuntAndCrossleysRestitutionIsThatOfItsFirstIntegral) {
  for (const double n : {1.0, 1.5})
    for (const double cv : {0.05, 0.3, 0.9}) {
      const double v = 0.02, c = cv / v;
      const auto G = [&](double speed) { return speed / c - std::log1p(c * speed) / (c * c); };
      double low = 0.0, high = v;  // of the speed that leaves
      for (int i = 0; i < 100; ++i) {
        const double middle = 0.5 * (low + high);
        (G(-middle) < G(v) ? low : high) = middle;
      }
      const Bounce b = bounce(drifting({1e4, n, c, 0.0, 1e-3}, 100.0, v), 1e-4, 1e-4);
      EXPECT_NEAR(b.restitution, low / v, 1e-4) << n << " " << cv;
    }
}

TEST(Contact, HalfTheStepChangesNoFigureByAPercent) {
  const Environment e = drifting({1e6, 1.5, 10.0, 0.0, 1e-3}, 50.0, 0.05);
  const Bounce coarse = bounce(e, 1e-3, 50e-6), fine = bounce(e, 1e-3, 25e-6);
  EXPECT_NEAR(coarse.restitution, fine.restitution, 0.01 * fine.restitution);
  EXPECT_NEAR(coarse.peak, fine.peak, 0.01 * fine.peak);
  EXPECT_NEAR(coarse.restitution, bounce(e, 1e-5, 1e-6).restitution, 0.001);
}

// It comes, rebounds and is gone within one look, or within a few.
TEST(Contact, NoLookIsTooLong) {
  const Environment e = drifting({1e6, 1.0, 0.0, 0.0, 1e-3}, 50.0, 0.13);
  const Bounce due = bounce(e, 1e-4, 1e-4);
  for (const double dt : {1e-3, 1e-2, 0.1})
    EXPECT_NEAR(bounce(e, dt, 1e-4).restitution, due.restitution, 1e-6) << dt;
}

TEST(Contact, NeverPullsAndNeverActsFromAfar) {
  const ContactLaw law{1e4, 1.5, 30.0, 0.5, 1e-3};
  EXPECT_EQ(normalForce(law, 0.0, 1.0), 0.0);
  EXPECT_EQ(normalForce(law, -1e-3, 1.0), 0.0);
  EXPECT_EQ(normalForce(law, NAN, 1.0), 0.0);
  EXPECT_EQ(normalForce(law, 1e-3, -1.0), 0.0);  // leaves faster than it can push
  EXPECT_GT(normalForce(law, 1e-3, -0.01), 0.0);
  EXPECT_NEAR(normalForce(law, 1e-3, 0.01), 1e4 * std::pow(1e-3, 1.5) * 1.3, 1e-9);
}

TEST(Contact, FrictionOpposesSlipAndReachesCoulombs) {
  const ContactLaw law{1e4, 1.0, 0.0, 0.3, 1e-3};
  const Vec3 n = Vec3(1.0, 2.0, 2.0) / 3.0, along = Vec3(2.0, 1.0, -2.0) / 3.0;
  const double N = 1e4 * 2e-3;
  for (const double speed : {1e-5, 1e-3, 0.1}) {
    const Vec3 F = contactForce(law, 2e-3, n, speed * along);
    EXPECT_NEAR(F.dot(n), N, 1e-9);
    EXPECT_NEAR(F.dot(along), -0.3 * N * speed / std::sqrt(speed * speed + 1e-6), 1e-9);
    EXPECT_NEAR(F.dot(n.cross(along)), 0.0, 1e-9);
    // What moves along the normal too slips no more for that.
    EXPECT_LT((contactForce(law, 2e-3, n, speed * along + 0.05 * n) - F).norm(), 1e-9);
  }
}

// The normal is the gradient of the distance, whose length is one; its sign is inside's.
TEST(Contact, NormalsAreGradientsOfDistances) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-0.3, 0.3);
  const auto inBox = [](const Vec3& p) {
    return (p.cwiseAbs() - 0.5 * Vec3(0.2, 0.3, 0.1)).maxCoeff() < 0.0;
  };
  const auto inSocket = [](const Vec3& p) {  // radius 0.05, depth 0.1, chamfer 0.02
    const double r = p.head<2>().norm(), wall = p.z() > -0.02 ? 0.07 + p.z() : 0.05;
    return p.z() < 0.0 && (p.z() < -0.1 || r > wall);
  };
  const std::vector<std::pair<Shape, std::function<bool(const Vec3&)>>> shapes = {
      {HalfSpace{}, [](const Vec3& p) { return p.z() < 0.0; }},
      {Ball{0.15}, [](const Vec3& p) { return p.norm() < 0.15; }},
      {Box{{0.2, 0.3, 0.1}}, inBox},
      {Socket{0.05, 0.1, 0.02}, inSocket}};
  constexpr double h = 1e-7;
  for (std::size_t s = 0; s < shapes.size(); ++s) {
    int smooth = 0;
    for (int i = 0; i < 3000; ++i) {
      const Vec3 p(u(random), u(random), u(random));
      const Proximity near = proximity(shapes[s].first, p);
      EXPECT_EQ(near.distance < 0.0, shapes[s].second(p)) << s << " " << p.transpose();
      EXPECT_NEAR(near.normal.norm(), 1.0, 1e-9);
      Vec3 gradient;
      for (int k = 0; k < 3; ++k)
        gradient(k) = (proximity(shapes[s].first, p + h * Vec3::Unit(k)).distance -
                       proximity(shapes[s].first, p - h * Vec3::Unit(k)).distance) /
                      (2.0 * h);
      if ((gradient - near.normal).norm() < 1e-4) ++smooth;  // not where two sides are as near
    }
    EXPECT_GT(smooth, 2990) << s;
  }
}

// What acts on the tool acts on the target, backwards and along the same line.
TEST(Contact, ActionIsReactionAboutEveryPoint) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  const auto vector = [&] { return Vec3(u(random), u(random), u(random)); };
  Environment e = drifting({1e4, 1.5, 5.0, 0.4, 1e-3}, 80.0, 0.02);
  e.tool = {{{0.1, 0.0, 0.0}, 0.02}, {{-0.1, 0.05, 0.0}, 0.03}};
  int touched = 0;
  for (int i = 0; i < 500; ++i) {
    e.target->shape = i % 2 ? Shape(Ball{0.3}) : Shape(Box{{0.5, 0.4, 0.3}});
    FrameMotion tool;
    tool.X = {rotation(vector()), 0.2 * vector()};
    tool.v = 0.1 * vector();
    tool.w = vector();
    Floating body;
    body.p = 0.3 * vector();
    body.q = Eigen::Quaterniond(rotation(vector()));
    body.v = 0.1 * vector();
    body.w = vector();
    const Touch t = touch(e, tool, body);
    const Wrench about_I = shift(t.on_tool_To_I, -tool.X.p) + shift(t.on_target_Bo_I, -body.p);
    EXPECT_NEAR(about_I.stacked().norm(), 0.0, 1e-9 * (1.0 + t.on_tool_To_I.stacked().norm()));
    if (t.least < 0.0) ++touched;
  }
  EXPECT_GT(touched, 50);
}

// Beside the distance a moment earlier and later, wherever the tool and what floats go and turn.
TEST(Contact, ClosesAsFastAsItsDistanceShrinks) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  const auto vector = [&] { return Vec3(u(random), u(random), u(random)); };
  Environment e = drifting({1e4, 1.5, 5.0, 0.4, 1e-3}, 80.0, 0.02);
  e.tool = {{{0.1, 0.0, 0.0}, 0.02}};
  for (int i = 0; i < 100; ++i) {
    e.target->shape = i % 2 ? Shape(Ball{0.3}) : Shape(Box{{0.5, 0.4, 0.3}});
    FrameMotion tool{{rotation(vector()), vector()}, vector(), vector()};
    Floating body;
    body.p = vector();
    body.q = Eigen::Quaterniond(rotation(vector()));
    body.v = vector();
    body.w = vector();
    const auto least = [&](double t) {
      FrameMotion then = tool;
      then.X = {rotationOf(t * tool.w) * tool.X.R, tool.X.p + t * tool.v};
      Floating there = body;
      there.p = body.p + t * body.v;
      there.q = Eigen::Quaterniond(rotationOf(t * body.w)) * body.q;
      return touch(e, then, there).least;
    };
    constexpr double h = 1e-6;  // [s]
    EXPECT_NEAR(touch(e, tool, body).closing, (least(-h) - least(h)) / (2.0 * h), 1e-5) << i;
  }
}

// A ball that slides and spins on a wall: friction acts where they touch, against what moves there.
TEST(Contact, ABallTouchesAtItsSurface) {
  Environment e;
  e.law = {1e4, 1.0, 0.0, 0.5, 1e-3};
  e.tool = {{Vec3(0.0, 0.0, 0.1), 0.05}};
  e.bodies = {{Transform{}, HalfSpace{}}};
  FrameMotion tool;
  tool.X.p = {0.3, 0.2, -0.052};  // the ball's centre 48 mm above the wall
  const double N = 1e4 * 2e-3;
  const Vec3 lever(0.0, 0.0, 0.05);  // from the tool's origin to where they touch
  tool.w = {0.0, 2.0, 0.0};          // moves that point by 0.1 m/s along x
  for (const double v : {0.0, -0.1, -0.2}) {
    tool.v = {v, 0.0, 0.0};
    const double slip = v + 0.1;
    const Vec3 F(-0.5 * N * slip / std::hypot(slip, 1e-3), 0.0, N);
    const Touch t = touch(e, tool, {});
    EXPECT_LT((t.on_tool_To_I.f - F).norm(), 1e-9) << v;
    EXPECT_LT((t.on_tool_To_I.n - lever.cross(F)).norm(), 1e-9) << v;
    EXPECT_NEAR(t.least, -2e-3, 1e-12);
    EXPECT_NEAR(t.stored, 0.5 * 1e4 * 4e-6, 1e-12);
  }
  // The same against a target that moves as the ball does: nothing slips.
  Environment other = drifting(e.law, 10.0, 0.0);
  other.tool = {{Vec3::Zero(), 0.05}};
  Floating body;
  body.p = {0.0, 0.0, 0.348};
  body.v = {0.4, 0.0, 0.0};
  body.w = {0.0, 1.0, 0.0};
  FrameMotion along;
  along.v = body.v + body.w.cross(Vec3(0.0, 0.0, 0.05) - body.p);
  along.w = Vec3::Zero();
  EXPECT_NEAR(touch(other, along, body).on_tool_To_I.f.x(), 0.0, 1e-9);
  along.v = Vec3::Zero();
  EXPECT_GT(std::abs(touch(other, along, body).on_tool_To_I.f.x()), 1.0);
}

// Between two looks the tool goes on a cubic, and turns evenly: the mean force by its integral.
TEST(Contact, TheToolIsFollowedBetweenTwoLooks) {
  Environment e;
  e.law = {1e4, 1.0, 0.0, 0.0, 1e-3};
  e.tool = {{Vec3::Zero(), 0.0}};
  e.bodies = {{Transform{}, HalfSpace{}}};
  const double T = 1e-3;
  const auto at = [&](double t) {  // d = 1 mm (1 + t/T + (t/T)^2 - (t/T)^3)
    const double s = t / T;
    FrameMotion m;
    m.X.p.z() = -1e-3 * (1.0 + s + s * s - s * s * s);
    m.v.z() = -1e-3 / T * (1.0 + 2.0 * s - 3.0 * s * s);
    return m;
  };
  Floating none;
  ContactWatch watch;
  const Touch mean = advance(e, at(0.0), at(T), 0.0, T, T / 20.0, none, watch);
  EXPECT_NEAR(mean.on_tool_To_I.f.z(), 1e4 * 1e-3 * (1.0 + 0.5 + 1.0 / 3.0 - 0.25), 1e-9);
  // A point on a lever that swings from 0 to 0.2 rad below the wall.
  e.tool = {{Vec3(0.5, 0.0, 0.0), 0.0}};
  FrameMotion level, low;
  low.X.R = rotation({0.0, 0.2, 0.0});
  level.w = low.w = Vec3(0.0, 0.2 / T, 0.0);
  const Touch swung = advance(e, level, low, 0.0, T, T / 20.0, none, watch);
  EXPECT_NEAR(swung.on_tool_To_I.f.z(), 1e4 * 0.5 * (1.0 - std::cos(0.2)) / 0.2, 1e-4);
}

// A free body keeps its momenta and its energy; gravity adds m g t.
TEST(Contact, WhatFloatsFreelyKeepsItsBooks) {
  Environment e = drifting({1e4, 1.0, 0.0, 0.0, 1e-3}, 40.0, 0.0);
  e.tool.clear();
  e.target->I_Bcm_B = Vec3(2.0, 3.0, 5.0).asDiagonal();
  Floating body = e.target->start;
  body.v = {0.1, -0.2, 0.3};
  body.w = {1.0, 2.0, -0.5};
  const auto angular = [&](const Floating& b) {
    const Mat3 R = b.q.toRotationMatrix();
    return Vec3(R * e.target->I_Bcm_B * R.transpose() * b.w);
  };
  const Floating start = body;
  const FrameMotion nowhere;
  ContactWatch watch;
  for (int k = 0; k < 2000; ++k) advance(e, nowhere, nowhere, 0.0, 1e-3, 1e-3, body, watch);
  EXPECT_LT((body.p - start.p - 2.0 * start.v).norm(), 1e-12);
  EXPECT_LT((angular(body) - angular(start)).norm(), 1e-9);
  EXPECT_NEAR(body.w.dot(angular(body)), start.w.dot(angular(start)), 1e-9);
  EXPECT_GT((body.w - start.w).norm(), 0.1);  // it does tumble
  e.gravity = {0.0, 0.0, -9.81};
  Floating falling = start;
  for (int k = 0; k < 100; ++k) advance(e, nowhere, nowhere, 0.0, 1e-2, 1e-3, falling, watch);
  EXPECT_NEAR(falling.v.z(), start.v.z() - 9.81, 1e-9);
  EXPECT_NEAR(falling.p.z(), start.p.z() + start.v.z() - 0.5 * 9.81, 1e-9);
}

// In an orbit it goes as Clohessy and Wiltshire have it, and turns as a vehicle of its inertia
// does.
TEST(Contact, WhatFloatsGoesRoundTheEarth) {
  Environment e = drifting({1e4, 1.0, 0.0, 0.0, 1e-3}, 40.0, 0.0);
  e.tool.clear();
  e.target->I_Bcm_B = Vec3(2.0, 3.0, 5.0).asDiagonal();
  e.orbit.rate = 0.2;
  e.p_IO_I = {0.1, 0.2, 1.3};
  const Vec3 r(0.3, -0.2, 0.1), v(0.05, -0.02, 0.03);
  Floating body = e.target->start;
  body.q.setIdentity();
  body.p = e.p_IO_I + r;
  body.v = v;
  body.w = {0.1, 0.2, -0.05};
  FreeBodyModel model;
  model.body_P = {40.0, Vec3::Zero(), e.target->I_Bcm_B};
  model.orbit = e.orbit;
  model.w_IP_I = body.w;
  FreeBody vehicle(model, 0.01);
  vehicle.reset(Vec6::Zero());
  const FrameMotion nowhere;
  ContactWatch watch;
  for (int k = 1; k <= 1000; ++k) {
    advance(e, nowhere, nowhere, 0.0, 1e-2, 1e-3, body, watch);
    vehicle.step(Wrench{});
    const Vec3 should = test::inOrbit(e.orbit.rate, r, v, 0.01 * k);
    ASSERT_LT((body.p - e.p_IO_I - should).norm(), 1e-9) << k;
    ASSERT_LT((body.q.toRotationMatrix() - vehicle.state().R_IP).norm(), 1e-8) << k;
  }
}

// The mean wrench times the time is the change of momentum: what the sensor is given is the
// impulse.
TEST(Contact, TheMeanOverAStepIsTheImpulse) {
  const Environment e = drifting({1e5, 1.5, 5.0, 0.2, 1e-3}, 60.0, 0.05);
  Floating body = e.target->start;
  body.p = {0.05, 0.0, 0.316};  // off centre: it spins too
  FrameMotion a, b;
  a.v = b.v = {0.01, 0.0, 0.0};
  const double dt = 1e-3;
  ContactWatch watch;
  for (int k = 0; k < 100; ++k) {
    a.X.p = 1e-5 * k * Vec3::UnitX();
    b.X.p = 1e-5 * (k + 1) * Vec3::UnitX();
    const Floating before = body;
    const Touch mean = advance(e, a, b, 0.0, dt, 5e-5, body, watch);
    EXPECT_LT((60.0 * (body.v - before.v) - dt * mean.on_target_Bo_I.f).norm(), 1e-12);
    const double I = 0.4 * 60.0 * 0.09;  // a ball's: no gyroscopic term
    EXPECT_LT((I * (body.w - before.w) - dt * mean.on_target_Bo_I.n).norm(), 1e-10);
  }
  EXPECT_GT(body.w.norm(), 1e-3);
}

// A mass meets a spring whose force comes tau late: e = exp(pi omega tau / 2) to first order.
TEST(Contact, AForceThatIsLateGivesEnergy) {
  for (const double omega_tau : {0.02, 0.05, 0.1, 0.2, 0.28}) {
    const double m = 100.0, k = 1e4, omega = std::sqrt(k / m), tau = omega_tau / omega, v = 0.02;
    const ContactLaw law{k, 1.0, 0.0, 0.0, 1e-3};
    const int late = 200;
    const double h = tau / late;
    std::vector<double> past(static_cast<std::size_t>(late), 0.0);  // penetrations
    double d = 0.0, speed = v, force = 0.0;
    for (std::size_t i = 0; i < 100'000'000; ++i) {
      const double old = past[i % past.size()];
      past[i % past.size()] = d;
      const double before = force;
      force = normalForce(law, old, 0.0);
      speed -= h * 0.5 * (before + force) / m;
      d += h * speed;
      if (d < 0.0 && force == 0.0 && speed < 0.0) break;
    }
    EXPECT_NEAR(-speed / v, std::exp(0.5 * M_PI * omega_tau), 0.01 * -speed / v) << omega_tau;
  }
}

/// The frame's velocity by differences of its pose.
TEST(Contact, AToolMovesAsItsJointsAndItsBaseMoveIt) {
  RobotModel robot;
  Link l;
  l.X_parent = {rotation({0.1, 0.2, 0.3}), {0.1, 0.0, 0.4}};
  l.axis = Vec3(0.0, 0.6, 0.8);
  robot.extend(l);
  l.type = JointType::kPrismatic;
  l.axis = Vec3(1.0, 0.0, 0.0);
  robot.extend(l);
  l.type = JointType::kRevolute;
  robot.extend(l);
  Link follower = l;  // of the last joint, half as far
  follower.parent = 2;
  follower.joint = 2;
  follower.ratio = 0.5;
  robot.add(follower, true);
  const Transform X_PL0 = {rotation({0.3, -0.1, 0.2}), {0.0, 0.1, 0.1}},
                  X_link = {rotation({0.2, 0.2, 0.2}), {0.05, -0.02, 0.3}};
  const Vec3 v(0.1, 0.2, -0.3), w(0.5, -0.4, 0.2);
  JointState joints;
  joints.q.head<3>() << 0.3, 0.1, -0.4;
  joints.q_dot.head<3>() << 1.0, 0.3, -0.8;
  const auto pose = [&](double t) {
    BodyMotion P;
    P.X = {rotationOf(t * w) * rotation({0.1, 0.2, 0.3}), Vec3(0.0, 0.0, 1.0) + t * v};
    P.v = v;
    P.w = w;
    JointState at = joints;
    at.q += t * joints.q_dot;
    return carriedFrame(robot, at, P, X_PL0, 3, X_link);
  };
  const double h = 1e-6;
  const FrameMotion now = pose(0.0), later = pose(h), before = pose(-h);
  EXPECT_LT((now.v - (later.X.p - before.X.p) / (2.0 * h)).norm(), 1e-8);
  const Mat3 W = (later.X.R - before.X.R) / (2.0 * h) * now.X.R.transpose();
  EXPECT_LT((now.w - Vec3(W(2, 1), W(0, 2), W(1, 0))).norm(), 1e-8);
}

// Events, by closed form: a ball rebounds from a tool that stands, and comes again.
TEST(ContactWatch, KnowsWhenHowHardAndWithWhatARebound) {
  const double k = 1e4, m = 100.0, v = 0.02, omega = std::sqrt(k / m);
  const Environment e = drifting({k, 1.0, 0.0, 0.0, 1e-3}, m, v);
  Floating body = e.target->start;
  ContactWatch watch;
  const FrameMotion still;
  const double dt = 1e-3;
  int touching = 0;
  for (int i = 0; i < 1000; ++i) {
    advance(e, still, still, i * dt, dt, 5e-5, body, watch);
    touching += watch.touching();
    if (!watch.last().over() && i > 500) {
      EXPECT_TRUE(watch.touching())
          << "the speed after it is known 10 ms later, and better after 20";
    }
  }
  const Contact& c = watch.last();
  EXPECT_EQ(watch.count(), 1);
  EXPECT_FALSE(watch.touching());
  EXPECT_NEAR(touching * dt, M_PI / omega, 2.0 * dt);
  EXPECT_NEAR(c.began, 1e-3 / v, 1e-6);
  EXPECT_NEAR(c.duration, M_PI / omega, 1e-4);
  EXPECT_NEAR(c.peak, v * std::sqrt(k * m), 1e-4 * c.peak);
  EXPECT_NEAR(c.impulse.z(), -2.0 * m * v, 1e-4 * 2.0 * m * v);
  EXPECT_NEAR(c.approach, v, 1e-6);
  EXPECT_NEAR(c.separation, v, 1e-5);
  // Another one begins anew.
  body.v.z() = -0.5 * v;
  for (int i = 1000; i < 3500; ++i) advance(e, still, still, i * dt, dt, 5e-5, body, watch);
  EXPECT_EQ(watch.count(), 2);
  EXPECT_NEAR(watch.last().peak, 0.5 * v * std::sqrt(k * m), 1e-4 * c.peak);
  EXPECT_NEAR(watch.last().restitution(), 1.0, 1e-3);
}

// A rate that swings about its mean, as a platform's does within a period: the mean counts.
TEST(ContactWatch, TakesMeanSpeeds) {
  const auto gap = [](double t) {  // closes at 3 cm/s, and opens at 2, with 30 % of ripple
    const double ripple = 0.3 * 0.01 / (2.0 * M_PI) * std::sin(2.0 * M_PI * t / 0.01);
    return t < 1.0 ? -0.03 * (t - 0.9 + ripple) : -3e-3 + 0.02 * (t - 1.0 + ripple);
  };
  for (const double apart : {1e-4, 3.7e-4, 1e-3}) {  // whatever the times that it looks at
    ContactWatch watch;
    for (double t = 0.0; t < 2.0; t += apart) {
      Touch touch;
      touch.least = gap(t);
      touch.closing = -(gap(t + 1e-6) - gap(t)) / 1e-6;
      if (touch.least < 0.0) touch.pressed = {1.0, 0.0, 0.0};
      watch.see(t, touch);
    }
    EXPECT_EQ(watch.count(), 1);
    EXPECT_NEAR(watch.last().approach, 0.03, 0.03 * 0.005) << apart;
    EXPECT_NEAR(watch.last().separation, 0.02, 0.02 * 0.005) << apart;
    EXPECT_NEAR(watch.last().duration, 0.1 + 0.15, 2e-3);
    EXPECT_NEAR(watch.last().impulse.x(), watch.last().duration, apart);
  }
}

// Seen only a moment before it touches, or not before at all.
TEST(ContactWatch, TakesWhatItHasSeenOfAnApproach) {
  for (const int looks : {0, 1, 2}) {
    ContactWatch watch;
    for (int i = -looks; i <= 3; ++i) {
      Touch touch;
      touch.least = -0.04 * (2e-3 * i + 1e-3);  // 0.04 m/s
      touch.closing = 0.05;                     // at this very moment, as a ripple has it
      watch.see(2e-3 * i, touch);
    }
    EXPECT_EQ(watch.count(), 1);
    EXPECT_NEAR(watch.last().approach, looks == 0 ? 0.05 : 0.04, 1e-12) << looks;
  }
}

TEST(ContactWatch, CountsABounceThatComesAtOnce) {
  ContactWatch watch;
  for (int i = 0; i < 2000; ++i) {
    Touch touch;
    touch.least = 1e-4 * std::cos(2.0 * M_PI * i / 100.0);  // every 10 ms, of which 5 free
    touch.closing = 0.06 * std::sin(2.0 * M_PI * i / 100.0);
    watch.see(1e-4 * i, touch);
  }
  EXPECT_EQ(watch.count(), 20);
  EXPECT_NEAR(watch.last().approach, 0.06, 1e-3) << "since it parted it has not come nearer";
}

/// A tool that goes along x at 0.1 m/s and turns; a ball before it.
Environment gripping(Floating& body, FrameMotion& tool) {
  Environment e = drifting({1e4, 1.0, 0.0, 0.0, 1e-3}, 50.0, 0.0);
  e.grip = Grip{2e4, 400.0, 2e3, 60.0, 5e-3};
  body = e.target->start;
  tool.v = {0.1, 0.0, 0.0};
  tool.w = {0.0, 0.0, 0.2};
  return e;
}

// It is dragged along as if it were part of the tool.
TEST(Grip, TakesTheTargetAlongWhereItWasTaken) {
  Floating body;
  FrameMotion tool;
  const Environment e = gripping(body, tool);
  EXPECT_FALSE(grasp({}, tool, body));
  Floating far = body;
  far.p.z() += 0.01;
  EXPECT_FALSE(grasp(e, tool, far)) << "out of reach";
  ASSERT_TRUE(grasp(e, tool, body));
  EXPECT_FALSE(grasp(e, tool, body)) << "it is held already";
  const Transform X_TB = *body.X_TB;
  EXPECT_LT((X_TB.p - Vec3(0.0, 0.0, 0.321)).norm(), 1e-12);
  ContactWatch watch;
  const double dt = 1e-3;
  for (int i = 0; i < 3000; ++i) {
    FrameMotion next = tool;
    next.X.p += dt * tool.v;
    next.X.R = rotationOf(dt * tool.w) * tool.X.R;
    advance(e, tool, next, i * dt, dt, 5e-5, body, watch);
    tool = next;
  }
  const Transform due = tool.X * X_TB;
  EXPECT_LT((body.p - due.p).norm(), 1e-4);
  EXPECT_LT((body.X_IB().R - due.R).norm(), 1e-3);
  EXPECT_LT((body.v - (tool.v + tool.w.cross(body.p - tool.X.p))).norm(), 1e-3);
  EXPECT_LT((body.w - tool.w).norm(), 1e-3);
  EXPECT_EQ(watch.count(), 0) << "what is held is not touched";
}

// A light target on a stiff grip swings about the tool as mass and spring do, however long the
// looks.
TEST(Grip, SwingsAsItsSpringSays) {
  Floating body;
  FrameMotion still;
  Environment e = gripping(body, still);
  constexpr double kMass = 2.0, kStiffness = 2e6, kAway = 1e-3, kLook = 1e-3;
  e.target->mass = kMass;
  e.grip = Grip{kStiffness, 0.0, 2e3, 0.0, 5e-3};
  still = {};
  body.v.setZero();
  ASSERT_TRUE(grasp(e, still, body));
  const double at = body.p.x(), omega = std::sqrt(kStiffness / kMass);
  body.p.x() += kAway;
  ContactWatch watch;
  for (int i = 1; i <= 100; ++i) {  // 16 swings
    advance(e, still, still, (i - 1) * kLook, kLook, 1e-5, body, watch);
    EXPECT_NEAR(body.p.x() - at, kAway * std::cos(omega * i * kLook), 1e-3 * kAway) << i;
  }
}

// Action and reaction, about one point.
TEST(Grip, PushesBackOnTheTool) {
  Floating body;
  FrameMotion tool;
  const Environment e = gripping(body, tool);
  ASSERT_TRUE(grasp(e, tool, body));
  body.p += Vec3(0.003, -0.002, -0.004);  // into the ball: what is held is not touched
  body.q = Eigen::Quaterniond(rotation({0.02, -0.01, 0.03}));
  body.v = {0.01, 0.05, -0.02};
  body.w = {0.3, -0.1, 0.2};
  const Touch t = touch(e, tool, body);
  EXPECT_GT(t.on_target_Bo_I.f.norm(), 10.0);
  EXPECT_LT((t.on_target_Bo_I.f + t.on_tool_To_I.f).norm(), 1e-12);
  const Vec3 about_tool = t.on_target_Bo_I.n + (body.p - tool.X.p).cross(t.on_target_Bo_I.f);
  EXPECT_LT((about_tool + t.on_tool_To_I.n).norm(), 1e-12);
  // A spring and a damper, by hand.
  const Vec3 off(0.003, -0.002, -0.004), slip = body.v - (tool.v + tool.w.cross(body.p - tool.X.p));
  EXPECT_LT((t.on_target_Bo_I.f + 2e4 * off + 400.0 * slip).norm(), 1e-9);
  EXPECT_NEAR(
      t.stored,
      0.5 * 2e4 * off.squaredNorm() + 0.5 * 2e3 * std::pow(Eigen::AngleAxisd(body.q).angle(), 2),
      1e-9);
  EXPECT_LT((t.on_target_Bo_I.n + 60.0 * (body.w - tool.w) +
             2e3 * Eigen::AngleAxisd(body.q).angle() * Eigen::AngleAxisd(body.q).axis())
                .norm(),
            1e-9);
}

}  // namespace
}  // namespace ves
