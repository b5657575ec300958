// SPDX-License-Identifier: BSD-3-Clause
#include "ves/simulation/lockstep.hpp"
#include "ves/base/build.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/run/run.hpp"
#include "ves/run/run_monitor.hpp"
#include "ves/transport/channels.hpp"

namespace ves {

experiment_t describe(const Experiment& experiment, const Identity& from, std::int64_t time) {
  experiment_t m;
  m.header = header(from, 0, time);
  m.schema = kSchema;
  m.name = experiment.name;
  m.hash = experiment.hash;
  m.version = describeBuild();
  m.resolved = experiment.resolved;
  return m;
}

RunResult runLockstep(const Experiment& experiment, LogWriter* log, const Watch& watch,
                      Request first) {
  const Identity controller{1, 0}, machine{2, 0};
  Lockstep loop(experiment.controller, experiment.plant);
  RunMonitor monitor(experiment.controller);
  const auto time = [&] { return loop.plant().time(); };
  const auto record = [&](const std::string& channel, const auto& message) {
    if (log) log->write(channel, message, time());
  };
  record(channel::kExperiment, describe(experiment, controller, 0));

  const std::int64_t start = monotonicNow();
  std::int64_t orders = 0;
  for (loop.input.order.request = first;; loop.advance()) {
    const TickState& state = loop.tick();
    if (log) {
      const header_t h = header(controller, state.tick, time());
      record(channel::kTruth,
             toMessage(loop.plant().truth(), header(machine, loop.sample().sequence, time())));
      record(channel::kSample, toMessage(loop.sample(), machine, state.tick - 1));
      record(channel::kState, toMessage(state, loop.input, h));
      record(channel::kLegCommand, toMessage(state.command, h));
    }
    Order& order = loop.input.order;
    order = watch ? watch(state) : Order();
    if (monitor.reached(state, order.request)) break;
    if (order.request == Request::kRun) {
      order.id = {controller.source, orders++};
      record(channel::kOperator,
             toMessage(order, controller.source, header(controller, order.id.sequence, time())));
    }
  }
  RunResult result = monitor.result(monotonicNow() - start);
  if (log) {
    log->flush();
    result.log_lost = log->lost();
    result.log_trouble = log->trouble();
  }
  return result;
}

}  // namespace ves
