// SPDX-License-Identifier: BSD-3-Clause
//
// Meshes that a robot's description names: STL, Collada, OBJ, glTF and whatever else assimp reads.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "ves/math/frames.hpp"

namespace ves {

/// file://, package://NAME/... (under ROS_PACKAGE_PATH, or the shares of AMENT_PREFIX_PATH),
/// model://NAME/... (under GAZEBO_MODEL_PATH), or a path, from the folder `beside` or the working
/// directory. A package or model is also looked for around `beside`: in the folders above it.
/// Empty when there is no such file.
std::filesystem::path findMesh(const std::string& name, const std::filesystem::path& beside);

struct MeshPart {
  std::vector<Vec3>
      corners;  // three a triangle, in the file's unit as it says it, else as they are
  std::optional<Vec3> colour;  // [-] red, green, blue
};

/// Its triangles, by material. Throws InputError.
std::vector<MeshPart> readMesh(const std::filesystem::path& file);

}  // namespace ves
