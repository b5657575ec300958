// SPDX-License-Identifier: BSD-3-Clause
#include "ves/replay/replay.hpp"

#include <fmt/format.h>
#include <time.h>

#include <cstring>
#include <memory>

#include "ves/realtime/realtime.hpp"
#include "ves/transport/channels.hpp"

namespace ves {
namespace {

/// Calls f(name, index or -1, value) for every number of a message but its header.
template <typename F>
void forEachField(const state_t& m, F f) {
  const auto list = [&](const char* name, const auto& values) {
    int i = 0;
    for (const auto& value : values) f(name, i++, value);
  };
  f("count", -1, m.count);
  f("sample_sequence", -1, m.sample_sequence);
  f("request", -1, m.request);
  f("order_source", -1, m.order_source);
  f("order_sequence", -1, m.order_sequence);
  f("refusal", -1, m.refusal);
  f("refused_by", -1, m.refused_by);
  f("rival", -1, m.rival);
  f("ran_long", -1, m.ran_long);
  f("phase", -1, m.phase);
  f("segment", -1, m.segment);
  f("kind", -1, m.kind);
  f("idle", -1, m.idle);
  f("age", -1, m.age);
  list("total", m.total);
  list("fixed", m.fixed);
  list("inertial", m.inertial);
  list("dynamic", m.dynamic);
  list("x", m.x);
  list("x_dot", m.x_dot);
  list("x_ddot", m.x_ddot);
  list("x_due", m.x_due);
  list("leg", m.leg);
  list("leg_dot", m.leg_dot);
  list("leg_ddot", m.leg_ddot);
  f("compensated", -1, m.compensated);
  list("reference", m.reference);
  list("leg_measured", m.leg_measured);
  list("x_measured", m.x_measured);
  list("bias", m.bias);
  f("calibration", -1, m.calibration);
  f("unrest", -1, m.unrest);
  f("unrest_index", -1, m.unrest_index);
  f("unrest_amount", -1, m.unrest_amount);
  list("deviation", m.deviation);
  list("standard_error", m.standard_error);
  f("tripped", -1, m.tripped);
  f("latched", -1, m.latched);
  f("cause", -1, m.cause);
  f("cause_tick", -1, m.cause_tick);
  f("cut_short", -1, m.cut_short);
  f("slowed", -1, m.slowed);
  f("late_ticks", -1, m.late_ticks);
  f("engaged", -1, m.engaged);
  f("park", -1, m.park);
  list("counts", m.counts);
}

template <typename F>
void forEachField(const leg_command_t& m, F f) {
  f("engaged", -1, m.engaged);
  f("segment", -1, m.segment);
  f("park", -1, m.park);
  int i = 0;
  for (const std::int32_t value : m.counts) f("counts", i++, value);
}

/// Name and both values of the first field that is not the same, bit for bit.
template <typename Message>
std::optional<Difference> compare(const Message& recorded, const Message& replayed) {
  const auto raw = [](const auto& value) {
    return std::string(reinterpret_cast<const char*>(&value), sizeof value);
  };
  std::optional<Difference> first;
  std::vector<std::string> mine;
  forEachField(replayed, [&](const char*, int, const auto& value) { mine.push_back(raw(value)); });
  std::size_t k = 0;
  forEachField(recorded, [&](const char* name, int i, const auto& value) {
    const std::string& other = mine[k++];
    if (first || raw(value) == other) return;
    auto got = value;
    std::memcpy(&got, other.data(), sizeof got);
    first = Difference{
        recorded.header.sequence, 0,
        fmt::format("{}.{}{}", Message::getTypeName(), name, i < 0 ? "" : fmt::format("[{}]", i)),
        fmt::format("{}", +value), fmt::format("{}", +got)};
  });
  return first;
}

class Replayer {
 public:
  Replayer(const std::string& log, const ReplayOptions& options, const ReplayWatch& watch)
      : log_(log), options_(options), watch_(watch) {}

  ReplayResult run() {
    LogReader reader(log_);
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
          fmt::format("{}: no configuration in this log (channel {})", log_, channel::kExperiment));
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
    if (platform_) return;  // published again
    const auto m = decoded<experiment_t>();
    result_.name = m.name;
    result_.hash = m.hash;
    result_.version = m.version;
    const Experiment recorded = parseExperiment(m.resolved, log_ + ":configuration");
    const Experiment& used = options_.with ? *options_.with : recorded;
    result_.stability = used.controller.stability;
    period_ = used.controller.period;
    platform_ = std::make_unique<TestPlatform>(used.controller);
  }

  void keepSample() {
    const auto m = decoded<sample_t>();
    if (const auto sample = fromMessage(m)) samples_.put(m.header.sequence, *sample);
  }

  void keepOrder() {
    const auto m = decoded<operator_t>();
    if (const auto order = fromMessage(m)) orders_.push_back(*order);
  }

  Order orderOf(const state_t& recorded) const {
    Order order;
    order.request = static_cast<Request>(recorded.request);
    order.id = {recorded.order_source, recorded.order_sequence};
    if (order.request != Request::kRun) return order;
    for (const Order& known : orders_)
      if (known.id.source == order.id.source && known.id.sequence == order.id.sequence)
        return known;
    fail(fmt::format("tick {} followed order {}, which is not in this log",
                     recorded.header.sequence, order.id.sequence));
  }

  void replayTick() {
    if (!platform_) fail("a tick before any configuration");
    const auto recorded = decoded<state_t>();
    if (result_.ticks == 0) controller_ = recorded.header.source;
    if (recorded.header.source != controller_) return;  // another one on the bus
    if (recorded.count != result_.ticks)
      fail(result_.ticks == 0
               ? fmt::format(
                     "the log begins {} ticks after its controller; a replay needs the first",
                     recorded.count)
               : fmt::format("{} ticks before tick {} are missing", recorded.count - result_.ticks,
                             recorded.header.sequence));
    TickInput in;
    in.tick = recorded.header.sequence;
    in.order = orderOf(recorded);
    in.rival = recorded.rival != 0;
    in.ran_long = recorded.ran_long != 0;
    if (recorded.sample_sequence >= 0) {
      const Sample* sample = samples_.find(recorded.sample_sequence);
      if (!sample)
        fail(fmt::format("tick {} used sample {}, which is not in this log", in.tick,
                         recorded.sample_sequence));
      in.sample = *sample;
    }
    pace();
    const TickState& state = platform_->tick(in);
    ++result_.ticks;
    note(recorded, toMessage(state, in, recorded.header));
    replayed_commands_.put(in.tick, toMessage(state.command, recorded.header));
    if (const auto* command = recorded_commands_.find(in.tick))
      note(*command, *replayed_commands_.find(in.tick));
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
      note(recorded, *replayed);
    else
      recorded_commands_.put(recorded.header.sequence, recorded);
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
  std::int64_t controller_ = 0;  // source of the states
  std::int64_t period_ = 0;      // [ns]
  std::int64_t start_ = 0;       // [ns]
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
