// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/supervisor.hpp"

namespace ves {
namespace {

/// A check fails other than the two that fail until the stream of samples has begun.
bool forbids(Tripped tripped) {
  Tripped waiting;
  waiting.require(Check::kStale, false);
  waiting.require(Check::kOverrun, false);
  return (tripped.bits() & ~waiting.bits()) != 0;
}

}  // namespace

void Supervisor::handle(const Order& order, const Situation& now, Actuation act) noexcept {
  if (order.request == Request::kNone) return;
  const Refusal refusal = obey(order, now, act);
  if (refusal == Refusal::kChecking) rehearsed_ = order;
  answers_.give({order.id, refusal, Check::kCount});
}

Refusal Supervisor::obey(const Order& order, const Situation& now, Actuation act) noexcept {
  switch (order.request) {
    case Request::kNone:
    case Request::kCount: return Refusal::kNone;
    case Request::kArm:
    case Request::kStart: return arm(order.request, now, act);
    case Request::kOvertaken: return Refusal::kOvertaken;
    case Request::kStop:
      pending_request_ = Request::kNone;
      forgetRehearsal();
      if (phase_ == Phase::kArmed || phase_ == Phase::kRunning) beginReturn(now, act);
      operator_present_ = false;
      return Refusal::kNone;
    case Request::kRun: return run(order.segment, now, act);
    case Request::kHold: {
      const bool arming = pending_request_ != Request::kNone;
      pending_request_ = Request::kNone;
      forgetRehearsal();
      if (!ours()) return arming ? Refusal::kNone : Refusal::kNotArmed;
      operator_present_ = true;
      if (phase_ == Phase::kArmed) return Refusal::kNone;
      phase_ = Phase::kRunning;
      segment_ = -1;
      act.motion.brake(now.config.gentle.braking);
      return Refusal::kNone;
    }
    case Request::kTare:
      if (!ours()) return Refusal::kNotArmed;
      if (runs(act.motion, SegmentKind::kCalibration) || act.bias.taring()) return Refusal::kBusy;
      act.bias.beginTare();
      return Refusal::kNone;
    case Request::kCompensate: return compensate(true, now, act);
    case Request::kUncompensate: return compensate(false, now, act);
    case Request::kVehicle: return changeVehicle(order, now, act);
    case Request::kGripper:
      if (!now.config.learnsHand()) return Refusal::kNotLearning;
      if (!ours()) return Refusal::kNotArmed;
      act.carried.moveGripper();
      return Refusal::kNone;
    case Request::kThrust: return ours() ? act.motion.fire(order.thrust) : Refusal::kNotArmed;
    case Request::kReset: return reset(act);
  }
  return Refusal::kNone;
}

/// Why the loop, its compensation in or out, may not be closed for `duration` [s].
Refusal Supervisor::refusesLoop(const ControllerConfig& config, bool compensated,
                                double duration) const noexcept {
  Stability stability = config.stabilityOf(compensated);
  double stable_for = compensated ? config.stable_for : config.stable_for_uncompensated;
  if (changed_) {
    stability = compensated ? changed_->compensated : changed_->uncompensated;
    stable_for = HUGE_VAL;
  }
  switch (stability) {
    case Stability::kStable: return duration <= stable_for ? Refusal::kNone : Refusal::kTooLong;
    case Stability::kForced: return Refusal::kNone;
    case Stability::kUnstable: return Refusal::kUnstable;
    case Stability::kUnknown:
    case Stability::kCount: break;
  }
  return Refusal::kUnassessed;
}

/// The legs are taken, or soon will be gone from.
bool Supervisor::ours() const noexcept {
  return phase_ == Phase::kArmed || phase_ == Phase::kRunning || phase_ == Phase::kReturning;
}

Refusal Supervisor::arm(Request request, const Situation& now, Actuation act) noexcept {
  const Refusal unstable =
      refusesLoop(now.config, act.share.wanted(), now.config.longestAdmittance());
  if (request == Request::kStart && unstable != Refusal::kNone &&
      wantsAdmittance(now.config.program))
    return unstable;
  if (phase_ == Phase::kDisarmed) {
    if (forbids(tripped_)) return Refusal::kCauseRemains;
    pending_request_ = request;
    operator_present_ = request == Request::kArm;
    return Refusal::kNone;
  }
  if (request == Request::kArm) return ours() ? Refusal::kArmed : Refusal::kNotArmed;
  if (phase_ != Phase::kArmed || rehearsal_.underWay())
    return ours() ? Refusal::kBusy : Refusal::kNotArmed;
  beginProgram(0, now, act);
  return Refusal::kNone;
}

/// Begins an order's segment; one with a path once that has been gone through.
Refusal Supervisor::run(const Segment& segment, const Situation& now, Actuation act) noexcept {
  if (!ours()) return Refusal::kNotArmed;
  if (phase_ != Phase::kArmed || rehearsal_.underWay() || pending_request_ == Request::kStart)
    return Refusal::kBusy;
  if (segment.kind == SegmentKind::kAdmittance) {
    const Refusal refusal = refusesAdmittance(segment, now, act);
    if (refusal != Refusal::kNone) return refusal;
  }
  if (segment.kind == SegmentKind::kMove || segment.kind == SegmentKind::kTrajectory) {
    rehearsal_.begin(act.motion.planned(segment), now.L);
    return Refusal::kChecking;
  }
  begin(segment, now, act);
  return Refusal::kNone;
}

/// Some of a path that was ordered; then its segment begins, or is refused. Armed, nothing moves:
/// the path still begins where it was planned from.
void Supervisor::rehearse(const Situation& now, Actuation act) noexcept {
  if (!rehearsal_.underWay()) return;
  rehearsal_.advance(now.path, now.config.periodSeconds(), act.motion.path());
  if (rehearsal_.underWay()) return;
  if (rehearsal_.failure() == Check::kCount) {
    answers_.give({rehearsed_.id, Refusal::kNone, Check::kCount});
    begin(rehearsed_.segment, now, act);
  } else {
    answers_.give({rehearsed_.id, Refusal::kOutside, rehearsal_.failure()});
  }
}

/// A path that was being gone through is not begun.
void Supervisor::forgetRehearsal() noexcept {
  if (!rehearsal_.underWay()) return;
  rehearsal_.cancel();
  answers_.give({rehearsed_.id, Refusal::kOvertaken, Check::kCount});
}

/// A loop that runs is not changed to one that would diverge.
Refusal Supervisor::compensate(bool in, const Situation& now, Actuation act) noexcept {
  if (!act.share.exists()) return Refusal::kNoCompensation;
  // What runs by an order may go on for longer than the program's segments.
  const double duration = segment_ < 0 ? HUGE_VAL : now.config.longestAdmittance();
  const Refusal unstable = refusesLoop(now.config, in, duration);
  if (unstable != Refusal::kNone && runs(act.motion, SegmentKind::kAdmittance)) return unstable;
  act.share.want(in);
  return Refusal::kNone;
}

/// All of the way to another vehicle was checked, with the compensation in and out.
Refusal Supervisor::changeVehicle(const Order& order, const Situation& now,
                                  Actuation act) noexcept {
  if (!ours()) return Refusal::kNotArmed;
  const Refusal refusal = act.motion.admittance().refuses(order.vehicle);
  if (refusal != Refusal::kNone) return refusal;
  const std::optional<VehicleVerdict> before = changed_;
  changed_ = order.verdict;
  const Refusal unstable = refusesLoop(now.config, act.share.wanted(), HUGE_VAL);
  if (unstable != Refusal::kNone) {
    changed_ = before;
    return unstable;
  }
  act.motion.changeVehicle(order.vehicle, runs(act.motion, SegmentKind::kAdmittance));
  return Refusal::kNone;
}

Refusal Supervisor::reset(Actuation act) noexcept {
  if (phase_ != Phase::kStopped) return Refusal::kNotStopped;
  if (tripped_.any()) return Refusal::kCauseRemains;
  phase_ = Phase::kDisarmed;
  segment_ = -1;
  latched_ = {};
  cause_ = Check::kCount;
  cause_tick_ = -1;
  act.samples.restart();
  pending_request_ = Request::kNone;
  return Refusal::kNone;
}

/// Admittance control should begin with nothing but the base's own motion to come.
Refusal Supervisor::refusesAdmittance(const Segment& segment, const Situation& now,
                                      Actuation act) const noexcept {
  const Refusal unstable = refusesLoop(now.config, act.share.wanted(), segment.duration);
  if (unstable != Refusal::kNone) return unstable;
  const bool unloaded = now.dynamic.f.norm() <= now.config.safety.start_force &&
                        now.dynamic.n.norm() <= now.config.safety.start_moment;
  return unloaded ? Refusal::kNone : Refusal::kLoaded;
}

void Supervisor::advance(const Situation& now, Actuation act) noexcept {
  switch (phase_) {
    case Phase::kDisarmed:
      // A failing check cancels a pending request: releasing a button must move nothing.
      if (forbids(tripped_)) pending_request_ = Request::kNone;
      if (pending_request_ != Request::kNone && now.fresh_ticks > now.config.arming_samples &&
          !tripped_.any())
        phase_ = Phase::kArmed;
      act.share.reset();
      break;
    case Phase::kArmed:
      if (pending_request_ == Request::kStart) beginProgram(0, now, act);
      pending_request_ = Request::kNone;
      rehearse(now, act);
      break;
    case Phase::kRunning:
      if (segmentIsOver(now, act)) endSegment(now, act);
      break;
    case Phase::kReturning:
      if (!act.motion.over(now.tick)) break;
      phase_ = operator_present_ ? Phase::kArmed : Phase::kParked;
      if (operator_present_) segment_ = -1;
      break;
    case Phase::kStopping:
      if (act.motion.over(now.tick)) phase_ = Phase::kStopped;
      break;
    case Phase::kParked:
    case Phase::kStopped:
    case Phase::kCount: break;
  }
}

bool Supervisor::segmentIsOver(const Situation& now, Actuation act) const noexcept {
  if (act.motion.kind() == SegmentKind::kCalibration)
    return act.bias.calibration().status() != CalibrationStatus::kTaking;
  return act.motion.over(now.tick);
}

void Supervisor::endSegment(const Situation& now, Actuation act) noexcept {
  const bool in_program = segment_ >= 0;
  if (in_program && act.motion.kind() == SegmentKind::kCalibration &&
      act.bias.calibration().status() == CalibrationStatus::kRefused) {
    abort(Refusal::kNone, now, act);  // it does not go on without what it asked for
  } else if (act.motion.moving() && !nextBrakes(now.config.program)) {
    act.motion.brake(now.config.gentle.braking);
  } else if (in_program) {
    beginProgram(segment_ + 1, now, act);
  } else {
    act.motion.endEmulation();
    phase_ = Phase::kArmed;
  }
}

/// What follows in the program begins by braking.
bool Supervisor::nextBrakes(const Program& program) const noexcept {
  if (segment_ < 0) return false;
  const int next = segment_ + 1;
  return next >= program.size ||
         program.segments[static_cast<std::size_t>(next)].kind == SegmentKind::kMove;
}

void Supervisor::beginProgram(int at, const Situation& now, Actuation act) noexcept {
  segment_ = at;
  if (at == 0) {
    aborted_ = false;
    aborted_by_ = Refusal::kNone;
  }
  if (at >= now.config.program.size) {
    beginReturn(now, act);
    return;
  }
  const Segment& next = now.config.program.segments[static_cast<std::size_t>(at)];
  const Refusal refusal =
      next.kind == SegmentKind::kAdmittance ? refusesAdmittance(next, now, act) : Refusal::kNone;
  if (refusal != Refusal::kNone) {
    abort(refusal, now, act);
    return;
  }
  begin(next, now, act);
}

/// The program goes home early.
void Supervisor::abort(Refusal why, const Situation& now, Actuation act) noexcept {
  aborted_ = true;
  aborted_by_ = why;
  beginReturn(now, act);
}

void Supervisor::begin(const Segment& segment, const Situation& now, Actuation act) noexcept {
  phase_ = Phase::kRunning;
  act.motion.begin(segment, now.tick, now.M_1, now.age, act.share.value());
  if (segment.kind == SegmentKind::kCalibration) act.bias.beginCalibration();
}

void Supervisor::beginReturn(const Situation& now, Actuation act) noexcept {
  phase_ = Phase::kReturning;
  segment_ = now.config.program.size;
  act.motion.goHome();
}

bool Supervisor::trip(Tripped tripped, const Situation& now, Actuation act) noexcept {
  tripped_ = tripped;
  if (phase_ == Phase::kDisarmed || !tripped.any()) return false;
  forgetRehearsal();
  latch(tripped, act);
  if (phase_ == Phase::kStopped) return false;
  const bool stopping = phase_ == Phase::kStopping;
  if (!stopping) {
    cause_ = tripped.first();
    cause_tick_ = now.tick;
  }
  if (tripped.freeze()) {
    phase_ = Phase::kStopped;
    return false;
  }
  if (stopping) return false;
  act.motion.brake(now.config.stop_braking);
  phase_ = act.motion.over(now.tick) ? Phase::kStopped : Phase::kStopping;
  return phase_ == Phase::kStopping;
}

void Supervisor::tripStopping(Tripped tripped, Actuation act) noexcept {
  if (!tripped.freeze()) return;
  latch(tripped, act);
  phase_ = Phase::kStopped;
}

void Supervisor::latch(Tripped tripped, Actuation act) noexcept {
  latched_ = latched_ | tripped;
  act.bias.cancelTare();  // what it averages may be the fault
}

void Supervisor::report(TickState& state) noexcept {
  answers_.advance();
  state.phase = phase_;
  state.segment = segment_;
  state.order = answers_.shown().order;
  state.refusal = answers_.shown().refusal;
  state.refused_by = answers_.shown().refused_by;
  state.aborted = aborted_;
  state.aborted_by = aborted_by_;
  state.tripped = tripped_;
  state.latched = latched_;
  state.cause = cause_;
  state.cause_tick = cause_tick_;
}

}  // namespace ves
