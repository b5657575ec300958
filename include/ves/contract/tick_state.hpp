// SPDX-License-Identifier: BSD-3-Clause
//
// What goes into a tick of testPlatform, and what comes out. The state is a report: the next tick
// reads nothing of it. Each field is described in contract/schema.hpp.
#pragma once

#include <cstdint>
#include <string_view>

#include "ves/contract/check.hpp"
#include "ves/contract/order.hpp"
#include "ves/contract/sample.hpp"
#include "ves/math/quintic.hpp"
#include "ves/robot/mass_regressor.hpp"

namespace ves {

enum class Phase : std::int32_t {
  kDisarmed,   // the legs ignore commands; waiting for a fresh, healthy stream and a start
  kArmed,      // holding still; the first command is the measured pose
  kRunning,    // a segment: of the program, or an order's
  kReturning,  // gently home
  kParked,     // at home, done
  kStopped,    // a check tripped; holding the last checked lengths
  kStopping,   // a controlled stop: braking along the motion
  kCount
};
std::string_view name(Phase phase) noexcept;

/// How far the calibration has come.
enum class CalibrationStatus : std::int32_t { kNone, kTaking, kDone, kRefused, kCount };
std::string_view name(CalibrationStatus status) noexcept;

/// What kept a calibration from being taken.
enum class StillnessViolation : std::int32_t { kNone, kLeg, kJoint, kChannel, kBias, kCount };
std::string_view name(StillnessViolation violation) noexcept;

/// What the servo model is told of each leg, and what a machine's may differ in.
struct ServoGains {
  Vec6 extend = Vec6::Zero();   // [1/s] K for E > 0
  Vec6 retract = Vec6::Zero();  // [1/s] and for E < 0
  Vec6 delay = Vec6::Zero();    // [s]
};

struct TickInput {
  std::int64_t tick = 0;  // [-] counts controller periods, missed ones included
  std::int64_t time = 0;  // [ns] when it began, by the machine's clock
  Sample sample;          // the newest
  Order order;
  bool conflicting_node = false;  // another controller or machine was heard since the last tick
};

/// Everything one tick knew and decided; a pure function of its inputs, all of which it names.
struct TickState {
  std::int64_t tick = 0;
  std::int64_t count = -1;
  std::int64_t time = 0;
  std::int64_t sample_sequence = -1;
  Request request = Request::kNone;
  OrderId request_id;
  OrderId order;
  Refusal refusal = Refusal::kNone;
  Check refused_by = Check::kCount;
  bool conflicting_node = false;
  Phase phase = Phase::kDisarmed;
  std::int32_t segment = -1;
  SegmentKind kind = SegmentKind::kCount;
  std::int64_t idle = 0;
  std::int32_t age = 0;
  Wrench total, static_wrench, inertial, reaction;  // F_Po_I
  bool withholds = false;
  BodyMasses learnt;
  Wrench dynamic;  // F_Po_I
  PathPoint<6> motion;
  Vec6 desired = Vec6::Zero();
  LegMotion legs;
  double compensation_share = 0.0;
  Vec6 reference = Vec6::Zero();
  ServoGains servo;
  Vec6 L_measured = Vec6::Zero();
  Pose measured;
  Vec6 bias = Vec6::Zero();
  CalibrationStatus calibration = CalibrationStatus::kNone;
  StillnessViolation violation = StillnessViolation::kNone;
  std::int32_t violation_index = 0;
  double violation_amount = 0.0;
  Vec6 deviation = Vec6::Zero();
  Vec6 standard_error = Vec6::Zero();
  Tripped tripped, latched;
  Check cause = Check::kCount;
  std::int64_t cause_tick = -1;
  bool aborted = false;
  Refusal aborted_by = Refusal::kNone;
  double envelope_scale = 1.0;
  double energy_put_in = 0.0;
  double energy_paid = 0.0;
  double passivity_damping = 0.0;
  std::int64_t late_ticks = 0;
  LegCommand command;
  VehicleVerdict request_verdict;
  VehicleFactors vehicle, vehicle_ordered;
  double vehicle_energy = 0.0;
  Thrust thrust;
};

}  // namespace ves
