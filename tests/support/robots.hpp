// SPDX-License-Identifier: BSD-3-Clause
//
// Robots for the tests, and KDL's tree of the same URDF by a route of its own.
#pragma once

#include <urdf_parser/urdf_parser.h>

#include <fstream>
#include <kdl/chain.hpp>
#include <kdl/tree.hpp>
#include <sstream>
#include <string>

#include "ves/config/urdf.hpp"

namespace ves::test {

inline std::string configDir() { return VES_TEST_CONFIG_DIR; }

inline std::string readText(const std::string& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

inline UrdfRobot robot(const std::string& name) {
  const std::string file = configDir() + "/robots/" + name + ".urdf";
  return loadUrdf(readText(file), file);
}

/// The tree that KDL makes of a URDF's text, link by link, fixed joints as they are.
inline KDL::Tree kdlTree(const std::string& text) {
  const auto model = urdf::parseURDF(text);
  KDL::Tree tree(model->getRoot()->name);
  const auto frame = [](const urdf::Pose& p) {
    return KDL::Frame(
        KDL::Rotation::Quaternion(p.rotation.x, p.rotation.y, p.rotation.z, p.rotation.w),
        KDL::Vector(p.position.x, p.position.y, p.position.z));
  };
  std::vector<urdf::LinkSharedPtr> open = {model->links_.at(model->getRoot()->name)};
  while (!open.empty()) {
    const urdf::LinkSharedPtr parent = open.back();
    open.pop_back();
    for (const urdf::JointSharedPtr& joint : parent->child_joints) {
      const urdf::LinkSharedPtr link = model->links_.at(joint->child_link_name);
      const KDL::Frame f = frame(joint->parent_to_joint_origin_transform);
      const KDL::Vector axis = f.M * KDL::Vector(joint->axis.x, joint->axis.y, joint->axis.z);
      const KDL::Joint own =
          joint->type == urdf::Joint::FIXED
              ? KDL::Joint(joint->name, KDL::Joint::None)
              : KDL::Joint(joint->name, f.p, axis,
                           joint->type == urdf::Joint::PRISMATIC ? KDL::Joint::TransAxis
                                                                 : KDL::Joint::RotAxis);
      KDL::RigidBodyInertia body;
      if (link->inertial) {
        const urdf::Inertial& in = *link->inertial;
        body = frame(in.origin) *
               KDL::RigidBodyInertia(
                   in.mass, KDL::Vector::Zero(),
                   KDL::RotationalInertia(in.ixx, in.iyy, in.izz, in.ixy, in.ixz, in.iyz));
      }
      tree.addSegment(KDL::Segment(link->name, own, f, body), parent->name);
      open.push_back(link);
    }
  }
  return tree;
}

/// The serial arm of a robot of config, from its base to its last link.
inline KDL::Chain kdlChain(const std::string& name) {
  const KDL::Tree tree = kdlTree(readText(configDir() + "/robots/" + name + ".urdf"));
  std::string tip = tree.getRootSegment()->first;
  for (auto at = tree.getRootSegment(); !at->second.children.empty(); tip = at->first)
    at = at->second.children.front();
  KDL::Chain chain;
  tree.getChain(tree.getRootSegment()->first, tip, chain);
  return chain;
}

}  // namespace ves::test
