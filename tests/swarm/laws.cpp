// SPDX-License-Identifier: BSD-3-Clause
#include "laws.hpp"

#include <fmt/format.h>

#include <cmath>

namespace ves::swarm {
namespace {

constexpr double kQuinticBraking = 1.5;  // [-] peak over mean deceleration of a braking motion
constexpr std::int64_t kSecond = 1'000'000'000;  // [ns]

std::string legText(const Vec6& difference) {
  Eigen::Index leg = 0;
  const double most = difference.cwiseAbs().maxCoeff(&leg);
  return fmt::format("leg {} by {:.3f} mm", leg + 1, most * 1e3);
}

/// [rad | m] per unit of 6 coordinates: translations first.
double limit(const Braking& braking, int i) {
  return i < 3 ? braking.translation : braking.rotation;
}

/// [-] Of tau x'' + x' = K (r - x), K a quarter more than believed and a LegSlave's update late.
double overshootOfAStep(const ServoModel& servo) {
  const double tau = servo.tau.maxCoeff() + servo.update,
               K = 1.25 * std::max(servo.extend.maxCoeff(), servo.retract.maxCoeff()),
               under = 4.0 * K * tau - 1.0;
  return under > 0.0 ? std::exp(-M_PI / std::sqrt(under)) : 0.0;
}

}  // namespace

Laws::Laws(const Experiment& experiment, const std::string& only)
    : experiment_(experiment),
      c_(experiment.controller),
      checks_(c_.safety, c_.geometry),
      period_(c_.periodSeconds()),
      count_(c_.legs.scale.maxCoeff()),
      at_rest_(2.0 * count_),
      L_home_(legLengths(c_.geometry, c_.geometry.fromHome(Pose()))),
      only_(only) {
  if (!experiment.plant.hydraulic || c_.resonance.frequency == 0.0) return;
  swings_ = 1.0 / c_.resonance.frequency;
  const plant::HydraulicLegModel& leg = experiment.plant.hydraulic->leg;
  const plant::CylinderModel& c = leg.cylinder;
  const double middle = plant::boreVolume(leg, 0.5 * (c.length_min + c.length_max));
  // In its most crooked poses the robot's weight pulls a leg with all that its oil can hold.
  constexpr double kOverpowered = 1e-3;  // [m]
  at_rest_ += c.play + kOverpowered;
  slips_ = c.play + 2.0 * leg.seals.breakaway * middle / (leg.oil.bulk_modulus * c.bore * c.bore);
}

void Laws::broken(const std::string& law, const std::string& what) {
  if (!finding_ && (only_.empty() || only_ == law)) finding_ = Finding{law, tick_, what};
}

void Laws::controllerBegins(std::int64_t source) {
  controllerSilent();
  source_ = source;
  last_.reset();
  last_checked_.reset();
  said_.clear();
  permission_ = start_permission_ = false;
  stopping_since_ = -1;
}

void Laws::controllerSilent() { orders_.clear(); }

void Laws::controllerEnds(bool said_how, const std::string& how) {
  if (!said_how) broken("ended", fmt::format("a run ended without a word: {}", how));
  controllerSilent();
}

void Laws::ordered(const OrderId& id) { orders_[id.sequence] = {tick_, {}}; }

void Laws::ticked(const TickInput& in, const TickState& s) {
  checked(s);
  reference(s);
  if (last_ && s.late_ticks == last_->late_ticks) continuous(s);
  orders(s);
  trips(s);
  permitted(in, s);
  if (!(s.vehicle_energy <= 1e-9))
    broken("passive", fmt::format("a change of the vehicle has put in {:.3g} J", s.vehicle_energy));
  said_[s.tick] = {s.legs.L, s.phase == Phase::kStopped};
  said_.erase(s.tick - 256);
  desired_rate_ = s.desired == s.motion.x || !last_ ? s.motion.x_dot : last_->motion.x_dot;
  last_ = s;
}

/// Every pose that is commanded passes every check, and no leg is asked to be too fast.
void Laws::checked(const TickState& s) {
  if (!s.command.engaged) {
    last_checked_.reset();
    return;
  }
  const Vec6& L = s.legs.L;
  if (!L.allFinite() || !s.motion.x.allFinite() || !s.reference.allFinite()) {
    broken("finite", "a command that is not");
    return;
  }
  if (s.phase != Phase::kStopped) {
    const Pose x = Pose::from(s.motion.x);
    const Transform X_IP = c_.geometry.fromHome(x);
    const double off = (legLengths(c_.geometry, X_IP) - L).cwiseAbs().maxCoeff();
    if (!(off < 1e-9)) broken("checked", "lengths of another pose");
    if (const Tripped t = checks_.pose(X_IP, x, L); t.any())
      broken("checked", fmt::format("a pose that fails {}", name(t.first())));
  }
  // A stop may come in the tick of arming: what is held then was measured.
  if (last_checked_) {
    const double most = (L - *last_checked_).cwiseAbs().maxCoeff();
    if (!(most <= c_.safety.leg_velocity * period_ * (1.0 + 1e-9)))
      broken("checked", fmt::format("a step of {:.2f} mm in a tick", most * 1e3));
  }
  last_checked_ = L;
}

/// What the servos are told: the checked lengths, or as far ahead of them as the servos' lag, and
/// what seals and overlapping valves take, explain; stopped, the checked lengths.
void Laws::reference(const TickState& s) {
  if (!s.command.engaged || !s.legs.L.allFinite()) return;
  const Vec6 sent = legLengths(c_.legs, s.command.counts);
  const Vec6 ahead = sent - s.legs.L;
  Vec6 most = Vec6::Constant(0.5001 * count_);
  if (s.phase != Phase::kStopped) {
    if (c_.compensation.observer) most.array() += 1.6 * count_;
    if (c_.compensation.feed_forward)
      for (int i = 0; i < 6; ++i) {
        const double slowest = std::min(s.servo.extend(i), s.servo.retract(i)),
                     v = std::abs(s.legs.L_dot(i)), a = std::abs(s.legs.L_ddot(i));
        most(i) += (v + 0.06 * a) / slowest + 0.06 * v +
                   2.0 * (c_.servo.friction(i) + std::max(0.0, -c_.servo.opening(i)));
      }
  }
  if (!((ahead.cwiseAbs() - most).maxCoeff() <= 0.0))
    broken("reference", fmt::format("{} {}: {} ahead of the checked lengths", name(s.phase),
                                    name(s.kind), legText(ahead)));
  const double out =
      std::max(c_.safety.leg_min - sent.minCoeff(), sent.maxCoeff() - c_.safety.leg_max);
  if (!(out <= count_))
    broken("reference", fmt::format("{:.2f} mm outside a leg's limits", out * 1e3));
}

/// The commanded motion goes on from where it was, at the rate that it had.
void Laws::continuous(const TickState& s) {
  const TickState& b = *last_;
  if (!s.command.engaged || !b.command.engaged) {
    // Arming: the first command is what was measured.
    if (s.command.engaged && !b.command.engaged && s.phase == Phase::kArmed) {
      const Vec6 off = s.legs.L - s.L_measured;
      if (!(off.cwiseAbs().maxCoeff() <= 1e-6))
        broken("continuous", fmt::format("arming: {} off the measured", legText(off)));
    }
    return;
  }
  if (s.phase == Phase::kStopped || b.phase == Phase::kStopped) return;  // a freeze is a step
  // The report's ramps and sines begin, and ramps end, with a step of the rate (C.8) to (C.10).
  const auto planned = [](SegmentKind kind) {
    return kind == SegmentKind::kTrajectory || kind == SegmentKind::kPath;
  };
  const bool begins = planned(s.kind) && (!planned(b.kind) || s.segment != b.segment ||
                                          s.order.sequence != b.order.sequence);
  if (begins || s.envelope_scale < 1.0 || b.envelope_scale < 1.0) return;
  const Vec6 rate = s.desired == s.motion.x ? s.motion.x_dot : b.motion.x_dot;
  // Within a period of a model with fast modes rates say little: its own steps are its own.
  const bool model = b.kind == SegmentKind::kAdmittance && s.desired == b.motion.x;
  for (int i = 0; i < 6; ++i) {
    if (planned(b.kind) && (rate(i) == 0.0 || desired_rate_(i) == 0.0)) continue;
    const double most =
        kQuinticBraking * std::max(limit(c_.stop_braking, i), limit(c_.gentle.braking, i)) +
        std::abs(s.motion.x_ddot(i)) + std::abs(b.motion.x_ddot(i));
    const double step = s.desired(i) - b.desired(i),
                 due = 0.5 * period_ * (rate(i) + desired_rate_(i));
    if (!model && !(std::abs(step - due) <= 0.3 * most * period_ * period_ + 1e-9))
      broken("continuous",
             fmt::format(
                 "{} {} to {} {}: coordinate {} goes {:.3g} where its rates say {:.3g} [m, rad]",
                 name(b.phase), name(b.kind), name(s.phase), name(s.kind), i, step, due));
    const double jump = s.motion.x_dot(i) - b.motion.x_dot(i);
    if (planned(s.kind) || s.kind == SegmentKind::kAdmittance) continue;
    if (!(std::abs(jump) <= 1.1 * most * period_ + 1e-9))
      broken("continuous",
             fmt::format("{} {} to {} {}: the rate of coordinate {} jumps by {:.3g} [1/s]",
                         name(b.phase), name(b.kind), name(s.phase), name(s.kind), i, jump));
  }
}

/// Each order is answered once, within a second.
void Laws::orders(const TickState& s) {
  const auto at = orders_.find(s.order.sequence);
  if (at != orders_.end() && s.refusal != Refusal::kChecking) {
    if (at->second.answer && *at->second.answer != s.refusal)
      broken("orders", fmt::format("an order was answered '{}', then '{}'",
                                   name(*at->second.answer), name(s.refusal)));
    at->second.answer = s.refusal;
  }
  const auto patience = static_cast<std::int64_t>(1.0 / period_) + 3;
  for (auto order = orders_.begin(); order != orders_.end();) {
    if (!order->second.answer && tick_ - order->second.since > patience)
      broken("orders", fmt::format("order {} was not answered within a second", order->first));
    const bool old = order->second.answer && order->first != s.order.sequence &&
                     tick_ - order->second.since > 4 * patience;
    order = old ? orders_.erase(order) : std::next(order);
  }
}

/// A stop has one cause, latched; phases follow each other as the diagram says.
void Laws::trips(const TickState& s) {
  const bool stop = s.phase == Phase::kStopping || s.phase == Phase::kStopped;
  if (stop && (s.cause == Check::kCount || s.cause_tick < 0 || !s.latched.has(s.cause)))
    broken("trip", "stopped without a cause");
  if (s.phase == Phase::kStopped && !s.motion.x_dot.isZero(0.0))
    broken("trip", "stopped, and says that it moves");
  if (!stop && s.cause != Check::kCount) broken("trip", "a cause without a stop");
  if (s.phase != Phase::kStopping) stopping_since_ = -1;
  if (s.phase == Phase::kStopping && stopping_since_ < 0) stopping_since_ = s.tick;
  if (stopping_since_ >= 0 && static_cast<double>(s.tick - stopping_since_) * period_ > 3.0)
    broken("trip", "a controlled stop that does not end");
  if (!last_) return;
  const TickState& b = *last_;
  const bool stood = b.phase == Phase::kStopping || b.phase == Phase::kStopped;
  if (stop && stood && (b.cause != s.cause || b.cause_tick != s.cause_tick))
    broken("trip", fmt::format("the cause changed from {} to {}", name(b.cause), name(s.cause)));
  if (stop && stood && (b.latched.bits() & ~s.latched.bits()) != 0)
    broken("trip", "a latched check was forgotten");
  if (b.phase == s.phase) return;
  using P = Phase;
  const auto may = [&](std::initializer_list<P> to) {
    return std::find(to.begin(), to.end(), s.phase) != to.end();
  };
  bool good = false;
  switch (b.phase) {
    case P::kDisarmed:
      good = may({P::kArmed, P::kRunning, P::kReturning, P::kStopping, P::kStopped});
      break;
    case P::kArmed: good = may({P::kRunning, P::kReturning, P::kStopping, P::kStopped}); break;
    case P::kRunning: good = may({P::kArmed, P::kReturning, P::kStopping, P::kStopped}); break;
    case P::kReturning:
      good = may({P::kArmed, P::kRunning, P::kParked, P::kStopping, P::kStopped});
      break;
    case P::kParked: good = may({P::kStopping, P::kStopped}); break;
    case P::kStopping: good = may({P::kStopped}); break;
    case P::kStopped: good = may({P::kDisarmed}); break;
    case P::kCount: break;
  }
  if (!good) broken("trip", fmt::format("from {} to {}", name(b.phase), name(s.phase)));
}

/// Nothing moves without an order that came after the last reset.
void Laws::permitted(const TickInput& in, const TickState& s) {
  const Request asked = in.order.request;
  if (asked == Request::kArm || asked == Request::kStart) permission_ = true;
  if (asked == Request::kStart) start_permission_ = true;
  if (last_ && last_->phase == Phase::kStopped && s.phase == Phase::kDisarmed)
    permission_ = start_permission_ = false;
  if (s.command.engaged && !permission_)
    broken("permitted", "the legs were taken without an order");
  if (s.phase == Phase::kRunning && s.segment >= 0 && !start_permission_)
    broken("permitted", "a program begins without an order");
  if (s.kind != SegmentKind::kAdmittance && last_ && last_->kind == SegmentKind::kAdmittance &&
      s.tripped.any() && s.cause_tick == s.tick) {
    for (const Check check :
         {Check::kMotionLimits, Check::kActuatorLimits, Check::kJointLimits, Check::kCollide,
          Check::kConditioning, Check::kVelocity, Check::kFlow})
      if (s.cause == check)
        broken("envelope", fmt::format("admittance control ran into {}", name(check)));
  }
}

void Laws::machineBegins() {
  engaged_ = frozen_ = heard_ours_ = false;
  alone_from_.reset();
}

void Laws::machine(std::int64_t time, const plant::Truth& truth, const std::optional<Taken>& taken,
                   bool loops_closed) {
  if (taken) follow(time, truth, *taken);
  if (!loops_closed && !loops_open_) loop_opened_ = time;
  loops_open_ = loops_open_ || !loops_closed;
  if (!engaged_) return;
  if (time - engaged_time_ > kSecond) {
    alone(time, truth);
  } else {
    alone_from_.reset();
  }
  if (frozen_) frozen(time, truth);
}

void Laws::follow(std::int64_t time, const plant::Truth& truth, const Taken& taken) {
  if (taken.source == ghost_ && heard_ours_) broken("ghost", "a ghost has the legs");
  heard_ours_ = heard_ours_ || taken.source == source_;
  if (!taken.command.engaged) return;
  engaged_ = true;
  loops_open_ = false;
  engaged_time_ = time;
  const auto said = said_.find(taken.tick);
  const bool ours = taken.source == source_ && said != said_.end();
  const bool stopped = ours && said->second.stopped;
  const Vec6 before = anchor_;
  anchor_ = ours ? said->second.L : legLengths(c_.legs, taken.command.counts);
  if (stopped && (!frozen_ || anchor_ != before)) {  // another stop, of which this is heard first
    frozen_time_ = time;
    const Vec6 from = truth.legs.L - anchor_;
    // The servo's own: of a speed that it has to lose, and of a step that it has to make. What
    // gives way swings on, six modes add up in a leg, and each leg feels what the others lose.
    const double modes = std::sqrt(6.0) * swings_;
    const Vec6 overshoot = Vec6::Constant(2.0 * count_ + slips_) +
                           0.010 * truth.legs.L_dot.cwiseAbs() +
                           Vec6::Constant(modes * truth.legs.L_dot.cwiseAbs().maxCoeff()) +
                           modes * swings_ * truth.legs.L_ddot.cwiseAbs() +
                           overshootOfAStep(c_.servo) * from.cwiseAbs();
    frozen_low_ = from.cwiseMin(0.0) - overshoot;
    frozen_high_ = from.cwiseMax(0.0) + overshoot;
  }
  frozen_ = stopped;
}

/// After a stop the legs come to rest at the last checked lengths, and go no further.
void Laws::frozen(std::int64_t time, const plant::Truth& truth) {
  const Vec6 off = truth.legs.L - anchor_;
  if (time - engaged_time_ > kSecond / 2) return;  // nobody commands any more
  const Vec6 beyond = (off - frozen_high_).cwiseMax(frozen_low_ - off);
  if (!(beyond.maxCoeff() <= 0.0))
    broken("rest",
           fmt::format("{:.2f} s after a stop {} beyond what a stop takes, {} off the last checked "
                       "lengths",
                       static_cast<double>(time - frozen_time_) * 1e-9,
                       legText(beyond.cwiseMax(0.0)), legText(off)));
  if (time - frozen_time_ > kSecond && !(off.cwiseAbs().maxCoeff() <= at_rest_))
    broken("rest", fmt::format("stopped, and {} from the last checked lengths", legText(off)));
}

/// Nobody commands: the legs stay at the last checked lengths, or go home, slowly.
void Laws::alone(std::int64_t time, const plant::Truth& truth) {
  const Vec6& L = truth.legs.L;
  const Watchdog& watchdog = experiment_.plant.watchdog;
  if (!alone_from_) {
    alone_from_ = L;
    if (time - engaged_time_ < watchdog.park_after && time - engaged_time_ < 2 * kSecond) {
      const Vec6 off = L - anchor_;
      if (!(off.cwiseAbs().maxCoeff() <= at_rest_))
        broken("rest", fmt::format("a second after the last command {} from its checked lengths",
                                   legText(off)));
    }
  }
  const double park_time = static_cast<double>(watchdog.park_time) * kSecondPerNanosecond;
  const Vec6 way = (anchor_ - L_home_).cwiseAbs();
  // A leg takes a count at the servo's pace; one that was on its way takes a moment to stop.
  // One that gives way swings by what it slips.
  const double jolt = swings_ > 0.0 ? (slips_ + count_) / swings_ : 0.0,
               pace = 2.0 * count_ * c_.servo.extend.maxCoeff() + jolt;
  const bool stays = loops_open_ && time - loop_opened_ > kSecond / 2;
  const Vec6 most = Vec6::Constant(pace) + (stays ? 0.0 : 1.3 / park_time) * way;
  const Vec6 speed = truth.legs.L_dot.cwiseAbs();
  if (!((speed - most).maxCoeff() <= 0.0))
    broken("alone",
           fmt::format("nobody commands, and a leg moves at {:.0f} mm/s", speed.maxCoeff() * 1e3));
  const Vec6 further = (L - L_home_).cwiseAbs() - (*alone_from_ - L_home_).cwiseAbs();
  if (!(further.maxCoeff() <= 3.0 * count_))
    broken("alone", fmt::format("nobody commands, and {} goes away from home", legText(further)));
}

}  // namespace ves::swarm
