// SPDX-License-Identifier: BSD-3-Clause
#include "ves/analysis/platform.hpp"

#include <algorithm>
#include <cmath>

#include "ves/control/path_checks.hpp"

namespace ves {
namespace {

Vec3 legAxis(const Geometry& g, const Transform& X_IP, std::size_t i) {
  return (X_IP * g.p_PPi_P[i] - g.p_IBi_I[i]).normalized();
}

double angleBetween(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace

LegGap nearestLegs(const Geometry& g, const Transform& X_IP) {
  LegGap out;
  out.distance = HUGE_VAL;
  for (int i = 0; i < kLegs; ++i)
    for (int j = i + 1; j < kLegs; ++j) {
      const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
      const double d =
          segmentDistance(g.p_IBi_I[a], X_IP * g.p_PPi_P[a], g.p_IBi_I[b], X_IP * g.p_PPi_P[b]);
      if (d < out.distance) out = {i, j, d};
    }
  return out;
}

LegSlope flattestLeg(const Geometry& g, const Transform& X_IP) {
  LegSlope out;
  out.angle = HUGE_VAL;
  for (int i = 0; i < kLegs; ++i) {
    const Vec3 along = legAxis(g, X_IP, static_cast<std::size_t>(i));
    const double sine = std::min(along.z(), along.dot(X_IP.R.col(2)));
    const double angle = std::asin(std::clamp(sine, -1.0, 1.0));
    if (angle < out.angle) out = {i, angle};
  }
  return out;
}

double largestJointAngle(const Geometry& g, const Transform& X_IP) {
  const Transform home = g.fromHome({});
  double most = 0.0;
  for (std::size_t i = 0; i < kLegs; ++i) {
    const Vec3 rest = legAxis(g, home, i), now = legAxis(g, X_IP, i);
    most = std::max(
        {most, angleBetween(rest, now), angleBetween(X_IP.R * home.R.transpose() * rest, now)});
  }
  return most;
}

WorkspaceUse workspaceUse(const Geometry& g, double translation, double rotation) {
  WorkspaceUse use;
  use.leg_least.setConstant(HUGE_VAL);
  use.clearance = use.plate_angle = HUGE_VAL;
  const auto look = [&](const Vec6& x) {
    const Transform X_IP = g.fromHome(Pose::from(x));
    const Vec6 L = legLengths(g, X_IP);
    use.leg_least = use.leg_least.cwiseMin(L);
    use.leg_most = use.leg_most.cwiseMax(L);
    use.joint_angle = std::max(use.joint_angle, largestJointAngle(g, X_IP));
    if (const double d = nearestLegs(g, X_IP).distance; d < use.clearance)
      use.clearance = d, use.nearest = x;
    use.plate_angle = std::min(use.plate_angle, flattestLeg(g, X_IP).angle);
    // Not a number is as bad as can be.
    if (const double c = conditionNumber(g, X_IP); !(c <= use.condition))
      use.condition = std::isnan(c) ? HUGE_VAL : c, use.worst = x;
  };
  look(Vec6::Zero());
  Vec6 farthest;
  farthest << Vec3::Constant(translation), Vec3::Constant(rotation);
  for (int i = 0; i < 6; ++i)
    for (const double sign : {-1.0, 1.0}) look(sign * farthest(i) * Vec6::Unit(i));
  for (int corner = 0; corner < 64; ++corner) {
    Vec6 x = 0.5 * farthest;
    for (int i = 0; i < 6; ++i)
      if (corner >> i & 1) x(i) = -x(i);
    look(x);
  }
  return use;
}

Stroke derivedStroke(const WorkspaceUse& use) {
  constexpr double kSpare = 0.05;  // [-]
  const double least = use.leg_least.minCoeff(), most = use.leg_most.maxCoeff();
  return {least - kSpare * (most - least), most + kSpare * (most - least)};
}

double derivedOffset(const Stroke& stroke, double metre_per_count) {
  const double range = metre_per_count * kMaxLegCount;
  return std::max(0.0, 0.5 * (stroke.min + stroke.max - range));
}

SafetyLimits derivedLimits(const WorkspaceUse& use, const Stroke& legs, const ServoModel& servo) {
  const double stroke = legs.max - legs.min;
  const double slowest = std::min(servo.extend.minCoeff(), servo.retract.minCoeff());
  SafetyLimits l;
  l.leg_min = legs.min + 0.03 * stroke;
  l.leg_max = legs.max - 0.03 * stroke;
  l.joint_cone = std::min(M_PI, use.joint_angle + 5.0 * kDegree);
  l.leg_clearance = 0.8 * use.clearance;
  l.plate_angle = 0.8 * use.plate_angle;
  l.condition = 1.5 * use.condition;
  l.leg_velocity = 0.95 * slowest * servo.rail;
  l.position_error = 1.5 * l.leg_velocity / slowest;
  l.position_error_still = 0.015 * stroke;
  l.position_error_lag = 1.35 / slowest;
  l.reading_jump = 0.003 * stroke;
  return l;
}

Travel travel(const Geometry& g, const SafetyLimits& limits, int coordinate, double sign,
              double farthest) {
  SafetyLimits free = limits;  // as far as the machine goes
  free.translation = free.rotation = HUGE_VAL;
  const PathChecks checks(free, g);
  const auto at = [&](double distance) {
    const Pose x = Pose::from(sign * distance * Vec6::Unit(coordinate));
    const Transform X_IP = g.fromHome(x);
    return checks.pose(X_IP, x, legLengths(g, X_IP)).first();
  };
  constexpr int kSteps = 200, kHalvings = 30;
  double good = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    double bad = farthest * i / kSteps;
    Check ends = at(bad);
    if (ends == Check::kCount) {
      good = bad;
      continue;
    }
    for (int k = 0; k < kHalvings && i > 0; ++k) {
      const double middle = 0.5 * (good + bad);
      const Check here = at(middle);
      if (here == Check::kCount)
        good = middle;
      else
        bad = middle, ends = here;
    }
    return {good, ends};
  }
  return {farthest, Check::kMotionLimits};
}

}  // namespace ves
