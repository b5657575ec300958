// SPDX-License-Identifier: BSD-3-Clause
//
// The gate: whether admittance control may begin with this base, robot and machine.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "ves/analysis/loop.hpp"
#include "ves/planning/robot_task.hpp"

namespace ves {

/// The loop of an experiment at its worst: the gain of either direction, the robot in each of
/// programRobots(). With the inertia compensated it has to decay also where the belief is off by
/// what it may be: the wrench's time, the servos' gain and the robot's mass, each up or down.
struct LoopVerdict {
  bool stable = true;            // or grows as little as ControllerConfig::most_growth allows
  double stable_for = HUGE_VAL;  // [s] of one segment, for which that holds
  double longest = 0.0;          // [s] of the program's admittance segments
  bool as_believed = true;       // it would be, were the belief exact
  Uncertainty uncertainty;       // that it is judged for,
  std::array<int, 3> off{};      // [-] and where not: timing, gain and mass, -1 or 1,
  double hand = 0.0;             // [kg] in its hand and not known of, or known of and not there
  DominantRoot at_off;           // and what grows there
  DominantRoot worst;
  Direction direction = Direction::kExtending;
  std::array<Loop, kDirections> loops;  // of directionsOf(), in the pose where each is worst
  const Loop& at(Direction which) const { return loops[static_cast<std::size_t>(which)]; }
  int modes = 0;              // [-] kept
  int stable_modes = 0;       // [-] that could be
  double damping_ratio = 0;   // [-] that every mode would need; 0: none up to 1 helps
  double K_P = 0;             // [-] share of K_P that would do; 0: none from 1/8 to 1
  bool plain_servos = false;  // a belief without friction and overlap would do
  // Where the machine gives way, what lets its swing no longer into the wrench, and out of the oil.
  double sensor_cutoff = 0.0;  // [rad/s] of the sensor's filter that would do; 0: none
  double feedback = 0.0;       // [1/s] of the pressure, with the sensor's filter as it is or so
};

/// The robot at one time of a program.
struct ProgramRobot {
  JointVector q;
  CarriedRobot body;  // with what it has in hand; what of that the controller has been told
  RigidBody in_hand;  // what may be there that nobody tells, and may be learnt, in P
};

/// The robot in admittance control, its masses as the controller believes them: where the program
/// begins, all along each motion of its admittance segments, and with each load in hand before and
/// after the controller is told. What is ordered by hand is not known beforehand; the oscillation
/// monitor looks at that.
std::vector<ProgramRobot> programRobots(const ControllerConfig& controller, const RobotTask& task);

/// Whether the loop decays at its worst, or grows by `growth` [1/s] at most. Much less work than
/// the rest of the verdict.
bool isStable(const ControllerConfig& controller, const RobotTask& task, double growth = 0.0);
/// [1/s] that is let pass: by a factor of ControllerConfig::most_growth until the longest
/// admittance segment of the program ends; without one, 0.
double allowedGrowth(const ControllerConfig& controller);
/// Whether the tool may lean on all that it is expected to touch (analysis/contact.hpp), or what
/// that gives is taken back by the passivity controller.
bool contactsDecay(const ControllerConfig& controller, const RobotTask& task);
LoopVerdict assessStability(const ControllerConfig& controller, const RobotTask& task);

/// The verdict on a change of the vehicle in operation: the loop decays, and the tool may lean on
/// what it touches, at places all along the way, for as long as one likes.
VehicleVerdict assessChange(const ControllerConfig& controller, const RobotTask& task,
                            const VehicleFactors& from, const VehicleFactors& to);

/// In one line: what grows, how fast, and what would cure it.
std::string explain(const LoopVerdict& verdict);

/// Sets ControllerConfig::stability and stability_uncompensated; what is forced stays so. Returns
/// the explanation where the loop would diverge; empty when all is well.
std::string applyStabilityCheck(ControllerConfig& controller, const RobotTask& task);

}  // namespace ves
