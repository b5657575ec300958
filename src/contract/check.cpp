// SPDX-License-Identifier: BSD-3-Clause
#include "ves/contract/check.hpp"

namespace ves {

std::string_view name(Check check) noexcept {
  switch (check) {
    case Check::kPanicButton: return "panic button";
    case Check::kFloorMat: return "floor mat";
    case Check::kFinite: return "finite numbers";
    case Check::kStale: return "sample age";
    case Check::kDevice: return "device fault";
    case Check::kOverrun: return "tick overrun";
    case Check::kLeftAlone: return "legs left alone";
    case Check::kLegReading: return "leg reading";
    case Check::kForwardKinematics: return "forward kinematics";
    case Check::kPositionError: return "position error";
    case Check::kPressure: return "pressure";
    case Check::kSensorSaturated: return "sensor saturated";
    case Check::kSensorFrozen: return "sensor frozen";
    case Check::kOscillation: return "growing oscillation";
    case Check::kMotionLimits: return "motion limits";
    case Check::kActuatorLimits: return "actuator limits";
    case Check::kJointLimits: return "joint limits";
    case Check::kCollide: return "collide";
    case Check::kConditioning: return "conditioning";
    case Check::kVelocity: return "velocity";
    case Check::kFlow: return "flow limits";
    case Check::kConflictingNode: return "second controller or machine";
    case Check::kCount: break;
  }
  return "none";
}

bool freezes(Check check) noexcept {
  switch (check) {
    case Check::kStale:
    case Check::kDevice:
    case Check::kOverrun:
    case Check::kPressure:
    case Check::kSensorSaturated:
    case Check::kSensorFrozen:
    case Check::kOscillation: return false;
    default: return true;
  }
}

bool Tripped::freeze() const noexcept {
  if (bits_ == 0) return false;
  bool any = false;
  forEach([&](Check check) { any = any || freezes(check); });
  return any;
}

Check Tripped::first() const noexcept {
  std::uint32_t i = 0;
  while (i < static_cast<std::uint32_t>(Check::kCount) && !has(static_cast<Check>(i))) ++i;
  return static_cast<Check>(i);
}

}  // namespace ves
