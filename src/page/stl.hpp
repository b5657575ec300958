// SPDX-License-Identifier: BSD-3-Clause
//
// Meshes that a robot's description names.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "ves/math/frames.hpp"

namespace ves {

/// package://NAME/... under ROS_PACKAGE_PATH or the shares of AMENT_PREFIX_PATH, file://..., or a
/// path. Empty when there is no such file.
std::filesystem::path findMesh(const std::string& name);

/// Corners of the triangles of an STL file, binary or text, three each. Throws InputError.
std::vector<Vec3> readStl(const std::filesystem::path& file);

}  // namespace ves
