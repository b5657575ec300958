// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/replay.hpp"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <memory>

#include "ves/bus/bus.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/fields.hpp"
#include "ves/bus/ordered_log.hpp"
#include "ves/core/build.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

template <typename Message>
std::vector<std::uint8_t> encoded(const Message& m) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(m.getEncodedSize()));
  m.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

/// "0.25": the value whose encoding holds the byte at `offset`.
template <typename Message>
std::string valueAt(const Message& m, std::size_t offset) {
  std::size_t end = kFingerprintSize + kHeaderSize;
  std::string found;
  forEachField(m, [&](const char*, const auto& value) {
    const auto one = [&](const auto& v) {
      const std::size_t begin = end;
      end += sizeof v;
      if (offset >= begin && offset < end) found = fmt::format("{}", +v);
    };
    if constexpr (std::is_array_v<std::remove_cvref_t<decltype(value)>>)
      for (const auto& v : value) one(v);
    else
      one(value);
  });
  return found;
}

/// Name and both values of the first field that is not the same, bit for bit. What a tick was given
/// (request, conflicting_node) stands in its state too, and comes from the record itself.
template <typename Message>
std::optional<Difference> compare(const Message& recorded, const Message& replayed) {
  const std::vector<std::uint8_t> a = encoded(recorded), b = encoded(replayed);
  const auto at = std::mismatch(a.begin(), a.end(), b.begin()).first;
  if (at == a.end()) return {};
  const auto offset = static_cast<std::size_t>(at - a.begin());
  return Difference{recorded.header.sequence, 0, fieldAt<Message>(offset),
                    valueAt(recorded, offset), valueAt(replayed, offset)};
}

class Replayer {
 public:
  Replayer(const std::string& log, const ReplayOptions& options, const ReplayWatch& watch)
      : log_(log), options_(options), watch_(watch) {}

  ReplayResult run() {
    OrderedLog reader(log_);
    if (options_.with) use(*options_.with);
    while (reader.next(event_)) {
      if (event_.channel == channel::kExperiment)
        configure();
      else if (event_.channel == channel::kSample)
        keepSample();
      else if (event_.channel == channel::kOperator)
        keepOrder();
      else if (event_.channel == channel::kState)
        replayTick();
      else if (event_.channel == channel::kLegCommand)
        compareCommand();
    }
    if (!platform_)
      throw InputError(
          fmt::format("{}: no configuration in this log (channel {}); --with names one", log_,
                      channel::kExperiment));
    if (result_.ticks == 0)
      throw InputError(fmt::format("{}: no tick of a controller in this log (channel {})", log_,
                                   channel::kState));
    return result_;
  }

 private:
  template <typename Message>
  Message decoded() const {
    return event_.require<Message>(log_);
  }
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}: byte {}: {}", log_, event_.offset, what));
  }

  void configure() {
    if (configured_) return;  // published again
    configured_ = true;
    const auto m = decoded<experiment_t>();
    result_.name = m.name;
    result_.hash = m.hash;
    result_.version = m.version;
    result_.same_arithmetic = arithmeticOf(m.version) == build().arithmetic;
    const Experiment recorded = parseExperiment(m.resolved, log_ + ":configuration");
    if (!platform_) use(recorded);
  }

  void use(const Experiment& experiment) {
    result_.stability = experiment.controller.stability;
    period_ = experiment.controller.period;
    platform_ = std::make_unique<TestPlatform>(experiment.controller);
  }

  void keepSample() {
    const auto m = decoded<sample_t>();
    const auto sample = fromMessage(m);
    const bool alive = m.command_source == controller_ || m.header.signature[0] == 0;
    const auto verdict = machine_.judge(m.header, alive, engaged_);
    const bool first = machine_.source() == 0;  // in lockstep they have no epoch
    if (!sample || (verdict == MachineHeard::Verdict::kAnother && !first)) return;
    machine_.take(m.header);
    samples_.put(m.header.sequence, *sample);
  }

  void keepOrder() {
    const auto m = decoded<operator_t>();
    if (const auto order = fromMessage(m)) orders_.push_back(*order);
  }

  Order orderOf(const state_t& recorded) const {
    Order order;
    order.request = static_cast<Request>(recorded.request);
    order.id = {recorded.request_source, recorded.request_sequence};
    order.verdict = {static_cast<Stability>(recorded.request_stability),
                     static_cast<Stability>(recorded.request_stability_uncompensated)};
    if (!hasNumbers(order.request)) return order;
    for (const Order& known : orders_) {
      if (known.id.source != order.id.source || known.id.sequence != order.id.sequence) continue;
      order.segment = known.segment;
      order.vehicle = known.vehicle;
      order.thrust = known.thrust;
      order.controller = known.controller;
      return order;
    }
    fail(fmt::format("tick {} followed order {}, which is not in this log",
                     recorded.header.sequence, order.id.sequence));
  }

  void replayTick() {
    if (!platform_) fail("a tick before any configuration; --with names one");
    const auto recorded = decoded<state_t>();
    if (result_.ticks == 0) controller_ = recorded.header.source;
    if (recorded.header.source != controller_) return;  // another one on the bus
    if (recorded.count != result_.ticks)
      fail(
          result_.ticks == 0
              ? fmt::format(
                    "the log begins {} ticks after its controller; a replay needs the first",
                    recorded.count)
          : recorded.count < result_.ticks
              ? std::string(
                    "another controller's run begins here (two logs put together?); a replay is of "
                    "one")
              : fmt::format("{} ticks before tick {} are missing", recorded.count - result_.ticks,
                            recorded.header.sequence));
    TickInput in;
    in.tick = recorded.header.sequence;
    constexpr std::int64_t kMaxTime = INT64_MAX / 8;  // [ns]
    in.time = recorded.machine_time_ns;
    if (in.time < 0 || in.time > kMaxTime)
      fail(fmt::format("tick {} has a machine_time_ns of {}, want 0 to {}", in.tick, in.time,
                       kMaxTime));
    in.order = orderOf(recorded);
    in.conflicting_node = recorded.conflicting_node != 0;
    if (recorded.sample_sequence >= 0) {
      const Sample* sample = samples_.find(recorded.sample_sequence);
      if (!sample)
        fail(fmt::format("tick {} used sample {}, which is not in this log", in.tick,
                         recorded.sample_sequence));
      in.sample = *sample;
    }
    pace();
    engaged_ = recorded.engaged != 0;
    const TickState& state = platform_->tick(in);
    ++result_.ticks;
    note(recorded, toMessage(state, recorded.header));
    replayed_commands_.put(in.tick, toMessage(state.command, recorded.header));
    if (const auto* command = recorded_commands_.find(in.tick))
      noteCommand(*command, *replayed_commands_.find(in.tick));
    result_.pose_difference =
        result_.pose_difference.cwiseMax((state.motion.x - Vec6::Map(recorded.x)).cwiseAbs());
    result_.phase = state.phase;
    result_.cause = state.cause;
    result_.cause_tick = state.cause_tick;
    if (watch_) watch_(state);
  }

  void compareCommand() {
    const auto recorded = decoded<leg_command_t>();
    if (result_.ticks > 0 && recorded.header.source != controller_) return;
    if (const auto* replayed = replayed_commands_.find(recorded.header.sequence))
      noteCommand(recorded, *replayed);
    else
      recorded_commands_.put(recorded.header.sequence, recorded);
  }

  /// Which machine a command is for, and its signature, are no part of the tick.
  void noteCommand(const leg_command_t& recorded, leg_command_t replayed) {
    replayed.header = recorded.header;
    replayed.machine = recorded.machine;
    note(recorded, replayed);
  }

  template <typename Message>
  void note(const Message& recorded, const Message& replayed) {
    ++result_.messages;
    auto difference = compare(recorded, replayed);
    if (!difference) return;
    ++result_.different;
    if (result_.first) return;
    difference->offset = event_.offset;
    result_.first = std::move(difference);
  }

  void pace() {
    if (!(options_.speed > 0.0)) return;
    const std::int64_t now = monotonicNow();
    if (result_.ticks == 0) start_ = now;
    const auto due = start_ + static_cast<std::int64_t>(
                                  static_cast<double>(result_.ticks * period_) / options_.speed);
    const timespec until{due / 1'000'000'000, due % 1'000'000'000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
  }

  const std::string& log_;
  const ReplayOptions& options_;
  const ReplayWatch& watch_;
  LogEvent event_;
  std::unique_ptr<TestPlatform> platform_;
  bool configured_ = false;      // by the log
  std::int64_t controller_ = 0;  // source of the states
  std::int64_t period_ = 0;      // [ns]
  std::int64_t start_ = 0;       // [ns]
  MachineHeard machine_;
  bool engaged_ = false;  // by the last tick
  Recent<Sample> samples_;
  std::vector<Order> orders_;
  Recent<leg_command_t> recorded_commands_, replayed_commands_;
  ReplayResult result_;
};

}  // namespace

ReplayResult replay(const std::string& log, const ReplayOptions& options,
                    const ReplayWatch& watch) {
  return Replayer(log, options, watch).run();
}

}  // namespace ves
