// SPDX-License-Identifier: BSD-3-Clause
//
// A robot description as it stands in its file: every element and attribute is used, is one that is
// known to say nothing about masses and motion, or is reported.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ves/config/urdf.hpp"

namespace ves {

struct UrdfLink {
  std::string name;
  int line = 0;
  std::optional<RigidBody> body;  // in the link's frame
  std::vector<Visual> visuals;    // `frame` is not set
  std::vector<Visual> collisions;
};

struct UrdfJoint {
  enum class Type { kFixed, kRevolute, kContinuous, kPrismatic };
  struct Mimic {
    std::string joint;
    double ratio = 1.0;   // [-]
    double offset = 0.0;  // [rad | m]
  };

  std::string name;
  int line = 0;
  Type type = Type::kFixed;
  std::string parent, child;  // links
  Transform X_parent;
  Vec3 axis = Vec3::UnitX();  // [-] unit vector
  double lower = -HUGE_VAL;   // [rad | m]
  double upper = HUGE_VAL;
  double fastest = HUGE_VAL;  // [rad/s | m/s]
  std::optional<Mimic> mimic;
};

struct UrdfFile {
  std::vector<UrdfLink> links;    // in the file's order
  std::vector<UrdfJoint> joints;  // the same
  std::vector<std::string> warnings;
};

/// Throws InputError where masses or motion cannot be read; what concerns the picture alone warns.
UrdfFile readUrdf(const std::string& text, const std::string& file);

}  // namespace ves
