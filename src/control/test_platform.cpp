// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/test_platform.hpp"

#include "ves/control/gravity_compensation.hpp"

namespace ves {

TestPlatform::TestPlatform(const ControllerConfig& config)
    : config_(config),
      period_(config.periodSeconds()),
      samples_(config.period),
      share_(config.compensation, period_),
      legs_(config),
      known_(config),
      load_(config),
      bias_(config),
      joints_(config),
      robot_(config),
      aided_(config),
      filter_(config.wrench_filter, period_),
      motion_(config),
      safety_(config.safety, config.geometry, period_),
      commander_(config) {}

const TickState& TestPlatform::tick(const TickInput& in) noexcept {
  const bool engaged = commander_.command().engaged;
  const bool following = engaged && !supervisor_.stopped();
  const Elapsed& elapsed = clock_.update(in.tick);
  time_ = in.time;
  samples_.update(in.sample, in.time, engaged, in.conflicting_node);
  if (following) share_.advance();
  const Sample& sample = samples_.sample();
  const Transform& X_IP = legs_.update(samples_, elapsed, following, commander_).X_IP;  // (2.23)

  if (samples_.fresh()) known_.readGripper(sample.switches);
  known_.update(elapsed, commander_.command().segment);
  if (!engaged) joints_.reset(sample.q);
  Wrenches W;
  const Emulated& emulated = W.emulated = motion_.emulated(X_IP.R, samples_.wrench().since);
  joints_.update(known_, sample, X_IP.R, emulated.R_EP, engaged ? samples_.wrench().since : 0.0);
  load_.update(known_, joints_.at(sample), X_IP.R, samples_.wrench().since, engaged,
               share_.value());
  bias_.stepTare(sample, samples_.fresh(), load_.counts());
  // The measured attitude: the commanded one leads it by the servo's lag, and the difference would
  // pass as a wrench of the robot's weight.
  W.total = forceMeasurement(config_.sensor, bias_.counts(), sample.adc, X_IP.R);  // (C.1)
  W.static_wrench = gravityCompensation(config_.payload, X_IP.R, load_.wrench());  // (B.4)
  W.inertial = robot_.update(known_, elapsed.count, joints_.q(), samples_.wrench().since, X_IP,
                             emulated.R_EP, legs_.feltMotion(), engaged, share_.value());
  const Wrench measured = W.total - W.static_wrench + W.inertial;
  W.felt = aided_.update({measured, W.static_wrench, known_.carried(), robot_, joints_, samples_,
                          bias_, X_IP, emulated, share_.value(), known_.gripperMoved()},
                         engaged);
  if (aided_.taught()) {
    known_.learn(aided_.robot());
    bias_.learn(aided_.belief().bias());
  }
  if (emulated.apart) W.felt = inE(emulated, W.felt);
  if (!engaged) filter_.reset();
  W.dynamic = filter_.update(W.felt);
  safety_.watch(elapsed, samples_, load_.counts());

  const Situation now{config_,
                      safety_.path(),
                      in.tick,
                      samples_.freshTicks(),
                      W.dynamic,
                      robot_.M_1(),
                      samples_.wrench().age,
                      commander_.legs().L};
  const Actuation act{motion_, bias_, samples_, share_, known_};
  supervisor_.handle(in.order, now, act);
  supervisor_.advance(now, act);

  const auto proposed = [&] {
    const Proposal next = inverseKinematics(config_.geometry, nextMotion(W));
    return safetyChecks(next, W.dynamic, in.conflicting_node);
  };
  Checked next = proposed();  // (C.11), (C.12)
  if (supervisor_.trip(next.tripped(), now, act)) {
    next = proposed();  // begins to brake
    supervisor_.tripStopping(next.tripped(), act);
  }
  legCommunication(next);  // (C.13)
  legs_.sent(commander_.command().counts, in.tick, in.time);
  return report(in, W);
}

/// F_Po_E of what is felt in the laboratory: the joints' momentum is emulated to change in E.
Wrench TestPlatform::inE(const Emulated& emulated, const Wrench& F_Po_I) const noexcept {
  const Wrench beyond = joints_.emulatedForce() - rotate(emulated.R_EI, joints_.force());
  return rotate(emulated.R_EI, F_Po_I) + Wrench::from(share_.value() * beyond.stacked());
}

/// The admittance model (C.2) to (C.7), trajectory generation (C.8) to (C.10), or rest.
Waypoint<6> TestPlatform::nextMotion(const Wrenches& W) noexcept {
  const Sample& sample = samples_.sample();
  if (supervisor_.stopped()) motion_.hold();
  if (supervisor_.runs(motion_, SegmentKind::kCalibration))
    bias_.calibrate(sample, samples_.fresh(), load_.counts());
  if (supervisor_.runs(motion_, SegmentKind::kAdmittance)) {
    const Transform& X_IP = legs_.measured().X_IP;
    const Mat6 noise =
        aided_.withholds()
            ? Mat6(Mat6::Zero())
            : filter_.noise(wrenchNoise(config_.sensor, bias_.noise(), W.emulated.R_EP));
    const Wrench at_port = W.emulated.apart ? rotate(W.emulated.R_EI.transpose(), W.felt) : W.felt;
    return motion_.admittanceModel(
        {W.dynamic, at_port, noise, robot_.carried(joints_.emulatedMomentum()), share_.value(),
         samples_.wrench(), !aided_.withholds(), aided_.lesson(), sample.q, commander_.legs().L,
         X_IP, legs_.servo()},
        safety_.path());
  }
  if (supervisor_.moves()) return motion_.trajectoryGeneration();
  // Until the legs follow, they are where they are measured.
  const bool at_measured = supervisor_.disarmed() ||
                           (supervisor_.phase() == Phase::kArmed && !commander_.command().engaged);
  return {atRest(at_measured ? legs_.measured().pose.stacked() : motion_.motion().x)};
}

Checked TestPlatform::safetyChecks(const Proposal& next, const Wrench& dynamic,
                                   bool conflict) const noexcept {
  // Before the legs follow, the last command is where they are.
  LegContext context{next.legs.L, legs_.measured().L};
  if (commander_.command().engaged) {
    context.last = commander_.legs().L;
    context.expected = commander_.expected(share_.value());
  }
  return safety_.check(
      next, {context, samples_, legs_, dynamic, motion_.admittance().oscillation(), conflict});
}

void TestPlatform::legCommunication(const Checked& next) noexcept {
  const MovingFrame& frame = motion_.admittance().frame();
  if (supervisor_.stopped() || !(supervisor_.disarmed() || next.passes())) {
    motion_.hold();
    commander_.hold();
    // They are where their watchdog took them: to hold where they were would be a leap.
    if (next.tripped().has(Check::kLeftAlone)) commander_.release({legs_.measured().L});
  } else {
    motion_.commit(next.proposal().x);
    if (supervisor_.disarmed())
      commander_.release(next.proposal().legs);
    else
      commander_.send(next, supervisor_.segment(), share_.value(), legs_.servo(), legs_.age(time_));
  }
  if (frame.enabled()) commander_.fly({time_ + config_.period, frame.laboratory()});
}

const TickState& TestPlatform::report(const TickInput& in, const Wrenches& W) noexcept {
  const Phase phase = supervisor_.phase();
  commander_.allowPark(phase != Phase::kStopped && phase != Phase::kStopping);
  const Elapsed& elapsed = clock_.elapsed();
  state_.kind = supervisor_.kind(motion_);
  state_.idle = state_.kind == SegmentKind::kMonitor ? motion_.idleTicks(elapsed.tick) : 0;
  clock_.announceIdle(state_.idle);

  supervisor_.report(state_);
  state_.tick = elapsed.tick;
  state_.count = elapsed.count;
  state_.time = in.time;
  state_.request = in.order.request;
  state_.request_id = in.order.id;
  state_.conflicting_node = in.conflicting_node;
  state_.late_ticks = elapsed.late;
  state_.sample_sequence = samples_.sample().sequence;
  state_.age = samples_.age();
  state_.total = W.total;
  state_.static_wrench = W.static_wrench;
  state_.inertial = W.inertial;
  state_.reaction = aided_.reaction();
  state_.withholds = aided_.withholds();
  if (aided_.learnsMasses()) state_.learnt = aided_.masses();
  state_.dynamic = W.dynamic;
  state_.compensation_share = share_.value();
  state_.motion = motion_.motion();
  state_.desired = motion_.desired();
  state_.request_verdict = in.order.verdict;
  state_.vehicle = motion_.admittance().vehicle();
  state_.vehicle_ordered = motion_.admittance().vehicleChange().target();
  state_.vehicle_energy = motion_.admittance().vehicleChange().energy();
  state_.thrust =
      state_.kind == SegmentKind::kAdmittance ? motion_.admittance().thrust() : Thrust{};
  state_.envelope_scale = motion_.emulates() ? motion_.admittance().scale() : 1.0;
  const EnergyAccount& energy = motion_.admittance().energy();
  state_.energy_put_in = energy.putIn();
  state_.energy_paid = energy.paid();
  state_.passivity_damping = motion_.emulates() ? energy.damping() : 0.0;
  state_.legs = commander_.legs();
  state_.reference = commander_.reference();
  state_.command = commander_.command();
  state_.servo = legs_.gains();
  state_.L_measured = legs_.measured().L;
  state_.measured = legs_.measured().pose;
  state_.bias = bias_.counts();
  state_.deviation = bias_.deviation();
  state_.standard_error = bias_.standardError();
  state_.calibration = bias_.calibration().status();
  state_.violation = bias_.calibration().violation();
  state_.violation_index = bias_.calibration().violationIndex();
  state_.violation_amount = bias_.calibration().violationAmount();
  return state_;
}

}  // namespace ves
