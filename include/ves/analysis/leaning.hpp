// SPDX-License-Identifier: BSD-3-Clause
//
// How an emulated base answers the contacts of a scenario, known before anything moves: the loop
// with the tool leaning on what it will touch, beside the base in free space.
#pragma once

#include <string>
#include <vector>

#include "ves/analysis/loop.hpp"
#include "ves/planning/robot_task.hpp"

namespace ves {

/// One contact of a program, at the pose where the tool comes nearest to it; the platform at home.
struct ExpectedContact {
  std::string name;    // "bodies[0]", "target", "grip x", ...
  JointVector q;       // of the robot
  Leaning leaning;     // a force on the tool pushes along n of d = {n, p x n}
  double speed = 0.0;  // [m/s] at which it is met; 0: it stays, or is held
};

/// Those that the tool, or the target on its way, comes near to in admittance control, and what the
/// grip holds. Empty without an environment.
std::vector<ExpectedContact> expectedContacts(const ControllerConfig& controller,
                                              const RobotTask& task);

/// The loop of an expected contact, its spring and damper scaled to another stiffness.
Loop leaning(Loop loop, const ExpectedContact& contact, double stiffness);

/// [kg] that meets: of base and robot, and of what they lean on, along the contact.
double meetingMass(const Loop& loop);

/// One meeting of the tool with it, that begins at rest and ends when they part: in the loop, and
/// on the base in free space.
struct Impact {
  double restitution = 0.0, free_space = 0.0;        // [-]
  double peak = 0.0, peak_free_space = 0.0;          // [N] at `speed`
  double duration = 0.0, duration_free_space = 0.0;  // [s]
  // [-] of the energy of approach, that of meetingMass() at `speed`, by which base, robot and what
  // they met have more than in free space once the loop has answered. NaN where it takes longer
  // than kLongest.
  double energy_error = NAN;
  static constexpr double kLongest = 20.0, kAnswer = 0.5;  // [s]
};
Impact impact(const Loop& loop, double speed);

inline constexpr double kMostEnergyError = 0.1;  // [-] that passes without a warning

/// How stiff a contact may be.
struct ContactLimits {
  double energy = 0.0;  // [N/m], [N m/rad] up to which the energy error is at most kMostEnergyError
  double growth = 0.0;  // and up to which leaning on it for good grows no faster than the base does
  static constexpr double kLeast = 1.0, kMost = 1e8;  // what is looked at; 0: not even kLeast
};

struct ContactVerdict {
  ExpectedContact contact;
  Impact impact;  // of what is met
  bool grows = false;
  double growth = 0.0, frequency = 0.0;  // [1/s], [Hz] of the loop that leans on it
  ContactLimits limits;
};

/// Whether the loop that leans on something grows where it does not without.
bool growsLeaning(const Loop& loop);

/// Of every contact, the servos' gain at its worst. The limits take a second each.
std::vector<ContactVerdict> assessContacts(const ControllerConfig& controller,
                                           const RobotTask& task, bool limits = true);

/// In one line.
std::string explain(const ContactVerdict& verdict);

}  // namespace ves
