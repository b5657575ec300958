// SPDX-License-Identifier: BSD-3-Clause
//
// The names of the safety checks (Appendix C), what a failing one does, and a set of them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string_view>

namespace ves {

/// In order of priority: of checks that trip in the same tick the first is the cause.
enum class Check : std::uint32_t {
  kPanicButton,
  kFloorMat,
  kFinite,             // NaN or infinity, anywhere in the tick
  kStale,              // no new sample for too long, or one with a piece that old
  kDevice,             // legs, sensor or robot say that they are at fault
  kOverrun,            // ticks missed: one long stall, or too many in a second
  kLeftAlone,          // so many in a row that the legs have gone home by themselves
  kLegReading,         // a leg's reading jumped as no leg can
  kForwardKinematics,  // the measured legs belong to no pose
  kPositionError,
  kPressure,         // hydraulic pressure out of range
  kSensorSaturated,  // a wrench channel at the end of the converter
  kSensorFrozen,     // readings that stand while the weight they carry turns
  kOscillation,      // the emulated base gains energy that nothing gives it
  kMotionLimits,
  kActuatorLimits,
  kJointLimits,
  kCollide,       // legs against each other, or against a plate
  kConditioning,  // near a singular pose
  kVelocity,
  kFlow,
  kConflictingNode,  // another controller or machine is on the bus
  kCount
};

/// What a trip does: hold the last checked lengths at once, or, for faults that leave the planned
/// path safe, brake along the motion first.
enum class Reaction { kFreeze, kBrake };

/// Of one check.
struct CheckMeaning {
  Check check;
  std::string_view name;
  Reaction reaction;
  std::string_view limits;  // the keys of `safety` that it looks at, by spaces
};

/// One line a check, in the order of Check.
inline constexpr CheckMeaning kChecks[] = {
    {Check::kPanicButton, "panic button", Reaction::kFreeze, ""},
    {Check::kFloorMat, "floor mat", Reaction::kFreeze, ""},
    {Check::kFinite, "finite numbers", Reaction::kFreeze, ""},
    {Check::kStale, "sample age", Reaction::kBrake, "stale_ticks"},
    {Check::kDevice, "device fault", Reaction::kBrake, ""},
    {Check::kOverrun, "tick overrun", Reaction::kBrake, "stall_ticks overruns_per_second"},
    {Check::kLeftAlone, "legs left alone", Reaction::kFreeze, ""},
    {Check::kLegReading, "leg reading", Reaction::kFreeze,
     "reading_jump_m reading_speed reading_patience"},
    {Check::kForwardKinematics, "forward kinematics", Reaction::kFreeze, ""},
    {Check::kPositionError, "position error", Reaction::kFreeze,
     "position_error_still_m position_error_lag_s position_error_m"},
    {Check::kPressure, "pressure", Reaction::kBrake, "pressure_min_v pressure_max_v"},
    {Check::kSensorSaturated, "sensor saturated", Reaction::kBrake, ""},
    {Check::kSensorFrozen, "sensor frozen", Reaction::kBrake, "frozen_samples frozen_counts"},
    {Check::kOscillation, "growing oscillation", Reaction::kBrake,
     "growing_windows growth_window_s window_growth growth_floor_j"},
    {Check::kMotionLimits, "motion limits", Reaction::kFreeze, "translation_m rotation_deg"},
    {Check::kActuatorLimits, "actuator limits", Reaction::kFreeze, "leg_min_m leg_max_m"},
    {Check::kJointLimits, "joint limits", Reaction::kFreeze, "joint_cone_deg"},
    {Check::kCollide, "collide", Reaction::kFreeze, "leg_clearance_m plate_angle_deg"},
    {Check::kConditioning, "conditioning", Reaction::kFreeze, "condition_number"},
    {Check::kVelocity, "velocity", Reaction::kFreeze, "leg_velocity_m_per_s"},
    {Check::kFlow, "flow limits", Reaction::kFreeze, "flow_l_per_s"},
    {Check::kConflictingNode, "second controller or machine", Reaction::kFreeze, ""},
};
static_assert(
    [] {
      std::uint32_t n = 0;
      for (const CheckMeaning& c : kChecks)
        if (static_cast<std::uint32_t>(c.check) != n++ || c.name.empty()) return false;
      return n == static_cast<std::uint32_t>(Check::kCount);
    }(),
    "each check has a line in kChecks, in the order of Check");

/// "none" of kCount.
constexpr std::string_view name(Check check) noexcept {
  return check < Check::kCount ? kChecks[static_cast<std::size_t>(check)].name : "none";
}

/// A set of tripped checks.
class Tripped {
 public:
  Tripped() = default;
  explicit Tripped(std::uint32_t bits) : bits_(bits) {}

  /// Records the check unless its requirement holds.
  void require(Check check, bool holds) noexcept {
    if (!holds) bits_ |= bit(check);
  }
  bool has(Check check) const noexcept { return (bits_ & bit(check)) != 0; }
  bool any() const noexcept { return bits_ != 0; }
  std::uint32_t bits() const noexcept { return bits_; }
  /// Calls f(check) for each, by priority.
  template <typename F>
  void forEach(F f) const {
    for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(Check::kCount); ++i)
      if (has(static_cast<Check>(i))) f(static_cast<Check>(i));
  }
  /// One of them freezes.
  bool freeze() const noexcept {
    bool any = false;
    forEach([&](Check c) {
      any = any || kChecks[static_cast<std::size_t>(c)].reaction == Reaction::kFreeze;
    });
    return any;
  }
  /// The tripped check of highest priority; kCount when none.
  Check first() const noexcept {
    Check first = Check::kCount;
    forEach([&](Check c) { first = std::min(first, c); });
    return first;
  }

  Tripped operator|(Tripped other) const noexcept { return Tripped(bits_ | other.bits_); }

 private:
  static constexpr std::uint32_t bit(Check check) {
    return 1u << static_cast<std::uint32_t>(check);
  }
  std::uint32_t bits_ = 0;
};

}  // namespace ves
