// SPDX-License-Identifier: BSD-3-Clause
#include "ves/bus/ordered_log.hpp"

#include <string_view>

#include "ves/bus/channels.hpp"

namespace ves {
namespace {

constexpr std::size_t kRemembered = 4096;  // [-] events that one may repeat
constexpr std::size_t kPatience = 64;      // [-] ticks that wait for an earlier one

}  // namespace

bool OrderedLog::next(LogEvent& event) {
  for (;;) {
    if (!waiting_.empty() && (over_ || ready() || waiting_.size() > kPatience)) {
      const auto first = waiting_.begin();
      last_ = first->first;
      event = std::move(first->second.event);
      waiting_.erase(first);
      return true;
    }
    if (over_) return false;
    if (!reader_.next(event)) {
      over_ = true;
      continue;
    }
    if (isRepeat(event)) {
      ++repeated_;
      continue;
    }
    if (event.channel == channel::kSample) {
      if (const auto sample = event.as<sample_t>()) samples_.insert(sample->header.sequence);
    } else if (event.channel == channel::kTruth) {
      if (const auto truth = event.as<truth_t>()) truths_.insert(truth->header.sequence);
    } else if (event.channel == channel::kState && hold(event)) {
      continue;
    }
    return true;
  }
}

bool OrderedLog::isRepeat(const LogEvent& event) {
  const std::string_view bytes(reinterpret_cast<const char*>(event.data.data()), event.data.size());
  const std::size_t hash =
      std::hash<std::string_view>()(bytes) ^ (std::hash<std::string>()(event.channel) << 1);
  if (!known_.insert(hash).second) return true;
  order_.push_back(hash);
  if (order_.size() > kRemembered) {
    known_.erase(order_.front());
    order_.pop_front();
  }
  return false;
}

bool OrderedLog::hold(const LogEvent& event) {
  const auto state = event.as<state_t>();
  if (!state) return false;
  const Identity from{state->header.source, state->header.epoch};
  if (!controller_) controller_ = from;
  const bool ours = from.source == controller_->source && from.epoch == controller_->epoch;
  if (!ours || state->count <= last_) return false;
  return waiting_.try_emplace(state->count, Waiting{event, state->sample_sequence}).second;
}

bool OrderedLog::ready() const {
  const auto& [count, first] = *waiting_.begin();
  return count == last_ + 1 &&
         (first.sample < 0 ||
          (samples_.count(first.sample) && (truths_.empty() || truths_.count(first.sample))));
}

}  // namespace ves
