// SPDX-License-Identifier: BSD-3-Clause
//
// testPlatform: the routines of Appendix C in their order, once every controller period.
//
//              start, arm          program, order
//   disarmed -------------> armed ---------------> running --------.
//       ^                   |   ^ <------ over ------'  |          |
//       | reset             |   `------- held ----------|          | a check fails
//       |              stop |                           | stop     |
//       |                   `-------> returning <-------'          |-- freezes -----------.
//       |                                 |                        |                      v
//       |                                 `--> parked              `--> stopping ----> stopped
//       `---------------------------------------------------------------------------------'
//
// Armed is holding still, ready for an order. A program started without anybody in attendance ends
// by returning to home and parking. A check that freezes holds the last checked lengths at once;
// the others brake along the motion first (stopping), and freeze should a freezing check fail
// meanwhile. A stop lasts until a reset, which is refused while its cause remains; what follows
// begins at the measured pose again.
//
// The invariant: every command that leaves is either the checked new lengths or the last checked
// ones.
#pragma once

#include <cstdint>
#include <string_view>

#include "ves/control/admittance_model.hpp"
#include "ves/control/force_measurement.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/control/leg_communication.hpp"
#include "ves/control/monitors.hpp"
#include "ves/control/program.hpp"
#include "ves/control/servo.hpp"

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

/// What goes beyond the report (control/servo.hpp); all off: as published.
struct Compensation {
  bool feed_forward = false;  // the servos' lag taken out of the reference
  bool observer = false;      // the servo model beside the servos: lengths below a count
  bool inertia = false;       // the robot's inertia taken out of the wrench, and into the base
  int mass_update = 1;        // [-] ticks for which the robot's locked mass is kept
  double ramp = 0.5;          // [s] over which they come in, and go out
  double jitter = 0.0;        // [s] by which the time of a leg's reading may be wrong

  bool any() const noexcept { return feed_forward || observer; }
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
  ServoModel servo;  // as the controller believes it to be
  Compensation compensation;
  SafetyLimits safety;
  Program program;
  RecordedPath path;              // of its path segments
  double gentle_speed = 0.05;     // [m/s] peak, of moves and the return
  double gentle_rotation = 0.10;  // [rad/s] peak
  struct Braking {
    double translation = 0.0;  // [m/s^2] mean
    double rotation = 0.0;     // [rad/s^2] mean
  };
  Braking gentle_braking = {1.5, 2.5};   // of moves that begin in motion, and before the envelope
  Braking stop_braking = {5.0, 8.5};     // of a controlled stop
  int arming_samples = 10;               // [-] consecutive ticks with a new sample before arming
  StillnessLimits stillness;             // of a calibration
  double tare_ramp = 1.0;                // [s] over which a tare takes effect
  bool admissible = true;                // admittance control with this base would not diverge,
  bool admissible_uncompensated = true;  // nor would it with the compensation out;
  bool forced = false;                   // or somebody wants it all the same
};

struct TickInput {
  std::int64_t tick = 0;  // [-] counts controller periods, missed ones included
  Sample sample;          // the newest
  Order order;
  bool rival = false;     // another controller or machine was heard since the last tick
  bool ran_long = false;  // ticks were missed because the last one took too long; else it woke late
};

/// Everything one tick knew and decided.
struct TickState {
  std::int64_t tick = 0;              // [-]
  std::int64_t count = -1;            // [-] ticks run before this one
  std::int64_t sample_sequence = -1;  // [-] of the sample used
  Phase phase = Phase::kDisarmed;
  std::int32_t segment = -1;               // [-] of the program, -1 outside it
  SegmentKind kind = SegmentKind::kCount;  // of what runs; kCount: nothing
  OrderId order;                           // the last one given
  Check refused_by = Check::kCount;        // of a path that was refused
  Refusal refusal = Refusal::kNone;        // of it
  std::int64_t idle = 0;                   // [-] ticks to come of which nothing is expected
  std::int32_t age = 0;                    // [-] ticks since the sample was new
  Wrench total, fixed, dynamic;    // F_Po_I measured; of gravity (the report's static); difference
  Wrench inertial;                 // what the robot's locked mass takes, left out of dynamic
  double compensated = 0.0;        // [-] share of the compensation that is in
  PathPoint<6> motion;             // commanded coordinates about home, rates, accelerations
  Vec6 due = Vec6::Zero();         // coordinates that the platform should have at this very tick
  LegMotion legs;                  // commanded
  Vec6 reference = Vec6::Zero();   // [m] what the servos are told, so that the legs go there
  Vec6 L_measured = Vec6::Zero();  // [m]
  Pose measured;                   // about home, from L_measured
  Vec6 bias = Vec6::Zero();        // [count]
  Calibration::Status calibration = Calibration::Status::kNone;  // of the last one asked for
  Unrest unrest = Unrest::kNone;                                 // what it last saw moving
  std::int32_t unrest_index = 0;                                 // [-] which one, from 0
  double unrest_amount = 0.0;                                    // [count | rad | m]
  Vec6 deviation = Vec6::Zero();                                 // [count] of a channel's samples
  Vec6 standard_error = Vec6::Zero();                            // [count] of the bias
  bool cut_short = false;        // the program: a calibration or a start was refused
  double slowed = 1.0;           // [-] share of the admittance model's step that was taken
  std::int64_t late_ticks = 0;   // [-] so far
  Tripped tripped;               // in this tick
  Tripped latched;               // since the start
  Check cause = Check::kCount;   // the first to latch
  std::int64_t cause_tick = -1;  // [-]
  LegCommand command;
};

class TestPlatform {
 public:
  explicit TestPlatform(const ControllerConfig& config);

  /// One period. Bounded, and free of heap, locks, clocks, logs and exceptions.
  const TickState& tick(const TickInput& input) noexcept;

  /// Parked, or stopped by a check.
  bool done() const noexcept {
    return state_.phase == Phase::kParked || state_.phase == Phase::kStopped;
  }

 private:
  void readSample(const TickInput& in) noexcept;
  void observe(std::int64_t periods, bool fresh) noexcept;
  void measureWrench(const Sample& sample) noexcept;
  Wrench felt(const Wrench& weight_S) noexcept;
  Wrench robotInertia(const Sample& sample) noexcept;
  Vec6 expectedLengths() const noexcept;
  Vec6 reference(const LegMotion& legs) const noexcept;
  Refusal obey(const Order& order) noexcept;
  Refusal accept(const Segment& segment) noexcept;
  bool admissible() const noexcept;
  Refusal refusesAdmittance() const noexcept;
  Refusal compensate(bool in) noexcept;
  bool feelsLittle() const noexcept;
  void choosePhase() noexcept;
  void beginProgram(int at) noexcept;
  void begin(const Segment& segment) noexcept;
  void beginReturn() noexcept;
  void beginMove(const Vec6& target, double duration) noexcept;
  Vec6 brake(const ControllerConfig::Braking& braking) noexcept;
  void hold() noexcept;
  void brakeHere() noexcept;
  void planHold(const ControllerConfig::Braking& braking) noexcept;
  void freeze() noexcept;
  bool segmentIsOver() const noexcept;
  void endSegment() noexcept;
  bool nextBrakes() const noexcept;
  bool commandsNextState() const noexcept;
  void calibrate(const Sample& sample) noexcept;
  void tare(const Sample& sample) noexcept;
  std::int64_t idleTicks() const noexcept;
  PathPoint<6> nextMotion(const Sample& sample) noexcept;
  void envelope() noexcept;
  PathPoint<6> pathAt(std::int64_t n) const noexcept;
  Tripped stepChecks(const Vec6& L, const Vec6& L_last, double time) const noexcept;
  Tripped pathChecks(const Transform& X_IP, const Pose& x, const Vec6& L) const noexcept;

  /// A command in the making.
  struct Step {
    PathPoint<6> next;
    LegMotion legs;
    Tripped tripped;
  };
  Step check(const TickInput& in, const PathPoint<6>& next) const noexcept;
  void trip(Tripped tripped) noexcept;
  PathPoint<6> moveAt(std::int64_t n) const noexcept;
  double gentleDuration(const Vec6& from, const Vec6& to) const noexcept;

  ControllerConfig config_;
  double period_;  // [s]
  JointAxes joint_axes_;
  RobotModel carried_;
  Transform X_PL0_;
  AdmittanceModel admittance_;
  ServoObserver servo_;
  Butterworth2<6> weight_;  // as the wrench's filter shows it
  Butterworth2<6>::Step weight_step_;
  RigidBody robot_P_;        // its joints locked
  Mat6 M_1_ = Mat6::Zero();  // of it, about Po in I
  Mat6 S_proc_;              // [count per N | N m]
  Calibration calibration_;
  LegSpeed leg_speed_;
  LegReadings readings_;
  FrozenSensor frozen_;
  Overruns overruns_;
  Oscillation oscillation_;
  ChannelStatistics tare_;  // what the sensor feels beyond what it should
  enum class Tare { kNone, kAveraging, kRamping } taring_ = Tare::kNone;
  Quintic<6> bias_path_;     // [count] of a tare
  std::int64_t tare_n_ = 0;  // [-] ticks since it began
  TickState state_;
  Vec6 carry_ = Vec6::Zero();  // [m] that rounding has left of the commands so far
  Sample sample_;              // the last
  Vec6 load_ = Vec6::Zero();   // [count] what the static load alone would read
  Transform X_IP_measured_;
  bool compensating_ = true;       // unless told otherwise
  bool legs_solved_ = false;       // forward kinematics found the pose of this sample
  int fresh_ticks_ = 0;            // [-] consecutive ticks with a new sample and no rival
  Request wish_ = Request::kNone;  // kStart or kArm: what to do once the stream is fresh
  bool attended_ = false;          // somebody gives orders: hold after what is over
  Segment segment_;                // that runs
  std::int64_t n_ = 0;             // [-] ticks of the segment (or the return) so far
  std::int64_t steps_ = 0;         // [-] periods that it lasts
  std::int64_t begun_ = 0;         // [-] tick in which it began
  Vec6 segment_start_ = Vec6::Zero();
  Quintic<6> brake_, move_;  // one after the other
};

}  // namespace ves
