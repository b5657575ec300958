// SPDX-License-Identifier: BSD-3-Clause
//
// Between messages and the structs of the control path. What comes from the wire passes a gate:
// every value finite and in range, or the message is nobody's.
#pragma once

#include <optional>
#include <string>
#include <ves/experiment_t.hpp>
#include <ves/leg_command_t.hpp>
#include <ves/operator_t.hpp>
#include <ves/pace_t.hpp>
#include <ves/query_t.hpp>
#include <ves/robot_command_t.hpp>
#include <ves/sample_t.hpp>
#include <ves/setup_t.hpp>
#include <ves/state_t.hpp>
#include <ves/timing_t.hpp>
#include <ves/truth_t.hpp>

#include "ves/contract/robot_order.hpp"
#include "ves/contract/setup.hpp"
#include "ves/contract/tick_state.hpp"

namespace ves {

/// Of all messages and of the columns of series.csv; readers refuse others.
inline constexpr std::int32_t kSchema = 14;

/// Who sends, and since when.
struct Identity {
  std::int64_t source = 0;
  std::int64_t epoch = 0;

  /// A fresh one for this process.
  static Identity draw();
};

header_t header(const Identity& from, std::int64_t sequence, std::int64_t time) noexcept;

// What contract/schema.hpp describes goes field by field.
sample_t toMessage(const Sample& sample, const Identity& from) noexcept;
leg_command_t toMessage(const LegCommand& command, const header_t& header) noexcept;
setup_t toMessage(const MachineSetup& setup, const header_t& header) noexcept;
state_t toMessage(const TickState& state, const header_t& header) noexcept;
operator_t toMessage(const Order& order, const header_t& header) noexcept;
robot_command_t toMessage(const RobotOrder& order, const header_t& header) noexcept;

/// "panic button, floor mat"; empty when none tripped.
std::string names(Tripped tripped, std::string_view between = ", ");

/// Nothing where a value is out of range or not a number (contract/plausible.hpp).
std::optional<Sample> fromMessage(const sample_t& message) noexcept;
std::optional<LegCommand> fromMessage(const leg_command_t& message) noexcept;
std::optional<MachineSetup> fromMessage(const setup_t& message) noexcept;
std::optional<RobotOrder> fromMessage(const robot_command_t& message) noexcept;
std::optional<Order> fromMessage(const operator_t& message) noexcept;
/// Nothing where an enumeration has no such number; other values are as they were reported.
std::optional<TickState> fromMessage(const state_t& message) noexcept;

/// Decodes bytes of one message; nothing when they are not exactly that.
template <typename Message>
std::optional<Message> decode(const void* data, std::int64_t size) {
  Message message;
  if (size < 0 || size > INT32_MAX) return {};
  if (message.decode(data, 0, static_cast<int>(size)) != size) return {};
  return message;
}

/// The one message with strings: lcm-gen's own decoder trusts their lengths.
template <>
std::optional<experiment_t> decode<experiment_t>(const void* data, std::int64_t size);

/// Bytes that are exactly a message of this channel's type. Of another channel nothing is known:
/// false.
bool wellFormed(const std::string& channel, const void* data, std::int64_t size);

}  // namespace ves
