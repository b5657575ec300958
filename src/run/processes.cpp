// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include "ves/realtime/latency.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/run/announcer.hpp"
#include "ves/run/flight_record.hpp"
#include "ves/run/robot_orders.hpp"
#include "ves/run/run.hpp"
#include "ves/run/run_monitor.hpp"
#include "ves/transport/channels.hpp"

namespace ves {
namespace {

constexpr int kControllerPriority = 80;             // [-] SCHED_FIFO
constexpr int kPlantPriority = 70;                  // [-] SCHED_FIFO
constexpr std::int64_t kPlantPeriod = 2'000'000;    // [ns] between the plant's samples, real time
constexpr int kAnswerTime = 200;                    // [ms] lockstep, before a message is repeated
constexpr std::int64_t kLongestLeap = 100'000'000;  // [-] ticks that a command may pass over
constexpr int kAnswerTries = 50;                    // [-] before the other side counts as gone
constexpr std::int64_t kFirstSampleTime = 10'000'000'000;  // [ns]
constexpr std::int64_t kWorthAWord = 2'000'000'000;        // [ns]

/// Counts the times of this tick into the histograms.
void count(timing_t& t) noexcept {
  static_assert(std::extent_v<decltype(t.late)> == kLatencyBins);
  ++t.late[latencyBin(t.late_ns)];
  ++t.compute[latencyBin(t.compute_ns)];
  ++t.sample_age[latencyBin(t.sample_age_ns)];
  ++t.sample_to_command[latencyBin(t.sample_to_command_ns)];
}

void enableRealtime(const char* who, int priority, bool required) {
  if (!claimRealtime(priority, required))
    fmt::print(stderr,
               "{}: no real-time privileges, running at best effort; ./ves doctor says why\n", who);
}

}  // namespace

RunResult runController(const Experiment& experiment, const ProcessOptions& options,
                        const Watch& watch) {
  const Identity self = Identity::draw();
  Bus bus(options.url);
  ControllerLink link(bus, self);
  TestPlatform platform(experiment.controller);
  FlightRecord flight(experiment, options.flight);
  RunMonitor monitor(experiment.controller, !options.start);

  std::unique_ptr<LogWriter> log;
  if (!options.log.empty()) {
    log = std::make_unique<LogWriter>(options.log);
    log->write(channel::kExperiment, describe(experiment, self, 0), 0);
    bus.subscribe("VES_(SAMPLE|TRUTH|OPERATOR)",
                  [&](const std::string& from, const void* data, std::uint32_t size) {
                    log->write(from, data, size, link.sampleTime());
                  });
  }
  Announcer announcer(options.url, describe(experiment, self, 0),
                      setupOf(experiment, options.lockstep, header(self, 0, 0)));

  TickInput in;
  if (options.start) in.order.request = Request::kStart;
  const std::int64_t start = monotonicNow();

  const auto finish = [&](const TickState& state) {
    announcer.tell(state.phase);
    in.order = watch(state);
    if (in.order.request == Request::kNone) in.order = link.takeOrder();
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
    // is repeated; the answer to a repeated one is the same sample again.
    LegCommand none;
    leg_command_t out = toMessage(none, header(self, -1, 0));
    for (;;) {
      for (int i = 0; link.answers() != in.tick - 1; ++i) {
        if (i == kAnswerTries)
          throw InputError(fmt::format("bus {}: no machine in lockstep answers", options.url));
        link.send(out);
        const std::int64_t until = monotonicNow() + kAnswerTime * 1'000'000LL;
        while (link.answers() != in.tick - 1 && monotonicNow() < until) bus.wait(kAnswerTime);
        if (wantsOut()) return letGo();
      }
      in.sample = link.sample();
      const TickState& state = platform.tick(in);
      const header_t h = header(self, in.tick, in.sample.time);
      const state_t told = toMessage(state, in, h);
      out = toMessage(state.command, h);
      const leg_command_t logged = out;
      const bool over = finish(state);
      if (!over) {
        // As the command of the last tick that is passed over: the machine goes on to its end.
        out.header.sequence += state.idle;
        link.send(out);
      }
      bus.publish(channel::kState, told);
      flight.keep(told, toMessage(in.sample, {}, in.tick - 1));
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
  for (bool told = false; link.sample().sequence < 0;) {
    if (wantsOut()) return letGo();
    if (!told && monotonicNow() - start > kWorthAWord) {
      told = true;
      fmt::print(stderr, "controller: waiting for a machine on {}\n", options.url);
    }
    if (monotonicNow() - start > kFirstSampleTime)
      throw InputError(fmt::format(
          "bus {}: no machine to be heard{}", options.url,
          link.samplesRejected().total() > 0 ? "; " + link.samplesRejected().text() : ""));
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
    const std::int64_t received = monotonicNow();

    const TickState& state = platform.tick(in);
    const std::int64_t ticked = monotonicNow();

    const header_t h = header(self, in.tick, woke);
    link.send(toMessage(state.command, h));
    const std::int64_t sent = monotonicNow();
    const state_t told = toMessage(state, in, h);
    bus.publish(channel::kState, told);
    flight.keep(told, toMessage(in.sample, {}, -1));
    const std::int64_t over = monotonicNow();
    timing.header = h;
    timing.late_ns = ticker.late();
    timing.receive_ns = received - woke;
    timing.tick_ns = ticked - received;
    timing.send_ns = sent - ticked;
    timing.compute_ns = sent - woke;
    timing.tell_ns = over - sent;
    timing.sample_age_ns = woke - sample_time;
    timing.sample_to_command_ns = sent - sample_time;
    timing.missed = ticker.missed();
    timing.samples_malformed = link.samplesRejected().malformed;
    timing.samples_out_of_range = link.samplesRejected().out_of_range;
    timing.samples_of_another = link.samplesRejected().of_another;
    timing.samples_old = link.samplesRejected().old;
    (ran_long ? timing.missed_ran_long : timing.missed_woke_late) += missed;
    count(timing);
    bus.publish(channel::kTiming, timing);
    if (finish(state)) break;
  }
  RunResult result = monitor.result(monotonicNow() - start);
  result.rejected = link.samplesRejected().text();
  return result;
}

void runPlant(const Experiment& experiment, const ProcessOptions& options,
              const std::function<bool()>& stop) {
  const Identity self = Identity::draw();
  Bus bus(options.url);
  PlantLink link(bus);
  plant::Plant plant(experiment.plant);
  RobotOrders robot(experiment);
  constexpr const char* kNotNow = "it is in motion, elsewhere, or its hand is not free for that";
  int refused_events = 0;
  const std::int64_t period = experiment.controller.period;

  const auto begin = [&](const std::optional<RobotAction>& action) {
    if (action && !plant.moveRobot(*action)) throw InputError(kNotNow);
  };
  const auto refusable = [](const auto& act) {
    try {
      act();
    } catch (const InputError& error) {
      fmt::print(stderr, "plant: the robot does not do that: {}\n", error.what());
    }
  };
  const auto moveRobot = [&](bool wait) {
    for (const RobotOrder& order : link.takeRobotOrders())
      refusable([&] { begin(robot.take(order, plant.truth())); });
    refusable([&] { begin(robot.done(wait)); });
    if (plant.refusedEvents() > std::exchange(refused_events, plant.refusedEvents()))
      fmt::print(stderr, "plant: the robot leaves out an event of the program: {}\n", kNotNow);
  };

  const auto publish = [&](std::int64_t time, std::int64_t answers) {
    const Sample sample = plant.sample();
    bus.publish(channel::kTruth, toMessage(plant.truth(), header(self, sample.sequence, time)));
    sample_t message = toMessage(sample, self, answers);
    message.header.time_ns = time;
    bus.publish(channel::kSample, message);
    return message;
  };

  if (options.lockstep) {
    std::int64_t answered = -2;  // tick
    std::int64_t start = 0;      // [ns] plant time of the controller's tick 0
    sample_t last;
    while (!stop()) {
      bus.wait(100);
      link.setTime(monotonicNow());
      moveRobot(true);
      const auto command = link.takeCommand();
      if (!command) continue;
      const auto& [legs, tick] = *command;
      if (tick == -1 && answered >= 0) {  // another controller begins
        answered = -2;
        start = plant.time();
      }
      if (tick == answered) {
        bus.publish(channel::kSample, last);
      } else if (tick == -1 ||
                 (answered > -2 && tick > answered && tick - answered < kLongestLeap)) {
        if (tick >= 0) {
          plant.command(legs);
          plant.advance(start + (tick + 1) * period);
        }
        last = publish(plant.time(), tick);
        answered = tick;
      }
    }
    return;
  }

  enableRealtime("plant", kPlantPriority, options.realtime);
  const std::int64_t start = monotonicNow();
  Ticker ticker(kPlantPeriod);
  while (!stop()) {
    ticker.wait();
    bus.drain();
    const std::int64_t now = monotonicNow();
    link.setTime(now);
    moveRobot(false);
    if (const auto command = link.takeCommand()) plant.command(command->first);
    plant.advance(now - start);
    publish(now, -1);
  }
}

}  // namespace ves
