// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/urdf.hpp"

#include <console_bridge/console.h>
#include <fmt/format.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <mutex>

#include "ves/math/dense.hpp"

namespace ves {
namespace {

/// Keeps what urdfdom would print; one at a time, as it prints through one place.
class Messages : public console_bridge::OutputHandler {
 public:
  Messages() : alone_(place()) { console_bridge::useOutputHandler(this); }
  ~Messages() override { console_bridge::restorePreviousOutputHandler(); }
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR && first.empty()) first = text;
  }
  std::string first;

 private:
  static std::mutex& place() {
    static std::mutex mutex;
    return mutex;
  }
  std::lock_guard<std::mutex> alone_;
};

Transform toTransform(const urdf::Pose& pose) {
  const urdf::Rotation& q = pose.rotation;
  return {Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized().toRotationMatrix(),
          {pose.position.x, pose.position.y, pose.position.z}};
}

constexpr std::size_t kMaxElement = 8192;  // [B]
constexpr int kMaxElementDepth = 64;       // [-]
constexpr double kMaxLength = 1e3;         // [m]
constexpr double kMaxMass = 1e6;           // [kg]
constexpr double kMaxInertia = 1e9;        // [kg m^2]
constexpr double kNoInertia = 1e-6;        // [kg m^2] whose sign does not matter
constexpr double kMaxRatio = 1e3;          // [-] of a joint that follows

}  // namespace

class UrdfTree::Impl {
 public:
  Impl(const std::string& text, const std::string& file) : text_(text), file_(file) {
    urdf_ = parse();
    const std::map<std::string, std::size_t> places = placesOfJoints();
    const auto place = [&](const urdf::JointSharedPtr& joint) {
      const auto at = places.find(joint->name);
      return at == places.end() ? 0 : at->second;
    };
    // Depth first, a link's joints as they stand in the file.
    std::vector<const urdf::Link*> open = {urdf_->getRoot().get()};
    while (!open.empty()) {
      const urdf::Link& link = *open.back();
      open.pop_back();
      links_.push_back(&link);
      if (link.parent_joint) addJoint(*link.parent_joint);
      std::vector<urdf::JointSharedPtr> below = link.child_joints;
      std::sort(below.begin(), below.end(),
                [&](const auto& x, const auto& y) { return place(x) > place(y); });
      for (const urdf::JointSharedPtr& joint : below)
        open.push_back(urdf_->getLink(joint->child_link_name).get());
    }
    for (Joint& joint : joints_) resolve(joint);
  }

  const std::vector<Joint>& joints() const { return joints_; }

  const Joint* find(const std::string& name) const {
    const auto at = index_.find(name);
    return at == index_.end() ? nullptr : &joints_[at->second];
  }

  const urdf::Link* link(const std::string& name) const { return urdf_->getLink(name).get(); }

  UrdfRobot robot(const std::set<std::string>& moving,
                  const std::map<std::string, double>& held) const {
    UrdfRobot out;
    RobotModel& model = out.model;
    struct Carried {
      int link = -1;  // of the model
      Transform X;    // in it
    };
    std::map<const urdf::Link*, Carried> carried;
    std::map<const urdf::Link*, int> frames;  // index of its own
    out.fastest.setConstant(HUGE_VAL);
    for (const Joint& joint : joints_) {
      if (!joint.follows.empty() || !moving.count(joint.name)) continue;
      const auto i = std::ssize(out.joint_names);
      if (i < kMaxJoints) out.fastest(i) = joint.fastest;
      out.joint_names.push_back(joint.name);
    }
    for (const urdf::Link* link : links_) {
      Carried here;
      bool moves = false;
      if (link->parent_joint) {
        const urdf::Joint& joint = *link->parent_joint;
        here = carried.at(link->getParent().get());
        here.X = here.X * originOf(joint);
        if (const Joint* own = find(joint.name)) {
          Link next = linkOf(joint, *own);
          if (moving.count(own->master())) {
            next.parent = here.link;
            next.X_parent = here.X;
            here = {addTo(out, next, *own), {}};
            moves = true;
          } else {
            const double q = heldAt(*own, held);
            here.X = here.X * linkPose(next, q);
            out.held.push_back(fmt::format("joint '{}' at {:.6g} {}", own->name,
                                           q / jointUnit(own->type), jointUnitName(own->type)));
          }
        }
      }
      const auto parent = link->parent_joint ? frames.at(link->getParent().get()) : -1;
      frames[link] = static_cast<int>(out.frames.size());
      out.frames.push_back(
          {link->name, parent, here.link, here.X, moves ? link->parent_joint->name : ""});
      addVisuals(*link, frames[link], out.visuals);
      carried[link] = here;
      RigidBody& carrier = model.bodyOf(here.link);
      if (!link->inertial) {
        if (moves)
          out.warnings.push_back(fmt::format("{}:{}: link '{}' moves and has no mass", file_,
                                             lineOf("link", link->name), link->name));
        continue;
      }
      carrier = combine(carrier, here.X, bodyOf(*link, out.warnings));
    }
    return out;
  }

 private:
  static Transform originOf(const urdf::Joint& joint) {
    return toTransform(joint.parent_to_joint_origin_transform);
  }

  /// What makes the XML parser slow or lets it run out of stack.
  void requireReasonable() const {
    int depth = 0;
    for (std::size_t at = 0; (at = text_.find('<', at)) != std::string::npos;) {
      const std::size_t end = std::min(text_.find('>', at), text_.size());
      if (end - at > kMaxElement)
        throw InputError(fmt::format("{}:{}: an element of {} bytes, want at most {}", file_,
                                     lineAt(at), end - at, kMaxElement));
      const char first = at + 1 < text_.size() ? text_[at + 1] : '>';
      if (first == '/')
        --depth;
      else if (first != '?' && first != '!' && text_[end - 1] != '/' && ++depth > kMaxElementDepth)
        throw InputError(fmt::format("{}:{}: elements nested deeper than {}", file_, lineAt(at),
                                     kMaxElementDepth));
      at = end;
    }
  }

  urdf::ModelInterfaceSharedPtr parse() const {
    requireReasonable();
    Messages messages;
    urdf::ModelInterfaceSharedPtr urdf;
    try {
      urdf = urdf::parseURDF(text_);
    } catch (const std::exception& error) {
      messages.first = error.what();
    }
    // urdfdom goes on with zeros after some errors; an error is an error.
    if (urdf && messages.first.empty() && urdf->getRoot()) return urdf;
    std::string what = messages.first.empty() ? "has no root link" : messages.first;
    std::replace(what.begin(), what.end(), '\n', ' ');
    throw InputError(fmt::format("{}:{}: not a usable URDF: {}", file_, lineOfQuoted(what), what));
  }

  void addJoint(const urdf::Joint& joint) {
    const Transform X = originOf(joint);
    if (!(X.p.cwiseAbs().maxCoeff() <= kMaxLength) || !X.p.allFinite() || !X.R.allFinite())
      refuse("joint", joint.name, fmt::format("its origin, want numbers within {} m", kMaxLength));
    if (joint.type == urdf::Joint::FIXED) return;
    Joint own;
    own.name = joint.name;
    switch (joint.type) {
      case urdf::Joint::REVOLUTE:
      case urdf::Joint::CONTINUOUS: own.type = JointType::kRevolute; break;
      case urdf::Joint::PRISMATIC: own.type = JointType::kPrismatic; break;
      default:
        refuse("joint", joint.name,
               "its type is not supported, want revolute, continuous, prismatic or fixed");
    }
    const Vec3 axis(joint.axis.x, joint.axis.y, joint.axis.z);
    if (!(axis.norm() > 1e-6) || !axis.allFinite())
      refuse("joint", joint.name, "its axis has no direction");
    own.lower = -HUGE_VAL;
    own.upper = HUGE_VAL;
    // Zero stands for a speed that nobody has filled in.
    if (joint.limits && joint.limits->velocity > 0.0) own.fastest = joint.limits->velocity;
    if (joint.limits && joint.type != urdf::Joint::CONTINUOUS) {
      own.lower = joint.limits->lower;
      own.upper = joint.limits->upper;
      if (!(own.lower <= own.upper))
        refuse("joint", joint.name,
               fmt::format("limits [{}, {}], want lower <= upper", own.lower, own.upper));
    }
    if (joint.mimic) {
      own.follows = joint.mimic->joint_name;
      own.ratio = joint.mimic->multiplier;
      own.offset = joint.mimic->offset;
      if (!std::isfinite(own.ratio) || !(std::abs(own.ratio) <= kMaxRatio) ||
          !std::isfinite(own.offset) || !(std::abs(own.offset) <= kMaxLength))
        refuse("joint", joint.name,
               fmt::format("follows by {} and {}, want numbers within {} and {}", own.ratio,
                           own.offset, kMaxRatio, kMaxLength));
    }
    index_[own.name] = joints_.size();
    joints_.push_back(own);
  }

  /// Whom a joint follows at the end, when it follows one that follows.
  void resolve(Joint& joint) const {
    for (std::size_t steps = 0; !joint.follows.empty(); ++steps) {
      const Joint* master = find(joint.follows);
      if (!master)
        refuse("joint", joint.name,
               fmt::format("follows '{}', which is no joint that moves", joint.follows));
      if (steps > joints_.size()) refuse("joint", joint.name, "follows itself");
      if (master->follows.empty()) return;
      joint.follows = master->follows;
      joint.offset += joint.ratio * master->offset;
      joint.ratio *= master->ratio;
    }
  }

  Link linkOf(const urdf::Joint& joint, const Joint& own) const {
    Link link;
    link.type = own.type;
    link.axis = Vec3(joint.axis.x, joint.axis.y, joint.axis.z).normalized();
    link.lower = own.lower;
    link.upper = own.upper;
    link.ratio = own.ratio;
    link.offset = own.offset;
    return link;
  }

  /// Returns its index.
  int addTo(UrdfRobot& out, Link link, const Joint& own) const {
    const auto refuseMore = [&](int most) {
      refuse("joint", own.name, fmt::format("one too many, at most {} may move", most));
    };
    if (out.model.size == kMaxLinks) refuseMore(kMaxLinks);
    link.joint =
        static_cast<int>(std::find(out.joint_names.begin(), out.joint_names.end(), own.master()) -
                         out.joint_names.begin());
    if (link.joint >= kMaxJoints) refuseMore(kMaxJoints);
    out.model.add(link, !own.follows.empty());
    return out.model.size - 1;
  }

  double heldAt(const Joint& joint, const std::map<std::string, double>& held) const {
    if (!joint.follows.empty())
      return joint.ratio * heldAt(*find(joint.follows), held) + joint.offset;
    const auto given = held.find(joint.name);
    return given != held.end() ? given->second : std::clamp(0.0, joint.lower, joint.upper);
  }

  /// Nothing for a shape that has no size.
  static std::optional<Visual> visualOf(const urdf::Geometry& geometry, const urdf::Pose& origin,
                                        int frame) {
    Visual out;
    out.frame = frame;
    out.X_frame = toTransform(origin);
    switch (geometry.type) {
      case urdf::Geometry::BOX: {
        const urdf::Vector3& d = static_cast<const urdf::Box&>(geometry).dim;
        out.kind = Visual::Kind::kBox;
        out.size = Vec3(d.x, d.y, d.z);
        break;
      }
      case urdf::Geometry::CYLINDER: {
        const auto& c = static_cast<const urdf::Cylinder&>(geometry);
        out.kind = Visual::Kind::kCylinder;
        out.size = Vec3(c.radius, c.length, 0.0);
        break;
      }
      case urdf::Geometry::SPHERE:
        out.kind = Visual::Kind::kSphere;
        out.size = Vec3(static_cast<const urdf::Sphere&>(geometry).radius, 0.0, 0.0);
        break;
      case urdf::Geometry::MESH: {
        const auto& mesh = static_cast<const urdf::Mesh&>(geometry);
        out.kind = Visual::Kind::kMesh;
        out.size = Vec3(mesh.scale.x, mesh.scale.y, mesh.scale.z);
        out.mesh = mesh.filename;
        break;
      }
    }
    const bool fine = out.size.allFinite() && out.size.cwiseAbs().maxCoeff() <= kMaxLength &&
                      out.size(0) != 0.0 && out.X_frame.p.allFinite() && out.X_frame.R.allFinite();
    return fine ? std::optional(out) : std::nullopt;
  }

  static bool isStl(const urdf::Geometry& geometry) {
    if (geometry.type != urdf::Geometry::MESH) return false;
    std::string name = static_cast<const urdf::Mesh&>(geometry).filename;
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return name.size() > 4 && name.compare(name.size() - 4, 4, ".stl") == 0;
  }

  /// A link's visuals. Where one is a mesh that is no STL, its collision meshes stand for all.
  static void addVisuals(const urdf::Link& link, int frame, std::vector<Visual>& out) {
    const auto add = [&](const urdf::GeometrySharedPtr& geometry, const urdf::Pose& origin) {
      if (const auto visual = visualOf(*geometry, origin, frame)) out.push_back(*visual);
    };
    const auto strange = [](const auto& part) {
      return part->geometry && part->geometry->type == urdf::Geometry::MESH &&
             !isStl(*part->geometry);
    };
    if (std::any_of(link.visual_array.begin(), link.visual_array.end(), strange)) {
      for (const auto& part : link.collision_array)
        if (part->geometry && !strange(part)) add(part->geometry, part->origin);
      return;
    }
    for (const auto& part : link.visual_array)
      if (part->geometry) add(part->geometry, part->origin);
  }

  RigidBody bodyOf(const urdf::Link& link, std::vector<std::string>& warnings) const {
    const urdf::Inertial& in = *link.inertial;
    const Transform X_link_com = toTransform(in.origin);
    RigidBody body;
    body.mass = in.mass;
    body.p_BoBcm_B = X_link_com.p;
    Mat3 I;
    I << in.ixx, in.ixy, in.ixz, in.ixy, in.iyy, in.iyz, in.ixz, in.iyz, in.izz;
    body.I_Bcm_B = X_link_com.R * I * X_link_com.R.transpose();
    if (!(in.mass >= 0.0 && in.mass <= kMaxMass))
      refuse("link", link.name,
             fmt::format("mass {}, want a number in [0, {}]", in.mass, kMaxMass));
    if (!body.p_BoBcm_B.allFinite() || !(body.p_BoBcm_B.cwiseAbs().maxCoeff() <= kMaxLength))
      refuse("link", link.name,
             fmt::format("its centre of mass, want numbers within {} m", kMaxLength));
    if (!I.allFinite() || !(I.cwiseAbs().maxCoeff() <= kMaxInertia))
      refuse("link", link.name,
             fmt::format("its inertia, want numbers within {} kg m^2", kMaxInertia));
    const Vec3 principal = symmetricEigenvalues(I);
    if (principal(0) < -std::max(kNoInertia, 1e-12 * principal(2)))
      refuse("link", link.name,
             fmt::format("principal moment of inertia {}, want at least 0", principal(0)));
    if (principal(2) > (principal(0) + principal(1)) * (1.0 + 1e-9))
      warnings.push_back(fmt::format(
          "{}:{}: link '{}': principal moments {:.4g}, {:.4g}, {:.4g} kg m^2: no rigid body has "
          "one "
          "larger than the sum of the others; used as given",
          file_, lineOf("link", link.name), link.name, principal(0), principal(1), principal(2)));
    return body;
  }

  [[noreturn]] void refuse(const char* element, const std::string& name,
                           const std::string& what) const {
    throw InputError(
        fmt::format("{}:{}: {} '{}': {}", file_, lineOf(element, name), element, name, what));
  }

  /// Line of <element name="name">; urdfdom keeps no positions.
  int lineOf(const std::string& element, const std::string& name) const {
    return lineAt(offsetOf(element, name));
  }
  /// Of every joint's element in the text, by name: urdfdom sorts joints by theirs.
  std::map<std::string, std::size_t> placesOfJoints() const {
    std::map<std::string, std::size_t> out;
    for (std::size_t at = 0; (at = text_.find("<joint", at)) != std::string::npos; ++at) {
      const std::string element = text_.substr(at, text_.find('>', at) - at);
      const std::size_t begin = element.find("name=");
      if (begin == std::string::npos || begin + 6 > element.size()) continue;
      const std::size_t end = element.find(element[begin + 5], begin + 6);
      if (end != std::string::npos) out.emplace(element.substr(begin + 6, end - begin - 6), at);
    }
    return out;
  }
  std::size_t offsetOf(const std::string& element, const std::string& name) const {
    for (std::size_t at = 0; (at = text_.find("<" + element, at)) != std::string::npos; ++at)
      if (text_.substr(at, text_.find('>', at) - at).find("\"" + name + "\"") != std::string::npos)
        return at;
    return 0;
  }

  /// Line of the first name that a message puts between brackets or quotes.
  int lineOfQuoted(const std::string& message) const {
    for (const auto& [open, close] : {std::pair{'[', ']'}, {'\'', '\''}, {'"', '"'}}) {
      const std::size_t begin = message.find(open);
      const std::size_t end = message.find(close, begin + 1);
      if (begin == std::string::npos || end == std::string::npos) continue;
      const std::size_t at = text_.find("\"" + message.substr(begin + 1, end - begin - 1) + "\"");
      if (at != std::string::npos) return lineAt(at);
    }
    return 1;
  }

  int lineAt(std::size_t offset) const {
    return 1 + static_cast<int>(std::count(
                   text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(offset), '\n'));
  }

  const std::string text_, file_;
  urdf::ModelInterfaceSharedPtr urdf_;
  std::vector<const urdf::Link*> links_;  // each behind those that carry it
  std::vector<Joint> joints_;
  std::map<std::string, std::size_t> index_;  // of joints_
};

UrdfTree::UrdfTree(const std::string& text, const std::string& file)
    : impl_(std::make_unique<Impl>(text, file)) {}
UrdfTree::~UrdfTree() = default;

const std::vector<UrdfTree::Joint>& UrdfTree::joints() const { return impl_->joints(); }

const UrdfTree::Joint* UrdfTree::find(const std::string& joint) const { return impl_->find(joint); }

bool UrdfTree::hasLink(const std::string& link) const { return impl_->link(link) != nullptr; }

std::set<std::string> UrdfTree::jointsTo(const std::string& link) const {
  std::set<std::string> out;
  for (const urdf::Link* at = impl_->link(link); at && at->parent_joint; at = at->getParent().get())
    if (const Joint* joint = find(at->parent_joint->name)) out.insert(joint->master());
  return out;
}

UrdfRobot UrdfTree::robot(const std::set<std::string>& moving,
                          const std::map<std::string, double>& held) const {
  return impl_->robot(moving, held);
}

UrdfRobot loadUrdf(const std::string& text, const std::string& file) {
  const UrdfTree tree(text, file);
  std::set<std::string> all;
  for (const UrdfTree::Joint& joint : tree.joints()) all.insert(joint.name);
  return tree.robot(all);
}

}  // namespace ves
