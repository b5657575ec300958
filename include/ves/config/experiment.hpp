// SPDX-License-Identifier: BSD-3-Clause
//
// One experiment from its scenario file: what the controller is told, what the plant is, and the
// text both came from.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "ves/config/calibration.hpp"
#include "ves/config/document.hpp"
#include "ves/config/urdf.hpp"
#include "ves/control/test_platform.hpp"
#include "ves/plant/plant.hpp"
#include "ves/srms/arm.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {

/// One experiment, complete: what the controller believes, what the plant is, and the text both
/// came from.
struct Experiment {
  std::string name;
  std::string description;
  ControllerConfig controller;
  plant::PlantConfig plant;
  UrdfRobot robot;              // as configured; without frames: none
  std::optional<ArmShape> arm;  // that the base is the tip of
  std::vector<std::string> warnings;
  std::vector<std::string> notes;                // known oddities of a robot's file
  std::optional<CalibrationRecord> calibration;  // that the bias comes from
  std::string setup;     // hash of what a calibration depends on: sensor, robot, gravity
  int substitutes = 0;   // [-] numbers that stand in for unknown ones
  Value document;        // what it was built from, URDF inside
  std::string resolved;  // the same as YAML; parseExperiment() reads it back
  std::string hash;      // of `resolved`
};

/// Reads a scenario file; `overrides` are "key.path=value"; `calibration`, `masses` and `servo` are
/// files that a calibration and identifications have left, or empty. Throws InputError.
Experiment loadExperiment(const std::filesystem::path& file,
                          const std::vector<std::string>& overrides = {},
                          const std::filesystem::path& calibration = {},
                          const std::filesystem::path& masses = {},
                          const std::filesystem::path& servo = {});

/// The same from a document that is in memory.
Experiment buildExperiment(Value document, const std::vector<std::string>& overrides = {});

/// Reads back what Experiment::resolved holds; `name` stands for a file name in messages.
Experiment parseExperiment(const std::string& resolved, const std::string& name);

/// Looks whether the experiment's admittance control decays, and writes the verdict into its
/// controller and its resolved text. Without it admittance control is refused. Returns the
/// explanation where the loop would diverge; empty when all is well.
std::string applyStabilityCheck(Experiment& experiment);

/// Robot and base of the program's first admittance segment, from its start, for the simulation of
/// chapter 3; `duration` [ns] of the segment. Throws InputError when there is none.
Interaction interactionOf(const Experiment& experiment, std::int64_t& duration);

/// The file of a scenario given by path or by its name in `config`/scenarios. Throws InputError,
/// listing what there is.
std::filesystem::path findScenario(const std::string& scenario,
                                   const std::filesystem::path& config);

}  // namespace ves
