// SPDX-License-Identifier: BSD-3-Clause
//
// Gravity compensation (Appendices B and C): the static wrench of all the sensor carries.
#pragma once

#include "ves/robot/payload.hpp"

namespace ves {

/// F_So_S on the sensor from the weight of robot, adapter plate and top plate, joints at q.
///
/// F = m g and N = r x F summed over the links (B.4), the robot taken as rigid. (B.7) prints the
/// third column of R for gravity in the robot's axes; it is the third row (of I to P).
Wrench staticWrench(const Payload& payload, const JointVector& q, const Mat3& R_IP,
                    const Vec3& g_I) noexcept;

/// A static wrench about Po in inertial axes: what gravity compensation subtracts from the
/// measurement.
Wrench gravityCompensation(const Payload& payload, const Mat3& R_IP,
                           const Wrench& static_S) noexcept;

}  // namespace ves
