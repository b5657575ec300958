// SPDX-License-Identifier: BSD-3-Clause
//
// What the controller can be told to do, and what it answers: the items of testPlatform's menu.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "ves/math/frames.hpp"

namespace ves {

enum class AxisMotion : std::int32_t { kHold, kRamp, kSine };

/// What one coordinate does.
struct Axis {
  AxisMotion motion = AxisMotion::kHold;
  double final = 0.0;      // [m | rad] of a ramp, counted from home
  double amplitude = 0.0;  // [m | rad] of a sine
  double frequency = 0.0;  // [Hz] of a sine
};

using Trajectory = std::array<Axis, 6>;

enum class SegmentKind : std::int32_t {
  kCalibration,  // hold until still, and take the bias of the sensor
  kMove,         // brakes if it must, then gently to rest at a pose
  kTrajectory,
  kAdmittance,  // from wherever the platform is, as the model's state at rest
  kMonitor,     // hold, and sample the sensor every interval
  kPath,        // the configuration's recorded path
  kCount
};

std::string_view name(SegmentKind kind) noexcept;

/// One item of testPlatform's menu.
struct Segment {
  SegmentKind kind = SegmentKind::kTrajectory;
  double duration = 0.0;    // [s] of a move: 0 for as long as is gentle
  Pose target;              // of a move, from home
  Trajectory trajectory{};  // of a trajectory
  double interval = 0.0;    // [s] of a monitor segment, from one sample to the next
};

inline constexpr int kMaxSegments = 64;

/// When something happens: `after` the controller's program reached `segment`.
struct Cue {
  int segment = 0;         // [-] -1: since the machine began
  std::int64_t after = 0;  // [ns]
};

enum class Request : std::int32_t {
  kNone,
  kStart,         // take the legs, run the program, come home
  kStop,          // brake, come home gently, let go
  kArm,           // take the legs and hold; orders will follow
  kRun,           // the order's segment
  kHold,          // brake and hold here
  kTare,          // what is measured now is subtracted from here on
  kReset,         // out of a stop, back to disarmed
  kCompensate,    // what the configuration has of compensation comes in
  kUncompensate,  // and goes out again: as published
  kOvertaken,     // an order that a hold or a stop came before: it is answered, and not obeyed
  kCount
};

std::string_view name(Request request) noexcept;

/// Why an order was not taken.
enum class Refusal : std::int32_t {
  kNone,
  kNotArmed,        // the legs are not ours
  kBusy,            // something else is running: hold first
  kArmed,           // the legs are ours already
  kNotStopped,      // nothing to leave
  kCauseRemains,    // a check still fails
  kOutside,         // its path would fail a safety check
  kLoaded,          // the wrench is larger than admittance control should begin with
  kUnstable,        // admittance control with this base and robot would diverge
  kNoCompensation,  // the configuration has none
  kUnassessed,      // the stability of this loop was not checked
  kChecking,        // not refused yet: its path is being checked, over some ticks
  kOvertaken,       // a hold, a stop or a failing check came before it began
  kTooLong,  // the loop grows, slowly: longer than the program's segments it was not let pass
  kCount
};

std::string_view name(Refusal refusal) noexcept;

/// Who gave an order, and its number: where the segment of a kRun is to be found again.
struct OrderId {
  std::int64_t source = 0;
  std::int64_t sequence = -1;  // [-] -1: given without a message
};

struct Order {
  Request request = Request::kNone;
  Segment segment;  // of kRun
  OrderId id;
};

}  // namespace ves
