// SPDX-License-Identifier: BSD-3-Clause
//
// ves conform: does a machine on the bus keep its side of it?
#include <fmt/format.h>

#include "commands.hpp"
#include "options.hpp"
#include "print.hpp"
#include "ves/bus/channels.hpp"
#include "ves/core/build.hpp"
#include "ves/doctor/conform.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/run/announcer.hpp"

namespace ves::app {
namespace {

constexpr std::int64_t kFirstSample = 10'000'000'000;  // [ns]
constexpr std::int64_t kTold = 1'000'000'000;          // [ns] of silence
constexpr std::int64_t kHello = 100'000'000;           // [ns] between commands that engage nothing

/// Engages nothing; says that it is there.
std::vector<Requirement> listen(const Experiment& experiment, const std::string& url,
                                double seconds) {
  const Identity self = Identity::draw();
  const MachineSetup told = setupOf(experiment, false);
  const setup_t setup = toMessage(told, header(self, 0, 0));
  Bus bus(url);
  Announcer announcer(bus, url, describe(experiment, self, 0), told);
  std::optional<SampleJudge> judge;
  const std::int64_t start = monotonicNow();
  bus.subscribe({channel::kSample}, [&](const std::string&, const void* data, std::uint32_t size) {
    if (!judge) judge.emplace(setup, bus.arrival());
    judge->take(data, size, bus.arrival());  // how late we come to it is no fault of the machine
  });
  for (bool announced = false; !judge && !stop_requested && monotonicNow() - start < kFirstSample;
       bus.wait(100))
    if (monotonicNow() - start > kTold && !std::exchange(announced, true))
      fmt::print(stderr, "waiting up to 10 s for samples on {}: a driver, or {} plant SCENARIO\n",
                 url, frontDoor());
  if (!judge) return {{"samples", "heard", "none in 10 s", false}};
  const std::int64_t end = monotonicNow() + static_cast<std::int64_t>(seconds * 1e9);
  const leg_command_t hello = toMessage(LegCommand(), header(self, -1, 0));
  for (std::int64_t said = 0; !stop_requested && monotonicNow() < end; bus.wait(20)) {
    if (monotonicNow() - said < kHello) continue;
    said = monotonicNow();
    bus.publish(channel::kLegCommand, hello);
  }
  return judge->verdict(monotonicNow());
}

/// Arms, 20 mm up and tilted so that every leg goes a way of its own, rests there, home again,
/// parks.
std::vector<Requirement> move(const Experiment& experiment, const ProcessOptions& process) {
  LegJudge legs(experiment.controller.period);
  const RunResult result = runController(experiment, process, [&](const TickState& s) {
    legs.take(s);
    return stop_requested ? Order{Request::kStop, {}, {}} : Order();
  });
  Requirement moved{"a gentle move", "arms, 20 mm up and back, parks", "",
                    result.phase == Phase::kParked && !result.aborted};
  moved.found =
      moved.kept ? fmt::format("parked after {:.1f} s", result.simulated) : whyNot(result);
  if (moved.found.empty()) moved.found = "ended early";
  return {moved, legs.verdict()};
}

/// Follows commands a millimetre ahead of where it is to rest, and then hears no more.
Requirement silence(const Experiment& experiment, const std::string& url) {
  constexpr int kTicks = 50;           // [-] of commands
  constexpr std::int32_t kAhead = 15;  // [count]
  constexpr double kStill = 2.0;       // [count]
  const std::int64_t period = experiment.controller.period;
  const Identity self = Identity::draw();
  const MachineSetup setup = setupOf(experiment, false);
  Bus bus(url);
  Announcer announcer(bus, url, describe(experiment, self, 0), setup);
  ControllerLink link(bus, self);
  std::int64_t tick = 0;
  const auto run = [&](const LegCommand& command, int ticks) {
    for (Ticker ticker(period); ticks-- > 0 && !stop_requested; ++tick) {
      ticker.wait();
      bus.drain();
      if (tick > 0) link.send(toMessage(command, header(self, tick, monotonicNow())));
    }
  };
  const auto apart = [&](const LegCounts& from) {
    double most = 0.0;
    for (std::size_t i = 0; i < kLegs; ++i)
      most = std::max(most, std::abs(static_cast<double>(link.sample().legs[i] - from[i])));
    return most;
  };
  run({},
      static_cast<int>(2 * PlantLink::kSilence / period));  // the last controller's are free now
  LegCommand command;
  command.engaged = true;
  command.rest = command.counts = link.sample().legs;
  for (std::int32_t& count : command.counts) count += kAhead;
  run(command, kTicks);
  const double followed = apart(command.rest);
  const std::int64_t until = monotonicNow() + setup.watchdog.hold_after + 1'000'000'000;
  while (monotonicNow() < until && !stop_requested) bus.wait(20);
  bus.drain();
  const double off = apart(command.rest);
  run({}, 3);
  return {"silence",
          fmt::format("rests at `rest` after {:.0f} ms without a command",
                      static_cast<double>(setup.watchdog.hold_after) * 1e-6),
          fmt::format("{:.0f} counts from it, of {:.0f} that it was led away", off, followed),
          off <= kStill && followed > 0.5 * kAhead};
}

}  // namespace

int conformCommand(int argc, char** argv) {
  CLI::App cli(
      "Listens to the machine on the bus as a controller that commands nothing, and says which "
      "requirements of docs/machine.md it keeps. With --move it then arms and moves the platform "
      "20 mm up, tilted, and back. Status 1 when one is not kept. The scenario says which machine "
      "is "
      "expected.",
      "ves conform");
  Options options;
  bool moves = false;
  double seconds = 3.0;
  options.addExperiment(cli);
  addUrl(cli, options.process.url);
  addJoin(cli, options.join);
  cli.add_option("--seconds", seconds, "to listen")
      ->check(inRange(0.5, 3600.0))
      ->capture_default_str();
  cli.add_flag("--move", moves, "move the platform, when all else is well");
  return run(cli, argc, argv, [&] {
    for (const std::string& one : options.overrides)
      if (one.starts_with("program="))
        throw InputError("--set program: means nothing here, the motion is this command's own");
    // There every leg is some millimetres from where any other is told to be.
    const std::string away =
        "{move: {to: {x_m: 0.015, y_m: 0.015, z_m: 0.02, beta_deg: 3, gamma_deg: -2}, duration_s: "
        "2}}";
    options.overrides.push_back("program=[{move: {}}, " + away + ", " + away + ", {move: {}}]");
    const Experiment experiment = options.load();
    if (options.verbose) printWarnings(experiment, true);
    options.enterBus();
    catchSignals();
    fmt::print(stderr, "listening on {} for {:g} s\n", options.process.url, seconds);
    std::vector<Requirement> all = listen(experiment, options.process.url, seconds);
    const auto kept = [](const Requirement& r) { return r.kept; };
    const bool well = std::all_of(all.begin(), all.end(), kept);
    if (moves && well) {
      options.process.start = true;
      for (const Requirement& r : move(experiment, options.process)) all.push_back(r);
      if (std::all_of(all.begin(), all.end(), kept))
        all.push_back(silence(experiment, options.process.url));
    }
    for (const Requirement& r : all)
      fmt::print("{} {:<16} {:<42} {}\n", r.kept ? "ok" : "NO", r.name, r.asked, r.found);
    if (moves && !well) fmt::print("nothing was moved\n");
    if (all.front().name == std::string("samples") && !all.front().kept)
      fmt::print("no machine is heard on {}: start yours, or {} plant {} to see one that passes\n",
                 options.process.url, frontDoor(), options.scenario);
    return std::all_of(all.begin(), all.end(), kept) ? kDone : kTripped;
  });
}

}  // namespace ves::app
