// SPDX-License-Identifier: BSD-3-Clause
//
// A run's log as it was meant: each event once, and the ticks in their order. Loggers that hear on
// several interfaces, merged logs and busy networks leave events twice, or late.
#pragma once

#include <map>
#include <optional>

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
  Recent<bool> known_;  // by the hash of their bytes
  std::optional<Identity> controller_;
  std::int64_t last_ = -1;  // [-] state_t.count of the last tick that was given out
  struct Waiting {
    LogEvent event;
    std::int64_t sample;
  };
  std::map<std::int64_t, Waiting> waiting_;  // by count
  Recent<bool> samples_, truths_;            // that have come
  bool has_truths_ = false;
};

}  // namespace ves
