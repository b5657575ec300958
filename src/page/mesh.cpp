// SPDX-License-Identifier: BSD-3-Clause
#include "mesh.hpp"

#include <assimp/config.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>

#include "ves/core/errors.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMostBytes = 64u << 20;               // [B]
constexpr std::size_t kHead = 80, kTriangle = 50, kCount = 4;  // [B] of binary STL
constexpr double kMostFar = 1e6;                               // [-]

std::vector<fs::path> folders(const char* variable) {
  const char* given = std::getenv(variable);
  std::istringstream all(given ? given : "");
  std::vector<fs::path> out;
  for (std::string one; std::getline(all, one, ':');)
    if (!one.empty()) out.push_back(one);
  return out;
}

bool isFile(const fs::path& path) {
  std::error_code none;
  return fs::is_regular_file(path, none);
}

/// "%20" is a blank.
std::string unescaped(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned byte = 0;
    const char* digits = text.data() + i + 1;
    const bool escape = text[i] == '%' && i + 2 < text.size() &&
                        std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2;
    out += escape ? static_cast<char>(byte) : text[i];
    if (escape) i += 2;
  }
  return out;
}

[[noreturn]] void refuse(const fs::path& file, const std::string& why) {
  throw InputError(fmt::format("{}: no mesh: {}", file.string(), why));
}

/// Bytes behind the last triangle of a binary STL, which assimp takes for no STL at all, are left
/// out.
std::string stlWithoutTrail(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  std::uint32_t count = 0;
  if (bytes.size() >= kHead + kCount) std::memcpy(&count, bytes.data() + kHead, kCount);
  const std::uintmax_t whole = kHead + kCount + kTriangle * std::uintmax_t{count};
  if (count > 0 && whole < bytes.size()) bytes.resize(whole);
  return bytes;
}

MeshPart part(const fs::path& file, const aiScene& scene, const aiMesh& mesh) {
  MeshPart out;
  for (unsigned i = 0; i < mesh.mNumFaces; ++i) {
    const aiFace& face = mesh.mFaces[i];
    for (unsigned k = 0; face.mNumIndices == 3 && k < 3; ++k) {
      const aiVector3D& v = mesh.mVertices[face.mIndices[k]];
      out.corners.emplace_back(v.x, v.y, v.z);
      if (!(out.corners.back().cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= kMostFar))
        refuse(file, fmt::format("a corner at [{}, {}, {}]", v.x, v.y, v.z));
    }
  }
  aiColor4D colour;
  if (mesh.mMaterialIndex < scene.mNumMaterials &&
      scene.mMaterials[mesh.mMaterialIndex]->Get(AI_MATKEY_COLOR_DIFFUSE, colour) == AI_SUCCESS)
    out.colour = Vec3(colour.r, colour.g, colour.b).cwiseMax(0.0).cwiseMin(1.0);
  return out;
}

}  // namespace

fs::path findMesh(const std::string& name, const fs::path& beside) {
  const auto after = [&](std::string_view scheme) -> std::optional<std::string> {
    if (name.rfind(scheme, 0) != 0) return {};
    return unescaped(name.substr(scheme.size()));
  };
  std::vector<fs::path> places;
  if (const auto path = after("file://")) {
    places = {*path};
  } else if (const auto in_package = after("package://")) {
    for (const fs::path& folder : folders("ROS_PACKAGE_PATH")) {
      places.push_back(folder / *in_package);
      places.push_back(folder.parent_path() / *in_package);  // the package itself is named
    }
    for (const fs::path& folder : folders("AMENT_PREFIX_PATH"))
      places.push_back(folder / "share" / *in_package);
    for (fs::path up = fs::absolute(beside); up != up.parent_path(); up = up.parent_path())
      places.push_back(up / *in_package);
  } else if (const auto in_model = after("model://")) {
    for (const fs::path& folder : folders("GAZEBO_MODEL_PATH"))
      places.push_back(folder / *in_model);
    for (fs::path up = fs::absolute(beside); up != up.parent_path(); up = up.parent_path())
      places.push_back(up / *in_model);
  } else {
    places = {beside / name, beside / unescaped(name), name};
  }
  const auto found = std::find_if(places.begin(), places.end(), isFile);
  return found == places.end() ? fs::path() : *found;
}

std::vector<MeshPart> readMesh(const fs::path& file) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(file, error);
  if (error) refuse(file, error.message());
  if (size > kMostBytes) refuse(file, fmt::format("{} bytes, want at most {}", size, kMostBytes));
  Assimp::Importer importer;
  // As others draw robots: a description says itself which way is up.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, true);
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE,
                              aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  constexpr unsigned kSteps =
      aiProcess_Triangulate | aiProcess_SortByPType | aiProcess_PreTransformVertices;
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const aiScene* scene = nullptr;
  if (ending == ".stl") {
    const std::string bytes = stlWithoutTrail(file);
    scene = importer.ReadFileFromMemory(bytes.data(), bytes.size(), kSteps, "stl");
  } else {
    scene = importer.ReadFile(file.string(), kSteps);
  }
  if (!scene) refuse(file, importer.GetErrorString());
  std::vector<MeshPart> out;
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) {
    out.push_back(part(file, *scene, *scene->mMeshes[i]));
    if (out.back().corners.empty()) out.pop_back();
  }
  if (out.empty()) refuse(file, "it has no triangle");
  return out;
}

}  // namespace ves
