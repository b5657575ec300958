// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/plant.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace ves::plant {
namespace {

double seconds(std::int64_t ns) { return static_cast<double>(ns) * kSecondPerNanosecond; }

constexpr std::int64_t kMidUpdate = kUpdatePeriod / 2;  // [ns]
constexpr double kStillSpeed = 1e-9;                    // [m/s]
constexpr std::uint32_t kJointSeed = 0x9e3779b9;        // [-] a stream of its own
constexpr std::uint32_t kTransducerSeed = 0x7f4a7c15;   // [-] the same
constexpr std::int64_t kSettle = 100'000'000;           // [ns] between checks whether all is still

LegCounts countsAt(const PlantConfig& config, const Pose& pose) {
  const Vec6 L = legLengths(config.geometry, config.geometry.fromHome(pose));
  LegCounts out;
  for (std::size_t i = 0; i < kLegs; ++i)
    out[i] = config.transducer.count(L(static_cast<Eigen::Index>(i)));
  return out;
}

}  // namespace

Plant::Plant(const PlantConfig& config)
    : config_(config),
      watchdog_(config.watchdog, countsAt(config, config.initial_pose), countsAt(config, {})),
      sensor_(config.sensor, Noise(config.seed)),
      filter_position_(config.filter_cutoff),
      filter_velocity_(config.filter_cutoff),
      filter_acceleration_(config.filter_cutoff),
      transducer_noise_(config.seed ^ kTransducerSeed),
      sensor_step_(sensor_.prepare(seconds(kUpdatePeriod))),
      position_step_(filter_position_.prepare(seconds(kUpdatePeriod))),
      rate_step_(filter_velocity_.prepare(seconds(kUpdatePeriod))),
      fine_(config.hydraulic && config.task.world),
      next_step_(fine_ ? kTransducerPeriod / 2 : kNever),
      encoders_(config.joints, Noise(config.seed ^ kJointSeed), config.task.initial_joints),
      joints_read_(config.task.initial_joints),
      robot_(carried(config.payload), config.task.initial_joints) {
  X_SL0_ = inverse(config.payload.X_PS) * config.payload.X_PL0();

  truth_.P.X = config_.geometry.fromHome(config_.initial_pose);
  truth_.legs.L = legLengths(config_.geometry, truth_.P.X);
  truth_.joints.q = config_.task.initial_joints;
  robot_event_done_.assign(config_.task.robot_events.size(), false);
  injectors_.resize(config_.faults.size());
  began_.fill(kNever);
  for (int i = 0; i < kLegs; ++i) {
    const double L = truth_.legs.L(i);
    if (!config_.hydraulic) actuators_.emplace_back(config_.actuator, L);
    slaves_.emplace_back(config_.leg_slave, config_.transducer.count(L));
  }
  for (const FaultEvent& event : config_.faults) {
    const bool stuck = event.fault == Fault::kValveStuck;
    if (stuck || event.fault == Fault::kRunaway) valve_faults_.push_back(event);
    if (config_.hydraulic && (stuck || isHydraulic(event.fault))) leg_faults_.push_back(event);
  }
  worn_.assign(leg_faults_.size(), false);
  filter_position_.settle(truth_.legs.L.array());
  filter_velocity_.settle(Vec6::Zero().array());
  filter_acceleration_.settle(Vec6::Zero().array());
  if (config_.task.world) {
    tool_ = toolMotion();
    if (config_.task.world->environment.target)
      truth_.target = config_.task.world->environment.target->start;
  }
  sensor_.settle(sensorLoad());
  magnets_ = truth_.legs.L;
  if (config_.hydraulic)
    hydraulic_.emplace(config_.geometry, *config_.hydraulic, truth_.P.X, platformLoad({}));
  if (config.joints.interval > 0) next_joints_ = config.joints.interval;
  if (config.sensor_readings > 1) {
    sensor_interval_ = config.sensor_window / config.sensor_readings;
    next_sensor_ = sensor_interval_ / 2;
    const double warmer = config_.climate.at(0.0) - config_.climate.mean;
    sensor_readings_.assign(static_cast<std::size_t>(config.sensor_readings) + 1,
                            sensor_.convert(warmer));
  }
}

void Plant::command(const LegCommand& command) noexcept {
  watchdog_.take(command, now_);
  fly(command.laboratory);
  if (!command.engaged) return;
  if (command.segment < 0) {  // an operator's order: what the program began goes on
    outside_ = true;
    next_robot_event_ = kNever;
    return;
  }
  if (command.segment == segment_ && !outside_) return;
  if (command.segment < segment_ || outside_) {  // a program begins anew
    robot_event_done_.assign(robot_event_done_.size(), false);
    began_.fill(kNever);
  }
  outside_ = false;
  segment_ = command.segment;
  segment_start_ = now_;
  began_[static_cast<std::size_t>(segment_)] = now_;
  planRobotEvent();
}

/// Where the laboratory stops, what floats stops with it, and keeps its place and what it did
/// beside it: also where a stop has come in the midst of a period, or another controller counts
/// from elsewhere.
void Plant::fly(const Laboratory& laboratory) noexcept {
  const auto rests = [](const BodyMotion& H) { return H.v.isZero(0.0) && H.w.isZero(0.0); };
  const BodyMotion before = laboratory_.at(now_), after = laboratory.at(now_);
  laboratory_ = laboratory;
  if (!rests(after) || (rests(before) && before.X == after.X) || !config_.task.world) return;
  Floating& target = truth_.target;
  const Vec3 home = config_.geometry.home(), p = target.p - home;
  const Transform moved = after.X * inverse(before.X);
  target.v = moved.R * (target.v - before.v - before.w.cross(p - before.X.p));
  target.w = moved.R * (target.w - before.w);
  target.p = home + moved * p;
  target.q = (Eigen::Quaterniond(moved.R) * target.q).normalized();
  tool_ = toolMotion();
}

/// The next event of this segment that is still to come.
void Plant::planRobotEvent() noexcept {
  next_robot_event_ = kNever;
  for (std::size_t i = 0; i < config_.task.robot_events.size(); ++i) {
    const Cue& cue = config_.task.robot_events[i].cue;
    if (cue.segment == segment_ && !robot_event_done_[i])
      next_robot_event_ = std::min(next_robot_event_, segment_start_ + cue.after);
  }
}

void Plant::startRobotEvents() noexcept {
  for (std::size_t i = 0; i < config_.task.robot_events.size(); ++i) {
    const RobotEvent& event = config_.task.robot_events[i];
    if (robot_event_done_[i] || event.cue.segment != segment_ ||
        segment_start_ + event.cue.after > now_)
      continue;
    robot_event_done_[i] = true;
    if (!moveRobot(event.action)) ++refused_events_;
  }
  planRobotEvent();
}

bool Plant::moveRobot(const RobotAction& action) noexcept {
  if (const auto* finger = std::get_if<Push>(&action)) return push(*finger);
  if (std::holds_alternative<GraspTarget>(action))
    return config_.task.world && !robot_.holds() &&
           grasp(config_.task.world->environment, toolMotion(), truth_.target);
  if (std::holds_alternative<Release>(action) && truth_.target.X_TB) {
    truth_.target.X_TB.reset();
    return true;
  }
  standing_.reset();
  return robot_.begin(action, now_);
}

bool Plant::push(const Push& push) noexcept {
  const bool there = push.on == Push::On::kTarget
                         ? config_.task.world && config_.task.world->environment.target
                         : push.link >= -1 && push.link < robot_.model().size;
  if (!there) return false;
  if (truth_.push) stepMechanics();  // what it pushed so far
  truth_.push = BegunPush{push, now_};
  ++truth_.pushes;
  return true;
}

double Climate::at(double t) const noexcept {
  return mean + 0.5 * swing * std::sin(2.0 * M_PI * (t - rising) / period);
}

/// No valve is open, no joint is on its way, and nothing is planned.
bool Plant::still() const noexcept {
  if (next_robot_event_ != kNever || config_.task.world) return false;
  if (truth_.push && truth_.push->end() + kSettle > now_) return false;
  for (const LegSlave& slave : slaves_)
    if (slave.code() != 0) return false;
  for (const Actuator& actuator : actuators_)
    if (std::abs(actuator.velocity()) > kStillSpeed) return false;
  if (hydraulic_ && !(hydraulic_->motion().v.norm() + hydraulic_->motion().w.norm() < kStillSpeed))
    return false;
  return !robot_.moving(now_);
}

/// Whole LegSlave periods, so that every phase stays, up to a second before `until`.
void Plant::skip(std::int64_t until) noexcept {
  const std::int64_t time = (until - now_ - 1'000'000'000) / kUpdatePeriod * kUpdatePeriod;
  now_ += time;
  last_step_ += time;
  watchdog_.skip(time);
  next_reading_ += time;
  if (next_step_ != kNever) next_step_ += time;
  if (next_sensor_ != kNever) next_sensor_ += time;
  if (next_joints_ != kNever) next_joints_ += time;
  joints_time_ += time;
}

void Plant::advance(std::int64_t until) noexcept {
  while (until - now_ > kSkipped && !still()) runEvents(now_ + kSettle);
  if (until - now_ > kSkipped) skip(until);
  runEvents(until);
}

void Plant::runEvents(std::int64_t until) noexcept {
  for (;;) {
    const std::int64_t next =
        std::min({next_reading_, next_step_, next_sensor_, next_joints_, next_robot_event_});
    if (next > until) break;
    moveActuators(next);
    if (next == next_robot_event_) startRobotEvents();
    if (next == next_step_) {
      stepMechanics();
      next_step_ = fine_ ? now_ + kTransducerPeriod / 2 : kNever;
    }
    if (next == next_sensor_) {
      readSensor();
      next_sensor_ += sensor_interval_;
    }
    if (next == next_joints_) {
      readJoints();
      next_joints_ += config_.joints.interval;
    }
    if (next == next_reading_) {
      readTransducers();
      next_reading_ += kTransducerPeriod;
    }
  }
  moveActuators(until);
}

void Plant::moveActuators(std::int64_t to) noexcept {
  if (to <= now_) return;
  const double dt = seconds(to - now_);
  Vec6 currents;
  for (std::size_t i = 0; i < kLegs; ++i) currents(static_cast<Eigen::Index>(i)) = current(i);
  if (hydraulic_) {
    wear();
    hydraulic_->advance(currents, dt);
  } else {
    if (dt != passed_) {  // most are alike
      passed_ = dt;
      decay_ = std::exp(-dt / config_.actuator.tau);
    }
    for (std::size_t i = 0; i < kLegs; ++i)
      actuators_[i].advance(currents(static_cast<Eigen::Index>(i)), dt, decay_);
  }
  now_ = to;
}

/// A cue's time has come, and not yet gone.
bool Plant::now(const Cue& cue, std::int64_t duration) const noexcept {
  const std::int64_t began = cue.segment < 0 ? 0 : began_[static_cast<std::size_t>(cue.segment)];
  if (began == kNever || now_ - began < cue.after) return false;
  return now_ - began - cue.after < duration;
}

/// Faults of hydraulic legs come and go.
void Plant::wear() noexcept {
  bool changed = false;
  for (std::size_t i = 0; i < leg_faults_.size(); ++i) {
    const bool there = now(leg_faults_[i].cue, leg_faults_[i].duration);
    changed = changed || there != worn_[i];
    worn_[i] = there;
  }
  if (!changed) return;
  for (int leg = 0; leg < kLegs; ++leg) {
    HydraulicLegModel model = config_.hydraulic->leg;
    for (std::size_t i = 0; i < leg_faults_.size(); ++i) {
      const FaultEvent& event = leg_faults_[i];
      if (!worn_[i] || (event.fault != Fault::kSupplyFalls && event.index != leg)) continue;
      switch (event.fault) {
        case Fault::kSupplyFalls: model.oil.supply *= event.amount; break;
        case Fault::kLegLeaks: model.oil.outside += event.amount; break;
        case Fault::kAirInOil: model.oil.bulk_modulus *= event.amount; break;
        case Fault::kLegSticks: model.seals.coulomb = model.seals.breakaway = event.amount; break;
        case Fault::kSealWorn: model.oil.leak += event.amount; break;
        case Fault::kValveStuck: model.valve.stuck = true; break;
        default: break;
      }
    }
    hydraulic_->change(leg, model);
  }
}

/// [A] through a valve.
double Plant::current(std::size_t leg) const noexcept {
  double amperes = slaves_[leg].current();
  for (const FaultEvent& event : valve_faults_) {
    if (static_cast<std::size_t>(event.index) != leg || !now(event.cue, event.duration)) continue;
    if (event.fault == Fault::kValveStuck) amperes = 0.0;
    if (event.fault == Fault::kRunaway)
      amperes = LegSlave::kFullScale * LegSlave::kVoltsPerDigit * LegSlave::kAmperesPerVolt;
  }
  return amperes;
}

void Plant::readTransducers() noexcept {
  const LegCounts& reference = watchdog_.reference(now_);
  truth_.parking = watchdog_.parking();
  for (std::size_t i = 0; i < kLegs; ++i)
    slaves_[i].read(config_.transducer.count(reading(i)), reference[i]);
  if (slaves_[0].updated() && !fine_) next_step_ = now_ + kMidUpdate;
}

/// [m] that a leg's transducer says: its magnet follows where the piston has taken up the
/// hysteresis.
double Plant::reading(std::size_t leg) noexcept {
  if (!hydraulic_) return actuators_[leg].length();
  const double L = hydraulic_->leg(static_cast<int>(leg)).length();
  const ReadingModel& model = config_.hydraulic->reading;
  double& magnet = magnets_(static_cast<Eigen::Index>(leg));
  magnet = std::clamp(magnet, L - 0.5 * model.hysteresis, L + 0.5 * model.hysteresis);
  return model.noise > 0.0 ? magnet + model.noise * transducer_noise_.normal() : magnet;
}

Wrench Plant::sensorLoad() noexcept {
  const Transform X_PL0 = config_.payload.X_PL0();
  const ProperMotion felt = properMotion(truth_.P, X_PL0, config_.gravity);
  return transfer(X_SL0_, Wrench{} - wrenchOnRobot(felt));
}

/// The platform where the world is.
BodyMotion Plant::emulated() const noexcept {
  if (!laboratory_.flies()) return truth_.P;
  BodyMotion P = truth_.P;
  P.X.p -= config_.geometry.home();
  P = composed(laboratory_.at(now_), P);
  P.X.p += config_.geometry.home();
  return P;
}

FrameMotion Plant::toolMotion() const noexcept {
  return carriedFrame(robot_.model(), truth_.joints, emulated(), config_.payload.X_PL0(),
                      config_.task.world->link, config_.task.world->X_link);
}

/// The robot on the platform, locked, and what it puts on it beyond that: its weight, its joints'
/// motion, and `further`.
PlatformLoad Plant::platformLoad(const Wrench& further_So_S) noexcept {
  const Transform X_PL0 = config_.payload.X_PL0();
  BodyMotion steady = truth_.P;
  steady.a = steady.alpha = Vec3::Zero();
  const Wrench robot_Po_P =
      transfer(X_PL0, wrenchOnRobot(properMotion(steady, X_PL0, config_.gravity)));
  PlatformLoad load;
  load.body_P = combine(RigidBody{}, X_PL0, compositeBody(robot_.model(), truth_.joints.q));
  const Vec3 w_P = steady.X.R.transpose() * steady.w;
  load.F_Po_P = inertialWrench(load.body_P, {w_P, Vec3::Zero(), Vec3::Zero()}) - robot_Po_P +
                transfer(config_.payload.X_PS, further_So_S);
  return load;
}

/// What touches the tool while it goes from where it was to where it is, as the sensor feels it:
/// F_So_S. Ideal legs do not feel it, as they feel no other load; hydraulic ones get it with
/// theirs.
Wrench Plant::meetWorld(double dt) noexcept {
  const World& world = *config_.task.world;
  const FrameMotion now = toolMotion();
  const bool held = world.release >= 0 && began_[static_cast<std::size_t>(world.release)] == kNever;
  Floating target = truth_.target;
  if (held) target.v = target.w = Vec3::Zero();
  if (truth_.push && truth_.push->push.on == Push::On::kTarget &&
      truth_.push->share(last_step_ - std::llround(dt * 1e9), now_) > 0.0) {
    const Wrench on_target_Bo_E =
        rotate(laboratoryTurn(), pushed(last_step_ - std::llround(dt * 1e9)));
    const FloatingRates with = rates(world.environment, target, on_target_Bo_E),
                        without = rates(world.environment, target, Wrench{});
    target.v += dt * (with.v - without.v);
    target.w += dt * (with.w - without.w);
  }
  const Touch mean = ves::advance(world.environment, tool_, now, seconds(last_step_) - dt, dt,
                                  kContactStep, target, truth_.contacts);
  if (!held) truth_.target = target;
  tool_ = now;
  const Transform X_EP = emulated().X, X_ES = X_EP * config_.payload.X_PS;
  truth_.contact_To_I = laboratory_.flies()
                            ? rotate(truth_.P.X.R * X_EP.R.transpose(), mean.on_tool_To_I)
                            : mean.on_tool_To_I;
  truth_.clearance = mean.least;
  return rotate(X_ES.R.transpose(), shift(mean.on_tool_To_I, X_ES.p - now.X.p));
}

/// R_EI
Mat3 Plant::laboratoryTurn() const noexcept {
  return laboratory_.flies() ? laboratory_.at(now_).X.R : Mat3(Mat3::Identity());
}

/// The push's mean since `from` [ns], in {I}: about Po, or about the centre of what floats, whose
/// place is in {E}.
Wrench Plant::pushed(std::int64_t from) const noexcept {
  const Push& push = truth_.push->push;
  const Vec3 f = truth_.push->share(from, now_) * push.force_I;
  const Transform X_IB = truth_.target.X_IB();
  const Vec3 at =
      pushedPoint(push, truth_.P.X, config_.payload.X_PL0(), robot_.model(), truth_.joints.q, X_IB);
  if (push.on != Push::On::kTarget) return {f, (at - truth_.P.X.p).cross(f)};
  return {f, (laboratoryTurn().transpose() * (at - X_IB.p)).cross(f)};
}

/// F_L0o_L0. A robot that stands is one body.
Wrench Plant::wrenchOnRobot(const ProperMotion& L0) noexcept {
  const JointState& joints = truth_.joints;
  if (!joints.q_dot.isZero(0.0) || !joints.q_ddot.isZero(0.0))
    return newtonEuler(robot_.model(), joints, L0).F_L0o_L0;
  if (!standing_ || standing_->q != joints.q)
    standing_ = Standing{joints.q, compositeBody(robot_.model(), joints.q)};
  return inertialWrench(standing_->body_L0, L0);
}

LegMotion Plant::legOutputs(double dt) noexcept {
  if (real_legs_) return truth_.legs = *real_legs_;
  LegMotion out;
  for (int i = 0; i < kLegs; ++i) {
    const Actuator& actuator = actuators_[static_cast<std::size_t>(i)];
    out.L(i) = actuator.length();
    out.L_dot(i) = actuator.velocity();
  }
  // The mean since the last step. A valve's step makes the acceleration itself jump; points of it,
  // joined by lines, would put part of every jump before its time, and a sample that is taken
  // between two steps shifts that part: together they made the wrench 11 ms early.
  out.L_ddot = (out.L_dot - truth_.legs.L_dot) / dt;
  truth_.legs = out;
  if (config_.filters == LegFilters::kNone) return out;
  const bool regular = dt == position_step_.dt;
  const auto position = regular ? position_step_ : filter_position_.prepare(dt);
  const auto rate = regular ? rate_step_ : filter_velocity_.prepare(dt);
  filter_position_.advance(position, out.L.array());
  filter_velocity_.advance(rate, out.L_dot.array());
  filter_acceleration_.jump(out.L_ddot.array());
  filter_acceleration_.advance(rate, out.L_ddot.array());
  return {filter_position_.output().matrix(), filter_velocity_.output().matrix(),
          filter_acceleration_.output().matrix()};
}

/// Brings the platform from the last step to now. Its acceleration is the mean of that time.
void Plant::movePlatform(double dt) noexcept {
  if (hydraulic_) {
    const BodyMotion before = truth_.P;
    truth_.P = hydraulic_->motion();
    truth_.P.a = (truth_.P.v - before.v) / dt;
    truth_.P.alpha = (truth_.P.w - before.w) / dt;
    truth_.legs = legMotion(config_.geometry, truth_.P);
    return;
  }
  const LegMotion legs = legOutputs(dt);
  Transform guess = truth_.P.X;
  guess.p += dt * truth_.P.v;
  guess.R = rotationOf(dt * truth_.P.w) * guess.R;
  const ForwardSolution forward = forwardPose(config_.geometry, legs.L, guess, jacobian_);
  truth_.legs_agree =
      forward.ok() && forwardMotion(config_.geometry, forward.X_IP, legs, truth_.P, jacobian_);
}

/// Brings platform, robot and sensor from the last step to now.
void Plant::stepMechanics() noexcept {
  if (now_ <= last_step_) return;
  const std::int64_t before = std::exchange(last_step_, now_);
  const double dt = seconds(now_ - before);

  movePlatform(dt);
  truth_.joints = real_joints_ ? *real_joints_ : robot_.at(now_);

  Wrench further_So_S;  // of what touches and pushes
  if (config_.task.world) further_So_S = meetWorld(dt);
  if (truth_.push && truth_.push->push.on != Push::On::kTarget &&
      truth_.push->share(before, now_) > 0.0) {
    const Transform X_IS = truth_.P.X * config_.payload.X_PS;
    further_So_S =
        further_So_S + rotate(X_IS.R.transpose(), shift(pushed(before), X_IS.p - truth_.P.X.p));
  }
  const Wrench F_So_S = sensorLoad() + further_So_S;
  if (hydraulic_) hydraulic_->carry(platformLoad(further_So_S));
  // Behind Filter 3 the acceleration is smooth again, and known at the end of the step.
  const auto over = config_.filters == LegFilters::kNone ? ForceTorqueSensor::Over::kConstant
                                                         : ForceTorqueSensor::Over::kRamp;
  sensor_.advance(dt == sensor_step_.dt ? sensor_step_ : sensor_.prepare(dt), F_So_S, over);
  truth_.F_Po_I = rotate(truth_.P.X.R, transfer(config_.payload.X_PS, F_So_S));
}

void Plant::readSensor() noexcept {
  stepMechanics();
  const double warmer = config_.climate.at(seconds(now_)) - config_.climate.mean;
  sensor_readings_[read_++ % sensor_readings_.size()] = sensor_.convert(warmer);
}

void Plant::readJoints() noexcept {
  stepMechanics();
  joints_time_ = now_;
  joints_read_ = encoders_.read(truth_.joints.q);
}

/// The newest window that is over: each reading is the middle of its part of it.
void Plant::averageSensor(Sample& s) const noexcept {
  const std::int64_t newest = next_sensor_ - sensor_interval_;
  const std::size_t skipped = newest + sensor_interval_ / 2 > now_ ? 1 : 0;
  s.wrench_time = std::max<std::int64_t>(
      0, newest + sensor_interval_ / 2 - static_cast<std::int64_t>(skipped) * sensor_interval_);
  const std::size_t size = sensor_readings_.size();
  for (std::size_t i = 0; i < kWrenchChannels; ++i) {
    double sum = 0.0;
    for (std::size_t k = 1 + skipped; k < size + skipped; ++k)
      sum += sensor_readings_[(read_ + size - k) % size][i];
    s.adc[i] = static_cast<std::int32_t>(std::lround(sum / static_cast<double>(size - 1)));
  }
}

Sample Plant::sample() noexcept {
  stepMechanics();
  truth_.time = now_;
  truth_.x = config_.geometry.toHome(truth_.P.X);
  Sample s;
  s.sequence = ++sequence_;
  s.time = s.legs_time = s.wrench_time = s.joints_time = now_;
  s.temperature = config_.climate.at(seconds(now_));
  const double warmer = s.temperature - config_.climate.mean;
  s.adc = sensor_.convert(warmer);
  if (!sensor_readings_.empty()) averageSensor(s);
  truth_.F_So_S = sensor_.reading(warmer);
  for (std::size_t i = 0; i < kLegs; ++i) {
    s.legs[i] = config_.transducer.count(reading(i));
    truth_.current(static_cast<Eigen::Index>(i)) = slaves_[i].current();
  }
  if (next_joints_ == kNever) readJoints();
  s.joints_time = joints_time_;
  s.q = joints_read_;
  s.switches = kAllSwitchesClosed;
  if (config_.gripper_switch && (robot_.holds() || truth_.target.X_TB))
    s.switches |= kGripperClosed;
  for (std::size_t i = 0; i < config_.faults.size(); ++i) {
    const FaultEvent& event = config_.faults[i];
    injectors_[i].apply(event, now(event.cue, event.duration), config_.sensor.volts_per_count, s);
  }
  if ((s.switches & kAllSwitchesClosed) != kAllSwitchesClosed) watchdog_.loopOpened();
  return s;
}

}  // namespace ves::plant
