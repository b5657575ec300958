// SPDX-License-Identifier: BSD-3-Clause
#include "ves/transport/messages.hpp"

#include "ves/transport/channels.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <random>

#include "ves/math/dense.hpp"
#include "ves/simulation/lockstep.hpp"

namespace ves {
namespace {

template <typename Vector, std::size_t N>
void put(const Vector& from, double (&to)[N]) {
  static_assert(Vector::RowsAtCompileTime == static_cast<int>(N));
  for (std::size_t i = 0; i < N; ++i) to[i] = from(static_cast<Eigen::Index>(i));
}

template <typename T>
bool inRange(T x, T lo, T hi) {
  return x >= lo && x <= hi;
}

constexpr double kMaxJointValue = 1e3;   // [rad | m]
constexpr double kMaxPathTime = 1e4;     // [s] of a tool path
constexpr double kMaxToolSpeed = 100.0;  // [m/s]
constexpr double kMaxReach = 100.0;      // [m] of a tool
constexpr double kMaxLoad = 1e6;         // [kg]
constexpr double kMaxLoadInertia = 1e7;  // [kg m^2]
// robot_command_t::kind and ::parts
constexpr int kJointOrder = 0, kToolToOrder = 1, kToolByOrder = 2, kGraspOrder = 3,
              kReleaseOrder = 4;
constexpr int kPositionPart = 1, kRpyPart = 2, kViaPart = 4;
constexpr double kMaxTime = 1e6;                    // [s] of an order
constexpr double kMaxTranslation = 10.0;            // [m]
constexpr double kMaxRotation = 10.0;               // [rad]
constexpr double kMaxFrequency = 1e3;               // [Hz]
constexpr std::int64_t kMostAhead = 1'000'000'000;  // [ns] the longest period

}  // namespace

Identity Identity::draw() {
  std::random_device random;
  const auto high = static_cast<std::int64_t>(random() & 0x3fffffffu);
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return {(high << 22) ^ static_cast<std::int64_t>(getpid()),
          std::chrono::duration_cast<std::chrono::nanoseconds>(now).count()};
}

header_t header(const Identity& from, std::int64_t sequence, std::int64_t time) noexcept {
  header_t h{};
  h.time_ns = time;
  h.sequence = sequence;
  h.source = from.source;
  h.epoch = from.epoch;
  return h;
}

sample_t toMessage(const Sample& sample, const Identity& from, std::int64_t answers) noexcept {
  sample_t m{};
  m.header = header(from, sample.sequence, sample.time);
  m.answers = answers;
  std::copy(sample.adc.begin(), sample.adc.end(), m.adc);
  std::copy(sample.legs.begin(), sample.legs.end(), m.legs);
  m.switches = static_cast<std::int32_t>(sample.switches);
  put(sample.q, m.q);
  m.temperature = sample.temperature;
  m.legs_time_ns = sample.legs_time;
  m.wrench_time_ns = sample.wrench_time;
  m.joints_time_ns = sample.joints_time;
  m.faults = static_cast<std::int32_t>(sample.faults);
  if (sample.command_source != 0) {
    m.command_source = sample.command_source;
    m.command_sequence = sample.command_tick;
    m.command_time_ns = sample.command_time;
  }
  return m;
}

leg_command_t toMessage(const LegCommand& command, const header_t& header) noexcept {
  leg_command_t m{};
  m.header = header;
  m.engaged = command.engaged ? 1 : 0;
  m.segment = command.segment;
  m.park = command.park ? 1 : 0;
  std::copy(command.counts.begin(), command.counts.end(), m.counts);
  std::copy(command.rest.begin(), command.rest.end(), m.rest);
  m.ahead_ns = command.ahead;
  return m;
}

state_t toMessage(const TickState& state, const TickInput& in, const header_t& header) noexcept {
  state_t m;
  m.header = header;
  m.count = state.count;
  m.machine_time_ns = in.time;
  m.sample_sequence = state.sample_sequence;
  m.request = static_cast<std::int32_t>(in.order.request);
  m.request_source = in.order.id.source;
  m.request_sequence = in.order.id.sequence;
  m.order_source = state.order.source;
  m.order_sequence = state.order.sequence;
  m.refusal = static_cast<std::int32_t>(state.refusal);
  m.refused_by = static_cast<std::int32_t>(state.refused_by);
  m.conflicting_node = in.conflicting_node ? 1 : 0;
  m.phase = static_cast<std::int32_t>(state.phase);
  m.segment = state.segment;
  m.kind = static_cast<std::int32_t>(state.kind);
  m.idle = state.idle;
  m.age = state.age;
  put(state.total.stacked(), m.total);
  put(state.static_wrench.stacked(), m.static_wrench);
  put(state.inertial.stacked(), m.inertial);
  put(state.reaction.stacked(), m.reaction);
  m.withholds = state.withholds ? 1 : 0;
  put(state.dynamic.stacked(), m.dynamic);
  put(state.motion.x, m.x);
  put(state.motion.x_dot, m.x_dot);
  put(state.motion.x_ddot, m.x_ddot);
  put(state.desired, m.x_desired);
  put(state.legs.L, m.leg);
  put(state.legs.L_dot, m.leg_dot);
  put(state.legs.L_ddot, m.leg_ddot);
  m.compensation_share = state.compensation_share;
  put(state.reference, m.reference);
  put(state.servo.extend, m.gain_extend);
  put(state.servo.retract, m.gain_retract);
  put(state.servo.delay, m.servo_delay);
  put(state.L_measured, m.leg_measured);
  put(state.measured.stacked(), m.x_measured);
  put(state.bias, m.bias);
  m.calibration = static_cast<std::int32_t>(state.calibration);
  m.violation = static_cast<std::int32_t>(state.violation);
  m.violation_index = state.violation_index;
  m.violation_amount = state.violation_amount;
  put(state.deviation, m.deviation);
  put(state.standard_error, m.standard_error);
  m.tripped = static_cast<std::int32_t>(state.tripped.bits());
  m.latched = static_cast<std::int32_t>(state.latched.bits());
  m.cause = static_cast<std::int32_t>(state.cause);
  m.cause_tick = state.cause_tick;
  m.aborted = state.aborted ? 1 : 0;
  m.aborted_by = static_cast<std::int32_t>(state.aborted_by);
  m.envelope_scale = state.envelope_scale;
  m.energy_put_in = state.energy_put_in;
  m.energy_paid = state.energy_paid;
  m.passivity_damping = state.passivity_damping;
  m.late_ticks = state.late_ticks;
  m.engaged = state.command.engaged ? 1 : 0;
  m.park = state.command.park ? 1 : 0;
  std::copy(state.command.counts.begin(), state.command.counts.end(), m.counts);
  std::copy(state.command.rest.begin(), state.command.rest.end(), m.rest);
  m.ahead_ns = state.command.ahead;
  return m;
}

operator_t toMessage(const Order& order, std::int64_t controller, const header_t& header) noexcept {
  operator_t m;
  m.header = header;
  m.controller = controller;
  m.request = static_cast<std::int32_t>(order.request);
  const Segment& s = order.segment;
  m.kind = static_cast<std::int32_t>(s.kind);
  m.duration = s.duration;
  m.interval = s.interval;
  put(s.target.stacked(), m.target);
  for (int i = 0; i < 6; ++i) {
    const Axis& axis = s.trajectory[static_cast<std::size_t>(i)];
    m.motion[i] = static_cast<std::int32_t>(axis.motion);
    m.final[i] = axis.final;
    m.amplitude[i] = axis.amplitude;
    m.frequency[i] = axis.frequency;
  }
  return m;
}

truth_t toMessage(const plant::Truth& truth, const header_t& header) noexcept {
  truth_t m;
  m.header = header;
  put(truth.x.stacked(), m.x);
  put(truth.P.v, m.v);
  put(truth.P.w, m.w);
  put(truth.P.a, m.a);
  put(truth.P.alpha, m.alpha);
  put(truth.F_Po_I.stacked(), m.wrench);
  put(truth.F_So_S.stacked(), m.sensor);
  put(truth.joints.q, m.q);
  put(truth.joints.q_dot, m.q_dot);
  put(truth.joints.q_ddot, m.q_ddot);
  put(truth.legs.L, m.leg);
  put(truth.legs.L_dot, m.leg_dot);
  put(truth.current, m.current);
  m.parking = truth.parking ? 1 : 0;
  m.legs_agree = truth.legs_agree ? 1 : 0;
  m.clearance = truth.clearance;
  put(truth.contact_To_I.stacked(), m.contact);
  m.contacts = truth.contacts.count();
  m.touching = truth.contacts.touching() ? 1 : 0;
  const Contact& contact = truth.contacts.last();
  // By the header's clock, which need not begin with the plant's.
  m.contact_began =
      contact.began + static_cast<double>(header.time_ns - truth.time) * kSecondPerNanosecond;
  m.contact_duration = contact.duration;
  m.contact_peak = contact.peak;
  put(contact.impulse, m.contact_impulse);
  m.contact_approach = contact.approach;
  m.contact_separation = contact.separation;
  put(truth.target.p, m.target_p);
  put(truth.target.q.coeffs(), m.target_q);
  put(truth.target.v, m.target_v);
  put(truth.target.w, m.target_w);
  m.gripped = truth.target.X_TB ? 1 : 0;
  return m;
}

robot_command_t toMessage(const RobotOrder& order, const header_t& header) noexcept {
  robot_command_t m{};
  m.header = header;
  if (const auto* move = std::get_if<RobotMove>(&order)) {
    m.kind = kJointOrder;
    m.joint = move->joint;
    m.target = move->target;
    m.duration = move->duration;
  } else if (const auto* tool = std::get_if<ToolOrder>(&order)) {
    m.kind = tool->by ? kToolByOrder : kToolToOrder;
    m.duration = tool->duration;
    m.speed = tool->speed;
    m.frame = static_cast<int>(tool->in);
    const auto part = [&](int bit, const std::optional<Vec3>& from, double(&to)[3]) {
      if (!from) return;
      m.parts |= bit;
      Vec3::Map(to) = *from;
    };
    part(kPositionPart, tool->position, m.position);
    part(kRpyPart, tool->rpy, m.rpy);
    part(kViaPart, tool->via, m.via);
  } else if (const auto* hand = std::get_if<HandOrder>(&order)) {
    const Mat3& I = hand->body_T.I_Bcm_B;
    m.kind = kGraspOrder;
    m.mass = hand->body_T.mass;
    Vec3::Map(m.com) = hand->body_T.p_BoBcm_B;
    Vec6::Map(m.inertia) << I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2);
  } else {
    m.kind = kReleaseOrder;
  }
  return m;
}

setup_t setupOf(const Experiment& e, bool lockstep, const header_t& header) {
  const ControllerConfig& c = e.controller;
  setup_t m{};
  m.header = header;
  m.period_ns = c.period;
  m.lockstep = lockstep ? 1 : 0;
  m.arming_samples = c.arming_samples;
  m.stale_ticks = c.safety.stale_ticks;
  put(c.legs.offset, m.leg_offset);
  put(c.legs.scale, m.leg_scale);
  const auto counts = [&](const Vec6& L, std::int32_t(&to)[6]) {
    const LegCounts n = legCounts(c.legs, L);
    std::copy(n.begin(), n.end(), to);
  };
  counts(Vec6::Constant(c.safety.leg_min), m.leg_min);
  counts(Vec6::Constant(c.safety.leg_max), m.leg_max);
  counts(legLengths(c.geometry, c.geometry.fromHome(Pose())), m.leg_home);
  m.leg_velocity = c.safety.leg_velocity;
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(m.wrench_per_count) = c.sensor.C_proc;
  m.wrench_window_ns = e.plant.sensor_window;
  m.pressure_min = c.safety.pressure_min;
  m.pressure_max = c.safety.pressure_max;
  m.joints = c.payload.robot.joints;
  for (int i = 0; i < m.joints; ++i) {
    m.joint_min[i] = c.payload.robot.jointLink(i).lower;
    m.joint_max[i] = c.payload.robot.jointLink(i).upper;
  }
  m.hold_after_ns = e.plant.watchdog.hold_after;
  m.park_after_ns = e.plant.watchdog.park_after;
  m.park_time_ns = e.plant.watchdog.park_time;
  return m;
}

template <>
std::optional<experiment_t> decode<experiment_t>(const void* data, std::int64_t size) {
  constexpr std::int64_t kFixed = 8 + 48 + 4;  // [B] fingerprint, header_t, schema
  constexpr int kStrings = 4;                  // name, hash, version, resolved
  const auto* bytes = static_cast<const std::uint8_t*>(data);
  if (size < kFixed || size > INT32_MAX) return {};
  std::int64_t at = kFixed;
  for (int i = 0; i < kStrings; ++i) {
    if (size - at < 4) return {};
    const std::int64_t length = static_cast<std::int32_t>(
        static_cast<std::uint32_t>(bytes[at]) << 24 |
        static_cast<std::uint32_t>(bytes[at + 1]) << 16 |
        static_cast<std::uint32_t>(bytes[at + 2]) << 8 | static_cast<std::uint32_t>(bytes[at + 3]));
    at += 4;
    if (length < 1 || length > size - at || bytes[at + length - 1] != 0) return {};
    at += length;
  }
  experiment_t message;
  if (at != size || message.decode(data, 0, static_cast<int>(size)) != size) return {};
  if (message.schema != kSchema) return {};
  return message;
}

std::string names(Tripped tripped) {
  std::string out;
  tripped.forEach([&](Check check) {
    if (!out.empty()) out += ", ";
    out += name(check);
  });
  return out;
}

std::optional<Sample> fromMessage(const sample_t& m) noexcept {
  Sample s;
  s.sequence = m.header.sequence;
  s.time = m.header.time_ns;
  std::copy(std::begin(m.adc), std::end(m.adc), s.adc.begin());
  std::copy(std::begin(m.legs), std::end(m.legs), s.legs.begin());
  s.q = JointVector::Map(m.q);
  s.switches = static_cast<std::uint32_t>(m.switches) & kAllSwitchesClosed;
  s.temperature = m.temperature;
  const auto stamp = [&](std::int64_t t) { return t == 0 ? s.time : t; };
  s.legs_time = stamp(m.legs_time_ns);
  s.wrench_time = stamp(m.wrench_time_ns);
  s.joints_time = stamp(m.joints_time_ns);
  s.faults = static_cast<std::uint32_t>(m.faults);
  if (m.command_source != 0) {
    s.command_source = m.command_source;
    s.command_tick = m.command_sequence;
    s.command_time = m.command_time_ns;
  }
  if (!plausible(s)) return {};
  return s;
}

std::optional<LegCommand> fromMessage(const leg_command_t& m) noexcept {
  LegCommand c;
  c.engaged = m.engaged != 0;
  c.segment = m.segment;
  c.park = m.park != 0;
  bool good = inRange<std::int64_t>(m.header.sequence, -1, kMaxSequence) &&
              inRange(m.segment, -1, kMaxSegments) && inRange<int>(m.engaged, 0, 1) &&
              inRange<int>(m.park, 0, 1) && inRange<std::int64_t>(m.ahead_ns, 0, kMostAhead);
  c.ahead = m.ahead_ns;
  for (std::size_t i = 0; i < c.counts.size(); ++i) {
    c.counts[i] = m.counts[i];
    c.rest[i] = m.rest[i];
    for (const std::int32_t count : {m.counts[i], m.rest[i]})
      good = good && inRange(count, 0, plant::Temposonics::kMaxCount);
  }
  if (!good) return {};
  return c;
}

namespace {

std::optional<RobotOrder> toolOrder(const robot_command_t& m) noexcept {
  if (!inRange(m.duration, 0.0, kMaxPathTime) || !inRange(m.speed, 0.0, kMaxToolSpeed) ||
      (m.duration > 0.0) == (m.speed > 0.0) || !inRange(m.frame, 0, 2) ||
      !inRange(m.parts, 1, kPositionPart | kRpyPart | kViaPart) || m.parts == kViaPart)
    return {};
  if (m.duration > 0.0 ? m.duration < 1e-2 : m.speed < 1e-5) return {};
  ToolOrder order;
  order.by = m.kind == kToolByOrder;
  order.in = static_cast<ToolOrder::Frame>(m.frame);
  order.duration = m.duration;
  order.speed = m.speed;
  const auto part = [&](int bit, const double(&from)[3], double most, std::optional<Vec3>& to) {
    if (!(m.parts & bit)) return true;
    to = Vec3::Map(from);
    return inRange(from[0], -most, most) && inRange(from[1], -most, most) &&
           inRange(from[2], -most, most);
  };
  if (!part(kPositionPart, m.position, kMaxReach, order.position) ||
      !part(kRpyPart, m.rpy, kMaxRotation, order.rpy) ||
      !part(kViaPart, m.via, kMaxReach, order.via))
    return {};
  return order;
}

std::optional<RobotOrder> handOrder(const robot_command_t& m) noexcept {
  RigidBody body;
  body.mass = m.mass;
  body.p_BoBcm_B = Vec3::Map(m.com);
  body.I_Bcm_B = inertiaOf(Vec6::Map(m.inertia));
  bool good = inRange(m.mass, 0.0, kMaxLoad);
  for (const double x : m.com) good = good && inRange(x, -kMaxReach, kMaxReach);
  for (const double x : m.inertia) good = good && inRange(x, -kMaxLoadInertia, kMaxLoadInertia);
  if (!good) return {};
  if (!(symmetricEigenvalues(body.I_Bcm_B)(0) >= -1e-9 * body.I_Bcm_B.norm())) return {};
  return HandOrder{body};
}

}  // namespace

std::optional<RobotOrder> fromMessage(const robot_command_t& m) noexcept {
  switch (m.kind) {
    case kJointOrder:
      if (!inRange(m.joint, 0, kMaxJoints - 1) ||
          !inRange(m.target, -kMaxJointValue, kMaxJointValue) || !inRange(m.duration, 1e-3, 1e6))
        return {};
      return RobotMove{m.joint, m.target, m.duration};
    case kToolToOrder:
    case kToolByOrder: return toolOrder(m);
    case kGraspOrder: return handOrder(m);
    case kReleaseOrder: return Release{};
    default: return {};
  }
}

std::optional<Order> fromMessage(const operator_t& m) noexcept {
  if (!inRange(m.request, 1, static_cast<int>(Request::kUncompensate))) return {};
  Order order;
  order.request = static_cast<Request>(m.request);
  order.id = {m.header.source, m.header.sequence};
  if (m.header.sequence < 0) return {};
  if (order.request != Request::kRun) return order;

  Segment& s = order.segment;
  if (!inRange(m.kind, 0, static_cast<int>(SegmentKind::kMonitor))) return {};
  s.kind = static_cast<SegmentKind>(m.kind);
  s.duration = m.duration;
  s.interval = m.interval;
  s.target = Pose::from(Vec6::Map(m.target));
  bool good = inRange(m.duration, 0.0, kMaxTime) && inRange(m.interval, 0.0, kMaxTime);
  for (int i = 0; i < 6; ++i) {
    const double reach = i < 3 ? kMaxTranslation : kMaxRotation;
    Axis& axis = s.trajectory[static_cast<std::size_t>(i)];
    good = good && inRange(m.motion[i], 0, static_cast<int>(AxisMotion::kSine)) &&
           inRange(m.target[i], -reach, reach) && inRange(m.final[i], -reach, reach) &&
           inRange(m.amplitude[i], -reach, reach) && inRange(m.frequency[i], 0.0, kMaxFrequency);
    axis = {static_cast<AxisMotion>(m.motion[i]), m.final[i], m.amplitude[i], m.frequency[i]};
  }
  if (s.kind == SegmentKind::kTrajectory || s.kind == SegmentKind::kAdmittance)
    good = good && m.duration > 0.0;
  if (!good) return {};
  return order;
}

bool wellFormed(const std::string& channel, const void* data, std::int64_t size) {
  if (channel == channel::kSample) return decode<sample_t>(data, size).has_value();
  if (channel == channel::kLegCommand) return decode<leg_command_t>(data, size).has_value();
  if (channel == channel::kState) return decode<state_t>(data, size).has_value();
  if (channel == channel::kTruth) return decode<truth_t>(data, size).has_value();
  if (channel == channel::kTiming) return decode<timing_t>(data, size).has_value();
  if (channel == channel::kRobot) return decode<robot_command_t>(data, size).has_value();
  if (channel == channel::kSetup) return decode<setup_t>(data, size).has_value();
  if (channel == channel::kQuery) return decode<query_t>(data, size).has_value();
  if (channel == channel::kOperator) return decode<operator_t>(data, size).has_value();
  return false;
}

}  // namespace ves
