// SPDX-License-Identifier: BSD-3-Clause
//
// The gate: whether admittance control may begin with this base, robot and machine.
#pragma once

#include <string>
#include <vector>

#include "ves/analysis/loop.hpp"

namespace ves {

/// The loop of an experiment at its worst: the gain of either direction, the robot in each of
/// programPoses().
struct LoopVerdict {
  bool stable = true;
  DominantRoot worst;
  Direction direction = Direction::kExtending;
  Loop extending, retracting;  // in the pose where each is worst
  int modes = 0;               // [-] kept
  int stable_modes = 0;        // [-] that could be
  double damping_ratio = 0;    // [-] that every mode would need; 0: none up to 1 helps
  double K_P = 0;              // [-] share of K_P that would do; 0: none from 1/8 to 1
};

/// The robot's poses in admittance control: where the program begins, and all along each motion of
/// its admittance segments. Motions ordered by hand are not known beforehand; the oscillation
/// monitor looks at those.
std::vector<JointVector> programPoses(const Program& program, const plant::PlantConfig& plant);

/// Whether the loop decays at its worst. Much less work than the rest of the verdict.
bool isStable(const ControllerConfig& controller, const plant::PlantConfig& plant);
LoopVerdict assessStability(const ControllerConfig& controller, const plant::PlantConfig& plant);

/// In one line: what grows, how fast, and what would cure it.
std::string explain(const LoopVerdict& verdict);

/// Sets ControllerConfig::stability and stability_uncompensated; what is forced stays so. Returns
/// the explanation where the loop would diverge; empty when all is well.
std::string applyStabilityCheck(ControllerConfig& controller, const plant::PlantConfig& plant);

}  // namespace ves
