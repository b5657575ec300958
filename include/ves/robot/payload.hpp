// SPDX-License-Identifier: BSD-3-Clause
//
// What the force-torque sensor carries.
#pragma once

#include "ves/robot/robot_model.hpp"

namespace ves {

/// Everything the force-torque sensor carries (report, figure 2.1): its own top plate, the adapter
/// plate, the robot.
struct Payload {
  Transform X_PS;         // sensor in the platform
  RigidBody top_plate_S;  // of the sensor
  Transform X_PR;         // centre of the adapter plate
  RigidBody adapter_R;    // adapter plate
  Transform X_RL0;        // robot's base link on the plate
  RobotModel robot;

  Transform X_PL0() const { return X_PR * X_RL0; }
  bool operator==(const Payload&) const = default;
};

/// The robot with the sensor's top plate and the adapter plate counted into its link 0.
RobotModel carried(const Payload& payload) noexcept;
/// All of it as one body in the platform's frame, its joints locked at q.
RigidBody lockedRobot(const Payload& payload, const JointVector& q) noexcept;

}  // namespace ves
