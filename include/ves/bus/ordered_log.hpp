// SPDX-License-Identifier: BSD-3-Clause
//
// A run's log as it was meant: each event once, and the ticks in their order. Loggers that hear on
// several interfaces, merged logs and busy networks leave events twice, or late.
#pragma once

#include <map>
#include <optional>
#include <unordered_set>

#include "ves/bus/event_log.hpp"
#include "ves/bus/messages.hpp"

namespace ves {

class OrderedLog {
 public:
  /// As LogReader.
  explicit OrderedLog(const std::string& path, Damage* damage = nullptr) : reader_(path, damage) {}

  /// The next event; nothing at the end. An event with the bytes of one shortly before is left out.
  /// A tick of the log's controller waits for the ticks before it, for the sample that it used and,
  /// where the log has truths, for that one's; what does not come within 64 ticks is passed over.
  /// All else comes as it stands.
  bool next(LogEvent& event);

  std::int64_t repeated() const { return repeated_; }  // [-] events left out

 private:
  bool isRepeat(const LogEvent& event);
  /// True: it waits.
  bool hold(const LogEvent& event);
  bool ready() const;

  LogReader reader_;
  bool over_ = false;
  std::int64_t repeated_ = 0;
  std::unordered_set<std::size_t> known_;  // hashes of the last events
  std::deque<std::size_t> order_;
  std::optional<Identity> controller_;
  std::int64_t last_ = -1;  // [-] state_t.count of the last tick that was given out
  struct Waiting {
    LogEvent event;
    std::int64_t sample;
  };
  std::map<std::int64_t, Waiting> waiting_;            // by count
  std::unordered_set<std::int64_t> samples_, truths_;  // sequences that have come
};

}  // namespace ves
