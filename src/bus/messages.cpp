// SPDX-License-Identifier: BSD-3-Clause
#include "ves/bus/messages.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <random>

#include "ves/bus/channels.hpp"
#include "ves/bus/fields.hpp"
#include "ves/contract/plausible.hpp"

namespace ves {
namespace {

// robot_command_t::kind and ::parts
constexpr int kJointOrder = 0, kToolToOrder = 1, kToolByOrder = 2, kGraspOrder = 3,
              kReleaseOrder = 4, kPushOrder = 5;
constexpr int kPositionPart = 1, kRpyPart = 2, kViaPart = 4;

/// Field by field, as contract/schema.hpp has them.
template <typename Message, typename Struct>
Message messageOf(const Struct& from, const header_t& header) noexcept {
  Message m{};
  m.header = header;
  forEachPair(from, m, [](const auto& field, auto& to) { schema::put(field.value, to); });
  return m;
}

/// Nothing where a number is none of its field's.
template <typename Struct, typename Message>
std::optional<Struct> structOf(const Message& m) noexcept {
  Struct s;
  bool good = true;
  forEachPair(s, m, [&](const auto& field, const auto& from) {
    good = schema::take(from, field.value) && good;
  });
  if (!good) return {};
  return s;
}

template <typename T>
std::optional<T> ifPlausible(const T& value) noexcept {
  if (!plausible(value)) return {};
  return value;
}

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

sample_t toMessage(const Sample& sample, const Identity& from) noexcept {
  return messageOf<sample_t>(sample, header(from, sample.sequence, sample.time));
}

leg_command_t toMessage(const LegCommand& command, const header_t& header) noexcept {
  return messageOf<leg_command_t>(command, header);
}

setup_t toMessage(const MachineSetup& setup, const header_t& header) noexcept {
  return messageOf<setup_t>(setup, header);
}

state_t toMessage(const TickState& state, const header_t& header) noexcept {
  return messageOf<state_t>(state, header);
}

operator_t toMessage(const Order& order, const header_t& header) noexcept {
  return messageOf<operator_t>(order, header);
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
  } else if (const auto* push = std::get_if<PushOrder>(&order)) {
    m.kind = kPushOrder;
    m.on = static_cast<std::int32_t>(push->on);
    m.duration = push->duration;
    Vec3::Map(m.position) = push->point;
    Vec3::Map(m.force) = push->force_I;
  } else {
    m.kind = kReleaseOrder;
  }
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

std::string names(Tripped tripped, std::string_view between) {
  std::string out;
  tripped.forEach([&](Check check) {
    if (!out.empty()) out += between;
    out += name(check);
  });
  return out;
}

std::optional<Sample> fromMessage(const sample_t& m) noexcept {
  auto s = structOf<Sample>(m);
  if (!s) return {};
  s->sequence = m.header.sequence;
  s->time = m.header.time_ns;
  s->switches &= kAllSwitches;
  for (std::int64_t* t : {&s->legs_time, &s->wrench_time, &s->joints_time})
    if (*t == 0) *t = s->time;
  return ifPlausible(*s);
}

std::optional<LegCommand> fromMessage(const leg_command_t& m) noexcept {
  if (m.header.sequence < -1 || m.header.sequence > kMaxSequence) return {};
  const auto command = structOf<LegCommand>(m);
  return command ? ifPlausible(*command) : command;
}

std::optional<MachineSetup> fromMessage(const setup_t& m) noexcept {
  const auto setup = structOf<MachineSetup>(m);
  return setup ? ifPlausible(*setup) : setup;
}

std::optional<TickState> fromMessage(const state_t& m) noexcept {
  auto state = structOf<TickState>(m);
  if (state) state->tick = m.header.sequence;
  return state;
}

std::optional<RobotOrder> fromMessage(const robot_command_t& m) noexcept {
  switch (m.kind) {
    case kJointOrder: return ifPlausible<RobotOrder>(RobotMove{m.joint, m.target, m.duration});
    case kToolToOrder:
    case kToolByOrder: {
      if (m.parts < 0 || m.parts > (kPositionPart | kRpyPart | kViaPart)) return {};
      const auto part = [&](int bit, const double(&from)[3]) {
        return m.parts & bit ? std::optional<Vec3>(Vec3::Map(from)) : std::nullopt;
      };
      return ifPlausible<RobotOrder>(
          ToolOrder{m.kind == kToolByOrder, static_cast<ToolOrder::Frame>(m.frame),
                    part(kPositionPart, m.position), part(kRpyPart, m.rpy), part(kViaPart, m.via),
                    m.duration, m.speed});
    }
    case kGraspOrder: {
      RigidBody body;
      body.mass = m.mass;
      body.p_BoBcm_B = Vec3::Map(m.com);
      body.I_Bcm_B = inertiaOf(Vec6::Map(m.inertia));
      return ifPlausible<RobotOrder>(HandOrder{body});
    }
    case kReleaseOrder: return Release{};
    case kPushOrder:
      return ifPlausible<RobotOrder>(PushOrder{
          static_cast<PushOrder::On>(m.on), Vec3::Map(m.position), Vec3::Map(m.force), m.duration});
    default: return {};
  }
}

std::optional<Order> fromMessage(const operator_t& m) noexcept {
  Order order;
  if (m.request == static_cast<std::int32_t>(Request::kRun)) {
    const std::optional<Order> whole = structOf<Order>(m);
    if (!whole) return {};
    order = *whole;
  } else {  // nothing else of it counts, nor can it make a stop unheard
    order.request = static_cast<Request>(m.request);
    order.controller = m.controller;
    if (order.request == Request::kVehicle)
      order.vehicle = {{m.vehicle_mass, m.vehicle_damping, m.vehicle_stiffness}, m.vehicle_over};
    if (order.request == Request::kThrust) order.thrust = ThrustOrder::Map(m.thrust);
  }
  order.id = {m.header.source, m.header.sequence};
  return ifPlausible(order);
}

bool wellFormed(const std::string& channel, const void* data, std::int64_t size) {
  if (channel == channel::kSample) return decode<sample_t>(data, size).has_value();
  if (channel == channel::kLegCommand) return decode<leg_command_t>(data, size).has_value();
  if (channel == channel::kState) return decode<state_t>(data, size).has_value();
  if (channel == channel::kTruth) return decode<truth_t>(data, size).has_value();
  if (channel == channel::kTiming) return decode<timing_t>(data, size).has_value();
  if (channel == channel::kRobot) return decode<robot_command_t>(data, size).has_value();
  if (channel == channel::kSetup) return decode<setup_t>(data, size).has_value();
  if (channel == channel::kPace) return decode<pace_t>(data, size).has_value();
  if (channel == channel::kQuery) return decode<query_t>(data, size).has_value();
  if (channel == channel::kOperator) return decode<operator_t>(data, size).has_value();
  return false;
}

}  // namespace ves
