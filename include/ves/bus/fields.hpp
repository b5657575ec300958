// SPDX-License-Identifier: BSD-3-Clause
//
// The fields of the messages in the order of their definitions: what replay names, series.csv
// writes and comparisons point at.
#pragma once

#include <string>
#include <type_traits>
#include <utility>
#include <ves/values.hpp>

#include "ves/bus/messages.hpp"
#include "ves/contract/schema.hpp"

namespace ves {

/// The struct that a message mirrors.
template <typename Message>
struct MirrorOf;
template <>
struct MirrorOf<sample_t> : std::type_identity<Sample> {};
template <>
struct MirrorOf<leg_command_t> : std::type_identity<LegCommand> {};
template <>
struct MirrorOf<setup_t> : std::type_identity<MachineSetup> {};
template <>
struct MirrorOf<operator_t> : std::type_identity<Order> {};
template <>
struct MirrorOf<state_t> : std::type_identity<TickState> {};

/// Calls f(field, value) for every field of a struct and its value in the message.
template <typename Struct, typename Message, typename F>
void forEachPair(Struct& s, Message& m, F f) {
  schema::fields(s, [&](const auto&... field) {
    values(m, [&](auto&... value) {
      static_assert(sizeof...(field) == sizeof...(value));
      (f(field, value), ...);
    });
  });
}

/// Calls f(name, value) for every field of a message but its header; lists are arrays.
template <typename Message, typename F>
void forEachField(const Message& m, F f) {
  const typename MirrorOf<Message>::type mirror{};
  forEachPair(mirror, m, [&](const auto& field, const auto& value) { f(field.name, value); });
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
