// SPDX-License-Identifier: BSD-3-Clause
//
// The names of the safety checks (Appendix C), what a failing one does, and a set of them.
#pragma once

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

std::string_view name(Check check) noexcept;

/// What a trip does. A freeze holds the last checked lengths at once. A controlled stop brakes
/// along the motion first: for faults that leave the planned path safe.
bool freezes(Check check) noexcept;

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
  bool freeze() const noexcept;
  /// The tripped check of highest priority; kCount when none.
  Check first() const noexcept;

  Tripped operator|(Tripped other) const noexcept { return Tripped(bits_ | other.bits_); }

 private:
  static constexpr std::uint32_t bit(Check check) {
    return 1u << static_cast<std::uint32_t>(check);
  }
  std::uint32_t bits_ = 0;
};

}  // namespace ves
