// SPDX-License-Identifier: BSD-3-Clause
//
// What the controller can be told to do, and what it answers: the items of testPlatform's menu.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "ves/math/frames.hpp"

namespace ves {

/// What one coordinate of a trajectory does.
enum class AxisMotion : std::int32_t { kHold, kRamp, kSine, kCount };

/// What the six coordinates do, and the numbers of it; those of other motions count for nothing.
struct Trajectory {
  std::array<AxisMotion, 6> motion{};
  Vec6 final = Vec6::Zero();      // [m | rad] of a ramp, counted from home
  Vec6 amplitude = Vec6::Zero();  // [m | rad] of a sine
  Vec6 frequency = Vec6::Zero();  // [Hz] of a sine
};

/// A number that a motion takes.
struct MotionNumber {
  const char* key = nullptr;   // in a scenario; of a length or an angle "_m" or "_deg" follows
  const char* word = nullptr;  // at the console
  Vec6 Trajectory::*value = nullptr;
  double most = 0.0;  // [Hz]; 0: it is a length or an angle
};

/// How a motion is asked for, in scenarios and orders.
struct MotionMeaning {
  AxisMotion motion;
  std::string_view name;
  std::array<MotionNumber, 3> numbers{};
};

/// One line a motion, in the order of AxisMotion.
inline constexpr MotionMeaning kMotions[] = {
    {AxisMotion::kHold, "hold", {}},
    {AxisMotion::kRamp, "ramp", {{{"to", "to", &Trajectory::final}}}},
    {AxisMotion::kSine,
     "sine",
     {{{"amplitude", "amplitude", &Trajectory::amplitude},
       {"frequency_hz", "frequency", &Trajectory::frequency, 50.0}}}},
};
static_assert(
    [] {
      int n = 0;
      for (const MotionMeaning& m : kMotions)
        if (static_cast<int>(m.motion) != n++) return false;
      return n == static_cast<int>(AxisMotion::kCount);
    }(),
    "each motion has a line in kMotions, in the order of AxisMotion");

constexpr std::string_view name(AxisMotion motion) noexcept {
  return motion < AxisMotion::kCount ? kMotions[static_cast<std::size_t>(motion)].name : "unknown";
}

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
  double duration = 0.0;  // [s] of a move: 0 for as long as is gentle
  Pose target;            // of a move, from home
  Trajectory trajectory;  // of a trajectory
  double interval = 0.0;  // [s] of a monitor segment, from one sample to the next
};

inline constexpr int kMaxSegments = 128;

/// When something happens: `after` the controller's program reached `segment`.
struct Cue {
  int segment = 0;         // [-] -1: since the machine began
  std::int64_t after = 0;  // [ns]
};

/// What times the configured vehicle is emulated; modes share them.
struct VehicleFactors {
  double mass = 1.0, damping = 1.0, stiffness = 1.0;  // [-]

  bool operator==(const VehicleFactors&) const = default;
};

inline constexpr double kLeastVehicleFactor = 0.01, kMostVehicleFactor = 100.0;  // [-]

/// Another vehicle, while it is emulated.
struct VehicleOrder {
  VehicleFactors to{0.0, 0.0, 0.0};  // 0: stays
  double over = 0.0;                 // [s]

  /// What it leads to where `present` stays.
  constexpr VehicleFactors appliedTo(const VehicleFactors& present) const noexcept {
    const auto one = [](double factor, double stays) { return factor > 0.0 ? factor : stays; };
    return {one(to.mass, present.mass), one(to.damping, present.damping),
            one(to.stiffness, present.stiffness)};
  }
};

inline constexpr int kMostThrusters = 16;      // [-] of a vehicle
inline constexpr double kLongestThrust = 1e3;  // [s] by one order

/// Thrusters of a vehicle that floats are on from now on, for so long [s] each; 0: as it was.
using ThrustOrder = Eigen::Matrix<double, kMostThrusters, 1>;

/// What a vehicle that floats pushes itself with in a step.
struct Thrust {
  double time = 0.0;                       // [s] since it was let go, when the step begins
  ThrustOrder left = ThrustOrder::Zero();  // [s] that each thruster is on from then, by orders
  std::uint32_t on = 0;  // bit i: thruster i, kMostThrusters + i: the couple about axis i of P
};

/// Whether admittance control with this vehicle, robot and machine decays (analysis/gate.hpp).
enum class Stability : std::int32_t {
  kUnknown,   // not checked: refused
  kStable,    // begins
  kUnstable,  // refused
  kForced,    // begins, whatever the check said
  kCount
};
inline constexpr std::string_view kStabilityNames[] = {"unknown", "stable", "unstable", "forced"};
static_assert(std::size(kStabilityNames) == static_cast<std::size_t>(Stability::kCount));
constexpr std::string_view name(Stability stability) noexcept {
  return stability < Stability::kCount ? kStabilityNames[static_cast<std::size_t>(stability)]
                                       : "unknown";
}

/// The stability check of a change of the vehicle, compensation in and out. No message carries it
/// to the controller: its own process asks.
struct VehicleVerdict {
  Stability compensated = Stability::kUnknown, uncompensated = Stability::kUnknown;
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
  kVehicle,       // its mass, damping and stiffness change to the order's
  kGripper,       // it has closed or opened: what is in the hand is to be learnt
  kThrust,        // the vehicle's thrusters are on for so long as the order says
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
  kTooLong,      // the loop grows, slowly: longer than the program's segments it was not let pass
  kTooFast,      // a mode of the vehicle would be too fast to be followed with the robot on it
  kNotLearning,  // the robot's masses, and so what is in its hand, are not learnt
  kNoSuchPart,   // the vehicle has no springs, dampers or thrusters, or not this one
  kTooShort,     // a thruster cannot be on for so short a time
  kNotEmulated,  // no vehicle is emulated now
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
  std::int64_t controller = 0;               // header.source of the states of the one that is meant
  VehicleOrder vehicle = {};                 // of kVehicle,
  VehicleVerdict verdict = {};               // and what the stability check says of it
  ThrustOrder thrust = ThrustOrder::Zero();  // of kThrust
};

/// An order of which the name is not all: it has to be kept to be given again.
constexpr bool hasNumbers(Request request) noexcept {
  return request == Request::kRun || request == Request::kVehicle || request == Request::kThrust;
}

}  // namespace ves
