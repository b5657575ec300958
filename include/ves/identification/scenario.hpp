// SPDX-License-Identifier: BSD-3-Clause
//
// From a plan to a scenario that the controller runs.
#pragma once

#include "ves/config/experiment.hpp"
#include "ves/identification/pose_plan.hpp"

namespace ves {

StaticSetup staticSetup(const ControllerConfig& controller);

/// YAML of a scenario that goes through the plan; `from` is the file it builds on, as seen from
/// where it will lie. Joints go `speed` [deg/s | cm/s] on average.
std::string scenarioOf(const PosePlan& plan, const Experiment& experiment, const std::string& name,
                       const std::string& from, double speed);

}  // namespace ves
