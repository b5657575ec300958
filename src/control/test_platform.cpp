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

std::string_view name(SegmentKind kind) noexcept {
  switch (kind) {
    case SegmentKind::kCalibration: return "calibration";
    case SegmentKind::kMove: return "move";
    case SegmentKind::kTrajectory: return "trajectory";
    case SegmentKind::kAdmittance: return "admittance";
  }
  return "unknown";
}

TestPlatform::TestPlatform(const ControllerConfig& config)
    : config_(config),
      period_(static_cast<double>(config.period) * kSecondPerNanosecond),
      joint_axes_(config.geometry),
      admittance_(config.admittance, period_),
      S_proc_(config.sensor.C_proc.inverse()),
      X_IP_measured_(config.geometry.fromHome({})) {
  state_.bias = config.bias;
}

const TickState& TestPlatform::tick(const TickInput& in) noexcept {
  readSample(in);
  measureWrench(in.sample);  // force measurement, gravity compensation
  choosePhase(in.request);

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
  state_.total = forceMeasurement(config_.sensor, state_.bias, sample.adc, R_IP);
  state_.fixed = gravityCompensation(config_.payload, sample.q, R_IP, config_.gravity);
  state_.dynamic = state_.total - state_.fixed;
}

void TestPlatform::choosePhase(Request request) noexcept {
  if (request == Request::kStart) start_requested_ = true;
  if (request == Request::kStop) start_requested_ = false;

  switch (state_.phase) {
    case Phase::kDisarmed:
      if (start_requested_ && fresh_ticks_ > config_.arming_samples && !state_.tripped.any())
        state_.phase = Phase::kArmed;
      break;
    case Phase::kArmed:
    case Phase::kRunning:
      if (request == Request::kStop)
        state_.segment = config_.program.size;
      else if (state_.phase == Phase::kArmed || segmentIsOver())
        ++state_.segment;
      else
        break;
      beginSegment();
      break;
    case Phase::kReturning:
      if (n_ >= steps_) state_.phase = Phase::kParked;
      break;
    case Phase::kParked:
    case Phase::kStopped: break;
  }
}

bool TestPlatform::segmentIsOver() const noexcept {
  switch (segment().kind) {
    case SegmentKind::kCalibration: return calibration_.complete();
    case SegmentKind::kMove:
    case SegmentKind::kTrajectory:
    case SegmentKind::kAdmittance: return n_ >= steps_;
  }
  return true;
}

/// The admittance model determines the next state; everything else says where to be now.
bool TestPlatform::commandsNextState() const noexcept {
  return state_.phase == Phase::kRunning && segment().kind == SegmentKind::kAdmittance;
}

void TestPlatform::beginSegment() noexcept {
  if (state_.segment >= config_.program.size) {
    state_.phase = Phase::kReturning;
    beginMove(Vec6::Zero(), 0.0);
    return;
  }
  state_.phase = Phase::kRunning;
  const Segment& s = segment();
  n_ = 0;
  steps_ = std::llround(s.duration / period_);
  segment_start_ = state_.motion.x;
  switch (s.kind) {
    case SegmentKind::kCalibration: calibration_.reset(); break;
    case SegmentKind::kMove: beginMove(s.target.stacked(), s.duration); break;
    case SegmentKind::kTrajectory: break;
    case SegmentKind::kAdmittance: admittance_.reset(segment_start_); break;
  }
}

/// To rest where braking at a gentle rate ends, then by a quintic to `target`; 0 s: as long as is
/// gentle.
void TestPlatform::beginMove(const Vec6& target, double duration) noexcept {
  const Vec6& x = state_.motion.x;
  const Vec6& v = state_.motion.x_dot;
  const double brake_time = std::max(v.head<3>().norm() / config_.gentle_braking,
                                     v.tail<3>().norm() / config_.gentle_rotation_braking);
  brake_ = Quintic<6>();
  Vec6 rest = x;
  if (brake_time > 0.0) {
    rest += 0.5 * brake_time * v;
    PathPoint<6> from = atRest(x);
    from.x_dot = v;
    brake_ = Quintic<6>(from, rest, brake_time);
  }
  if (duration <= 0.0) duration = gentleDuration(rest, target);
  move_ = Quintic<6>(atRest(rest), target, duration);
  n_ = 0;
  steps_ = static_cast<std::int64_t>(std::ceil((brake_time + duration) / period_));
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
    case Phase::kDisarmed:
    case Phase::kArmed: return atRest(state_.measured.stacked());
    case Phase::kReturning: return moveAt(++n_);  // where it starts, the platform is already
    case Phase::kParked:
    case Phase::kStopped: return atRest(state_.motion.x);
    case Phase::kRunning: break;
  }
  const std::int64_t n = ++n_;
  switch (segment().kind) {
    case SegmentKind::kCalibration:
      if (state_.age == 0 && sample.q.allFinite()) {
        calibration_.add(sample.adc, S_proc_ * staticWrench(config_.payload, sample.q,
                                                            X_IP_measured_.R, config_.gravity)
                                                   .stacked());
        if (calibration_.complete()) state_.bias = calibration_.mean();
      }
      return atRest(state_.motion.x);
    case SegmentKind::kMove: return moveAt(n);
    case SegmentKind::kTrajectory:
      return trajectoryGeneration(segment().trajectory, segment_start_, n, steps_, period_);
    case SegmentKind::kAdmittance:
      // A wrench that is no number must not enter the model's state; the finite check stops the
      // run.
      if (state_.dynamic.stacked().allFinite()) admittance_.step(state_.dynamic);
      return admittance_.motion();
  }
  return atRest(state_.motion.x);
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
