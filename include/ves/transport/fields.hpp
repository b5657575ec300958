// SPDX-License-Identifier: BSD-3-Clause
//
// The fields of the messages in the order of their definitions: what replay names, series.csv
// writes and comparisons point at.
#pragma once

#include <string>
#include <type_traits>

#include "ves/transport/messages.hpp"

namespace ves {

// The digits that the comments of state_t.lcm and operator_t.lcm name.
static_assert(static_cast<int>(Check::kCount) == 22);
static_assert(static_cast<int>(SegmentKind::kPath) == 5 &&
              static_cast<int>(SegmentKind::kCount) == 6);
static_assert(static_cast<int>(Request::kUncompensate) == 9);
static_assert(static_cast<int>(Phase::kStopping) == 6);

/// Calls f(name, value) for every field of a message but its header; lists are arrays.
template <typename F>
void forEachField(const state_t& m, F f) {
  f("count", m.count);
  f("machine_time_ns", m.machine_time_ns);
  f("sample_sequence", m.sample_sequence);
  f("request", m.request);
  f("request_source", m.request_source);
  f("request_sequence", m.request_sequence);
  f("order_source", m.order_source);
  f("order_sequence", m.order_sequence);
  f("refusal", m.refusal);
  f("refused_by", m.refused_by);
  f("conflicting_node", m.conflicting_node);
  f("phase", m.phase);
  f("segment", m.segment);
  f("kind", m.kind);
  f("idle", m.idle);
  f("age", m.age);
  f("total", m.total);
  f("static_wrench", m.static_wrench);
  f("inertial", m.inertial);
  f("reaction", m.reaction);
  f("withholds", m.withholds);
  f("dynamic", m.dynamic);
  f("x", m.x);
  f("x_dot", m.x_dot);
  f("x_ddot", m.x_ddot);
  f("x_desired", m.x_desired);
  f("leg", m.leg);
  f("leg_dot", m.leg_dot);
  f("leg_ddot", m.leg_ddot);
  f("compensation_share", m.compensation_share);
  f("reference", m.reference);
  f("gain_extend", m.gain_extend);
  f("gain_retract", m.gain_retract);
  f("servo_delay", m.servo_delay);
  f("leg_measured", m.leg_measured);
  f("x_measured", m.x_measured);
  f("bias", m.bias);
  f("calibration", m.calibration);
  f("violation", m.violation);
  f("violation_index", m.violation_index);
  f("violation_amount", m.violation_amount);
  f("deviation", m.deviation);
  f("standard_error", m.standard_error);
  f("tripped", m.tripped);
  f("latched", m.latched);
  f("cause", m.cause);
  f("cause_tick", m.cause_tick);
  f("aborted", m.aborted);
  f("aborted_by", m.aborted_by);
  f("envelope_scale", m.envelope_scale);
  f("energy_put_in", m.energy_put_in);
  f("energy_paid", m.energy_paid);
  f("passivity_damping", m.passivity_damping);
  f("late_ticks", m.late_ticks);
  f("engaged", m.engaged);
  f("park", m.park);
  f("counts", m.counts);
  f("rest", m.rest);
  f("ahead_ns", m.ahead_ns);
}

template <typename F>
void forEachField(const leg_command_t& m, F f) {
  f("machine", m.machine);
  f("engaged", m.engaged);
  f("segment", m.segment);
  f("park", m.park);
  f("counts", m.counts);
  f("rest", m.rest);
  f("ahead_ns", m.ahead_ns);
}

inline constexpr std::size_t kFingerprintSize = 8;  // [B] of every encoded message
inline constexpr std::size_t kHeaderSize = 48;      // [B] of header_t, which leads every message

/// "state_t.x[2]": whose encoding holds the byte at `offset` of a Message.
template <typename Message>
std::string fieldAt(std::size_t offset) {
  const std::string type = Message::getTypeName();
  if (offset < kFingerprintSize) return type;
  std::size_t end = kFingerprintSize + kHeaderSize;
  if (offset < end) return type + ".header";
  std::string found = type;
  forEachField(Message{}, [&](const char* name, const auto& value) {
    using T = std::remove_cvref_t<decltype(value)>;
    const std::size_t begin = end;
    end += sizeof value;
    if (offset < begin || offset >= end) return;
    found += std::string(".") + name;
    if constexpr (std::is_array_v<T>)
      found += "[" + std::to_string((offset - begin) / sizeof(std::remove_extent_t<T>)) + "]";
  });
  return found;
}

}  // namespace ves
