// SPDX-License-Identifier: BSD-3-Clause
//
// testPlatform's phases: what an order, the end of a segment or a failing check leads to. The
// state diagram is in control/test_platform.hpp.
#pragma once

#include <optional>

#include "ves/contract/tick_state.hpp"
#include "ves/control/answers.hpp"
#include "ves/control/leg_commander.hpp"
#include "ves/control/motion_generator.hpp"
#include "ves/control/robot_load.hpp"
#include "ves/control/sensor_bias.hpp"
#include "ves/control/tick_clock.hpp"

namespace ves {

/// What a tick has found when orders and phases are decided.
struct Situation {
  const ControllerConfig& config;
  const PathChecks& path;
  std::int64_t tick;      // [-]
  int fresh_ticks;        // [-] in a row
  const Wrench& dynamic;  // F_Po_I
  const Mat6& M_1;        // of the composite body that is compensated
  double age;             // [s] of the wrench
  const Vec6& L;          // [m] lengths last commanded
};

/// What a decision acts on.
struct Actuation {
  MotionGenerator& motion;
  SensorBias& bias;
  SampleStream& samples;
  CompensationShare& share;
  KnownPayload& carried;
};

class Supervisor {
 public:
  /// An order of the menu: taken, or refused with a reason.
  void handle(const Order& order, const Situation& now, Actuation act) noexcept;
  /// Phases that follow by themselves: armed, the program's next segment, home, parked.
  void advance(const Situation& now, Actuation act) noexcept;
  /// The checks that failed in this tick. True in the first tick of a controlled stop, when another
  /// motion is to be commanded than the one that was checked.
  bool trip(Tripped tripped, const Situation& now, Actuation act) noexcept;
  /// The same of the first motion of a controlled stop: freezes if a check that freezes fails.
  void tripStopping(Tripped tripped, Actuation act) noexcept;

  Phase phase() const noexcept { return phase_; }
  bool stopped() const noexcept { return phase_ == Phase::kStopped; }
  bool disarmed() const noexcept { return phase_ == Phase::kDisarmed; }
  /// A plan or the admittance model is under way.
  bool moves() const noexcept {
    return phase_ == Phase::kRunning || phase_ == Phase::kReturning || phase_ == Phase::kStopping;
  }
  bool runs(const MotionGenerator& motion, SegmentKind kind) const noexcept {
    return phase_ == Phase::kRunning && motion.kind() == kind;
  }
  /// What runs; kCount: nothing.
  SegmentKind kind(const MotionGenerator& motion) const noexcept {
    return phase_ == Phase::kRunning ? motion.kind() : SegmentKind::kCount;
  }
  std::int32_t segment() const noexcept { return segment_; }

  /// The end of a tick: everything of the report that is decided here.
  void report(TickState& state) noexcept;

 private:
  Refusal obey(const Order& order, const Situation& now, Actuation act) noexcept;
  Refusal arm(Request request, const Situation& now, Actuation act) noexcept;
  Refusal run(const Segment& segment, const Situation& now, Actuation act) noexcept;
  void rehearse(const Situation& now, Actuation act) noexcept;
  void forgetRehearsal() noexcept;
  void abort(Refusal why, const Situation& now, Actuation act) noexcept;
  Refusal compensate(bool in, const Situation& now, Actuation act) noexcept;
  Refusal changeVehicle(const Order& order, const Situation& now, Actuation act) noexcept;
  Refusal refusesLoop(const ControllerConfig& config, bool compensated,
                      double duration) const noexcept;
  Refusal reset(Actuation act) noexcept;
  Refusal refusesAdmittance(const Segment& segment, const Situation& now,
                            Actuation act) const noexcept;
  bool ours() const noexcept;
  void beginProgram(int at, const Situation& now, Actuation act) noexcept;
  void begin(const Segment& segment, const Situation& now, Actuation act) noexcept;
  void beginReturn(const Situation& now, Actuation act) noexcept;
  void endSegment(const Situation& now, Actuation act) noexcept;
  bool nextBrakes(const Program& program) const noexcept;
  bool segmentIsOver(const Situation& now, Actuation act) const noexcept;
  void latch(Tripped tripped, Actuation act) noexcept;

  Phase phase_ = Phase::kDisarmed;
  std::int32_t segment_ = -1;                 // [-] of the program, -1 outside it
  Request pending_request_ = Request::kNone;  // kStart or kArm, once the stream is fresh
  bool operator_present_ = false;             // somebody gives orders: hold after what is over
  bool aborted_ = false;                      // the program: a calibration or a start was refused
  Refusal aborted_by_ = Refusal::kNone;       // why, of a start
  std::optional<VehicleVerdict> changed_;     // of the vehicle, once it is not the configured one
  Answers answers_;
  Order rehearsed_;  // the order whose path is being checked
  Rehearsal rehearsal_;
  Tripped tripped_;               // in the last tick
  Tripped latched_;               // since the start
  Check cause_ = Check::kCount;   // the first to latch
  std::int64_t cause_tick_ = -1;  // [-]
};

}  // namespace ves
