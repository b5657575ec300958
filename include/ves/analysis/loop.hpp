// SPDX-License-Identifier: BSD-3-Clause
//
// Stability of this machine's force feedback: the base, its sampling, and everything between a
// command and the reading that answers it.
//
//   eta --Phi--> command, held --servo--> platform --M_1--> wrench --sensor filter--> sample -->
//   eta
//
// Linear, one sampling period a step, exact for what it contains: all modes, all six directions
// coupled through the robot's inertia, the hold, the servo K_v/(s(tau s + 1)), Filter 3, the
// sensor's filter. Left out: the LegSlaves' own sampling (0.7 ms), quantisation, and the change of
// gain with the direction; both directions are looked at instead, as if each lasted.
#pragma once

#include "ves/control/test_platform.hpp"
#include "ves/plant/plant.hpp"

namespace ves {

struct Loop {
  ModalModel base;
  RigidBody robot_P;           // what the sensor carries, joints locked
  double period = 0.0;         // [s] of the controller
  double velocity_gain = 0.0;  // [1/s] K_v of the servo, speed per error
  double tau = 0.0;            // [s] of the actuator
  double filter_cutoff = 0.0;  // [rad/s] of Filter 3; 0: none
  double sensor_cutoff = 0.0;  // [rad/s]
};

enum class Direction { kExtending, kRetracting };

/// The loop of an experiment with its legs all moving one way, the robot's joints at q.
Loop loopOf(const ControllerConfig& controller, const plant::PlantConfig& plant,
            const JointVector& q, Direction direction);

/// The root of largest magnitude.
struct Slowest {
  double radius = 0.0;     // [-] a period; above 1 the emulation diverges
  double growth = 0.0;     // [1/s]
  double frequency = 0.0;  // [Hz]
};
Slowest slowest(const Loop& loop);

/// How many of the base's modes can be kept: the largest k for which the loop with 1, 2, .. k modes
/// decays in both directions, with legs.filters as they are and the robot at q. 0 when even one
/// diverges.
int stableModes(const ControllerConfig& controller, const plant::PlantConfig& plant,
                const JointVector& q);

/// The softest k modes of a base.
ModalModel softest(const ModalModel& base, int k);

}  // namespace ves
