// SPDX-License-Identifier: BSD-3-Clause
//
// What the controller may know of the machine: counts, joint angles, switches. Nothing else.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "ves/kinematics/stewart.hpp"
#include "ves/robot/robot_model.hpp"

namespace ves {

inline constexpr int kWrenchChannels = 6;
inline constexpr int kAdcChannels = 7;  // six of the wrench, then hydraulic pressure

using AdcCounts = std::array<std::int32_t, kAdcChannels>;
using LegCounts = std::array<std::int32_t, kLegs>;

/// Safety loops, closed while the switches are not pressed: a broken wire reads as pressed.
enum Switch : std::uint32_t { kPanicButtonClosed = 1u, kFloorMatClosed = 2u };
inline constexpr std::uint32_t kAllSwitchesClosed = kPanicButtonClosed | kFloorMatClosed;

/// Pieces of the machine that can say of themselves that they are at fault.
enum Piece : std::uint32_t { kLegsPiece = 1u, kSensorPiece = 2u, kRobotPiece = 4u };
inline constexpr std::uint32_t kAllPieces = kLegsPiece | kSensorPiece | kRobotPiece;

struct Sample {
  std::int64_t sequence = -1;           // [-] counts up by one; -1: nothing received yet
  std::int64_t time = 0;                // [ns] the machine's clock when it was put together
  std::int64_t legs_time = 0;           // [ns] the same clock when the legs were read,
  std::int64_t wrench_time = 0;         // [ns] the six wrench channels,
  std::int64_t joints_time = 0;         // [ns] the robot's joints
  AdcCounts adc{};                      // [count]
  LegCounts legs{};                     // [count] Temposonics
  JointVector q = JointVector::Zero();  // [rad | m] the robot's joints
  std::uint32_t switches = 0;           // bits of Switch
  double temperature = 20.0;            // [C] of the laboratory, by a thermometer beside the sensor
  std::uint32_t faults = 0;             // bits of Piece
  std::int64_t command_source = 0;      // [-] who sent the last command that came; 0: not said
  std::int64_t command_tick = -1;       // [-] its tick
  std::int64_t command_time = 0;        // [ns] the machine's clock when it came

  /// [ns] of the piece that is oldest, when the sample was put together.
  std::int64_t oldest() const noexcept {
    return time - std::min({legs_time, wrench_time, joints_time});
  }
};

struct LegCommand {
  bool engaged = false;       // false: the legs stay where they are and ignore the counts
  LegCounts counts{};         // [count] (C.13) what the servos are told
  LegCounts rest{};           // [count] the checked lengths: where the legs stay, should none follow
  std::int64_t ahead = 0;     // [ns] after its tick, for which those are meant
  std::int32_t segment = -1;  // [-] where the program is; other equipment takes its cue from it
  bool park = false;          // should no command follow, the legs may go home slowly
};

}  // namespace ves
