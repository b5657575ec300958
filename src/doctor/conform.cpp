// SPDX-License-Identifier: BSD-3-Clause
#include "ves/doctor/conform.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace ves {
namespace {

constexpr double kMilliseconds = 1e-6;  // [ms/ns]

/// What of a sample no controller lets in.
std::string strange(const sample_t& m) {
  for (int i = 0; i < 7; ++i)
    if (m.adc[i] < -32768 || m.adc[i] > 32767) return fmt::format("adc[{}] {}", i, m.adc[i]);
  for (int i = 0; i < 6; ++i)
    if (m.legs[i] < 0 || m.legs[i] > kMaxLegCount) return fmt::format("legs[{}] {}", i, m.legs[i]);
  for (int i = 0; i < kMaxJoints; ++i)
    if (!std::isfinite(m.q[i]) || std::abs(m.q[i]) > 1e3) return fmt::format("q[{}] {}", i, m.q[i]);
  if (m.header.sequence < 0) return fmt::format("sequence {}", m.header.sequence);
  for (const auto& [name, time] : {std::pair("legs", m.legs_time_ns),
                                   {"wrench", m.wrench_time_ns},
                                   {"joints", m.joints_time_ns}})
    if (time < 0 || time > m.header.time_ns)
      return fmt::format("{}_time_ns {} at time_ns {}", name, time, m.header.time_ns);
  if (m.faults < 0 || m.faults > static_cast<int>(kAllPieces))
    return fmt::format("faults {}", m.faults);
  return fmt::format("temperature {}", m.temperature);
}

}  // namespace

void SampleJudge::Span::add(double x) {
  low = std::min(low, x);
  high = std::max(high, x);
}

SampleJudge::SampleJudge(const setup_t& setup, std::int64_t now) : setup_(setup), start_(now) {}

void SampleJudge::take(const void* data, std::int64_t size, std::int64_t now) {
  const auto sample = decode<sample_t>(data, size);
  if (!sample) {
    ++malformed_;
    return;
  }
  if (first_ &&
      (sample->header.source != first_->source || sample->header.epoch != first_->epoch)) {
    ++others_;
    return;
  }
  judge(*sample, now);
}

void SampleJudge::judge(const sample_t& m, std::int64_t now) {
  if (!first_) {
    first_ = m.header;
    first_heard_ = now;
  } else {
    longest_gap_ = std::max(longest_gap_, now - heard_);
    if (m.header.time_ns <= last_->time_ns) ++stood_still_;
    if (m.header.sequence <= last_->sequence)
      ++backwards_;
    else
      lost_ += m.header.sequence - last_->sequence - 1;
  }
  const bool newer = !last_ || m.header.sequence > last_->sequence;
  last_ = m.header;
  heard_ = now;
  ++taken_;
  if (!fromMessage(m) && out_of_range_.empty()) out_of_range_ = strange(m);
  const std::int64_t tick = (now - start_) / setup_.period_ns;
  if (newer && tick != tick_) {
    fresh_ = tick == tick_ + 1 ? fresh_ + 1 : 1;
    most_fresh_ = std::max(most_fresh_, fresh_);
    tick_ = tick;
  }
  if (m.answers != -1) ++answering_;
  if (m.command_source == setup_.header.source) ++naming_;
  faults_ |= m.faults;
  if (const auto sample = fromMessage(m)) oldest_ = std::max(oldest_, sample->oldest());
  switches_ &= static_cast<std::uint32_t>(m.switches);
  pressure_.add(m.adc[6]);
  for (std::size_t i = 0; i < 6; ++i) {
    channels_[i].add(m.adc[i]);
    legs_[i].add(m.legs[i]);
  }
  for (int i = 0; i < kMaxJoints && joints_.empty(); ++i) {
    if (i >= setup_.joints && m.q[i] != 0.0)
      joints_ = fmt::format("q[{}] {} of a joint that is not there", i, m.q[i]);
    if (i < setup_.joints && !(m.q[i] >= setup_.joint_min[i] && m.q[i] <= setup_.joint_max[i]))
      joints_ = fmt::format("q[{}] {:.4g}, limits [{:.4g}, {:.4g}]", i, m.q[i], setup_.joint_min[i],
                            setup_.joint_max[i]);
  }
}

std::vector<Requirement> SampleJudge::verdict(std::int64_t now) const {
  constexpr double kStill = 2.0;        // [count] a servo at rest stays within one
  constexpr double kClockError = 0.01;  // [-]
  std::vector<Requirement> out;
  const auto add = [&](const char* name, const std::string& asked, const std::string& found,
                       bool kept) {
    out.push_back({name, asked, found, kept});
  };
  const double period = static_cast<double>(setup_.period_ns) * kMilliseconds;
  const double listened = static_cast<double>(now - start_) * kSecondPerNanosecond;
  const double rate = taken_ > 1 ? static_cast<double>(taken_ - 1) * 1e9 /
                                       static_cast<double>(heard_ - first_heard_)
                                 : 0.0;
  add("samples", "heard", fmt::format("{} in {:.1f} s, {:.1f} Hz", taken_, listened, rate),
      taken_ > 1);
  add("schema", "every message a sample_t of this schema", fmt::format("{} malformed", malformed_),
      malformed_ == 0);
  if (taken_ < 2) return out;
  const std::int64_t gap = std::max(longest_gap_, now - heard_);
  const double longest = static_cast<double>(setup_.stale_ticks) * period;
  add("longest gap", fmt::format("below {:.0f} ms", longest),
      fmt::format("{:.1f} ms", static_cast<double>(gap) * kMilliseconds),
      static_cast<double>(gap) * kMilliseconds < longest);
  add("ticks in a row", fmt::format("more than {} with a new sample", setup_.arming_samples),
      fmt::format("{}", most_fresh_), most_fresh_ > setup_.arming_samples);
  add("source", "one machine", fmt::format("{} samples of others", others_), others_ == 0);
  add("epoch", "above 0", fmt::format("{}", first_->epoch), first_->epoch > 0);
  add("sequence", "every sample newer",
      fmt::format("{} not newer; {} lost on the way", backwards_, lost_), backwards_ == 0);
  const double pace = static_cast<double>(last_->time_ns - first_->time_ns) /
                      static_cast<double>(heard_ - first_heard_);
  add("clock", "every sample later, as fast as time goes",
      fmt::format("{} not later, {:.4f} s a second", stood_still_, pace),
      stood_still_ == 0 && std::abs(pace - 1.0) < kClockError);
  add("pieces", fmt::format("none older than {:.0f} ms", longest),
      fmt::format("{:.1f} ms", static_cast<double>(oldest_) * kMilliseconds),
      static_cast<double>(oldest_) * kMilliseconds < longest);
  add("faults", "0: every piece is well", fmt::format("{}", faults_), faults_ == 0);
  add("names commands", "command_source as in ours", fmt::format("in {} samples", naming_),
      naming_ > 0);
  add("ranges", "as lcmtypes/sample_t.lcm", out_of_range_.empty() ? "all within" : out_of_range_,
      out_of_range_.empty());
  const bool closed = (switches_ & kAllSwitchesClosed) == kAllSwitchesClosed;
  add("safety loops", "closed: switches 3", fmt::format("{}", switches_ & kAllSwitchesClosed),
      closed);
  add("pressure", fmt::format("{} to {} counts", setup_.pressure_min, setup_.pressure_max),
      fmt::format("{:.0f} to {:.0f}", pressure_.low, pressure_.high),
      pressure_.low >= setup_.pressure_min && pressure_.high <= setup_.pressure_max);
  const auto dead = std::count_if(channels_.begin(), channels_.end(),
                                  [](const Span& s) { return s.width() == 0.0; });
  add("force sensor", "not to stand to the last bit", fmt::format("{} channels stand", dead),
      dead < 6);
  double moved = 0.0;
  bool within = true;
  for (std::size_t i = 0; i < 6; ++i) {
    moved = std::max(moved, legs_[i].width());
    within = within && legs_[i].low >= setup_.leg_min[i] && legs_[i].high <= setup_.leg_max[i];
  }
  add("legs at rest", fmt::format("within {:.0f} counts without a command", kStill),
      fmt::format("{:.0f}", moved), moved <= kStill);
  std::string stroke;
  for (std::size_t i = 0; i < 6; ++i)
    stroke += fmt::format("{}{:.0f}", i ? " " : "", 0.5 * (legs_[i].low + legs_[i].high));
  add("stroke", fmt::format("{} to {} counts", setup_.leg_min[0], setup_.leg_max[0]), stroke,
      within);
  add("joints", fmt::format("{} within their limits", setup_.joints),
      joints_.empty() ? "all" : joints_, joints_.empty());
  add("answers", "-1 in real time", fmt::format("{} others", answering_), answering_ == 0);
  return out;
}

void LegJudge::take(const TickState& state) {
  constexpr std::int64_t kSettling = 500'000'000;  // [ns]
  constexpr double kAway = 0.001;                  // [m] between the longest and the shortest leg
  if (state.legs.L != told_) settled_ = 0;
  if (state.sample_sequence > sequence_) ++settled_;
  told_ = state.legs.L;
  sequence_ = state.sample_sequence;
  if (!state.command.engaged || (settled_ - 1) * period_ < kSettling ||
      told_.maxCoeff() - told_.minCoeff() < kAway)
    return;
  seen_ = true;
  for (int i = 0; i < kLegs; ++i)
    apart_.row(i) += (told_.array() - state.L_measured(i)).square().matrix().transpose();
}

Requirement LegJudge::verdict() const {
  Requirement out{"which leg", "each goes the way it is told",
                  seen_ ? "" : "never at rest away from home", false};
  for (int i = 0; seen_ && i < kLegs; ++i) {
    Eigen::Index nearest = 0;
    apart_.row(i).minCoeff(&nearest);
    if (nearest != i)
      out.found += fmt::format("{}leg {} goes as leg {} is told", out.found.empty() ? "" : ", ",
                               i + 1, nearest + 1);
  }
  if (out.found.empty()) out = {out.name, out.asked, "all do", true};
  return out;
}

}  // namespace ves
