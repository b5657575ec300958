// SPDX-License-Identifier: BSD-3-Clause
//
// A run for the viewers of ROS 2: an MCAP file of that profile, messages as CDR with their schemas
// inside. ROS 2 itself is not needed, here or there.
#pragma once

#include <string>

#include "ves/results/comparison.hpp"

namespace ves {

/// /tf and /tf_static (platform, every frame of the robot, the same under ghost/ on the base in
/// free space), /robot_description, /joint_states, /wrench, /legs, /log, and every message of the
/// log as its .lcm file defines it under /ves/; the configuration is attached. `log` is read once
/// more for them. Throws InputError when the file cannot be written.
void writeMcap(const Series& series, const std::string& log, const std::string& file);

}  // namespace ves
