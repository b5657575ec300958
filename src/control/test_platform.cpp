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

/// More is wrong than that the stream of samples has not begun.
bool forbids(Tripped tripped) {
  Tripped waiting;
  waiting.require(Check::kStale, false);
  waiting.require(Check::kOverrun, false);
  return (tripped.bits() & ~waiting.bits()) != 0;
}

/// [s] after its own state that the admittance model answers: the wrench it is given is late by the
/// sensor's filter, and held for a period where it should be known along it.
double ahead(const ControllerConfig& config, double period) {
  if (!config.compensation.inertia) return 0.0;
  return M_SQRT2 / config.servo.sensor_cutoff + 0.5 * period;
}

double brakeTime(const Vec6& v, const ControllerConfig::Braking& braking) {
  return std::max(v.head<3>().norm() / braking.translation, v.tail<3>().norm() / braking.rotation);
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
    case Phase::kStopping: return "stopping";
  }
  return "unknown";
}

TestPlatform::TestPlatform(const ControllerConfig& config)
    : config_(config),
      period_(static_cast<double>(config.period) * kSecondPerNanosecond),
      joint_axes_(config.geometry),
      carried_(carried(config.payload)),
      X_PL0_(config.payload.X_PL0()),
      admittance_(config.admittance, period_, ahead(config, period_)),
      servo_(config.servo, period_),
      weight_(config.servo.sensor_cutoff),
      weight_step_(weight_.prepare(period_)),
      S_proc_(config.sensor.C_proc.inverse()),
      calibration_(config.stillness),
      X_IP_measured_(config.geometry.fromHome({})) {
  state_.bias = config.bias;
}

const TickState& TestPlatform::tick(const TickInput& input) noexcept {
  // An older sample than the last is none. Before arming the machine may begin anew.
  TickInput in = input;
  if (state_.command.engaged && in.sample.sequence < sample_.sequence) in.sample = sample_;
  sample_ = in.sample;

  readSample(in);
  measureWrench(in.sample);  // force measurement, gravity compensation
  if (in.order.request != Request::kNone) {
    state_.order = in.order.id;
    state_.refusal = obey(in.order);
  }
  choosePhase();

  // Admittance model or trajectory generation, inverse kinematics, safety checks.
  Step step = check(in, nextMotion(in.sample));
  state_.tripped = step.tripped;
  if (state_.phase != Phase::kDisarmed && step.tripped.any()) {
    const bool was_stopping = state_.phase == Phase::kStopping;
    trip(step.tripped);
    if (state_.phase == Phase::kStopping && !was_stopping) {
      step = check(in, moveAt(++n_));
      if (step.tripped.freeze()) trip(step.tripped);
    }
  }

  if (state_.phase != Phase::kStopped) {  // leg communication
    state_.due = commandsNextState() ? state_.motion.x : step.next.x;
    state_.motion = step.next;
    state_.legs = step.legs;
    state_.command.engaged = state_.phase != Phase::kDisarmed;
    state_.command.segment = state_.segment;
    if (step.legs.L.allFinite()) {
      state_.reference = reference(step.legs);
      // What rounding leaves goes with the next command; at rest it would only make the legs hum.
      const bool carries = config_.compensation.observer && state_.compensated == 1.0;
      if (!carries || !commandsNextState()) carry_.setZero();
      state_.command.counts = legCounts(config_.legs, state_.reference + carry_);
      carry_ += state_.reference - legLengths(config_.legs, state_.command.counts);
    }
  }
  state_.command.park = state_.phase != Phase::kStopped && state_.phase != Phase::kStopping;
  leg_speed_.step(state_.legs.L_dot, period_);
  state_.kind = state_.phase == Phase::kRunning ? segment_.kind : SegmentKind::kCount;
  state_.idle = idleTicks();
  return state_;
}

void TestPlatform::readSample(const TickInput& in) noexcept {
  const Sample& sample = in.sample;
  const bool fresh = sample.sequence > state_.sample_sequence;
  const int age_before = state_.age;
  state_.age = fresh ? 0 : state_.age + 1;
  fresh_ticks_ = fresh && !in.rival ? fresh_ticks_ + 1 : 0;
  // Idle ticks are passed over in lockstep only.
  const std::int64_t between = state_.count < 0 ? 0 : in.tick - state_.tick - 1;
  const std::int64_t missed = between >= state_.idle ? between - state_.idle : between;
  overruns_.take(in.tick, missed);
  if (missed > 0) ++state_.late_ticks;
  const auto waited = static_cast<double>(age_before + between + 1) * period_;
  state_.tick = in.tick;
  ++state_.count;
  state_.sample_sequence = sample.sequence;

  const Vec6 L = legLengths(config_.legs, sample.legs);
  const bool follow = state_.command.engaged && state_.phase != Phase::kStopped;
  if (!follow) readings_.reset();
  if (fresh || !follow)
    state_.L_measured = readings_.take(L, leg_speed_.speed(), waited, config_.safety.reading_jump);
  if (follow)
    observe(1 + missed, fresh);
  else
    servo_.reset(state_.L_measured);
  const ForwardSolution forward = forwardPose(config_.geometry, state_.L_measured, X_IP_measured_);
  legs_solved_ = forward.ok();
  if (legs_solved_) X_IP_measured_ = forward.X_IP;
  state_.measured = config_.geometry.toHome(X_IP_measured_);
}

/// The servo model, brought to this tick.
void TestPlatform::observe(std::int64_t periods, bool fresh) noexcept {
  const Compensation& c = config_.compensation;
  const double change = period_ / c.ramp;
  state_.compensated = c.any() && compensating_ ? std::min(1.0, state_.compensated + change)
                                                : std::max(0.0, state_.compensated - change);
  if (!c.observer) return;
  constexpr std::int64_t kMost = 10;  // [-] periods; after more it has come to rest
  const Vec6 sent = legLengths(config_.legs, state_.command.counts);
  for (std::int64_t i = 0; i < std::min(periods, kMost); ++i) servo_.advance(sent);
  if (fresh) servo_.correct(state_.L_measured);
}

void TestPlatform::measureWrench(const Sample& sample) noexcept {
  // The measured attitude: the commanded one leads it by the servo's lag, and the difference would
  // pass as a wrench of the robot's weight.
  const Mat3& R_IP = X_IP_measured_.R;
  const Wrench weight_S = staticWrench(config_.payload, sample.q, R_IP, config_.gravity);
  load_ = S_proc_ * weight_S.stacked();
  tare(sample);
  state_.total = forceMeasurement(config_.sensor, state_.bias, sample.adc, R_IP);
  state_.fixed = rotate(R_IP, transfer(config_.payload.X_PS, felt(weight_S)));
  state_.inertial = robotInertia(sample);
  state_.dynamic = state_.total - state_.fixed + state_.inertial;
  if (state_.age == 0) frozen_.take(sample.adc, load_);
}

/// The weight as the sensor's filter shows it: a turn of the robot moves it at once.
Wrench TestPlatform::felt(const Wrench& weight_S) noexcept {
  const Vec6 weight = weight_S.stacked();
  if (!config_.compensation.inertia || !weight.allFinite()) return weight_S;
  if (state_.command.engaged)
    weight_.advance(weight_step_, weight.array());
  else
    weight_.settle(weight.array());
  return Wrench::from(weight + state_.compensated * (weight_.output().matrix() - weight));
}

/// What it takes to move the robot, its joints locked, as the platform moves by the servo model:
/// the sensor's filter included, as it is in the wrench.
Wrench TestPlatform::robotInertia(const Sample& sample) noexcept {
  const Compensation& c = config_.compensation;
  if (!c.inertia || !state_.command.engaged) return {};
  if (state_.count % c.mass_update == 0)
    robot_P_ = combine(RigidBody{}, X_PL0_, locked(carried_, sample.q));
  M_1_ = state_.compensated * spatialMass(turned(X_IP_measured_.R, robot_P_));
  BodyMotion P;
  const LegMotion legs{state_.L_measured, servo_.velocity(), servo_.filteredAcceleration()};
  if (!forwardMotion(config_.geometry, X_IP_measured_, legs, P)) return {};
  Vec6 acceleration;
  acceleration << P.a, P.alpha;
  return Wrench::from(M_1_ * acceleration);
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
      if (order.request == Request::kStart && !admissible() && wantsAdmittance(config_.program))
        return Refusal::kUnstable;
      if (phase == Phase::kDisarmed) {
        if (forbids(state_.tripped)) return Refusal::kCauseRemains;
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
      return accept(order.segment);
    case Request::kHold:
      wish_ = Request::kNone;
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
    case Request::kCompensate: return compensate(true);
    case Request::kUncompensate: return compensate(false);
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

bool TestPlatform::admissible() const noexcept {
  return compensating_ ? config_.admissible : config_.admissible_uncompensated;
}

/// A loop that runs is not changed to one that would diverge.
Refusal TestPlatform::compensate(bool in) noexcept {
  if (!config_.compensation.any()) return Refusal::kNoCompensation;
  const bool stable = in ? config_.admissible : config_.admissible_uncompensated;
  if (!stable && commandsNextState()) return Refusal::kUnstable;
  compensating_ = in;
  return Refusal::kNone;
}

Refusal TestPlatform::refusesAdmittance() const noexcept {
  if (!admissible()) return Refusal::kUnstable;
  return feelsLittle() ? Refusal::kNone : Refusal::kLoaded;
}

/// Begins an order's segment, unless its path, gone through beforehand, fails a check.
Refusal TestPlatform::accept(const Segment& segment) noexcept {
  if (segment.kind == SegmentKind::kAdmittance) {
    const Refusal refusal = refusesAdmittance();
    if (refusal != Refusal::kNone) return refusal;
  }
  const TickState before = state_;
  begin(segment);
  if (segment.kind != SegmentKind::kMove && segment.kind != SegmentKind::kTrajectory)
    return Refusal::kNone;
  constexpr std::int64_t kLooks = 1000;  // [-] along the path
  const std::int64_t stride = std::max<std::int64_t>(1, steps_ / kLooks);
  Vec6 L_last = state_.legs.L;
  for (std::int64_t n = 0; n <= steps_; n += stride) {
    const PathPoint<6> at = pathAt(n);
    const BodyMotion P = bodyMotion(config_.geometry, Pose::from(at.x), at.x_dot, at.x_ddot);
    const LegMotion legs = legMotion(config_.geometry, P);
    // From one look to the next, and at the look itself.
    const double since = static_cast<double>(n == 0 ? 1 : stride) * period_;
    const Tripped t = pathChecks(P.X, Pose::from(at.x), legs.L) |
                      stepChecks(legs.L, L_last, since) |
                      stepChecks(legs.L + period_ * legs.L_dot, legs.L, period_);
    L_last = legs.L;
    if (!t.any()) continue;
    state_ = before;
    state_.refused_by = t.first();
    return Refusal::kOutside;
  }
  return Refusal::kNone;
}

/// Admittance control should begin with nothing but the base's own motion to come.
bool TestPlatform::feelsLittle() const noexcept {
  return state_.dynamic.f.norm() <= config_.safety.start_force &&
         state_.dynamic.n.norm() <= config_.safety.start_moment;
}

void TestPlatform::choosePhase() noexcept {
  switch (state_.phase) {
    case Phase::kDisarmed:
      // A wish does not outlive a cause: releasing a button must move nothing.
      if (forbids(state_.tripped)) wish_ = Request::kNone;
      if (wish_ != Request::kNone && fresh_ticks_ > config_.arming_samples && !state_.tripped.any())
        state_.phase = Phase::kArmed;
      state_.compensated = 0.0;
      break;
    case Phase::kArmed:
      if (wish_ == Request::kStart) beginProgram(0);
      wish_ = Request::kNone;
      break;
    case Phase::kRunning:
      if (segmentIsOver()) endSegment();
      break;
    case Phase::kReturning:
      if (n_ < steps_) break;
      state_.phase = attended_ ? Phase::kArmed : Phase::kParked;
      if (attended_) state_.segment = -1;
      break;
    case Phase::kStopping:
      if (n_ >= steps_) freeze();
      break;
    case Phase::kParked:
    case Phase::kStopped: break;
  }
}

void TestPlatform::endSegment() noexcept {
  const bool in_program = state_.segment >= 0;
  if (in_program && segment_.kind == SegmentKind::kCalibration &&
      calibration_.status() == Calibration::Status::kRefused) {
    state_.cut_short = true;  // a program does not go on without the calibration it asked for
    beginReturn();
  } else if (!state_.motion.x_dot.isZero(0.0) && !nextBrakes()) {
    brakeHere();
  } else if (in_program) {
    beginProgram(state_.segment + 1);
  } else {
    state_.phase = Phase::kArmed;
  }
}

/// What follows in the program begins by braking.
bool TestPlatform::nextBrakes() const noexcept {
  if (state_.segment < 0) return false;
  const int next = state_.segment + 1;
  return next >= config_.program.size ||
         config_.program.segments[static_cast<std::size_t>(next)].kind == SegmentKind::kMove;
}

bool TestPlatform::segmentIsOver() const noexcept {
  switch (segment_.kind) {
    case SegmentKind::kCalibration: return calibration_.status() != Calibration::Status::kTaking;
    case SegmentKind::kWatch: return state_.tick - begun_ >= steps_;
    case SegmentKind::kMove:
    case SegmentKind::kTrajectory:
    case SegmentKind::kAdmittance:
    case SegmentKind::kPath:
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
  if (at == 0) state_.cut_short = false;
  if (at >= config_.program.size) {
    beginReturn();
    return;
  }
  const Segment& next = config_.program.segments[static_cast<std::size_t>(at)];
  const Refusal refusal =
      next.kind == SegmentKind::kAdmittance ? refusesAdmittance() : Refusal::kNone;
  if (refusal != Refusal::kNone) {
    state_.refusal = refusal;
    state_.cut_short = true;
    beginReturn();
    return;
  }
  begin(next);
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
    case SegmentKind::kAdmittance:
      admittance_.reset(segment_start_, M_1_);
      oscillation_.reset();
      break;
    case SegmentKind::kTrajectory:
    case SegmentKind::kWatch:
    case SegmentKind::kPath:
    case SegmentKind::kCount: break;
  }
}

void TestPlatform::beginReturn() noexcept {
  state_.phase = Phase::kReturning;
  state_.segment = config_.program.size;
  beginMove(Vec6::Zero(), 0.0);
}

/// Plans the braking; where it ends.
Vec6 TestPlatform::brake(const ControllerConfig::Braking& braking) noexcept {
  const Vec6& v = state_.motion.x_dot;
  const double time = brakeTime(v, braking);
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
  const Vec6 rest = brake(config_.gentle_braking);
  if (duration <= 0.0) duration = gentleDuration(rest, target);
  move_ = Quintic<6>(atRest(rest), target, duration);
  n_ = 0;
  steps_ = static_cast<std::int64_t>(std::ceil((brake_.duration() + duration) / period_));
}

/// Brakes, and is armed again.
void TestPlatform::hold() noexcept {
  state_.phase = Phase::kRunning;
  state_.segment = -1;
  brakeHere();
}

/// As a move that ends where the braking does.
void TestPlatform::brakeHere() noexcept {
  segment_ = {};
  segment_.kind = SegmentKind::kMove;
  planHold(config_.gentle_braking);
}

void TestPlatform::planHold(const ControllerConfig::Braking& braking) noexcept {
  const Vec6 rest = brake(braking);
  move_ = Quintic<6>(atRest(rest), rest, period_);
  n_ = 0;
  steps_ = static_cast<std::int64_t>(std::ceil(brake_.duration() / period_));
}

PathPoint<6> TestPlatform::moveAt(std::int64_t n) const noexcept {
  const double t = static_cast<double>(n) * period_;
  return t < brake_.duration() ? brake_.at(t) : move_.at(t - brake_.duration());
}

/// Of a move, a trajectory or a recorded path, n periods after it began.
PathPoint<6> TestPlatform::pathAt(std::int64_t n) const noexcept {
  if (segment_.kind == SegmentKind::kPath) return recordedPath(config_.path, n, period_);
  return segment_.kind == SegmentKind::kMove
             ? moveAt(n)
             : trajectoryGeneration(segment_.trajectory, segment_start_, n, steps_, period_);
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
    case Phase::kReturning:
    case Phase::kStopping: return moveAt(++n_);  // where it starts, the platform is already
    case Phase::kParked:
    case Phase::kStopped: return atRest(state_.motion.x);
    case Phase::kRunning: break;
  }
  const std::int64_t n = ++n_;
  switch (segment_.kind) {
    case SegmentKind::kCalibration: calibrate(sample); break;
    case SegmentKind::kMove:
    case SegmentKind::kTrajectory:
    case SegmentKind::kPath: return pathAt(n);
    case SegmentKind::kAdmittance:
      // A wrench that is no number must not enter the model's state; the finite check stops the
      // run.
      if (state_.dynamic.stacked().allFinite()) {
        admittance_.step(state_.dynamic, M_1_, state_.compensated);
        envelope();
        const double floor = config_.safety.growth_floor;
        oscillation_.take(admittance_.energy(),
                          state_.slowed < 1.0 && admittance_.kineticEnergy() > floor, sample.q,
                          config_.stillness.joint, period_, floor);
      }
      return admittance_.motion();
    case SegmentKind::kWatch:
    case SegmentKind::kCount: break;
  }
  return atRest(state_.motion.x);
}

void TestPlatform::calibrate(const Sample& sample) noexcept {
  if (state_.age == 0) calibration_.add(sample, load_);
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
      tare_.add(sample.adc, load_);
      if (!tare_.complete()) return;
      if (!(tare_.mean().cwiseAbs().maxCoeff() <= config_.stillness.bias)) {
        taring_ = Tare::kNone;  // no stray voltage: a load, or a fault
        return;
      }
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

/// Slows the motion as a whole, never one leg, so that it can always come to rest, braking gently
/// along its path, where every path check still passes.
void TestPlatform::envelope() noexcept {
  const PathPoint<6> proposed = admittance_.motion();
  const Vec6& x = state_.motion.x;
  const Vec6 step = proposed.x - x;
  const auto fits = [&](double share) {
    const Vec6 v = share * step / period_;
    const double brake_time = brakeTime(v, config_.gentle_braking);
    const Pose next = Pose::from(x + share * step);
    const Pose rest = Pose::from(x + share * step + 0.5 * brake_time * v);
    const Transform X_rest = config_.geometry.fromHome(rest);
    const Vec6 L = legLengths(config_.geometry, config_.geometry.fromHome(next));
    return !pathChecks(X_rest, rest, legLengths(config_.geometry, X_rest)).any() &&
           !stepChecks(L, state_.legs.L, period_).any();
  };
  state_.slowed = 1.0;
  if (fits(1.0)) return;
  constexpr int kHalvings = 10;
  double low = 0.0, high = 1.0;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (fits(middle) ? low : high) = middle;
  }
  state_.slowed = low;
  admittance_.slow(low);
}

/// The checks that depend on the pose alone.
Tripped TestPlatform::pathChecks(const Transform& X_IP, const Pose& x,
                                 const Vec6& L) const noexcept {
  const SafetyLimits& limits = config_.safety;
  Tripped t;
  t.require(Check::kMotionLimits, motionLimitsCheck(limits, x));
  t.require(Check::kActuatorLimits, actuatorLimitsCheck(limits, L));
  t.require(Check::kJointLimits, joint_axes_.check(limits, config_.geometry, X_IP));
  t.require(Check::kCollide, collideCheck(limits, config_.geometry, X_IP));
  t.require(Check::kConditioning, conditioningCheck(limits, config_.geometry, X_IP));
  return t;
}

/// The checks of going from one set of lengths to another in `time` [s].
Tripped TestPlatform::stepChecks(const Vec6& L, const Vec6& L_last, double time) const noexcept {
  Tripped t;
  t.require(Check::kVelocity, velocityCheck(config_.safety, L, L_last, time));
  t.require(Check::kFlow, flowLimitsCheck(config_.safety, L, L_last, time));
  return t;
}

/// Inverse kinematics and all safety checks of what would be commanded.
TestPlatform::Step TestPlatform::check(const TickInput& in,
                                       const PathPoint<6>& next) const noexcept {
  const BodyMotion P = bodyMotion(config_.geometry, Pose::from(next.x), next.x_dot, next.x_ddot);
  const LegMotion legs = legMotion(config_.geometry, P);
  const SafetyLimits& limits = config_.safety;
  // Before the legs follow, the last command is where they are.
  const bool following = state_.command.engaged;
  const Vec6& L_last = following ? state_.legs.L : legs.L;

  Tripped t = pathChecks(P.X, Pose::from(next.x), legs.L) | stepChecks(legs.L, L_last, period_);
  t.require(Check::kPanicButton, in.sample.switches & kPanicButtonClosed);
  t.require(Check::kFloorMat, in.sample.switches & kFloorMatClosed);
  t.require(Check::kFinite, next.x.allFinite() && next.x_dot.allFinite() &&
                                next.x_ddot.allFinite() && legs.L.allFinite() &&
                                in.sample.q.allFinite() && state_.dynamic.stacked().allFinite());
  t.require(Check::kStale, in.sample.sequence >= 0 && state_.age <= limits.stale_ticks);
  t.require(Check::kOverrun, overruns_.good(limits, std::llround(1.0 / period_)));
  t.require(Check::kLegReading, readings_.good());
  t.require(Check::kForwardKinematics, legs_solved_);
  t.require(Check::kPositionError,
            positionErrorCheck(limits, following ? expectedLengths() : state_.L_measured,
                               state_.L_measured, leg_speed_.speed()));
  t.require(Check::kPressure, pressureCheck(limits, in.sample.adc));
  t.require(Check::kSensorSaturated, saturationCheck(in.sample.adc));
  t.require(Check::kSensorFrozen, frozen_.good(limits));
  t.require(Check::kOscillation, oscillation_.good(limits));
  t.require(Check::kRival, !in.rival);
  return {next, legs, t};
}

/// Where the legs should be at this tick: the last command's, or, when the servos' lag is taken
/// out, that command brought to now.
Vec6 TestPlatform::expectedLengths() const noexcept {
  if (state_.phase == Phase::kStopped) return state_.reference;
  if (!config_.compensation.feed_forward) return state_.legs.L;
  const double since = commandsNextState() ? 0.0 : period_;
  return state_.legs.L + state_.compensated * since * state_.legs.L_dot;
}

/// Leg communication's lengths: the legs', or what takes the legs there. Inside the limits in any
/// case: should no further command come, the legs end where they were told.
Vec6 TestPlatform::reference(const LegMotion& legs) const noexcept {
  const Compensation& c = config_.compensation;
  if (!c.any()) return legs.L;
  const double lead = commandsNextState() ? period_ : 0.0;
  Vec6 L = legs.L;
  if (c.feed_forward) L = feedForward(config_.servo, legs, lead, period_, state_.compensated);
  if (c.observer && state_.command.engaged) L += state_.compensated * servo_.rounding(legs.L_dot);
  return L.cwiseMax(config_.safety.leg_min).cwiseMin(config_.safety.leg_max);
}

/// Latches; then brakes, or holds the last checked lengths from now on.
void TestPlatform::trip(Tripped tripped) noexcept {
  state_.latched = state_.latched | tripped;
  taring_ = Tare::kNone;  // what it averages may be the fault
  if (state_.phase == Phase::kStopped) return;
  if (state_.phase != Phase::kStopping) {
    state_.cause = tripped.first();
    state_.cause_tick = state_.tick;
  }
  if (tripped.freeze()) {
    freeze();
  } else if (state_.phase != Phase::kStopping) {
    planHold(config_.stop_braking);
    state_.phase = Phase::kStopping;
    if (steps_ == 0) freeze();
  }
}

void TestPlatform::freeze() noexcept {
  oscillation_.reset();
  state_.phase = Phase::kStopped;
  state_.motion = atRest(state_.motion.x);
  state_.legs.L_dot.setZero();
  state_.legs.L_ddot.setZero();
}

}  // namespace ves
