// SPDX-License-Identifier: BSD-3-Clause
#include "ves/realtime/realtime.hpp"
#include "ves/run/ending.hpp"
#include "ves/run/run.hpp"
#include "ves/transport/channels.hpp"

namespace ves {

experiment_t describe(const Experiment& experiment, const Identity& from, std::int64_t time) {
  experiment_t m;
  m.header = header(from, 0, time);
  m.name = experiment.name;
  m.hash = experiment.hash;
  m.version = kVersion;
  m.resolved = experiment.resolved;
  return m;
}

RunResult runLockstep(const Experiment& experiment, LogWriter* log, const Watch& watch,
                      Request first) {
  const Identity controller{1, 0}, machine{2, 0};
  const std::int64_t period = experiment.controller.period;
  TestPlatform platform(experiment.controller);
  plant::Plant plant(experiment.plant);
  Ending ending(experiment.controller);

  const auto record = [&](const std::string& channel, const auto& message) {
    if (log) log->write(channel, message, plant.time());
  };
  record(channel::kExperiment, describe(experiment, controller, 0));

  const std::int64_t start = monotonicNow();
  TickInput in;
  in.order.request = first;
  std::int64_t orders = 0;
  for (;;) {
    const sample_t sent = toMessage(plant.sample(), machine, in.tick - 1);
    record(channel::kTruth,
           toMessage(plant.truth(), header(machine, sent.header.sequence, plant.time())));
    record(channel::kSample, sent);
    // The same gate as on the bus: what is not let in was not there.
    if (const auto sample = fromMessage(sent)) in.sample = *sample;

    const TickState& state = platform.tick(in);
    const header_t h = header(controller, in.tick, plant.time());
    record(channel::kState, toMessage(state, in, h));
    record(channel::kLegCommand, toMessage(state.command, h));
    in.order = watch ? watch(state) : Order();
    if (ending.reached(state, in.order.request)) break;
    if (in.order.request == Request::kRun) {
      in.order.id = {controller.source, orders++};
      record(channel::kOperator, toMessage(in.order, controller.source,
                                           header(controller, in.order.id.sequence, plant.time())));
    }

    in.tick += 1 + state.idle;
    plant.command(state.command);
    plant.advance(in.tick * period);
  }
  RunResult result = ending.result(monotonicNow() - start);
  if (log) result.lost = log->lost();
  return result;
}

}  // namespace ves
