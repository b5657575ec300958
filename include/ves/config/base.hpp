// SPDX-License-Identifier: BSD-3-Clause
//
// The emulated base from YAML: matrices, a table of modes, or an arm of beams.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "ves/config/document.hpp"
#include "ves/srms/arm.hpp"

namespace ves {

/// The base that a robot stands on, by its motion at the robot's foot.
struct Base {
  VehicleModel vehicle;           // by the modes that are kept, or a body that floats
  std::optional<ArmModel> arm;    // that they are of
  std::optional<ArmShape> shape;  // of the arm, by the same modal coordinates
  bool feels_weight = false;      // of what stands on it
};

/// One of four: `mass`, `damping`, `stiffness` (6 x 6); `modes`, a table from elsewhere; `arm`, a
/// chain of beams; `free`, a body that floats. All but the last may stand on a `ground` that moves,
/// and that may be all. Throws InputError.
Base readBase(Section section);

/// A file of config/bases; `overrides` are "key.path=value". Throws InputError.
Base loadBase(const std::filesystem::path& file, const std::vector<std::string>& overrides);

/// Frequencies that somebody has published of an arm without mass, and what held at its tip.
struct PublishedFrequencies {
  std::string name;
  RigidBody payload_P;
  Vec6 frequency = Vec6::Zero();  // [Hz]
};
struct PublishedArm {
  ArmModel arm;
  std::vector<PublishedFrequencies> rows;
};

/// Throws InputError.
PublishedArm loadPublished(const std::filesystem::path& file);

/// The file of a base given by path or by its name in `config`/bases. Throws InputError, listing
/// what there is.
std::filesystem::path findBase(const std::string& base, const std::filesystem::path& config);

}  // namespace ves
