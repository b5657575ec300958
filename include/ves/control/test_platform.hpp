// SPDX-License-Identifier: BSD-3-Clause
//
// testPlatform: the routines of Appendix C in their order, once every controller period.
//
//                    start                program over
//   disarmed -> armed -----> running ------------------> returning -> parked
//                  \            \   stop requested           ^ |
//                   \            `---------------------------' |
//                    `-- any check trips -> stopped <----------'
//
// The invariant: every command that leaves is either the checked new lengths or the last checked
// ones.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "ves/control/admittance_model.hpp"
#include "ves/control/force_measurement.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/control/leg_communication.hpp"
#include "ves/control/safety_checks.hpp"
#include "ves/control/trajectory_generation.hpp"

namespace ves {

enum class Phase : std::int32_t {
  kDisarmed,   // the legs ignore commands; waiting for a fresh, healthy stream and a start
  kArmed,      // commanding the measured pose, one tick
  kRunning,    // the program
  kReturning,  // gently home
  kParked,     // at home, done
  kStopped     // a check tripped; holding the last checked lengths
};

std::string_view name(Phase phase) noexcept;

enum class SegmentKind : std::int32_t {
  kCalibration,  // hold, and take the bias of the sensor
  kMove,         // brakes if it must, then gently to rest at a pose
  kTrajectory,
  kAdmittance  // from wherever the platform is, as the model's state at rest
};

std::string_view name(SegmentKind kind) noexcept;

/// One item of testPlatform's menu.
struct Segment {
  SegmentKind kind = SegmentKind::kTrajectory;
  double duration = 0.0;    // [s]
  Pose target;              // of a move, from home
  Trajectory trajectory{};  // of a trajectory
};

inline constexpr int kMaxSegments = 64;

struct Program {
  int size = 0;
  std::array<Segment, kMaxSegments> segments{};
};

struct ControllerConfig {
  std::int64_t period = 10'000'000;  // [ns]
  Geometry geometry;
  ForceSensor sensor;
  Vec6 bias = Vec6::Zero();          // [count] until a calibration replaces it
  Payload payload;                   // as the controller believes it to be
  Vec3 gravity = {0.0, 0.0, -9.81};  // [m/s^2] g_I
  ModalModel admittance;
  LegCodec legs;
  SafetyLimits safety;
  Program program;
  double gentle_speed = 0.05;            // [m/s] peak, of moves and the return
  double gentle_rotation = 0.10;         // [rad/s] peak
  double gentle_braking = 1.5;           // [m/s^2] mean, when one begins in motion
  double gentle_rotation_braking = 2.5;  // [rad/s^2] mean
  int arming_samples = 10;               // [-] consecutive ticks with a new sample before arming
};

enum class Request : std::int32_t {
  kNone,
  kStart,  // arm and run the program
  kStop    // come home gently, end the program
};

struct TickInput {
  std::int64_t tick = 0;  // [-] counts controller periods, missed ones included
  Sample sample;          // the newest
  Request request = Request::kNone;
  bool rival = false;  // another controller or machine was heard since the last tick
};

/// Everything one tick knew and decided.
struct TickState {
  std::int64_t tick = 0;              // [-]
  std::int64_t count = -1;            // [-] ticks run before this one
  std::int64_t sample_sequence = -1;  // [-] of the sample used
  Phase phase = Phase::kDisarmed;
  std::int32_t segment = -1;       // [-] of the program
  std::int32_t age = 0;            // [-] ticks since the sample was new
  Wrench total, fixed, dynamic;    // F_Po_I measured; of gravity (the report's static); difference
  PathPoint<6> motion;             // commanded coordinates about home, rates, accelerations
  Vec6 due = Vec6::Zero();         // coordinates that the platform should have at this very tick
  LegMotion legs;                  // commanded
  Vec6 L_measured = Vec6::Zero();  // [m]
  Pose measured;                   // about home, from L_measured
  Vec6 bias = Vec6::Zero();        // [count]
  Tripped tripped;                 // in this tick
  Tripped latched;                 // since the start
  Check cause = Check::kCount;     // the first to latch
  std::int64_t cause_tick = -1;    // [-]
  LegCommand command;
};

class TestPlatform {
 public:
  explicit TestPlatform(const ControllerConfig& config);

  /// One period. Bounded, and free of heap, locks, clocks, logs and exceptions.
  const TickState& tick(const TickInput& in) noexcept;

  /// Parked, or stopped by a check.
  bool done() const noexcept {
    return state_.phase == Phase::kParked || state_.phase == Phase::kStopped;
  }

 private:
  void readSample(const TickInput& in) noexcept;
  void measureWrench(const Sample& sample) noexcept;
  void choosePhase(Request request) noexcept;
  void beginSegment() noexcept;
  void beginMove(const Vec6& target, double duration) noexcept;
  bool segmentIsOver() const noexcept;
  bool commandsNextState() const noexcept;
  const Segment& segment() const noexcept {
    return config_.program.segments[static_cast<std::size_t>(state_.segment)];
  }
  PathPoint<6> nextMotion(const Sample& sample) noexcept;
  Tripped safetyChecks(const TickInput& in, const PathPoint<6>& next, const BodyMotion& P,
                       const LegMotion& legs) const noexcept;
  void trip(Tripped tripped) noexcept;
  PathPoint<6> moveAt(std::int64_t n) const noexcept;
  double gentleDuration(const Vec6& from, const Vec6& to) const noexcept;

  ControllerConfig config_;
  double period_;  // [s]
  JointAxes joint_axes_;
  AdmittanceModel admittance_;
  Mat6 S_proc_;  // [count per N | N m]
  Calibration calibration_;
  TickState state_;
  Transform X_IP_measured_;
  bool legs_solved_ = false;  // forward kinematics found the pose of this sample
  int fresh_ticks_ = 0;       // [-] consecutive ticks with a new sample and no rival
  bool start_requested_ = false;
  std::int64_t n_ = 0;      // [-] ticks of the segment (or the return) so far
  std::int64_t steps_ = 0;  // [-] periods that it lasts
  Vec6 segment_start_ = Vec6::Zero();
  Quintic<6> brake_, move_;  // one after the other
};

}  // namespace ves
