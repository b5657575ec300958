// SPDX-License-Identifier: BSD-3-Clause
#include "ves/page/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "mesh.hpp"
#include "ves/control/safety_checks.hpp"
#include "ves/core/coordinates.hpp"
#include "ves/core/errors.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/math/dense.hpp"
#include "ves/page/curves.hpp"
#include "ves/page/page.hpp"

namespace ves {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kLinkRadius = 0.035;   // [m] of what has no shape in its description
constexpr double kPlate = 0.02;         // [m] thickness
constexpr double kRodRadius = 0.018;    // [m]
constexpr double kArmRadius = 0.12;     // [m]
constexpr double kShortestLink = 1e-3;  // [m] worth drawing

Json json(const Vec3& p) { return {p.x(), p.y(), p.z()}; }

/// 0xRRGGBB, as the page takes colours; never 0, which stands for none.
int number(const Vec3& colour) {
  int out = 0;
  for (const double c : colour) out = out * 256 + static_cast<int>(std::lround(255.0 * c));
  return std::max(out, 1);
}

/// Of the report's platform, to which the sizes above belong.
constexpr double kJointRadius = 0.55;  // [m]

Json capsule(const std::string& frame, const Vec3& from, const Vec3& to, double radius) {
  return {{"kind", "capsule"},
          {"frame", frame},
          {"from", json(from)},
          {"to", json(to)},
          {"radius", radius}};
}

/// A plate at the joints' mean height, its corners in their order around it, and a post to each
/// joint that is off it.
void addPlate(Json& shapes, const std::string& frame, std::array<Vec3, kLegs> joints, double size) {
  Vec3 middle = Vec3::Zero();
  for (const Vec3& p : joints) middle += p / kLegs;
  std::sort(joints.begin(), joints.end(), [&](const Vec3& a, const Vec3& b) {
    return std::atan2(a.y() - middle.y(), a.x() - middle.x()) <
           std::atan2(b.y() - middle.y(), b.x() - middle.x());
  });
  Json points = Json::array();
  for (const Vec3& p : joints) points.push_back({p.x(), p.y()});
  shapes.push_back({{"kind", "plate"},
                    {"frame", frame},
                    {"corners", points},
                    {"top", middle.z()},
                    {"thickness", kPlate * size}});
  for (const Vec3& p : joints)
    if (std::abs(p.z() - middle.z()) > kPlate * size * 0.1)
      shapes.push_back({{"kind", "cylinder"},
                        {"frame", frame},
                        {"from", {p.x(), p.y(), middle.z()}},
                        {"length", p.z() - middle.z()},
                        {"radius", kRodRadius * size}});
}

std::string linkFrame(int i) { return fmt::format("link{}", i + 1); }

}  // namespace

Scene::Scene(const Experiment& e)
    : geometry_(e.plant.geometry),
      size_(jointRadius(geometry_) / kJointRadius),
      payload_(e.plant.payload),
      arm_(e.arm.value_or(ArmShape())),
      Phi_(linearised(e.controller.vehicle).Phi),
      flies_(e.controller.moving_frame.enabled) {
  if (e.robot.tool()) tool_ = *e.robot.tool();
  description_ = {{"name", e.name},
                  {"description", e.description},
                  {"home", geometry_.home_height},
                  {"size", size_},
                  {"reach", 0.0},
                  {"frames", Json::array()},
                  {"shapes", Json::array()}};
  Json& shapes = description_["shapes"];
  addFrame("platform", "");
  addFrame("base", "");  // where the base in free space would be
  addPlate(shapes, "", geometry_.p_IBi_I, size_);
  addPlate(shapes, "platform", geometry_.p_PPi_P, size_);
  const double length = e.plant.actuator.length_min;
  description_["legs"] = Json::array();
  for (int i = 0; i < kLegs; ++i) {
    const auto at = static_cast<std::size_t>(i);
    description_["legs"].push_back({json(geometry_.p_IBi_I[at]), json(geometry_.p_PPi_P[at])});
    shapes.push_back({{"kind", "cylinder"},
                      {"frame", fmt::format("leg{}", i + 1)},
                      {"length", 0.85 * length},
                      {"radius", 2.0 * kRodRadius * size_},
                      {"leg", i}});
    shapes.push_back({{"kind", "cylinder"},
                      {"frame", fmt::format("rod{}", i + 1)},
                      {"length", -length},
                      {"radius", kRodRadius * size_},
                      {"leg", i}});
  }
  shapes.push_back({{"kind", "cylinder"},
                    {"frame", "platform"},
                    {"radius", 0.08 * carriedSize()},
                    {"length", payload_.X_PS.p.z()}});
  if (!e.robot.frames.empty()) addRobot(e.robot);
  if (flies_) addEmulated();
  if (e.plant.task.world) addWorld(e.plant.task.world->environment);
  addArm();

  const auto add = [&](std::string name, auto value) {
    scalars_.push_back({std::move(name), value});
  };
  add("t_s", [](const Row& r) { return r.t; });
  add("phase", [](const Row& r) { return static_cast<double>(r.state.phase); });
  add("segment", [](const Row& r) { return static_cast<double>(r.state.segment); });
  add("kind", [](const Row& r) { return static_cast<double>(r.state.kind); });
  add("cause", [](const Row& r) { return static_cast<double>(r.state.cause); });
  const Program& program = e.controller.program;
  const bool waits = calibrates(program);
  for (int i = 0; i < 3; ++i)
    add(fmt::format("{}_dynamic", wrenchComponent(i).name), [i, waits](const Row& r) {
      if (!calibrated(r.state) && waits) return static_cast<double>(NAN);
      const Vec3 f_E = Vec3::Map(r.state.dynamic);
      return (laboratoryOf(r.state).E_H.X.R.transpose() * f_E)(i);
    });
  if (flies_) {
    add("flown", [](const Row& r) { return emulatedPose(r.state).p.norm(); });
    add("turns_at", [](const Row& r) {
      const Pose x = Pose::from(Vec6::Map(r.state.x));
      const BodyMotion shown = bodyMotion(Vec3::Zero(), x, Vec6::Map(r.state.x_dot), Vec6::Zero());
      return composed(laboratoryOf(r.state).E_H, shown).w.norm() / kDegree;
    });
  }
  const SafetyLimits limits = e.controller.safety;
  for (int i = 0; i < kLegs; ++i)  // 1 in the middle of the stroke, 0 at a limit
    add(fmt::format("leg{}_margin", i + 1), [i, limits](const Row& r) {
      const double half = 0.5 * (limits.leg_max - limits.leg_min);
      return std::min(r.state.leg_measured[i] - limits.leg_min,
                      limits.leg_max - r.state.leg_measured[i]) /
             half;
    });
  if (e.plant.task.world)
    for (int i = 0; i < 6; ++i)
      add(fmt::format("{}_contact", wrenchComponent(i).name),
          [i](const Row& r) { return r.has_truth ? r.truth.contact[i] : NAN; });
  // A push while it lasts, NaN else; where it is in the frame of what is pushed.
  const auto addPush = [&](std::string name, auto value) {
    add(std::move(name), [value](const Row& r) {
      return r.has_truth && pushed(r.truth) ? static_cast<double>(value(r.truth)) : NAN;
    });
  };
  addPush("push_on", [](const truth_t& m) { return m.push_on; });
  addPush("push_link", [](const truth_t& m) { return m.push_link; });
  for (int i = 0; i < 3; ++i) {
    addPush(fmt::format("push_{}", coordinate(i).name),
            [i](const truth_t& m) { return m.push_point[i]; });
    addPush(fmt::format("push_f{}", coordinate(i).name),
            [i](const truth_t& m) { return m.push_force[i]; });
  }
  addPropulsion(e.controller.vehicle);
  description_["emulates"] = wantsAdmittance(program);
  description_["floats"] = std::holds_alternative<FreeBodyModel>(e.controller.vehicle.kind);
  description_["simulated"] = e.machine.simulated();
  description_["target"] = target_.has_value();

  Json names = Json::array(), phases = Json::array(), segments = Json::array(),
       kinds = Json::array(), checks = Json::array();
  for (const Scalar& scalar : scalars_) names.push_back(scalar.name);
  for (int i = 0; i <= static_cast<int>(Phase::kStopping); ++i)
    phases.push_back(name(static_cast<Phase>(i)));
  for (int i = 0; i < e.controller.program.size; ++i)
    segments.push_back(name(e.controller.program.segments[static_cast<std::size_t>(i)].kind));
  for (int i = 0; i < static_cast<int>(SegmentKind::kCount); ++i)
    kinds.push_back(name(static_cast<SegmentKind>(i)));
  for (int i = 0; i < static_cast<int>(Check::kCount); ++i)
    checks.push_back(name(static_cast<Check>(i)));
  description_["scalars"] = names;
  description_["phases"] = phases;
  description_["segments"] = segments;
  description_["kinds"] = kinds;
  description_["checks"] = checks;
}

/// Thrusters where they are, from the platform, their forces, and which are on; wheels, which have
/// no place, about the vehicle's centre, and what they have taken.
void Scene::addPropulsion(const VehicleModel& vehicle) {
  const Propulsion propulsion = propulsionOf(vehicle);
  description_["thrusters"] = description_["wheels"] = Json::array();
  if (!propulsion.any()) return;
  for (int i = 0; i < propulsion.size; ++i) {
    const Thruster& one = propulsion.thrusters[static_cast<std::size_t>(i)];
    description_["thrusters"].push_back({{"at", json(one.p_PoT_P)}, {"force", json(one.force_P)}});
  }
  scalars_.push_back(
      {"thrusters_on", [](const Row& r) { return static_cast<double>(r.state.thrusters_on); }});
  for (int i = 0; i < propulsion.wheel_count; ++i) {
    const ReactionWheel wheel = propulsion.wheels[static_cast<std::size_t>(i)];
    double most = 0.0;
    for (int k = 0; k < wheel.size; ++k)
      most = std::max(
          most, std::abs(wheel.momentum(wheel.torques[static_cast<std::size_t>(k)].on.until)));
    description_["wheels"].push_back(
        {{"at", json(std::get<FreeBodyModel>(vehicle.kind).body_P.p_BoBcm_B)},
         {"axis", json(wheel.axis_P)},
         {"most", most}});
    scalars_.push_back({fmt::format("wheel{}_momentum", i),
                        [wheel](const Row& r) { return wheel.momentum(r.state.vehicle_time); }});
  }
}

/// The frame in which the vehicle is emulated, as the laboratory flies through it; and its axes
/// where they can be seen.
void Scene::addEmulated() {
  addFrame("emulated", "");
  addFrame("compass", "");
  description_["shapes"].push_back({{"kind", "axes"}, {"frame", "compass"}, {"size", 0.3 * size_}});
}

Vec3 Scene::compass() const { return Vec3(-1.1 * size_, 0.0, geometry_.home_height); }

void Scene::addFrame(const std::string& name, const std::string& parent) {
  frames_.push_back(name);
  description_["frames"].push_back({{"name", name}, {"parent", parent}});
}

/// What its description shows; of links without, capsules from joint to joint and to the tool.
void Scene::addRobot(const UrdfRobot& description) {
  const RobotModel& robot = payload_.robot;
  const double carried = carriedSize(), radius = kLinkRadius * carried;
  Json& shapes = description_["shapes"];
  const Transform X_PL0 = payload_.X_PL0();
  shapes.push_back({{"kind", "cylinder"},
                    {"frame", "platform"},
                    {"from", json(payload_.X_PR.p)},
                    {"length", X_PL0.p.z() - payload_.X_PR.p.z()},
                    {"radius", 0.2 * carried}});
  for (int i = 0; i < robot.size; ++i) addFrame(linkFrame(i), "platform");
  const std::set<int> seen = addVisuals(description);
  for (int i = 0; i < robot.size; ++i) {
    const Link& link = robot.link(i);
    const Vec3 joint = link.X_parent.p;
    if (!(joint.norm() > kShortestLink) || seen.count(link.parent)) continue;
    if (link.parent < 0)
      shapes.push_back(capsule("platform", X_PL0.p, X_PL0 * joint, radius));
    else
      shapes.push_back(capsule(linkFrame(link.parent), Vec3::Zero(), joint, radius));
  }
  double reach = tool_ ? tool_->X_link.p.norm() : 0.0;
  for (int i = 0; i < robot.size; ++i) reach += robot.link(i).X_parent.p.norm();
  description_["reach"] = reach;
  if (!tool_) return;
  addFrame("tool", "platform");
  if (tool_->link >= 0 && !seen.count(tool_->link) && tool_->X_link.p.norm() > kShortestLink)
    shapes.push_back(capsule(linkFrame(tool_->link), Vec3::Zero(), tool_->X_link.p, radius));
  shapes.push_back({{"kind", "axes"}, {"frame", "tool"}, {"size", 0.15 * carried}});
}

/// A shape a material; `shape` has its place.
void Scene::addMesh(const std::filesystem::path& file, const Visual& visual, Json shape) {
  constexpr double kLarge = 100.0;  // [m]
  double size = 0.0;
  for (const MeshPart& part : readMesh(file)) {
    std::vector<float> corners;
    for (const Vec3& corner : part.corners) {
      const Vec3 p = corner.cwiseProduct(visual.size);
      size = std::max(size, p.cwiseAbs().maxCoeff());
      for (const double x : p) corners.push_back(static_cast<float>(x));
    }
    shape["kind"] = "mesh";
    shape["triangles"] = base64(corners);
    if (!visual.colour && part.colour) shape["colour"] = number(*part.colour);
    description_["shapes"].push_back(shape);
  }
  if (size > kLarge)
    warnings_.push_back(fmt::format(
        "{}: reaches {:.4g} m: is it in mm (scale=\"0.001 0.001 0.001\")?", file.string(), size));
}

/// Returns the links that are drawn: -1 is link 0.
std::set<int> Scene::addVisuals(const UrdfRobot& description) {
  std::set<int> seen;
  const std::filesystem::path folder = std::filesystem::path(description.file).parent_path();
  for (const Visual& visual : description.visuals) {
    const NamedFrame& frame = description.frames[static_cast<std::size_t>(visual.frame)];
    const Transform X =
        (frame.link < 0 ? payload_.X_PL0() : Transform()) * frame.X_link * visual.X_frame;
    const Eigen::Quaterniond q(X.R);
    Json shape = {{"kind", ""},
                  {"frame", frame.link < 0 ? "platform" : linkFrame(frame.link)},
                  {"position", json(X.p)},
                  {"quaternion", {q.x(), q.y(), q.z(), q.w()}}};
    if (visual.colour) shape["colour"] = number(*visual.colour);
    switch (visual.kind) {
      case Visual::Kind::kBox:
        shape["kind"] = "box";
        shape["size"] = json(visual.size);
        break;
      case Visual::Kind::kCylinder:
        shape["kind"] = "rod";
        shape["radius"] = visual.size(0);
        shape["length"] = visual.size(1);
        break;
      case Visual::Kind::kSphere:
        shape["kind"] = "sphere";
        shape["radius"] = visual.size(0);
        break;
      case Visual::Kind::kCapsule: {
        const Vec3 half = 0.5 * visual.size(1) * Vec3::UnitZ();
        Json drawn = capsule(shape["frame"], X * Vec3(-half), X * half, visual.size(0));
        if (visual.colour) drawn["colour"] = number(*visual.colour);
        shape = drawn;
        break;
      }
      case Visual::Kind::kMesh: {
        const std::filesystem::path file = findMesh(visual.mesh, folder);
        if (file.empty()) {
          warnings_.push_back(
              fmt::format("{}: not found, its link is drawn as a line", visual.mesh));
          continue;
        }
        try {
          addMesh(file, visual, shape);
        } catch (const InputError& error) {
          warnings_.push_back(error.what());
          continue;
        }
        seen.insert(frame.link);
        continue;
      }
    }
    description_["shapes"].push_back(shape);
    seen.insert(frame.link);
  }
  return seen;
}

/// What the tool may touch. Of a half space a part of its surface.
void Scene::addWorld(const Environment& environment) {
  constexpr double kShown = 0.4, kThick = 0.01;  // [m]
  Json& shapes = description_["shapes"];
  const auto add = [&](const std::string& frame, const Transform& X, const Shape& shape) {
    const auto put = [&](Json one, const Vec3& p_BQ_B) {
      const Eigen::Quaterniond q(X.R);
      one["frame"] = frame;
      one["position"] = json(X * p_BQ_B);
      one["quaternion"] = {q.x(), q.y(), q.z(), q.w()};
      one["world"] = true;
      shapes.push_back(one);
    };
    const auto box = [&](const Vec3& size, const Vec3& at) {
      put({{"kind", "box"}, {"size", json(size)}}, at);
    };
    if (const Ball* ball = std::get_if<Ball>(&shape)) {
      put({{"kind", "sphere"}, {"radius", ball->radius}}, Vec3::Zero());
    } else if (const Box* block = std::get_if<Box>(&shape)) {
      box(block->size, Vec3::Zero());
    } else if (const Socket* socket = std::get_if<Socket>(&shape)) {
      // Four boards around the hole, and its floor.
      const double r = socket->radius + socket->chamfer, w = 0.5 * kShown - r;
      for (const double side : {-1.0, 1.0}) {
        box({w, kShown, kThick}, {side * (r + 0.5 * w), 0.0, -0.5 * kThick});
        box({2.0 * r, w, kThick}, {0.0, side * (r + 0.5 * w), -0.5 * kThick});
      }
      box({2.0 * r, 2.0 * r, kThick}, {0.0, 0.0, -socket->depth - 0.5 * kThick});
    } else {
      box({kShown, kShown, kThick}, {0.0, 0.0, -0.5 * kThick});
    }
  };
  for (const FixedBody& body : environment.bodies)
    add(flies_ ? "emulated" : "", body.X_IB, body.shape);
  if (!environment.target) return;
  target_ = environment.target->start;
  addFrame("target", flies_ ? "emulated" : "");
  add("target", Transform(), environment.target->shape);
}

void Scene::addArm() {
  Json points = Json::array();
  const Transform X_IP = geometry_.fromHome(Pose());
  for (const Vec3& p : arm_.points) points.push_back(json(X_IP * p));
  description_["arm"] = points;
  description_["arm_radius"] = kArmRadius * size_;
}

std::vector<float> Scene::picture(const Row& row, const std::optional<Vec6>& base) const {
  std::vector<float> out;
  out.reserve(width());
  const auto put = [&](const Transform& X) {
    const Eigen::Quaterniond q(X.R);
    for (const double x : {X.p.x(), X.p.y(), X.p.z(), q.x(), q.y(), q.z(), q.w()})
      out.push_back(static_cast<float>(x));
  };
  // Where nobody knows the truth, what is measured.
  const Vec6 x =
      row.hasTruePose() ? Vec6(Vec6::Map(row.truth.x)) : Vec6(Vec6::Map(row.state.x_measured));
  const JointVector q = row.has_truth    ? JointVector(JointVector::Map(row.truth.q))
                        : row.has_sample ? JointVector(JointVector::Map(row.sample.q))
                                         : JointVector(JointVector::Constant(NAN));
  const Transform X_IP = geometry_.fromHome(Pose::from(x));
  put(X_IP);
  if (base)
    put(geometry_.fromHome(Pose::from(*base)));
  else
    out.insert(out.end(), 7, NAN);
  const LinkPoses X_L0L = linkPoses(payload_.robot, q);
  const Transform X_PL0 = payload_.X_PL0();
  for (int i = 0; i < payload_.robot.size; ++i) put(X_PL0 * X_L0L[i]);
  if (tool_) put(X_PL0 * tool_->pose(X_L0L));
  if (flies_) {
    const Vec3 home = geometry_.home();
    const Transform X_HE = inverse(laboratoryOf(row.state).at(row.state.machine_time_ns).X);
    put({X_HE.R, home + X_HE.p - X_HE.R * home});
    put({X_HE.R, compass()});
  }
  if (target_ && row.has_truth) {
    Floating target;
    target.p = Vec3::Map(row.truth.target_p);
    target.q.coeffs() = Eigen::Vector4d::Map(row.truth.target_q);
    put(target.X_IB());
  } else if (target_) {
    put(target_->X_IB());
  }
  if (!arm_.points.empty()) {  // bent as the tip is moved
    const Eigen::VectorXd eta = leastSquares(Phi_, x);
    const Mat3 R_IP = geometry_.fromHome(Pose()).R;
    for (const Eigen::Matrix3Xd& displacement : arm_.displacements) {
      const Vec3 u = R_IP * (displacement * eta);
      for (const double c : {u.x(), u.y(), u.z()}) out.push_back(static_cast<float>(c));
    }
  }
  for (const Scalar& scalar : scalars_) out.push_back(static_cast<float>(scalar.value(row)));
  return out;
}

nlohmann::ordered_json recording(const Series& series, double rate,
                                 std::vector<std::string>& warnings) {
  const Scene scene(series.experiment);
  warnings.insert(warnings.end(), scene.warnings().begin(), scene.warnings().end());
  const std::optional<Emulation> emulated = emulation(series);
  const BasePoses base = emulated ? basePoses(series, emulated->base) : BasePoses();
  std::vector<float> numbers;
  double next = -HUGE_VAL;
  for (const Row& row : series.rows) {
    if (row.t < next - 0.5e-9) continue;
    next = row.t + 1.0 / rate;
    const std::vector<float> one = scene.picture(row, at(base, row.state));
    numbers.insert(numbers.end(), one.begin(), one.end());
  }
  Json out = {{"scene", scene.description()}, {"width", scene.width()}};
  out["pictures"] = base64(numbers);
  out["columns"] = recordedCurves(series, base);
  return out;
}

}  // namespace ves
