// SPDX-License-Identifier: BSD-3-Clause
//
// Decoders of all messages, and the gate behind them.
#include <cmath>

#include "bytes.hpp"
#include "ves/bus/messages.hpp"

namespace {

using namespace ves;

void requireGood(const RobotOrder& order) {
  if (const auto* move = std::get_if<RobotMove>(&order)) fuzz::require(std::isfinite(move->target));
  if (const auto* tool = std::get_if<ToolOrder>(&order)) {
    fuzz::require((tool->duration > 0.0) != (tool->speed > 0.0));
    for (const auto* part : {&tool->position, &tool->rpy, &tool->via})
      fuzz::require(!*part || (*part)->allFinite());
  }
  if (const auto* hand = std::get_if<HandOrder>(&order))
    fuzz::require(hand->body_T.mass >= 0.0 && hand->body_T.I_Bcm_B.allFinite());
  if (const auto* push = std::get_if<PushOrder>(&order))
    fuzz::require(push->force_I.norm() <= kMostPush && push->point.allFinite() &&
                  push->duration > 0.0 && push->duration <= kLongestPush);
}

void message(const std::uint8_t* data, std::int64_t size) {
  if (const auto m = decode<sample_t>(data, size))
    if (const auto s = fromMessage(*m)) {
      fuzz::require(s->q.allFinite() && std::isfinite(s->temperature) && s->sequence >= 0);
      for (const std::int32_t count : s->legs) fuzz::require(count >= 0 && count < 1 << 14);
    }
  if (const auto m = decode<leg_command_t>(data, size))
    if (const auto c = fromMessage(*m))
      for (const std::int32_t count : c->counts) fuzz::require(count >= 0 && count < 1 << 14);
  if (const auto m = decode<operator_t>(data, size))
    if (const auto order = fromMessage(*m))
      fuzz::require(order->segment.target.stacked().allFinite() &&
                    std::isfinite(order->segment.duration));
  if (const auto m = decode<robot_command_t>(data, size))
    if (const auto order = fromMessage(*m)) requireGood(*order);
  decode<state_t>(data, size);
  decode<truth_t>(data, size);
  decode<timing_t>(data, size);
  decode<experiment_t>(data, size);
}

/// The fuzzer's bytes behind the fingerprint of a type, which it would not guess.
template <typename Message>
void behindFingerprint(const std::uint8_t* data, std::size_t size) {
  std::uint8_t bytes[2048] = {};
  const std::int64_t hash = Message::getHash();
  for (int i = 0; i < 8; ++i) bytes[i] = static_cast<std::uint8_t>(hash >> (56 - 8 * i));
  const auto want = static_cast<std::size_t>(Message().getEncodedSize());
  if (size > 0) std::memcpy(bytes + 8, data, size < want - 8 ? size : want - 8);
  message(bytes, static_cast<std::int64_t>(want));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  message(data, static_cast<std::int64_t>(size));
  behindFingerprint<sample_t>(data, size);
  behindFingerprint<leg_command_t>(data, size);
  behindFingerprint<operator_t>(data, size);
  behindFingerprint<robot_command_t>(data, size);
  // The one with strings: as long as it is.
  if (size < 1900) {
    std::uint8_t bytes[2048];
    const std::int64_t hash = experiment_t::getHash();
    for (int i = 0; i < 8; ++i) bytes[i] = static_cast<std::uint8_t>(hash >> (56 - 8 * i));
    if (size > 0) std::memcpy(bytes + 8, data, size);
    decode<experiment_t>(bytes, static_cast<std::int64_t>(size) + 8);
  }
  return 0;
}
