// SPDX-License-Identifier: BSD-3-Clause
//
// The poses that every kinematic law is tried on.
#pragma once

#include <random>
#include <vector>

#include "ves/kinematics/stewart.hpp"

namespace ves::test {

inline constexpr double kTranslation = 0.305;      // [m] workspace, Appendix C
inline constexpr double kRotation = 30 * kDegree;  // [rad]

/// The substitute geometry of config/ves.yaml.
inline Geometry geometry() {
  Geometry g;
  const auto circle = [](double radius, double degrees) {
    return Vec3(radius * std::cos(degrees * kDegree), radius * std::sin(degrees * kDegree), 0.0);
  };
  const double base[] = {-8, 8, 112, 128, -128, -112}, platform[] = {-52, 52, 68, 172, -172, -68};
  for (std::size_t i = 0; i < kLegs; ++i) {
    g.p_IBi_I[i] = circle(1.0, base[i]);
    g.p_PPi_P[i] = circle(0.55, platform[i]);
  }
  g.home_height = 1.35;
  return g;
}

/// Home, the ends of every coordinate, all corners, and `count` random poses of the workspace.
inline std::vector<Pose> poses(int count = 2000, unsigned seed = 1) {
  std::vector<Pose> out = {Pose{}};
  Vec6 half;
  half << kTranslation, kTranslation, kTranslation, kRotation, kRotation, kRotation;
  for (int i = 0; i < 6; ++i)
    for (double sign : {-1.0, 1.0}) out.push_back(Pose::from(sign * half(i) * Vec6::Unit(i)));
  for (unsigned corner = 0; corner < 64; ++corner) {
    Vec6 x = half;
    for (unsigned i = 0; i < 6; ++i)
      if (corner & (1u << i)) x(static_cast<int>(i)) *= -1.0;
    out.push_back(Pose::from(x));
  }
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  for (int n = 0; n < count; ++n) {
    Vec6 x;
    for (int i = 0; i < 6; ++i) x(i) = half(i) * u(random);
    out.push_back(Pose::from(x));
  }
  return out;
}

/// A smooth motion through the workspace, with its exact derivatives.
struct Swing {
  Vec6 amplitude, w, phase;

  explicit Swing(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> u(0.2, 1.0);
    for (int i = 0; i < 6; ++i) {
      amplitude(i) = (i < 3 ? 0.15 : 15 * kDegree) * u(random);
      w(i) = 4.0 * u(random);
      phase(i) = 6.0 * u(random);
    }
  }
  Vec6 x(double t) const { return amplitude.array() * (w.array() * t + phase.array()).sin(); }
  Vec6 xDot(double t) const {
    return amplitude.array() * w.array() * (w.array() * t + phase.array()).cos();
  }
  Vec6 xDdot(double t) const {
    return -amplitude.array() * w.array().square() * (w.array() * t + phase.array()).sin();
  }
  BodyMotion motion(double t) const {
    return bodyMotion(geometry().home(), Pose::from(x(t)), xDot(t), xDdot(t));
  }
};

}  // namespace ves::test
