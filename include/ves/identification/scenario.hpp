// SPDX-License-Identifier: BSD-3-Clause
//
// From a plan to a scenario that the controller runs.
#pragma once

#include "ves/config/experiment.hpp"
#include "ves/identification/pose_plan.hpp"

namespace ves {

StaticSetup staticSetup(const ControllerConfig& controller);

/// [m/s^2 | rad/s^2] along a coordinate 0..5 that the force sensor bears either way beside the
/// weight, level and the robot at q, with two fifths of its range to spare; infinite where nothing
/// is on it.
double accelerationRoom(const ControllerConfig& controller, const JointVector& q, int coordinate);
/// [m | rad] of a sine of w [rad/s] that keeps within `acceleration`. It begins with its full speed,
/// which legs take up within 15 ms.
double sineRoom(double acceleration, double w);

/// A fifth-order motion of all joints at once.
struct TimedMove {
  double start = 0.0, duration = 0.0;    // [s] in its segment
  JointVector to = JointVector::Zero();  // [rad | m]
};

/// YAML of them, as a segment's `robot:`; empty where there is nothing to move.
std::string robotMoves(const Experiment& experiment, const std::vector<TimedMove>& moves);

/// YAML of segments that go through the plan, from home and the joints it begins with.
std::string programOf(const PosePlan& plan, const Experiment& experiment);

/// YAML of a scenario that goes through the plan; `from` is the file it builds on, as seen from
/// where it will lie.
std::string scenarioOf(const PosePlan& plan, const Experiment& experiment, const std::string& name,
                       const std::string& from);

}  // namespace ves
