// SPDX-License-Identifier: BSD-3-Clause
#include "stl.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>

#include "ves/core/errors.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

constexpr std::uintmax_t kMostBytes = 64u << 20;               // [B]
constexpr std::size_t kHead = 80, kTriangle = 50, kCount = 4;  // [B] of the binary format
constexpr double kMostFar = 1e6;                               // [-]

std::vector<std::string> folders(const char* variable) {
  const char* given = std::getenv(variable);
  std::istringstream all(given ? given : "");
  std::vector<std::string> out;
  for (std::string one; std::getline(all, one, ':');)
    if (!one.empty()) out.push_back(one);
  return out;
}

bool isFile(const fs::path& path) {
  std::error_code none;
  return fs::is_regular_file(path, none);
}

[[noreturn]] void refuse(const fs::path& file, const std::string& why) {
  throw InputError(fmt::format("{}: no STL mesh: {}", file.string(), why));
}

Vec3 corner(const fs::path& file, double x, double y, double z) {
  const Vec3 p(x, y, z);
  if (!(p.cwiseAbs().maxCoeff() <= kMostFar) || !p.allFinite())
    refuse(file, fmt::format("a corner at [{}, {}, {}]", x, y, z));
  return p;
}

std::vector<Vec3> readBinary(const fs::path& file, const std::string& bytes, std::size_t count) {
  std::vector<Vec3> out;
  out.reserve(3 * count);
  for (std::size_t i = 0; i < count; ++i) {
    float numbers[12];  // normal, three corners; little-endian as this machine
    std::memcpy(numbers, bytes.data() + kHead + kCount + i * kTriangle, sizeof numbers);
    for (int k = 3; k < 12; k += 3)
      out.push_back(corner(file, numbers[k], numbers[k + 1], numbers[k + 2]));
  }
  return out;
}

std::vector<Vec3> readText(const fs::path& file, const std::string& bytes) {
  std::vector<Vec3> out;
  std::istringstream in(bytes);
  for (std::string word; in >> word;) {
    if (word != "vertex") continue;
    double x = NAN, y = NAN, z = NAN;
    in >> x >> y >> z;
    if (!in) refuse(file, fmt::format("vertex {}, want three numbers", out.size() + 1));
    out.push_back(corner(file, x, y, z));
  }
  return out;
}

}  // namespace

fs::path findMesh(const std::string& name) {
  constexpr std::string_view kPackage = "package://", kFile = "file://";
  if (name.rfind(kFile, 0) == 0) {
    const fs::path path = name.substr(kFile.size());
    return isFile(path) ? path : fs::path();
  }
  if (name.rfind(kPackage, 0) != 0) return isFile(name) ? fs::path(name) : fs::path();
  const fs::path rest = name.substr(kPackage.size());
  std::vector<fs::path> places;
  for (const std::string& folder : folders("ROS_PACKAGE_PATH")) {
    places.push_back(fs::path(folder) / rest);
    places.push_back(fs::path(folder).parent_path() / rest);  // the package itself is named
  }
  for (const std::string& folder : folders("AMENT_PREFIX_PATH"))
    places.push_back(fs::path(folder) / "share" / rest);
  for (const fs::path& place : places)
    if (isFile(place)) return place;
  return {};
}

std::vector<Vec3> readStl(const fs::path& file) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(file, error);
  if (error) refuse(file, error.message());
  if (size > kMostBytes) refuse(file, fmt::format("{} bytes, want at most {}", size, kMostBytes));
  std::ifstream in(file, std::ios::binary);
  std::string bytes(size, '\0');
  if (!in.read(bytes.data(), static_cast<std::streamsize>(size))) refuse(file, "cannot be read");
  std::uint32_t count = 0;
  if (size >= kHead + kCount) std::memcpy(&count, bytes.data() + kHead, kCount);
  const bool binary =
      size >= kHead + kCount && size == kHead + kCount + kTriangle * std::uintmax_t{count};
  const std::vector<Vec3> out = binary ? readBinary(file, bytes, count) : readText(file, bytes);
  if (out.empty() || out.size() % 3 != 0)
    refuse(file, fmt::format("{} corners, want three a triangle", out.size()));
  return out;
}

}  // namespace ves
