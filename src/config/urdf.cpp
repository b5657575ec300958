// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/urdf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "urdf_file.hpp"

namespace ves {

class UrdfTree::Impl {
 public:
  Impl(const std::string& text, const std::string& file)
      : file_(file), urdf_(readUrdf(text, file)) {
    connect();
    // Depth first, a link's joints as they stand in the file.
    std::vector<const Node*> open = {root()};
    while (!open.empty()) {
      const Node& node = *open.back();
      open.pop_back();
      order_.push_back(&node);
      if (node.joint) addJoint(*node.joint);
      for (auto joint = node.below.rbegin(); joint != node.below.rend(); ++joint)
        open.push_back(&nodes_.at((*joint)->child));
    }
    for (const UrdfJoint& joint : urdf_.joints)
      if (std::none_of(order_.begin(), order_.end(),
                       [&](const Node* n) { return n->joint == &joint; }))
        refuse(joint, fmt::format("is part of a loop: link '{}' carries itself", joint.child));
    for (Joint& joint : joints_) resolve(joint);
  }

  const std::vector<Joint>& joints() const { return joints_; }

  const Joint* find(const std::string& name) const {
    const auto at = std::find_if(joints_.begin(), joints_.end(),
                                 [&](const Joint& joint) { return joint.name == name; });
    return at == joints_.end() ? nullptr : &*at;
  }

  /// The joints that carry a link, the last first; nothing where there is no such link.
  std::optional<std::vector<const UrdfJoint*>> carriers(const std::string& link) const {
    auto at = nodes_.find(link);
    if (at == nodes_.end()) return {};
    std::vector<const UrdfJoint*> out;
    for (; at->second.joint; at = nodes_.find(at->second.joint->parent))
      out.push_back(at->second.joint);
    return out;
  }

  UrdfRobot robot(const std::set<std::string>& moving,
                  const std::map<std::string, double>& held) const {
    UrdfRobot out;
    RobotModel& model = out.model;
    struct Carried {
      int link = -1;  // of the model
      Transform X;    // in it
      int frame = -1;
    };
    std::map<std::string, Carried> carried;
    out.file = file_;
    out.warnings = urdf_.warnings;
    out.fastest.setConstant(HUGE_VAL);
    for (const Joint& joint : joints_) {
      if (!joint.follows.empty() || !moving.count(joint.name)) continue;
      const auto i = std::ssize(out.joint_names);
      if (i < kMaxJoints) out.fastest(i) = joint.fastest;
      out.joint_names.push_back(joint.name);
    }
    for (const Node* node : order_) {
      Carried here;
      bool moves = false;
      if (node->joint) {
        const UrdfJoint& joint = *node->joint;
        here = carried.at(joint.parent);
        here.X = here.X * joint.X_parent;
        if (const Joint* own = find(joint.name)) {
          Link next = linkOf(joint, *own);
          if (moving.count(own->master())) {
            next.parent = here.link;
            next.X_parent = here.X;
            here.link = addTo(out, next, joint, *own);
            here.X = {};
            moves = true;
          } else {
            const double q = heldAt(*own, held);
            here.X = here.X * linkPose(next, q);
            out.held.push_back(fmt::format("joint '{}' at {:.6g} {}", own->name,
                                           q / jointUnit(own->type), jointUnitName(own->type)));
          }
        }
      }
      const UrdfLink& link = *node->link;
      out.frames.push_back(
          {link.name, here.frame, here.link, here.X, moves ? node->joint->name : ""});
      here.frame = static_cast<int>(out.frames.size()) - 1;
      addVisuals(link, here.frame, out.visuals);
      carried[link.name] = here;
      if (link.body) {
        RigidBody& carrier = model.bodyOf(here.link);
        carrier = combine(carrier, here.X, *link.body);
      } else if (moves) {
        out.warnings.push_back(
            fmt::format("{}:{}: link '{}' moves and has no mass", file_, link.line, link.name));
      }
    }
    return out;
  }

 private:
  /// A link, what carries it, and what it carries.
  struct Node {
    const UrdfLink* link = nullptr;
    const UrdfJoint* joint = nullptr;  // none: the root
    std::vector<const UrdfJoint*> below;
  };

  /// Who carries whom.
  void connect() {
    for (const UrdfLink& link : urdf_.links)
      if (const auto [at, fresh] = nodes_.emplace(link.name, Node{&link, nullptr, {}}); !fresh)
        fail(link.line, fmt::format("link '{}' is the second of that name, after line {}",
                                    link.name, at->second.link->line));
    std::map<std::string, int> lines;
    for (const UrdfJoint& joint : urdf_.joints) {
      if (const auto [at, fresh] = lines.emplace(joint.name, joint.line); !fresh)
        refuse(joint, fmt::format("is the second of that name, after line {}", at->second));
      for (const std::string& name : {joint.parent, joint.child})
        if (!nodes_.count(name)) refuse(joint, fmt::format("there is no link '{}'", name));
      Node& child = nodes_.at(joint.child);
      if (child.joint)
        refuse(joint, fmt::format("link '{}' is carried by joint '{}' too (line {}), want a tree",
                                  joint.child, child.joint->name, child.joint->line));
      child.joint = &joint;
      nodes_.at(joint.parent).below.push_back(&joint);
    }
  }

  const Node* root() const {
    const Node* out = nullptr;
    for (const UrdfLink& link : urdf_.links) {
      const Node& node = nodes_.at(link.name);
      if (node.joint) continue;
      if (out)
        fail(link.line,
             fmt::format("link '{}' is carried by nothing, and so is '{}' (line {}), want one root",
                         link.name, out->link->name, out->link->line));
      out = &node;
    }
    if (out) return out;
    if (urdf_.joints.empty()) fail(1, "has no link");
    refuse(urdf_.joints.front(), "is part of a loop: there is no link that nothing carries");
  }

  void addJoint(const UrdfJoint& joint) {
    if (joint.type == UrdfJoint::Type::kFixed) return;
    Joint own;
    own.name = joint.name;
    own.type =
        joint.type == UrdfJoint::Type::kPrismatic ? JointType::kPrismatic : JointType::kRevolute;
    own.lower = joint.lower;
    own.upper = joint.upper;
    own.fastest = joint.fastest;
    if (joint.mimic) {
      own.follows = joint.mimic->joint;
      own.ratio = joint.mimic->ratio;
      own.offset = joint.mimic->offset;
    }
    joints_.push_back(own);
    sources_.push_back(&joint);
  }

  /// Whom a joint follows at the end, when it follows one that follows.
  void resolve(Joint& joint) {
    const UrdfJoint& source = *sources_[static_cast<std::size_t>(&joint - joints_.data())];
    const Joint* master = nullptr;
    for (std::size_t steps = 0; !joint.follows.empty(); ++steps) {
      master = find(joint.follows);
      if (!master)
        refuse(source, fmt::format("follows '{}', which is no joint that moves", joint.follows));
      if (steps > joints_.size()) refuse(source, "follows itself");
      if (master->follows.empty()) break;
      joint.follows = master->follows;
      joint.offset += joint.ratio * master->offset;
      joint.ratio *= master->ratio;
    }
    if (!master) return;
    double least = joint.ratio * master->lower + joint.offset,
           most = joint.ratio * master->upper + joint.offset;
    if (least > most) std::swap(least, most);
    if (least < joint.lower - 1e-6 || most > joint.upper + 1e-6)
      urdf_.warnings.push_back(fmt::format(
          "{}:{}: joint '{}' follows '{}' over [{:.4g}, {:.4g}], beyond its own limits [{:.4g}, "
          "{:.4g}]",
          file_, source.line, joint.name, joint.follows, least, most, joint.lower, joint.upper));
  }

  static Link linkOf(const UrdfJoint& joint, const Joint& own) {
    Link link;
    link.type = own.type;
    link.axis = joint.axis;
    link.lower = own.lower;
    link.upper = own.upper;
    link.ratio = own.ratio;
    link.offset = own.offset;
    return link;
  }

  /// Returns its index.
  int addTo(UrdfRobot& out, Link link, const UrdfJoint& joint, const Joint& own) const {
    const auto refuseMore = [&](int most) {
      refuse(joint, fmt::format("one too many, at most {} may move", most));
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

  /// A link's visuals; where it has none, what it collides with.
  static void addVisuals(const UrdfLink& link, int frame, std::vector<Visual>& out) {
    for (Visual one : link.visuals.empty() ? link.collisions : link.visuals) {
      one.frame = frame;
      out.push_back(one);
    }
  }

  [[noreturn]] void refuse(const UrdfJoint& joint, const std::string& what) const {
    fail(joint.line, fmt::format("joint '{}': {}", joint.name, what));
  }
  [[noreturn]] void fail(int line, const std::string& what) const {
    throw InputError(fmt::format("{}:{}: {}", file_, line, what));
  }

  const std::string file_;
  UrdfFile urdf_;
  std::map<std::string, Node> nodes_;      // by the link's name
  std::vector<const Node*> order_;         // each behind the one that carries it
  std::vector<Joint> joints_;              // that can move
  std::vector<const UrdfJoint*> sources_;  // of these
};

UrdfTree::UrdfTree(const std::string& text, const std::string& file)
    : impl_(std::make_unique<Impl>(text, file)) {}
UrdfTree::~UrdfTree() = default;

const std::vector<UrdfTree::Joint>& UrdfTree::joints() const { return impl_->joints(); }

const UrdfTree::Joint* UrdfTree::find(const std::string& joint) const { return impl_->find(joint); }

bool UrdfTree::hasLink(const std::string& link) const { return impl_->carriers(link).has_value(); }

std::set<std::string> UrdfTree::jointsTo(const std::string& link) const {
  std::set<std::string> out;
  for (const UrdfJoint* carrier : impl_->carriers(link).value_or(std::vector<const UrdfJoint*>()))
    if (const Joint* joint = find(carrier->name)) out.insert(joint->master());
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
