// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/lockstep.hpp"

#include <fmt/format.h>

#include "ves/bus/channels.hpp"
#include "ves/config/document.hpp"
#include "ves/core/build.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/run/run.hpp"
#include "ves/run/run_monitor.hpp"
#include "ves/run/truth.hpp"
#include "ves/run/vehicle_judge.hpp"

namespace ves {

experiment_t describe(const Experiment& experiment, const Identity& from, std::int64_t time) {
  experiment_t m;
  m.header = header(from, 0, time);
  m.schema = kSchema;
  m.name = experiment.name;
  m.version = describeBuild();
  m.resolved = experiment.source.resolved();
  m.hash = fingerprint(m.resolved);
  return m;
}

void requireSimulated(const Experiment& experiment) {
  if (experiment.machine.simulated()) return;
  throw InputError(fmt::format(
      "{}: a machine with real pieces runs in real time; lockstep wants `machine` all simulated",
      experiment.name));
}

RunResult runRecorded(const Experiment& experiment, RunRecorder* recorder, const Watch& watch,
                      Request first) {
  requireSimulated(experiment);
  const Identity controller{1, 0}, machine{2, 0};
  const auto whole = std::make_unique<Lockstep>(experiment.controller, experiment.plant);
  Lockstep& loop = *whole;  // large for a stack
  RunMonitor monitor(experiment.controller);
  const auto time = [&] { return loop.plant().time(); };
  if (recorder) recorder->begin(experiment, controller);

  const std::int64_t start = monotonicNow();
  std::int64_t orders = 0;
  for (loop.input.order.request = first;; loop.advance()) {
    const TickState& state = loop.tick();
    if (recorder) {
      const header_t h = header(controller, state.tick, time());
      Sample sample = loop.sample();
      sample.answers = state.tick - 1;
      recorder->tick(
          {toMessage(loop.plant().truth(), header(machine, loop.sample().sequence, time())),
           toMessage(sample, machine), toMessage(state, h), toMessage(state.command, h)},
          time());
    }
    Order& order = loop.input.order;
    order = watch ? judged(watch(state), experiment, state) : Order();
    if (monitor.reached(state, order.request)) break;
    if (hasNumbers(order.request)) {
      order.id = {controller.source, orders++};
      order.controller = controller.source;
      if (recorder)
        recorder->order(toMessage(order, header(controller, order.id.sequence, time())), time());
    }
  }
  return monitor.result(monotonicNow() - start);
}

namespace {

class LogRecorder : public RunRecorder {
 public:
  explicit LogRecorder(LogWriter& log) : log_(log) {}
  void begin(const Experiment& experiment, const Identity& controller) override {
    log_.write(channel::kExperiment, describe(experiment, controller, 0), 0);
  }
  void tick(const TickMessages& m, std::int64_t time) override {
    log_.write(channel::kTruth, m.truth, time);
    log_.write(channel::kSample, m.sample, time);
    log_.write(channel::kState, m.state, time);
    log_.write(channel::kLegCommand, m.command, time);
  }
  void order(const operator_t& order, std::int64_t time) override {
    log_.write(channel::kOperator, order, time);
  }

 private:
  LogWriter& log_;
};

}  // namespace

RunResult runLockstep(const Experiment& experiment, LogWriter* log, const Watch& watch,
                      Request first) {
  if (!log) return runRecorded(experiment, nullptr, watch, first);
  LogRecorder recorder(*log);
  RunResult result = runRecorded(experiment, &recorder, watch, first);
  log->flush();
  result.log_lost = log->lost();
  result.log_trouble = log->trouble();
  return result;
}

}  // namespace ves
