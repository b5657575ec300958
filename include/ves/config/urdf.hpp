// SPDX-License-Identifier: BSD-3-Clause
//
// Robots from URDF.
#pragma once

#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "ves/config/document.hpp"
#include "ves/contract/robot_order.hpp"
#include "ves/robot/robot_model.hpp"

namespace ves {

/// A frame of the description: a link's, whether it has mass or not.
struct NamedFrame {
  std::string name;
  int parent = -1;    // [-] index of the frame that carries it; -1: the root
  int link = -1;      // [-] index of the moving link that carries it; -1: link 0
  Transform X_link;   // its pose in that link's frame
  std::string joint;  // that moves it against its parent; empty: none

  /// In L0.
  Transform pose(const LinkPoses& X_L0L) const { return link < 0 ? X_link : X_L0L[link] * X_link; }
};

/// What a link looks like.
struct Visual {
  enum class Kind { kBox, kCylinder, kSphere, kCapsule, kMesh };
  Kind kind = Kind::kBox;
  int frame = 0;             // [-] of the link, of `frames`
  Transform X_frame;         // its pose there
  Vec3 size = Vec3::Ones();  // [m] of a box; {radius, length along z, 0}; {radius, 0, 0}; [-] scale
  std::string mesh;          // file, as the description names it
  std::optional<Vec3> colour;  // [-] red, green, blue
};

struct UrdfRobot {
  std::string file;  // of the description, as it was named
  RobotModel model;
  std::vector<std::string> joint_names;  // of the joint values
  JointVector fastest;                   // [rad/s | m/s] of each; infinite where it is not said
  std::vector<NamedFrame> frames;        // every link, base first
  std::vector<Visual> visuals;           // what there is of them; of no use but to be looked at
  std::vector<std::string> held;         // "joint 'finger' at 0.01 m": could move, and does not
  std::vector<std::string> warnings;     // what no rigid body can have, accepted all the same
  std::string choice;  // what moves, where nobody has said it and it is no serial arm
  int tip = -1;  // [-] of `frames`, as chosen, or the end of a robot that has but one; -1: none

  const NamedFrame* tool() const {
    return tip < 0 ? nullptr : &frames[static_cast<std::size_t>(tip)];
  }
};

/// A robot description, a tree of links, and the robots that can be made of it.
///
/// Refuses (InputError) what does not parse, loops, planar and floating joints, and masses,
/// inertias and lengths that no robot has. Links without mass are frames; one that moves warns.
/// Inertias that violate the triangle inequality (the PUMA's link 3, the DOSS's links 3 and 5) warn
/// too. Meshes are not read.
class UrdfTree {
 public:
  /// A joint that can move.
  struct Joint {
    std::string name;
    JointType type = JointType::kRevolute;
    double lower = 0.0, upper = 0.0;   // [rad | m]
    double fastest = HUGE_VAL;         // [rad/s | m/s]
    std::string follows;               // the joint whose value moves it (mimic); empty: its own
    double ratio = 1.0, offset = 0.0;  // [-], [rad | m] stands at ratio * value + offset

    /// Of the joint whose value moves it.
    const std::string& master() const { return follows.empty() ? name : follows; }
  };

  /// `file` is for messages only.
  UrdfTree(const std::string& text, const std::string& file);
  ~UrdfTree();
  UrdfTree(const UrdfTree&) = delete;
  UrdfTree& operator=(const UrdfTree&) = delete;

  /// In the file's order, each behind those that carry it.
  const std::vector<Joint>& joints() const;
  const Joint* find(const std::string& joint) const;
  bool hasLink(const std::string& link) const;
  /// The joints that move a link, those that others follow among them.
  std::set<std::string> jointsTo(const std::string& link) const;

  /// The robot in which the joints `moving` move, and what follows them. The others are held at
  /// `held` [rad | m]; those it does not name at zero, or at the limit next to it. Links that do
  /// not move are counted into the one that carries them.
  UrdfRobot robot(const std::set<std::string>& moving,
                  const std::map<std::string, double>& held = {}) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// "tip", "joints" and "lock" of a robot's file: which joints move, and where the others are held.
/// Without them all move.
UrdfRobot chosenRobot(Section& s, const UrdfTree& tree);

/// "joints_deg_or_m" of a robot's file, inside their limits [rad | m]; without it zero, or the
/// limit next to it.
JointVector initialJoints(Section& s, const UrdfRobot& robot);

/// Why one joint may not move so: faster than its description allows, from where it is. Empty: it
/// may.
std::string whyTooFast(const UrdfRobot& robot, const RobotMove& move, const JointState& from);

/// A robot alone, without a platform.
struct LoadedRobot {
  std::string file;  // of the description
  UrdfRobot robot;
  JointVector q = JointVector::Zero();  // [rad | m] where its joints begin
};
/// Reads a URDF, or a robot's YAML as in config/robots; `overrides` are "key=value" of it (tip,
/// joints, lock.JOINT). Throws InputError.
LoadedRobot loadRobot(const std::string& file, const std::vector<std::string>& overrides);

/// The robot in which all joints move.
UrdfRobot loadUrdf(const std::string& text, const std::string& file);

}  // namespace ves
