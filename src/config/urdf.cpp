// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/urdf.hpp"

#include <console_bridge/console.h>
#include <fmt/format.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>
#include <cmath>
#include <mutex>

#include "ves/config/document.hpp"
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

class Loader {
 public:
  Loader(const std::string& text, const std::string& file) : text_(text), file_(file) {}

  UrdfRobot load() {
    const urdf::ModelInterfaceSharedPtr urdf = parse();
    const urdf::Link* link = urdf->getRoot().get();
    addBody(*link, Transform{});
    Transform X_body_link;  // of a fixed link in the body that carries it
    while (!link->child_joints.empty()) {
      if (link->child_joints.size() > 1)
        refuse("link", link->name,
               fmt::format("carries {} joints, want a serial arm without branches",
                           link->child_joints.size()));
      const urdf::Joint& joint = *link->child_joints.front();
      const Transform X_body_joint =
          X_body_link * toTransform(joint.parent_to_joint_origin_transform);
      if (!(X_body_joint.p.cwiseAbs().maxCoeff() <= kMaxLength) || !X_body_joint.p.allFinite() ||
          !X_body_joint.R.allFinite())
        refuse("joint", joint.name,
               fmt::format("its origin, want numbers within {} m", kMaxLength));
      link = urdf->getLink(joint.child_link_name).get();
      if (joint.type == urdf::Joint::FIXED) {
        X_body_link = X_body_joint;
      } else {
        addJoint(joint, X_body_joint);
        X_body_link = {};
      }
      addBody(*link, X_body_link);
    }
    return std::move(robot_);
  }

 private:
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

  void addJoint(const urdf::Joint& joint, const Transform& X_parent) {
    if (robot_.model.joints == kMaxJoints)
      refuse("joint", joint.name, fmt::format("one too many, at most {} may move", kMaxJoints));
    Link link;
    switch (joint.type) {
      case urdf::Joint::REVOLUTE:
      case urdf::Joint::CONTINUOUS: link.type = JointType::kRevolute; break;
      case urdf::Joint::PRISMATIC: link.type = JointType::kPrismatic; break;
      default:
        refuse("joint", joint.name,
               "its type is not supported, want revolute, continuous, prismatic or fixed");
    }
    const Vec3 axis(joint.axis.x, joint.axis.y, joint.axis.z);
    if (!(axis.norm() > 1e-6) || !axis.allFinite())
      refuse("joint", joint.name, "its axis has no direction");
    link.axis = axis.normalized();
    link.X_parent = X_parent;
    link.lower = -HUGE_VAL;
    link.upper = HUGE_VAL;
    if (joint.limits && joint.type != urdf::Joint::CONTINUOUS) {
      link.lower = joint.limits->lower;
      link.upper = joint.limits->upper;
      if (!(link.lower <= link.upper))
        refuse("joint", joint.name,
               fmt::format("limits [{}, {}], want lower <= upper", link.lower, link.upper));
    }
    robot_.model.links[static_cast<std::size_t>(robot_.model.joints++)] = link;
    robot_.joint_names.push_back(joint.name);
  }

  /// Adds a link's body to the last moving link (or the base).
  void addBody(const urdf::Link& link, const Transform& X_body_link) {
    const bool fixed = !link.parent_joint || link.parent_joint->type == urdf::Joint::FIXED;
    if (!link.inertial) {
      if (fixed) return;
      refuse("link", link.name, "has no inertial element, and its joint moves");
    }
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
    if (principal(0) < -1e-12 * std::abs(principal(2)))
      refuse("link", link.name,
             fmt::format("principal moment of inertia {}, want at least 0", principal(0)));
    if (principal(2) > (principal(0) + principal(1)) * (1.0 + 1e-9))
      robot_.warnings.push_back(fmt::format(
          "{}:{}: link '{}': principal moments {:.4g}, {:.4g}, {:.4g} kg m^2: no rigid body has "
          "one "
          "larger than the sum of the others; used as given",
          file_, lineOf("link", link.name), link.name, principal(0), principal(1), principal(2)));
    RobotModel& model = robot_.model;
    RigidBody& carrier = model.joints == 0
                             ? model.base
                             : model.links[static_cast<std::size_t>(model.joints - 1)].body;
    carrier = combine(carrier, X_body_link, body);
  }

  [[noreturn]] void refuse(const char* element, const std::string& name,
                           const std::string& what) const {
    throw InputError(
        fmt::format("{}:{}: {} '{}': {}", file_, lineOf(element, name), element, name, what));
  }

  /// Line of <element name="name">; urdfdom keeps no positions.
  int lineOf(const std::string& element, const std::string& name) const {
    for (std::size_t at = 0; (at = text_.find("<" + element, at)) != std::string::npos; ++at)
      if (text_.substr(at, text_.find('>', at) - at).find("\"" + name + "\"") != std::string::npos)
        return lineAt(at);
    return 1;
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

  const std::string& text_;
  const std::string& file_;
  UrdfRobot robot_;
};

}  // namespace

UrdfRobot loadUrdf(const std::string& text, const std::string& file) {
  return Loader(text, file).load();
}

}  // namespace ves
