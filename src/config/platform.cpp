// SPDX-License-Identifier: BSD-3-Clause
#include "readers.hpp"

#include <fmt/format.h>

#include "ves/base/coordinates.hpp"
#include "ves/math/dense.hpp"

namespace ves {
namespace {

/// The symmetric matrix of {xx, yy, zz, xy, xz, yz}, that a body can have.
Mat3 readInertia(Section& s, std::string_view key) {
  const Mat3 I = inertiaOf(s.vector(key, 6, -1e7, 1e7));
  const double least = symmetricEigenvalues(I)(0);
  if (!(least >= -1e-9 * I.norm()))
    s.fail(key, fmt::format("smallest principal moment {:.4g}, want none below 0", least));
  return I;
}

}  // namespace

/// A length in metres, or an angle in degrees, by coordinate.
double readCoordinate(Section& s, const std::string& key, int i) {
  const Coordinate& c = coordinate(i);
  return s.number(fmt::format("{}_{}", key, c.yaml_unit), -kAny, kAny) * c.yaml;
}

Pose readPose(Section s) {
  Vec6 x = Vec6::Zero();
  for (int i = 0; i < 6; ++i) {
    const Coordinate& c = coordinate(i);
    if (s.has(fmt::format("{}_{}", c.name, c.yaml_unit)))
      x(i) = readCoordinate(s, std::string(c.name), i);
  }
  s.finish();
  return Pose::from(x);
}

std::int64_t readTime(Section& s, std::string_view key) {
  return std::llround(s.number(key, 0.0, 1e6) * 1e9);
}

RigidBody readBody(Section s) {
  RigidBody body;
  body.mass = s.number("mass_kg", 0.0, 1e6);
  if (s.has("center_m")) body.p_BoBcm_B = s.vector("center_m", 3, -100.0, 100.0);
  body.I_Bcm_B = readInertia(s, "inertia_kg_m2");
  s.finish();
  return body;
}

RigidBody readBox(Section s) {
  RigidBody box;
  box.mass = s.number("mass_kg", 0.0, 1e5);
  const Vec3 size = s.vector("size_m", 3, 0.0, 10.0);
  if (s.has("center_m")) box.p_BoBcm_B = s.vector("center_m", 3, -10.0, 10.0);
  const Vec3 q = size.cwiseAbs2();
  box.I_Bcm_B = (box.mass / 12.0 * Vec3(q.y() + q.z(), q.x() + q.z(), q.x() + q.y())).asDiagonal();
  s.finish();
  return box;
}

Geometry readGeometry(Section s) {
  Geometry g;
  const auto joints = [&](const char* key) {
    const Eigen::MatrixXd xy = s.matrix(key, kLegs, 2, -10.0, 10.0);
    std::array<Vec3, kLegs> out;
    for (int i = 0; i < kLegs; ++i) out[static_cast<std::size_t>(i)] = {xy(i, 0), xy(i, 1), 0.0};
    return out;
  };
  g.p_IBi_I = joints("base_joints_m");
  g.p_PPi_P = joints("platform_joints_m");
  g.home_height = s.number("home_height_m", 0.01, 10.0);
  s.finish();
  const BodyMotion home{g.fromHome({}), {}, {}, {}, {}};
  BodyMotion solved;
  if (!forwardMotion(g, home.X, {legLengths(g, home.X), Vec6::Zero(), Vec6::Zero()}, solved))
    s.fail("platform_joints_m", "the platform is singular at home: its legs cannot hold it");
  return g;
}

}  // namespace ves
