// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include "process_conduct.hpp"
#include "ves/bus/channels.hpp"
#include "ves/core/build.hpp"
#include "ves/realtime/latency.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/run/announcer.hpp"
#include "ves/run/flight_record.hpp"
#include "ves/run/run.hpp"
#include "ves/run/run_monitor.hpp"
#include "ves/run/vehicle_judge.hpp"

namespace ves {
namespace {

constexpr int kControllerPriority = 80;  // [-] SCHED_FIFO
constexpr int kAnswerTime = 200;         // [ms] lockstep, before a message is repeated
constexpr int kAnswerTries = 50;         // [-] before the other side counts as gone
constexpr std::int64_t kFirstSampleTime = 10'000'000'000;  // [ns]
constexpr std::int64_t kHello = 100'000'000;               // [ns] between two of them
constexpr std::int64_t kWarnAfter = 2'000'000'000;         // [ns]

/// Counts the times of this tick into the histograms.
void count(timing_t& t) noexcept {
  static_assert(std::extent_v<decltype(t.late)> == kLatencyBins);
  ++t.late[latencyBin(t.late_ns)];
  ++t.compute[latencyBin(t.compute_ns)];
  ++t.sample_age[latencyBin(t.sample_age_ns)];
  ++t.sample_to_command[latencyBin(t.sample_to_command_ns)];
}

/// What was not let in, by cause; empty when all was.
std::string notLetIn(const ControllerLink& link, const Bus& bus) {
  std::string out = link.samplesRejected().text();
  if (const std::string refused = bus.refused().text(); !refused.empty())
    out += (out.empty() ? "" : "; ") + refused;
  return out;
}

/// Ages by our clock, of a sample whose times are the machine's.
void putAges(timing_t& t, const Sample& sample, std::int64_t sample_time, const ClockOffset& clock,
             std::int64_t woke, std::int64_t sent) noexcept {
  t.clock_offset_ns = clock.offset(woke);
  t.clock_uncertainty_ns = clock.uncertainty(woke);
  t.sample_age_ns = woke - (sample_time - t.clock_offset_ns);
  t.legs_age_ns = t.sample_age_ns + sample.time - sample.legs_time;
  t.wrench_age_ns = t.sample_age_ns + sample.time - sample.wrench_time;
  t.joints_age_ns = t.sample_age_ns + sample.time - sample.joints_time;
  t.sample_to_command_ns = sent - woke + t.sample_age_ns;
}

}  // namespace

RunResult runController(const Experiment& experiment, const ProcessOptions& options,
                        const Watch& watch) {
  warnOfOpenBus("controller", options.url);
  refuseKeyedLockstep(options);
  const Identity self = Identity::draw();
  Bus bus(options.url);
  ControllerLink link(bus, self);
  const auto whole = std::make_unique<TestPlatform>(experiment.controller);
  TestPlatform& platform = *whole;  // large for a stack
  FlightRecord flight(experiment, options.flight);
  RunMonitor monitor(experiment.controller, !options.start);

  std::unique_ptr<LogWriter> log;
  if (!options.log.empty()) {
    log = std::make_unique<LogWriter>(options.log);
    log->write(channel::kExperiment, describe(experiment, self, 0), 0);
    bus.subscribe({channel::kSample, channel::kTruth, channel::kOperator},
                  [&](const std::string& from, const void* data, std::uint32_t size) {
                    log->write(from, data, size, link.sampleTime());
                  });
  }
  Announcer announcer(bus, options.url, describe(experiment, self, 0),
                      setupOf(experiment, options.lockstep));

  VehicleJudge judge(experiment);
  TickInput in;
  if (options.start) in.order.request = Request::kStart;
  const std::int64_t start = monotonicNow();

  const auto finish = [&](const TickState& state) {
    announcer.tell(state.phase);
    in.order = watch(state);
    if (in.order.request == Request::kNone) in.order = link.takeOrder();
    in.order = options.lockstep ? judged(in.order, experiment, state) : judge.pass(in.order, state);
    in.conflicting_node = link.takeConflict();
    return monitor.reached(state, in.order.request);
  };

  // Before the first tick there is nothing to come home from.
  const auto wantsOut = [&] { return watch(TickState()).request == Request::kStop; };
  const auto letGo = [] {
    RunResult result;
    result.let_go = true;
    return result;
  };

  if (options.lockstep) {
    // The machine advances one period for each command and answers with one sample. A lost message
    // is repeated; the answer to a repeated one is the same sample again. A machine that is held
    // back repeats the sample before.
    LegCommand none;
    leg_command_t out = toMessage(none, header(self, -1, 0));
    std::int64_t first = 0;  // [ns] the machine's clock at tick 0
    for (;;) {
      for (int i = 0; link.answers() != in.tick - 1; ++i) {
        if (i == kAnswerTries)
          throw InputError(fmt::format("bus {}: no machine in lockstep answers", options.url));
        link.send(out);
        const std::int64_t until = monotonicNow() + kAnswerTime * 1'000'000LL,
                           heard = link.samples(), before = link.sample().sequence;
        while (link.answers() != in.tick - 1 && monotonicNow() < until) bus.waitAwake(kAnswerTime);
        if (link.samples() > heard && link.sample().sequence == before) i = 0;
        if (in.tick == 0 && wantsOut()) return letGo();
      }
      in.sample = link.sample();
      if (in.tick == 0) first = in.sample.time;
      in.time = first + in.tick * experiment.controller.period;
      const TickState& state = platform.tick(in);
      const header_t h = header(self, in.tick, in.sample.time);
      const state_t told = toMessage(state, h);
      out = toMessage(state.command, h);
      const leg_command_t logged = out;
      const bool over = finish(state);
      if (!over) {
        // As the command of the last tick that is passed over: the machine goes on to its end.
        out.header.sequence += state.idle;
        link.send(out);
      }
      bus.publish(channel::kState, told);
      flight.keep(told, toMessage(in.sample, {}));
      if (log) {
        log->write(channel::kState, told, in.sample.time);
        log->write(channel::kLegCommand, logged, in.sample.time);
      }
      if (over) break;
      in.tick += 1 + state.idle;
      bus.drain();
    }
    return monitor.result(monotonicNow() - start);
  }

  enableRealtime("controller", kControllerPriority, options.realtime);
  std::int64_t hello = 0;  // [ns] the last
  for (bool told = false; link.sample().sequence < 0;) {
    if (wantsOut()) return letGo();
    if (!told && monotonicNow() - start > kWarnAfter) {
      told = true;
      fmt::print(stderr,
                 "controller: waiting for a machine on {}: {} plant SCENARIO, or a driver\n",
                 options.url, frontDoor());
    }
    const std::string why = notLetIn(link, bus);
    if (monotonicNow() - start > kFirstSampleTime)
      throw InputError(fmt::format("bus {}: no machine to be heard{}", options.url,
                                   why.empty() ? "" : "; " + why));
    // Who is here: on a bus with a key a machine is believed when it answers.
    if (monotonicNow() - hello > kHello) {
      hello = monotonicNow();
      link.send(toMessage(LegCommand(), header(self, -1, hello)));
    }
    bus.wait(100);
  }
  Ticker ticker(experiment.controller.period);
  timing_t timing{};
  std::int64_t woke = monotonicNow();
  for (;; ++in.tick) {
    const bool ran_long = monotonicNow() - woke > experiment.controller.period;
    const std::int64_t missed = ticker.wait();
    in.tick += missed;
    woke = monotonicNow();
    bus.drain();
    in.sample = link.sample();
    const std::int64_t sample_time = link.sampleTime();
    in.conflicting_node = link.takeConflict() || in.conflicting_node;
    // Where the clocks are not known to each other, a sample counts as taken just now.
    in.time = link.clock().known() ? woke + link.clock().offset(woke) : in.sample.time;
    const std::int64_t received = monotonicNow();

    const TickState& state = platform.tick(in);
    const std::int64_t ticked = monotonicNow();

    const header_t h = header(self, in.tick, woke);
    link.send(toMessage(state.command, h));
    const std::int64_t sent = monotonicNow();
    const state_t told = toMessage(state, h);
    bus.publish(channel::kState, told);
    flight.keep(told, toMessage(in.sample, {}));
    const std::int64_t over = monotonicNow();
    timing.header = h;
    timing.late_ns = ticker.late();
    timing.receive_ns = received - woke;
    timing.tick_ns = ticked - received;
    timing.send_ns = sent - ticked;
    timing.compute_ns = sent - woke;
    timing.tell_ns = over - sent;
    putAges(timing, in.sample, sample_time, link.clock(), woke, sent);
    timing.missed = ticker.missed();
    timing.samples_malformed = link.samplesRejected().malformed;
    timing.samples_out_of_range = link.samplesRejected().out_of_range;
    timing.samples_of_another = link.samplesRejected().of_another;
    timing.samples_old = link.samplesRejected().old;
    timing.messages_forged = bus.refused().forged;
    timing.messages_replayed = bus.refused().replayed;
    (ran_long ? timing.missed_ran_long : timing.missed_woke_late) += missed;
    count(timing);
    bus.publish(channel::kTiming, timing);
    if (finish(state)) break;
  }
  RunResult result = monitor.result(monotonicNow() - start);
  result.rejected = notLetIn(link, bus);
  return result;
}

}  // namespace ves
