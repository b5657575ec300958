// SPDX-License-Identifier: BSD-3-Clause
//
// A platform alone, without a robot or a program: its joints, legs and limits.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "ves/analysis/platform.hpp"
#include "ves/plant/actuator.hpp"
#include "ves/plant/leg_slave.hpp"

namespace ves {

struct Platform {
  Geometry geometry;
  plant::LegSlaveGains gains;
  plant::ActuatorModel actuator;
  plant::Temposonics transducer;
  SafetyLimits limits;
  WorkspaceUse use;  // of the workspace that the limits allow
};

/// Reads `platform`, `legs` and `safety` of a scenario, or of a file of config/platforms;
/// `overrides` are "key.path=value". Throws InputError.
Platform loadPlatform(const std::filesystem::path& file,
                      const std::vector<std::string>& overrides = {});

/// The file of a platform given by path or by its name in `config`/platforms or, as a scenario, in
/// `config`/scenarios. Throws InputError, listing what there is.
std::filesystem::path findPlatform(const std::string& name, const std::filesystem::path& config);

}  // namespace ves
