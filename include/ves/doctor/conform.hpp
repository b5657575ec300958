// SPDX-License-Identifier: BSD-3-Clause
//
// Whether a machine on the bus says what docs/machine.md asks of it.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "ves/bus/messages.hpp"
#include "ves/contract/tick_state.hpp"

namespace ves {

struct Requirement {
  std::string name, asked, found;
  bool kept = true;
};

/// Judges the samples of a machine in real time that nobody commands.
class SampleJudge {
 public:
  /// `now` [ns] by the clock of take().
  SampleJudge(const setup_t& setup, std::int64_t now);

  /// The bytes of a message on VES_SAMPLE, when they come.
  void take(const void* data, std::int64_t size, std::int64_t now);

  std::int64_t taken() const { return taken_; }  // [-] samples of the machine that was heard first
  /// Of what has come until `now`.
  std::vector<Requirement> verdict(std::int64_t now) const;

 private:
  struct Span {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    void add(double x);
    double width() const { return high - low; }
  };
  void judge(const sample_t& sample, std::int64_t now);

  setup_t setup_;
  std::int64_t start_;  // [ns]
  std::optional<header_t> first_, last_;
  std::int64_t taken_ = 0, malformed_ = 0, others_ = 0, backwards_ = 0, lost_ = 0, answering_ = 0,
               naming_ = 0;                         // [-]
  std::int64_t oldest_ = 0;                         // [ns] a piece
  std::int32_t faults_ = 0;                         // of all samples
  std::int64_t first_heard_ = 0, heard_ = 0;        // [ns]
  std::int64_t longest_gap_ = 0, stood_still_ = 0;  // [ns], [-]
  std::int64_t tick_ = -1;                          // the last with a sample
  std::int64_t fresh_ = 0, most_fresh_ = 0;         // [-] ticks in a row with one
  std::string out_of_range_;                        // the first
  std::uint32_t switches_ = kAllSwitchesClosed;     // closed in every sample
  Span pressure_;
  std::array<Span, 6> channels_, legs_;  // [count]
  std::string joints_;                   // the first that is wrong
};

/// Judges whether each leg goes the way that it is told, while the platform is moved about. Where
/// it rests only: on the way a machine that answers late is nearer to a leg that goes less far.
class LegJudge {
 public:
  explicit LegJudge(std::int64_t period) : period_(period) {}  // [ns] of a tick
  void take(const TickState& state);
  Requirement verdict() const;

 private:
  std::int64_t period_;
  Mat6 apart_ = Mat6::Zero();   // [m^2] row: a leg as measured; column: a leg as told
  Vec6 told_ = Vec6::Zero();    // [m]
  std::int64_t sequence_ = -1;  // of the last sample
  std::int64_t settled_ = 0;    // [-] ticks with a new sample since the legs' order changed
  bool seen_ = false;           // at rest away from home
};

}  // namespace ves
