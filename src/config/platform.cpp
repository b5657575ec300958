// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/platform.hpp"

#include "readers.hpp"

#include <fmt/format.h>

#include "ves/analysis/platform.hpp"
#include "ves/core/coordinates.hpp"
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
  const double most = i < 3 ? 5.0 : 360.0;  // [m], [deg]: no platform goes farther
  return s.number(fmt::format("{}_{}", key, c.yaml_unit), -most, most) * c.yaml;
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

Mat3 boxInertia(double mass, const Vec3& size) {
  const Vec3 q = size.cwiseAbs2();
  return (mass / 12.0 * Vec3(q.y() + q.z(), q.x() + q.z(), q.x() + q.y())).asDiagonal();
}

RigidBody readBox(Section s) {
  RigidBody box;
  box.mass = s.number("mass_kg", 0.0, 1e5);
  const Vec3 size = s.vector("size_m", 3, 0.0, 10.0);
  if (s.has("center_m")) box.p_BoBcm_B = s.vector("center_m", 3, -10.0, 10.0);
  box.I_Bcm_B = boxInertia(box.mass, size);
  s.finish();
  return box;
}

/// Six points; with two coordinates each they lie in the plane of the plate, as in (2.18).
std::array<Vec3, kLegs> readJoints(Section& s, const char* key) {
  const Eigen::MatrixXd rows = s.matrix(key, kLegs, -1, -10.0, 10.0);
  if (rows.cols() != 2 && rows.cols() != 3)
    s.fail(key, fmt::format("has {} coordinates a joint, want x, y or x, y, z", rows.cols()));
  std::array<Vec3, kLegs> out;
  for (int i = 0; i < kLegs; ++i)
    out[static_cast<std::size_t>(i)] = {rows(i, 0), rows(i, 1),
                                        rows.cols() == 3 ? rows(i, 2) : 0.0};
  return out;
}

namespace {

// [-] of the Jacobian. 1 is the best there is; the report's machine has 1.3 at home.
constexpr double kNearSingular = 100.0;

std::string poseText(const Vec6& x) {
  std::string out;
  for (int i = 0; i < 6; ++i) {
    const Coordinate& c = coordinate(i);
    if (x(i) != 0.0)
      out += fmt::format("{}{} {:.4g} {}", out.empty() ? "" : ", ", c.name, x(i) * c.shown,
                         c.shown_unit);
  }
  return out.empty() ? "home" : out;
}

/// Legs that touch there are legs that cross.
void requireApart(const Section& s, std::string_view key, const Geometry& g, const Vec6& x) {
  constexpr double kTouch = 0.005;  // [-] of a leg's length
  const Transform X_IP = g.fromHome(Pose::from(x));
  const LegGap gap = nearestLegs(g, X_IP);
  if (!(gap.distance > kTouch * legLengths(g, X_IP).minCoeff()))
    s.fail(key, fmt::format("at {} legs {} and {} cross: their axes are {:.2g} mm apart",
                            poseText(x), gap.first + 1, gap.second + 1, gap.distance * 1e3));
}

}  // namespace

Geometry readGeometry(Section s) {
  Geometry g;
  g.p_IBi_I = readJoints(s, "base_joints_m");
  g.p_PPi_P = readJoints(s, "platform_joints_m");
  g.home_height = s.number("home_height_m", 0.01, 10.0);
  s.finish();
  const Transform home = g.fromHome({});
  const LegSlope slope = flattestLeg(g, home);
  if (!(slope.angle > 0.0))
    s.fail("home_height_m", fmt::format("leg {} stands at {:.1f} deg to a plate at home, want more "
                                        "than 0: the platform above the base",
                                        slope.leg + 1, slope.angle / kDegree));
  if (const double c = conditionNumber(g, home); !(c <= kNearSingular))
    s.fail("platform_joints_m",
           fmt::format("the platform is near singular at home (condition number {:.2g}, want at "
                       "most {}): its legs cannot hold it; are the joints numbered alike?",
                       c, kNearSingular));
  requireApart(s, "platform_joints_m", g, Vec6::Zero());
  return g;
}

WorkspaceUse readWorkspace(Section s, const Geometry& geometry) {
  const WorkspaceUse use = workspaceUse(geometry, s.number("translation_m", kTiny, 10.0),
                                        s.number("rotation_deg", kTiny, 85.0) * kDegree);
  if (!(use.condition <= kNearSingular))
    s.fail("rotation_deg", fmt::format("inside of the workspace, at {}, the platform is near "
                                       "singular (condition number {:.2g}, want at most {})",
                                       poseText(use.worst), use.condition, kNearSingular));
  requireApart(s, "rotation_deg", geometry, use.nearest);
  return use;
}

Platform loadPlatform(const std::filesystem::path& file,
                      const std::vector<std::string>& overrides) {
  Value document = loadDocument(file);
  for (const std::string& assignment : overrides) applyOverride(document, assignment);
  Section root(document, "");
  Platform out;
  out.geometry = readGeometry(root.section("platform"));
  out.use = readWorkspace(root.section("safety"), out.geometry);
  Section leg_section = root.section("legs");
  leg_section.has("watchdog");
  const Legs legs = readLegs(leg_section, out.use);
  const double volts = root.section("sensor").number("volts_per_count", kTiny, 1.0);
  out.limits = readSafety(root.section("safety"), out.geometry, out.use, legs, volts);
  out.gains = legs.gains;
  out.actuator = legs.actuator;
  out.transducer = legs.transducer;
  return out;
}

std::filesystem::path findPlatform(const std::string& name, const std::filesystem::path& config) {
  const std::filesystem::path scenario = config / "scenarios" / (name + ".yaml");
  return std::filesystem::exists(scenario) ? scenario
                                           : findFile("platform", name, config / "platforms");
}

}  // namespace ves
