// SPDX-License-Identifier: BSD-3-Clause
//
// Robots from URDF.
#pragma once

#include <string>
#include <vector>

#include "ves/robot/robot_model.hpp"

namespace ves {

struct UrdfRobot {
  RobotModel model;
  std::vector<std::string> joint_names;  // of the moving joints, base to tip
  std::vector<std::string> warnings;     // what no rigid body can have, accepted all the same
};

/// A serial arm, revolute (continuous too) and prismatic, from URDF text; links behind fixed joints
/// are counted into the link that carries them. `file` is for messages only.
///
/// Refuses (InputError) what is not a chain, has no inertia, or does not parse; a link without
/// mass on a fixed joint may lack its inertial element. Inertias that violate the triangle
/// inequality (the PUMA's link 3, the DOSS's links 3 and 5) only warn.
UrdfRobot loadUrdf(const std::string& text, const std::string& file);

}  // namespace ves
