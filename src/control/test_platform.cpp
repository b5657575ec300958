// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/test_platform.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace ves {
namespace {

/// The same place, at rest.
PathPoint<6> atRest(const Vec6& x) {
  PathPoint<6> point;
  point.x = x;
  return point;
}

}  // namespace

std::string_view name(Phase phase) noexcept {
  switch (phase) {
    case Phase::kDisarmed: return "disarmed";
    case Phase::kArmed: return "armed";
    case Phase::kRunning: return "running";
    case Phase::kReturning: return "returning";
    case Phase::kParked: return "parked";
    case Phase::kStopped: return "stopped";
  }
  return "unknown";
}

TestPlatform::TestPlatform(const ControllerConfig& config)
    : config_(config),
      period_(static_cast<double>(config.period) * kSecondPerNanosecond),
      joint_axes_(config.geometry),
      admittance_(config.admittance, period_),
      S_proc_(config.sensor.C_proc.inverse()),
      calibration_(config.stillness),
      X_IP_measured_(config.geometry.fromHome({})) {
  state_.bias = config.bias;
}

const TickState& TestPlatform::tick(const TickInput& in) noexcept {
  readSample(in);
  measureWrench(in.sample);  // force measurement, gravity compensation
  if (in.order.request != Request::kNone) {
    state_.order = in.order.id;
    state_.refusal = obey(in.order);
  }
  choosePhase();

  // Admittance model or trajectory generation, then inverse kinematics.
  const PathPoint<6> next = nextMotion(in.sample);
  const BodyMotion P = bodyMotion(config_.geometry, Pose::from(next.x), next.x_dot, next.x_ddot);
  const LegMotion legs = legMotion(config_.geometry, P);

  state_.tripped = safetyChecks(in, next, P, legs);
  if (state_.phase != Phase::kDisarmed && state_.tripped.any()) trip(state_.tripped);

  if (state_.phase != Phase::kStopped) {  // leg communication
    state_.due = commandsNextState() ? state_.motion.x : next.x;
    state_.motion = next;
    state_.legs = legs;
    state_.command.engaged = state_.phase != Phase::kDisarmed;
    state_.command.segment = state_.segment;
    if (legs.L.allFinite()) state_.command.counts = legCounts(config_.legs, legs.L);
  }
  state_.kind = state_.phase == Phase::kRunning ? segment_.kind : SegmentKind::kCount;
  state_.idle = idleTicks();
  return state_;
}

void TestPlatform::readSample(const TickInput& in) noexcept {
  const Sample& sample = in.sample;
  const bool fresh = sample.sequence > state_.sample_sequence;
  state_.age = fresh ? 0 : state_.age + 1;
  fresh_ticks_ = fresh && !in.rival ? fresh_ticks_ + 1 : 0;
  state_.tick = in.tick;
  ++state_.count;
  state_.sample_sequence = sample.sequence;

  state_.L_measured = legLengths(config_.legs, sample.legs);
  const ForwardSolution forward = forwardPose(config_.geometry, state_.L_measured, X_IP_measured_);
  legs_solved_ = forward.ok();
  if (legs_solved_) X_IP_measured_ = forward.X_IP;
  state_.measured = config_.geometry.toHome(X_IP_measured_);
}

void TestPlatform::measureWrench(const Sample& sample) noexcept {
  // The measured attitude: the commanded one leads it by the servo's lag, and the difference would
  // pass as a wrench of the robot's weight.
  const Mat3& R_IP = X_IP_measured_.R;
  tare(sample);
  state_.total = forceMeasurement(config_.sensor, state_.bias, sample.adc, R_IP);
  state_.fixed = gravityCompensation(config_.payload, sample.q, R_IP, config_.gravity);
  state_.dynamic = state_.total - state_.fixed;
}

Refusal TestPlatform::obey(const Order& order) noexcept {
  const Phase phase = state_.phase;
  const bool ours =
      phase == Phase::kArmed || phase == Phase::kRunning || phase == Phase::kReturning;
  switch (order.request) {
    case Request::kNone:
    case Request::kCount: return Refusal::kNone;
    case Request::kArm:
    case Request::kStart:
      if (phase == Phase::kDisarmed) {
        wish_ = order.request;
        attended_ = order.request == Request::kArm;
        return Refusal::kNone;
      }
      if (order.request == Request::kArm) return ours ? Refusal::kArmed : Refusal::kNotArmed;
      if (phase != Phase::kArmed) return ours ? Refusal::kBusy : Refusal::kNotArmed;
      beginProgram(0);
      return Refusal::kNone;
    case Request::kStop:
      wish_ = Request::kNone;
      if (phase == Phase::kArmed || phase == Phase::kRunning) beginReturn();
      attended_ = false;
      return Refusal::kNone;
    case Request::kRun:
      if (!ours) return Refusal::kNotArmed;
      if (phase != Phase::kArmed) return Refusal::kBusy;
      begin(order.segment);
      return Refusal::kNone;
    case Request::kHold:
      if (!ours) return Refusal::kNotArmed;
      if (phase != Phase::kArmed) hold();
      attended_ = true;
      return Refusal::kNone;
    case Request::kTare:
      if (!ours) return Refusal::kNotArmed;
      if (state_.kind == SegmentKind::kCalibration || taring_ != Tare::kNone) return Refusal::kBusy;
      taring_ = Tare::kAveraging;
      tare_.reset();
      return Refusal::kNone;
    case Request::kReset:
      if (phase != Phase::kStopped) return Refusal::kNotStopped;
      if (state_.tripped.any()) return Refusal::kCauseRemains;
      state_.phase = Phase::kDisarmed;
      state_.segment = -1;
      state_.latched = {};
      state_.cause = Check::kCount;
      state_.cause_tick = -1;
      fresh_ticks_ = 0;
      wish_ = Request::kNone;
      return Refusal::kNone;
  }
  return Refusal::kNone;
}

void TestPlatform::choosePhase() noexcept {
  switch (state_.phase) {
    case Phase::kDisarmed:
      if (wish_ != Request::kNone && fresh_ticks_ > config_.arming_samples && !state_.tripped.any())
        state_.phase = Phase::kArmed;
      break;
    case Phase::kArmed:
      if (wish_ == Request::kStart) beginProgram(0);
      wish_ = Request::kNone;
      break;
    case Phase::kRunning:
      if (!segmentIsOver()) break;
      // A program does not go on without the calibration it asked for.
      if (state_.segment >= 0 && calibration_.status() != Calibration::Status::kRefused)
        beginProgram(state_.segment + 1);
      else if (state_.segment >= 0)
        beginReturn();
      else
        state_.phase = Phase::kArmed;
      break;
    case Phase::kReturning:
      if (n_ < steps_) break;
      state_.phase = attended_ ? Phase::kArmed : Phase::kParked;
      if (attended_) state_.segment = -1;
      break;
    case Phase::kParked:
    case Phase::kStopped: break;
  }
}

bool TestPlatform::segmentIsOver() const noexcept {
  switch (segment_.kind) {
    case SegmentKind::kCalibration: return calibration_.status() != Calibration::Status::kTaking;
    case SegmentKind::kWatch: return state_.tick - begun_ >= steps_;
    case SegmentKind::kMove:
    case SegmentKind::kTrajectory:
    case SegmentKind::kAdmittance:
    case SegmentKind::kCount: break;
  }
  return n_ >= steps_;
}

/// The admittance model determines the next state; everything else says where to be now.
bool TestPlatform::commandsNextState() const noexcept {
  return state_.phase == Phase::kRunning && segment_.kind == SegmentKind::kAdmittance;
}

void TestPlatform::beginProgram(int at) noexcept {
  state_.segment = at;
  if (at < config_.program.size)
    begin(config_.program.segments[static_cast<std::size_t>(at)]);
  else
    beginReturn();
}

void TestPlatform::begin(const Segment& segment) noexcept {
  state_.phase = Phase::kRunning;
  segment_ = segment;
  n_ = 0;
  begun_ = state_.tick;
  steps_ = std::llround(segment.duration / period_);
  segment_start_ = state_.motion.x;
  switch (segment.kind) {
    case SegmentKind::kCalibration: calibration_.begin(); break;
    case SegmentKind::kMove: beginMove(segment.target.stacked(), segment.duration); break;
    case SegmentKind::kAdmittance: admittance_.reset(segment_start_); break;
    case SegmentKind::kTrajectory:
    case SegmentKind::kWatch:
    case SegmentKind::kCount: break;
  }
}

void TestPlatform::beginReturn() noexcept {
  state_.phase = Phase::kReturning;
  state_.segment = config_.program.size;
  beginMove(Vec6::Zero(), 0.0);
}

/// Plans the braking at a gentle rate; where it ends.
Vec6 TestPlatform::brake() noexcept {
  const Vec6& v = state_.motion.x_dot;
  const double time = std::max(v.head<3>().norm() / config_.gentle_braking,
                               v.tail<3>().norm() / config_.gentle_rotation_braking);
  brake_ = Quintic<6>();
  if (!(time > 0.0)) return state_.motion.x;
  const Vec6 rest = state_.motion.x + 0.5 * time * v;
  PathPoint<6> from = atRest(state_.motion.x);
  from.x_dot = v;
  brake_ = Quintic<6>(from, rest, time);
  return rest;
}

/// To rest, then by a quintic to `target`; 0 s: as long as is gentle.
void TestPlatform::beginMove(const Vec6& target, double duration) noexcept {
  const Vec6 rest = brake();
  if (duration <= 0.0) duration = gentleDuration(rest, target);
  move_ = Quintic<6>(atRest(rest), target, duration);
  n_ = 0;
  steps_ = static_cast<std::int64_t>(std::ceil((brake_.duration() + duration) / period_));
}

/// Brakes, and is armed again.
void TestPlatform::hold() noexcept {
  state_.phase = Phase::kRunning;
  state_.segment = -1;
  segment_ = {};
  segment_.kind = SegmentKind::kMove;
  const Vec6 rest = brake();
  move_ = Quintic<6>(atRest(rest), rest, period_);
  n_ = 0;
  steps_ = static_cast<std::int64_t>(std::ceil(brake_.duration() / period_));
}

PathPoint<6> TestPlatform::moveAt(std::int64_t n) const noexcept {
  const double t = static_cast<double>(n) * period_;
  return t < brake_.duration() ? brake_.at(t) : move_.at(t - brake_.duration());
}

double TestPlatform::gentleDuration(const Vec6& from, const Vec6& to) const noexcept {
  const double distance = (to - from).head<3>().norm(), angle = (to - from).tail<3>().norm();
  return std::max({1.0, kQuinticPeakRate * distance / config_.gentle_speed,
                   kQuinticPeakRate * angle / config_.gentle_rotation});
}

PathPoint<6> TestPlatform::nextMotion(const Sample& sample) noexcept {
  switch (state_.phase) {
    case Phase::kDisarmed: return atRest(state_.measured.stacked());
    case Phase::kArmed:
      return atRest(state_.command.engaged ? state_.motion.x : state_.measured.stacked());
    case Phase::kReturning: return moveAt(++n_);  // where it starts, the platform is already
    case Phase::kParked:
    case Phase::kStopped: return atRest(state_.motion.x);
    case Phase::kRunning: break;
  }
  const std::int64_t n = ++n_;
  switch (segment_.kind) {
    case SegmentKind::kCalibration: calibrate(sample); break;
    case SegmentKind::kMove: return moveAt(n);
    case SegmentKind::kTrajectory:
      return trajectoryGeneration(segment_.trajectory, segment_start_, n, steps_, period_);
    case SegmentKind::kAdmittance:
      // A wrench that is no number must not enter the model's state; the finite check stops the
      // run.
      if (state_.dynamic.stacked().allFinite()) admittance_.step(state_.dynamic);
      return admittance_.motion();
    case SegmentKind::kWatch:
    case SegmentKind::kCount: break;
  }
  return atRest(state_.motion.x);
}

/// What the static load alone would read.
Vec6 TestPlatform::staticCounts(const Sample& sample) const noexcept {
  return S_proc_ *
         staticWrench(config_.payload, sample.q, X_IP_measured_.R, config_.gravity).stacked();
}

void TestPlatform::calibrate(const Sample& sample) noexcept {
  if (state_.age == 0) calibration_.add(sample, staticCounts(sample));
  state_.calibration = calibration_.status();
  state_.unrest = calibration_.unrest();
  state_.unrest_index = calibration_.unrestIndex();
  state_.unrest_amount = calibration_.unrestAmount();
  if (calibration_.status() != Calibration::Status::kDone) return;
  state_.bias = calibration_.statistics().mean();
  state_.deviation = calibration_.statistics().deviation();
  state_.standard_error = calibration_.statistics().standardError();
}

/// The bias slides to what the sensor reads beyond the static load, on average: the admittance
/// model never sees a step.
void TestPlatform::tare(const Sample& sample) noexcept {
  switch (taring_) {
    case Tare::kNone: return;
    case Tare::kAveraging:
      if (state_.age != 0 || !sample.q.allFinite()) return;
      tare_.add(sample.adc, staticCounts(sample));
      if (!tare_.complete()) return;
      bias_path_ = Quintic<6>(atRest(state_.bias), tare_.mean(), config_.tare_ramp);
      tare_n_ = 0;
      taring_ = Tare::kRamping;
      return;
    case Tare::kRamping:
      const double t = static_cast<double>(++tare_n_) * period_;
      state_.bias = bias_path_.at(t).x;
      if (t >= config_.tare_ramp) taring_ = Tare::kNone;
  }
}

/// Until the next look of a watch, its last tick excepted.
std::int64_t TestPlatform::idleTicks() const noexcept {
  if (state_.kind != SegmentKind::kWatch) return 0;
  const std::int64_t interval = std::llround(segment_.interval / period_);
  if (interval <= kCalibrationSamples) return 0;
  const std::int64_t since = state_.tick - begun_, into = since % interval;
  if (into < kCalibrationSamples - 1) return 0;
  return std::max<std::int64_t>(0, std::min(interval - into, steps_ - since) - 1);
}

Tripped TestPlatform::safetyChecks(const TickInput& in, const PathPoint<6>& next,
                                   const BodyMotion& P, const LegMotion& legs) const noexcept {
  const SafetyLimits& limits = config_.safety;
  // Before the legs follow, the last command is where they are.
  const bool following = state_.command.engaged;
  const Vec6& L_last = following ? state_.legs.L : legs.L;
  const Vec6& L_in_force = following ? state_.legs.L : state_.L_measured;

  Tripped t;
  t.require(Check::kPanicButton, in.sample.switches & kPanicButtonClosed);
  t.require(Check::kFloorMat, in.sample.switches & kFloorMatClosed);
  t.require(Check::kFinite, next.x.allFinite() && next.x_dot.allFinite() &&
                                next.x_ddot.allFinite() && legs.L.allFinite() &&
                                in.sample.q.allFinite() && state_.dynamic.stacked().allFinite());
  t.require(Check::kStale, in.sample.sequence >= 0 && state_.age <= limits.stale_ticks);
  t.require(Check::kForwardKinematics, legs_solved_);
  t.require(Check::kPositionError, positionErrorCheck(limits, L_in_force, state_.L_measured));
  t.require(Check::kMotionLimits, motionLimitsCheck(limits, Pose::from(next.x)));
  t.require(Check::kActuatorLimits, actuatorLimitsCheck(limits, legs.L));
  t.require(Check::kJointLimits, joint_axes_.check(limits, config_.geometry, P.X));
  t.require(Check::kCollide, collideCheck(limits, config_.geometry, P.X));
  t.require(Check::kVelocity, velocityCheck(limits, legs.L, L_last, period_));
  t.require(Check::kFlow, flowLimitsCheck(limits, legs.L, L_last, period_));
  t.require(Check::kRival, !in.rival);
  return t;
}

/// Latches, and holds the last checked lengths from now on.
void TestPlatform::trip(Tripped tripped) noexcept {
  state_.latched = state_.latched | tripped;
  if (state_.phase == Phase::kStopped) return;
  state_.phase = Phase::kStopped;
  state_.cause = tripped.first();
  state_.cause_tick = state_.tick;
  state_.motion = atRest(state_.motion.x);
  state_.legs.L_dot.setZero();
  state_.legs.L_ddot.setZero();
}

}  // namespace ves
