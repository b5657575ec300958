// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/base.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "readers.hpp"
#include "ves/core/memo.hpp"
#include "ves/math/dense.hpp"

namespace ves {
namespace {

constexpr double kMostShape = 1e3;  // [1/sqrt(kg)], [1/sqrt(kg) rad/m]: a mass of a milligram
constexpr int kMostDofs = 600;      // [-] of an arm

/// What is wrong with a matrix that should be symmetric and positive definite (or semidefinite);
/// empty when nothing is.
std::string definitenessFault(const Mat6& A, bool semidefinite) {
  const double scale = A.cwiseAbs().maxCoeff();
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < i; ++j)
      if (!(std::abs(A(i, j) - A(j, i)) <= 1e-9 * scale))
        return fmt::format("not symmetric: entry [{}][{}] is {}, [{}][{}] is {}", i, j, A(i, j), j,
                           i, A(j, i));
  const double least = symmetricEigenvalues(A)(0);
  if (semidefinite ? least >= -1e-12 * scale : least > 1e-12 * scale) return {};
  return fmt::format("smallest eigenvalue {:.4g}, want {}", least,
                     semidefinite   ? "none below 0 (positive semidefinite)"
                     : least <= 0.0 ? "all above 0 (positive definite)"
                                    : fmt::format("all above {:.4g}, 1e-12 of the largest entry "
                                                  "(positive definite)",
                                                  1e-12 * scale));
}

constexpr const char* kBefore = " (`base: !replace` leaves out what a file before said)";

/// A 6x6 given by its rows or, when only it is not zero, by its diagonal.
Mat6 readMatrix(Section& s, std::string_view key, bool semidefinite) {
  const std::string diagonal = std::string(key) + "_diagonal";
  const bool is_diagonal = s.has(diagonal);
  if (is_diagonal && s.has(key))
    s.fail(std::string(key),
           fmt::format("stands beside {}, want one of them{}", diagonal, kBefore));
  const Mat6 A = is_diagonal ? Mat6(s.vector(diagonal, 6, -kAny, kAny).asDiagonal())
                             : Mat6(s.matrix(key, 6, 6, -kAny, kAny));
  const std::string fault = definitenessFault(A, semidefinite);
  if (!fault.empty()) s.fail(is_diagonal ? diagonal : std::string(key), fault);
  return A;
}

/// Axes of {P} in those that shapes or a tip are given in.
Mat3 readAxes(Section& s) {
  if (!s.has("platform_rpy_deg")) return Mat3::Identity();
  return rotation(s.vector("platform_rpy_deg", 3, -360.0, 360.0) * kDegree);
}

/// How many modes to keep of `all`; all of them unless `keep_modes` says otherwise.
int readKeep(Section& s, int all) {
  const int most = std::min(all, kMaxModes);
  if (s.has("keep_modes")) return static_cast<int>(s.integer("keep_modes", 1, most));
  if (all > kMaxModes)
    s.fail("keep_modes",
           fmt::format("the base has {} modes, want 1 to {} of them kept", all, most));
  return all;
}

/// The first k modes.
ModalModel keep(const ModalModel& all, int k) {
  return {all.Phi.leftCols(k), all.stiffness.head(k), all.damping.topLeftCorner(k, k)};
}

/// Modes as NASTRAN prints them, the shapes already at the robot's foot.
ModalModel readTable(Section s) {
  const Eigen::VectorXd omega = 2.0 * M_PI * s.vector("frequency_hz", -1, 0.0, 1e4);
  const auto all = static_cast<int>(omega.size());
  const Eigen::VectorXd zeta = s.vector("damping_ratio", all, 0.0, 1e3);
  const Eigen::VectorXd mass = s.vector("generalized_mass", all, 0.0, kAny);
  for (int i = 0; i < all; ++i)
    if (!(std::abs(mass(i) - 1.0) <= 1e-3))
      s.fail("generalized_mass",
             fmt::format("mode {} has {}, want 1: mass-normalised shapes (divide the mode's shape "
                         "by the root of its generalised mass)",
                         i + 1, mass(i)));
  Eigen::MatrixXd shapes = s.matrix("shapes", 6, all, -kMostShape, kMostShape);
  for (int i = 0; i < all; ++i)
    if (shapes.col(i).isZero(0.0))
      s.fail("shapes", fmt::format("column {} is zero: that mode moves nothing here", i + 1));
  const Mat3 R_PA = readAxes(s).transpose();
  shapes.topRows<3>() = R_PA * shapes.topRows<3>();
  shapes.bottomRows<3>() = R_PA * shapes.bottomRows<3>();
  s.finish();
  std::vector<int> softest_first(static_cast<std::size_t>(all));
  std::iota(softest_first.begin(), softest_first.end(), 0);
  std::stable_sort(softest_first.begin(), softest_first.end(),
                   [&](int a, int b) { return omega(a) < omega(b); });
  ModalModel out;
  out.Phi = shapes(Eigen::all, softest_first);
  out.stiffness = omega.cwiseAbs2()(softest_first);
  out.damping = (2.0 * zeta.cwiseProduct(omega))(softest_first).asDiagonal();
  return out;
}

ArmJoint readJoint(Section s, Section& pose) {
  ArmJoint joint;
  joint.name = s.text("name");
  joint.axis = s.vector("axis", 3, -1.0, 1.0);
  if (!(joint.axis.norm() > 1e-3)) s.fail("axis", "has no direction");
  joint.axis.normalize();
  joint.stiffness = s.number("stiffness_nm_per_rad", 1e-3, 1e12);
  const Eigen::VectorXd range = s.vector("range_deg", 2, -1e4, 1e4);
  if (!(range(0) <= range(1)))
    s.fail("range_deg", fmt::format("[{}, {}], want lower <= upper", range(0), range(1)));
  joint.angle = pose.number(joint.name, range(0), range(1)) * kDegree;
  s.finish();
  return joint;
}

ArmBeam readBeam(Section s) {
  ArmBeam beam;
  beam.to = s.vector("to_m", 3, -100.0, 100.0);
  const double length = beam.to.norm();
  if (!(length > 1e-3)) s.fail("to_m", "has no length, want more than 1 mm");
  beam.section.EI = s.number("EI_n_m2", 1e-3, 1e15);
  beam.section.GJ = s.number("GJ_n_m2", 1e-3, 1e15);
  beam.section.EA = s.number("EA_n", 1e-3, 1e15);
  beam.section.mass_per_length = s.number("mass_kg", 0.0, 1e6) / length;
  beam.section.radius = s.number("radius_m", 0.0, 10.0);
  beam.elements = static_cast<int>(s.integer("elements", 1, 100));
  s.finish();
  return beam;
}

ArmDescription readArm(Section& s) {
  ArmDescription arm;
  arm.stiffness_scale = s.number("stiffness_scale", 1e-6, 1e6);
  arm.damping_ratio = s.number("damping_ratio", 0.0, 1e3);
  arm.R_TP = readAxes(s);
  Section pose = s.section("pose_deg");
  const std::vector<Section> parts = s.list("chain");
  if (parts.empty()) s.fail("chain", "has no parts");
  std::set<std::string> names;
  int dofs = 0;
  for (Section part : parts) {
    const std::string kind = part.onlyKey({"joint", "beam", "housing"}, {});
    if (kind == "joint") {
      const ArmJoint joint = readJoint(part.section("joint"), pose);
      if (!names.insert(joint.name).second)
        part.fail("joint.name", fmt::format("'{}' is the name of another joint too", joint.name));
      arm.chain.push_back(joint);
    } else if (kind == "beam") {
      const ArmBeam beam = readBeam(part.section("beam"));
      if ((dofs += 6 * beam.elements) > kMostDofs)
        part.fail("beam.elements", fmt::format("{} degrees of freedom up to here, want at most {}",
                                               dofs, kMostDofs));
      arm.chain.push_back(beam);
    } else
      arm.chain.push_back(ArmHousing{readBody(part.section("housing"))});
    part.finish();
  }
  pose.finish();
  if (s.has("payload")) arm.payload_P = readBody(s.section("payload"));
  return arm;
}

/// Their modes take as long as a run in lockstep, and who loads many experiments has few arms.
std::shared_ptr<const ArmModes> modesOfArm(const ArmDescription& arm, const ArmModel& model,
                                           int keep) {
  constexpr std::size_t kKept = 16;
  static Memo<std::pair<ArmDescription, int>, ArmModes, kKept> known;
  return known.of({arm, keep}, [&] { return armModes(model, arm.damping_ratio, keep); });
}

/// Six modes at most of M, C and K.
Base readMatrices(Section& s) {
  const Mat6 M = readMatrix(s, "mass", false);
  const Mat6 C = readMatrix(s, "damping", true);
  const Mat6 K = readMatrix(s, "stiffness", true);
  Base out;
  out.vehicle = keep(modesOf(M, C, K), readKeep(s, 6));
  return out;
}

Base readModes(Section& s) {
  const ModalModel all = readTable(s.section("modes"));
  Base out;
  out.vehicle = keep(all, readKeep(s, static_cast<int>(all.stiffness.size())));
  return out;
}

Base readArmBase(Section& s) {
  Section section = s.section("arm");
  const ArmDescription arm = readArm(section);
  section.finish();
  Base out;
  out.arm = assemble(arm);
  const int dofs = out.arm->frame.dofs();
  if (dofs == 0) section.fail("chain", "has nothing that can move");
  try {
    const std::shared_ptr<const ArmModes> modes = modesOfArm(arm, *out.arm, readKeep(s, dofs));
    out.vehicle = modes->tip;
    out.shape = modes->shape;
  } catch (const std::domain_error&) {
    section.fail("chain",
                 "a part that can move has no mass; want mass in every beam, or inertia "
                 "about every axis of a housing at its end");
  }
  return out;
}

/// From and until, which begin a row of such; the rows are in order.
Firing firingOf(const Section& s, const char* key, const Eigen::MatrixXd& rows, Eigen::Index i) {
  const Firing one{rows(i, 0), rows(i, 1)};
  if (!(one.from >= 0.0 && one.until > one.from) || (i > 0 && !(one.from >= rows(i - 1, 1)))) {
    const Eigen::VectorXd row = rows.row(i);
    s.fail(key, fmt::format("[{}], want each to end after it begins, and to begin after the one "
                            "before",
                            fmt::join(row.begin(), row.end(), ", ")));
  }
  return one;
}

Thruster readThruster(Section s) {
  constexpr double kLongest = 1e5;  // [s]
  Thruster out;
  out.p_PoT_P = s.vector("at_m", 3, -100.0, 100.0);
  out.force_P = s.vector("force_n", 3, -1e5, 1e5);
  if (!(out.force_P.norm() > 0.0)) s.fail("force_n", "no force, want a direction of it");
  if (s.has("least_on_s")) out.least_on = s.number("least_on_s", 0.0, 100.0);
  if (s.has("firings_s")) {
    const Eigen::MatrixXd rows = s.matrix("firings_s", -1, 2, 0.0, kLongest);
    if (rows.rows() > Thruster::kMostFirings)
      s.fail("firings_s",
             fmt::format("{} of them, want at most {}", rows.rows(), Thruster::kMostFirings));
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
      const Firing one = firingOf(s, "firings_s", rows, i);
      if (!(one.until - one.from >= out.least_on - 1e-9))
        s.fail("firings_s", fmt::format("[{}, {}] is shorter than least_on_s of {}", one.from,
                                        one.until, out.least_on));
      out.firings[static_cast<std::size_t>(out.size++)] = one;
    }
  }
  s.finish();
  return out;
}

AttitudeHold readHold(Section s) {
  AttitudeHold out;
  out.dead_band = s.number("dead_band_deg", 0.001, 45.0) * kDegree;
  out.pulse = s.number("pulse_s", 0.001, 10.0);
  out.torque_P = s.vector("torque_nm", 3, 0.0, 1e5);
  if (!(out.torque_P.maxCoeff() > 0.0)) s.fail("torque_nm", "none, want one about some axis");
  s.finish();
  return out;
}

ReactionWheel readWheel(Section s) {
  constexpr double kLongest = 1e5;  // [s]
  ReactionWheel out;
  out.axis_P = s.vector("axis", 3, -1e3, 1e3);
  if (!(out.axis_P.norm() > 0.0)) s.fail("axis", "no direction");
  out.axis_P.normalize();
  const double most = s.number("most_nms", 0.0, 1e6);
  const Eigen::MatrixXd rows = s.matrix("torques_s_nm", -1, 3, -1e5, kLongest);
  if (rows.rows() > ReactionWheel::kMostTorques)
    s.fail("torques_s_nm",
           fmt::format("{} of them, want at most {}", rows.rows(), ReactionWheel::kMostTorques));
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    const Firing on = firingOf(s, "torques_s_nm", rows, i);
    out.torques[static_cast<std::size_t>(out.size++)] = {on, rows(i, 2)};
    if (const double taken = out.momentum(on.until); !(std::abs(taken) <= most))
      s.fail("torques_s_nm",
             fmt::format("after {} s the wheel has {:.4g} N m s, want at most most_nms of {}",
                         on.until, taken, most));
  }
  s.finish();
  return out;
}

/// A body that floats.
Base readFree(Section& s) {
  FreeBodyModel free;
  Section section = s.section("free");
  if (section.has("velocity_m_per_s"))
    free.v_IPo_I = section.vector("velocity_m_per_s", 3, -1e4, 1e4);
  if (section.has("rate_deg_per_s"))
    free.w_IP_I = kDegree * section.vector("rate_deg_per_s", 3, -90.0, 90.0);
  if (section.has("orbital_rate_deg_per_s"))
    free.orbit.rate = kDegree * section.number("orbital_rate_deg_per_s", 0.0, 1.0);
  if (section.has("thrusters"))
    for (Section one : section.list("thrusters")) {
      if (free.propulsion.size == kMostThrusters)
        section.fail("thrusters", fmt::format("more than {}", kMostThrusters));
      free.propulsion.thrusters[static_cast<std::size_t>(free.propulsion.size++)] =
          readThruster(one);
    }
  if (section.has("wheels"))
    for (Section one : section.list("wheels")) {
      if (free.propulsion.wheel_count == ReactionWheel::kMost)
        section.fail("wheels", fmt::format("more than {}", ReactionWheel::kMost));
      free.propulsion.wheels[static_cast<std::size_t>(free.propulsion.wheel_count++)] =
          readWheel(one);
    }
  if (section.has("attitude_hold"))
    free.propulsion.hold = readHold(section.section("attitude_hold"));
  std::optional<Vec3> about;  // [m] of P
  if (section.has("inertia_about_m")) about = section.vector("inertia_about_m", 3, -100.0, 100.0);
  RigidBody& body = free.body_P = readBody(section);
  if (!(body.mass > 0.0)) section.fail("mass_kg", "no mass, want more than 0");
  if (about) {
    const Mat3 S = skew(body.p_BoBcm_B - *about);
    body.I_Bcm_B += body.mass * S * S;
  }
  const Eigen::VectorXd moments = symmetricEigenvalues(body.I_Bcm_B);
  const auto fail = [&](const std::string& why) {
    section.fail("inertia_kg_m2",
                 fmt::format("principal moments of {:.4g}, {:.4g} and {:.4g} kg m^2 about the "
                             "centre of mass: {}",
                             moments(0), moments(1), moments(2), why));
  };
  if (!(moments(0) > 1e-9 * moments(2))) fail("want all above 0");
  if (!(moments(2) <= (1.0 + 1e-9) * (moments(0) + moments(1))))
    fail("no body's, want none above the sum of the others");
  Base out;
  out.vehicle = free;
  return out;
}

/// Nothing between the robot and what moves under it.
Base readRigid(Section&) {
  Base out;
  out.vehicle = ModalModel{Eigen::MatrixXd(6, 0), {}, {}};
  return out;
}

/// A kind of base, by the key that says so.
struct BaseKind {
  std::string_view key;
  Base (*read)(Section& s);
};
constexpr BaseKind kBases[] = {{"arm", readArmBase},
                               {"free", readFree},
                               {"modes", readModes},
                               {"mass", readMatrices},
                               {"mass_diagonal", readMatrices},
                               {"ground", readRigid}};

}  // namespace

Base readBase(Section s) {
  const BaseKind* kind = std::find_if(std::begin(kBases), std::end(kBases),
                                      [&](const BaseKind& one) { return s.has(one.key); });
  if (kind == std::end(kBases)) {
    std::vector<std::string_view> keys;
    for (const BaseKind& one : kBases) keys.push_back(one.key);
    s.fail("mass", fmt::format("missing, want one of {}", fmt::join(keys, ", ")));
  }
  for (const BaseKind& other : kBases)
    if (other.key != "ground" && other.read != kind->read && s.has(other.key))
      s.fail(std::string(other.key),
             fmt::format("stands beside {}, want a base of one kind{}", kind->key, kBefore));
  Base out = kind->read(s);
  if (s.has("ground")) {
    if (kind->key == "free")
      s.fail("ground", "the vehicle floats, want a ground under modes, an arm, or alone");
    out.vehicle.ground = readGround(s.section("ground"));
  }
  if (s.has("weight") && s.choice("weight", {"removed", "felt"}) == "felt") {
    if (linearised(out.vehicle).stiffness.size() == 0 || kind->key == "free")
      s.fail("weight", "felt, and there are no springs to give way, want modes or removed");
    out.feels_weight = true;
  }
  s.finish();
  return out;
}

Base loadBase(const std::filesystem::path& file, const std::vector<std::string>& overrides) {
  Value document = loadDocument(file);
  for (const std::string& assignment : overrides) applyOverride(document, assignment);
  return readBase(Section(document, ""));
}

PublishedArm loadPublished(const std::filesystem::path& file) {
  const Value document = loadDocument(file);
  Section root(document, "");
  const Base base = readBase(root.section("base"));
  if (!base.arm) root.fail("base", "want one that is an arm");
  PublishedArm out{*base.arm, {}};
  for (Section row : root.list("rows")) {
    PublishedFrequencies published;
    published.name = row.text("name");
    published.payload_P = readBody(row.section("payload"));
    published.frequency = row.vector("frequency_hz", 6, 0.0, 1e4);
    row.finish();
    out.rows.push_back(published);
  }
  root.finish();
  return out;
}

std::filesystem::path findBase(const std::string& base, const std::filesystem::path& config) {
  return findFile("base", base, config / "bases");
}

}  // namespace ves
