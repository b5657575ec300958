// SPDX-License-Identifier: BSD-3-Clause
//
// What the controller may know of the machine: counts, joint angles, switches. Nothing else. And
// what it tells the legs.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "ves/kinematics/stewart.hpp"
#include "ves/math/relative_motion.hpp"
#include "ves/robot/robot_model.hpp"

namespace ves {

inline constexpr int kWrenchChannels = 6;
inline constexpr int kAdcChannels = 7;  // six of the wrench, then hydraulic pressure

inline constexpr std::int64_t kMaxSequence = 100'000'000'000;  // [-] 30 years of 100 Hz

using AdcCounts = std::array<std::int32_t, kAdcChannels>;
using LegCounts = std::array<std::int32_t, kLegs>;
inline constexpr std::int32_t kMaxLegCount = (1 << 14) - 1;  // [count] of a Temposonics

/// Safety loops, closed while the switches are not pressed: a broken wire reads as pressed.
/// And the gripper's, which is no safety loop: it only tells.
enum Switch : std::uint32_t { kPanicButtonClosed = 1u, kFloorMatClosed = 2u, kGripperClosed = 4u };
inline constexpr std::uint32_t kAllSwitchesClosed = kPanicButtonClosed | kFloorMatClosed;
inline constexpr std::uint32_t kAllSwitches = kAllSwitchesClosed | kGripperClosed;

/// Pieces of the machine that can say of themselves that they are at fault.
enum Piece : std::uint32_t { kLegsPiece = 1u, kSensorPiece = 2u, kRobotPiece = 4u };
inline constexpr std::uint32_t kAllPieces = kLegsPiece | kSensorPiece | kRobotPiece;

/// Each field is described in contract/schema.hpp.
struct Sample {
  std::int64_t sequence = -1;  // [-] counts up by one; -1: nothing received yet
  std::int64_t time = 0;       // [ns] the machine's clock when it was put together
  std::int64_t answers = -1;
  AdcCounts adc{};
  LegCounts legs{};
  std::uint32_t switches = 0;  // bits of Switch
  JointVector q = JointVector::Zero();
  double temperature = 20.0;
  std::int64_t legs_time = 0, wrench_time = 0, joints_time = 0;
  std::uint32_t faults = 0;  // bits of Piece
  std::int64_t command_source = 0, command_tick = 0, command_time = 0;
  std::int64_t robot_orders_taken = 0, robot_orders_refused = 0;

  /// [ns] of the piece that is oldest, when the sample was put together.
  std::int64_t oldest() const noexcept {
    return time - std::min({legs_time, wrench_time, joints_time});
  }
};

/// How the laboratory flies through the frame E that the vehicle is emulated in
/// (control/moving_frame.hpp).
struct Laboratory {
  std::int64_t time = 0;  // [ns] by the machine's clock, for which it is meant; 0: E is I
  BodyMotion E_H;         // home in E, in E's axes

  bool flies() const noexcept { return time != 0; }
  /// At another time [ns].
  BodyMotion at(std::int64_t t) const noexcept {
    return later(E_H, static_cast<double>(t - time) * kSecondPerNanosecond);
  }
};

/// Each field is described in contract/schema.hpp.
struct LegCommand {
  std::int64_t machine = 0;
  bool engaged = false;
  std::int32_t segment = -1;
  bool park = false;
  LegCounts counts{};
  LegCounts rest{};
  std::int64_t ahead = 0;
  Laboratory laboratory;
};

}  // namespace ves
