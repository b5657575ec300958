// SPDX-License-Identifier: BSD-3-Clause
//
// What goes into a tick of testPlatform, and what comes out. The state is a report: the next tick
// reads nothing of it.
#pragma once

#include <cstdint>
#include <string_view>

#include "ves/control/force_measurement.hpp"
#include "ves/control/modelled_servos.hpp"
#include "ves/control/program.hpp"
#include "ves/control/safety_checks.hpp"
#include "ves/control/sample.hpp"

namespace ves {

enum class Phase : std::int32_t {
  kDisarmed,   // the legs ignore commands; waiting for a fresh, healthy stream and a start
  kArmed,      // holding still; the first command is the measured pose
  kRunning,    // a segment: of the program, or an order's
  kReturning,  // gently home
  kParked,     // at home, done
  kStopped,    // a check tripped; holding the last checked lengths
  kStopping    // a controlled stop: braking along the motion
};

std::string_view name(Phase phase) noexcept;

struct TickInput {
  std::int64_t tick = 0;  // [-] counts controller periods, missed ones included
  std::int64_t time = 0;  // [ns] when it began, by the machine's clock
  Sample sample;          // the newest
  Order order;
  bool conflicting_node = false;  // another controller or machine was heard since the last tick
};

/// Everything one tick knew and decided.
struct TickState {
  std::int64_t tick = 0;              // [-]
  std::int64_t count = -1;            // [-] ticks run before this one
  std::int64_t sample_sequence = -1;  // [-] of the sample used
  Phase phase = Phase::kDisarmed;
  std::int32_t segment = -1;               // [-] of the program, -1 outside it
  SegmentKind kind = SegmentKind::kCount;  // of what runs; kCount: nothing
  OrderId order;                           // the last one that was answered
  Refusal refusal = Refusal::kNone;        // the answer
  Check refused_by = Check::kCount;        // of a path that was refused
  std::int64_t idle = 0;                   // [-] ticks to come of which nothing is expected
  std::int32_t age = 0;                    // [-] ticks since the sample was new
  Wrench total;                            // F_Po_I measured
  Wrench static_wrench;                    // of gravity, the report's static wrench
  Wrench inertial;         // of the robot's composite body, when that is compensated
  Wrench reaction;         // of its joints in motion, modelled, when the wrench is aided
  bool withholds = false;  // of total - static_wrench + inertial what differs from it, as noise
  Wrench dynamic;          // the rest: the admittance model's input
  double compensation_share = 0.0;  // [-] of the compensation that is in
  PathPoint<6> motion;              // commanded coordinates about home, rates, accelerations
  Vec6 desired = Vec6::Zero();      // coordinates that the platform should have at this very tick
  LegMotion legs;                   // commanded
  Vec6 reference = Vec6::Zero();    // [m] what the servos are told, so that the legs go there
  ServoGains servo;                 // of the servo model in use
  Vec6 L_measured = Vec6::Zero();   // [m]
  Pose measured;                    // about home, from L_measured
  Vec6 bias = Vec6::Zero();         // [count]
  Calibration::Status calibration = Calibration::Status::kNone;  // of the last one asked for
  StillnessViolation violation = StillnessViolation::kNone;      // what it last saw moving
  std::int32_t violation_index = 0;                              // [-] which one, from 0
  double violation_amount = 0.0;                                 // [count | rad | m]
  Vec6 deviation = Vec6::Zero();                                 // [count] of a channel's samples
  Vec6 standard_error = Vec6::Zero();                            // [count] of the bias
  bool aborted = false;                 // the program: a calibration or a start was refused
  Refusal aborted_by = Refusal::kNone;  // why the start was
  double envelope_scale = 1.0;          // [-] of the admittance model's step that was taken
  double energy_put_in = 0.0;           // [J] by the emulation, since admittance control began
  double energy_paid = 0.0;             // [J] by the model's modes, to the passivity controller
  double passivity_damping = 0.0;       // [1/s] of every mode, in the next step
  std::int64_t late_ticks = 0;          // [-] so far
  Tripped tripped;                      // in this tick
  Tripped latched;                      // since the start
  Check cause = Check::kCount;          // the first to latch
  std::int64_t cause_tick = -1;         // [-]
  LegCommand command;
};

}  // namespace ves
