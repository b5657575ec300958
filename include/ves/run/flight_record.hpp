// SPDX-License-Identifier: BSD-3-Clause
//
// The last seconds before a stop, kept without heap and written afterwards.
#pragma once

#include <filesystem>
#include <thread>
#include <vector>

#include "ves/run/run.hpp"

namespace ves {

/// The last seconds of a controller, written when a check has stopped it: an event log that begins
/// with the configuration, as every log. Keeping them costs no heap; a thread writes them.
class FlightRecord {
 public:
  static constexpr double kKept = 5.0;  // [s]

  /// `folder` is where records go; empty: none are written.
  FlightRecord(const Experiment& experiment, std::filesystem::path folder);
  /// Writes what a stop has left unwritten.
  ~FlightRecord();
  FlightRecord(const FlightRecord&) = delete;
  FlightRecord& operator=(const FlightRecord&) = delete;

  /// Keeps a tick. Writes the record once the platform has stood for a moment after a trip.
  void keep(const state_t& state, const sample_t& sample);

 private:
  struct Tick {
    state_t state;
    sample_t sample;
  };
  void begin(std::int64_t tick);
  void write(std::int64_t tick) const;

  const Experiment& experiment_;
  std::filesystem::path folder_;
  std::vector<Tick> ticks_;  // a ring
  std::size_t next_ = 0;
  std::vector<Tick> written_ticks_;  // the writer's, oldest first from written_next_
  std::size_t written_next_ = 0;
  std::thread writer_;
  std::int64_t written_ = -1;  // [-] cause_tick of the last record
  std::int64_t stopped_ = -1;  // [-] cause_tick of the stop that lasts
};

}  // namespace ves
