// SPDX-License-Identifier: BSD-3-Clause
#include "ves/bus/ordered_log.hpp"

#include <string_view>

#include "ves/bus/channels.hpp"

namespace ves {
namespace {

constexpr std::size_t kPatience = 64;  // [-] ticks that wait for an earlier one

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
      if (const auto sample = event.as<sample_t>()) samples_.put(sample->header.sequence, true);
    } else if (event.channel == channel::kTruth) {
      if (const auto truth = event.as<truth_t>()) truths_.put(truth->header.sequence, true);
      has_truths_ = true;
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
  const auto key = static_cast<std::int64_t>(hash);
  if (known_.find(key)) return true;
  known_.put(key, true);
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
  const bool used_is_here = first.sample < 0 || (samples_.find(first.sample) &&
                                                 (!has_truths_ || truths_.find(first.sample)));
  return count == last_ + 1 && used_is_here;
}

}  // namespace ves
