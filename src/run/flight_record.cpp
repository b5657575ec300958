// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/flight_record.hpp"

#include <fmt/format.h>

#include <utility>

#include "ves/bus/channels.hpp"
#include "ves/bus/event_log.hpp"

namespace ves {

FlightRecord::FlightRecord(const Experiment& experiment, std::filesystem::path folder)
    : experiment_(experiment), folder_(std::move(folder)) {
  const double period = static_cast<double>(experiment.controller.period) * kSecondPerNanosecond;
  for (std::vector<Tick>* ring : {&ticks_, &written_ticks_})
    ring->reserve(static_cast<std::size_t>(kKept / period));
}

void FlightRecord::keep(const state_t& state, const sample_t& sample) {
  if (folder_.empty()) return;
  if (ticks_.size() < ticks_.capacity())
    ticks_.push_back({state, sample});
  else
    ticks_[next_] = {state, sample};
  next_ = (next_ + 1) % ticks_.capacity();
  constexpr std::int64_t kMoment = 20;  // [-] ticks
  stopped_ = state.phase == static_cast<int>(Phase::kStopped) ? state.cause_tick : -1;
  if (stopped_ >= 0 && stopped_ != written_ && state.header.sequence - stopped_ >= kMoment) {
    begin(stopped_);
  }
}

/// What was kept goes to the writer; a stop within the next seconds has what came since.
void FlightRecord::begin(std::int64_t tick) {
  if (writer_.joinable()) writer_.join();
  written_ = tick;
  std::swap(ticks_, written_ticks_);
  written_next_ = written_ticks_.size() < written_ticks_.capacity() ? 0 : next_;
  ticks_.clear();
  next_ = 0;
  writer_ = std::thread([this, tick] { write(tick); });
}

FlightRecord::~FlightRecord() {
  if (stopped_ >= 0 && stopped_ != written_) begin(stopped_);
  if (writer_.joinable()) writer_.join();
}

void FlightRecord::write(std::int64_t tick) const {
  const std::string file = (folder_ / fmt::format("flight-{}.lcmlog", tick)).string();
  try {
    LogWriter log(file);
    log.write(channel::kExperiment, describe(experiment_, {}, 0), 0);
    std::int64_t last = -1;
    for (std::size_t i = 0; i < written_ticks_.size(); ++i) {
      const Tick& t = written_ticks_[(written_next_ + i) % written_ticks_.size()];
      // A tick whose sample is late runs on that of the tick before.
      if (std::exchange(last, t.state.sample_sequence) != t.state.sample_sequence)
        log.write(channel::kSample, t.sample, t.state.header.time_ns);
      log.write(channel::kState, t.state, t.state.header.time_ns);
    }
  } catch (const InputError& error) {
    fmt::print(stderr, "controller: {}\n",
               error.what());  // the platform stands; nothing depends on it
  }
}

}  // namespace ves
