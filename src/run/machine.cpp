// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include "pace.hpp"
#include "process_conduct.hpp"
#include "ves/bus/channels.hpp"
#include "ves/devices/machine.hpp"
#include "ves/run/robot_orders.hpp"
#include "ves/run/run.hpp"
#include "ves/run/truth.hpp"

namespace ves {
namespace {

constexpr int kMachinePriority = 70;                // [-] SCHED_FIFO
constexpr std::int64_t kLongestLeap = 100'000'000;  // [-] ticks that a command may pass over
constexpr std::int64_t kToldAfter = 2'000'000'000;  // [ns]

/// The machine on its bus.
class MachineProcess {
 public:
  MachineProcess(const Experiment& experiment, const ProcessOptions& options)
      : experiment_(experiment),
        options_(options),
        bus_(options.url),
        link_(bus_, self_),
        machine_(experiment, bus_),
        robot_(experiment) {}

  void inLockstep(const std::function<bool()>& stop);
  void inRealTime(const std::function<bool()>& stop);

 private:
  plant::Plant& plant() { return machine_.plant(); }
  void moveRobot(bool wait);
  sample_t publish(std::int64_t answers);

  const Experiment& experiment_;
  const ProcessOptions& options_;
  const Identity self_ = Identity::draw();
  Bus bus_;
  PlantLink link_;
  devices::Machine machine_;
  RobotOrders robot_;
  std::int64_t orders_taken_ = 0, orders_refused_ = 0;
  int refused_events_ = 0;
};

/// The orders that have come, and the path that has been planned, begin.
void MachineProcess::moveRobot(bool wait) {
  constexpr const char* kNotNow = "it is in motion, elsewhere, or its hand is not free for that";
  const auto begin = [&](const std::optional<RobotAction>& action) {
    if (!action) return;
    if (!plant().moveRobot(*action)) throw InputError(kNotNow);
    ++orders_taken_;
  };
  const auto refusable = [&](const auto& act) {
    try {
      act();
    } catch (const InputError& error) {
      ++orders_refused_;
      fmt::print(stderr, "plant: the robot does not do that: {}\n", error.what());
    }
  };
  for (const RobotOrder& order : link_.takeRobotOrders())
    refusable([&] { begin(robot_.take(order, plant().truth())); });
  refusable([&] { begin(robot_.done(wait)); });
  if (plant().refusedEvents() > std::exchange(refused_events_, plant().refusedEvents()))
    fmt::print(stderr, "plant: the robot leaves out an event of the program: {}\n", kNotNow);
}

sample_t MachineProcess::publish(std::int64_t answers) {
  Sample sample = *machine_.sample();
  if (machine_.knowsTruth())
    bus_.publish(channel::kTruth,
                 toMessage(plant().truth(), header(self_, sample.sequence, sample.time)));
  sample.answers = answers;
  sample.robot_orders_taken = orders_taken_;
  sample.robot_orders_refused = orders_refused_ + link_.refusedRobotOrders();
  if (!options_.lockstep) {  // there a command comes at its tick, by the simulated clock
    const PlantLink::Heard& heard = link_.lastHeard();
    sample.command_source = heard.source;
    sample.command_tick = heard.sequence;
    sample.command_time = heard.time;
  }
  const sample_t message = toMessage(sample, self_);
  bus_.publish(channel::kSample, message);
  return message;
}

/// One period for each command, and one sample in answer; a repeated command gets the same one.
void MachineProcess::inLockstep(const std::function<bool()>& stop) {
  const std::int64_t period = experiment_.controller.period;
  Pace pace(bus_, self_, options_.pace);
  std::int64_t answered = -2;  // tick
  std::int64_t start = 0;      // [ns] plant time of the controller's tick 0
  sample_t last;
  while (!stop()) {
    bus_.waitAwake(100);
    link_.setTime(monotonicNow());
    moveRobot(true);
    const auto command = link_.takeCommand();
    if (!command) continue;
    const auto& [legs, tick] = *command;
    if (tick == -1 && answered >= 0) {  // another controller begins
      answered = -2;
      start = plant().time();
    }
    if (tick == answered) {
      bus_.publish(channel::kSample, last);
    } else if (tick == -1 || (answered > -2 && tick > answered && tick - answered < kLongestLeap)) {
      std::int64_t until = plant().time();
      if (tick >= 0) {
        machine_.command(legs);
        until = start + (tick + 1) * period;
      }
      for (int wait; (wait = pace.wait(until, monotonicNow())) > 0 && !stop();) {
        bus_.wait(wait);
        moveRobot(true);
        if (link_.takeCommand() && answered > -2)  // it is asked again
          bus_.publish(channel::kSample, last);
      }
      machine_.advance(until, until);
      last = publish(tick);
      answered = tick;
    }
  }
}

void MachineProcess::inRealTime(const std::function<bool()>& stop) {
  enableRealtime("plant", kMachinePriority, options_.realtime);
  const std::int64_t start = monotonicNow();
  Ticker ticker(experiment_.machine.period);
  bool told = false;
  while (!stop()) {
    ticker.wait();
    bus_.drain();
    const std::int64_t now = monotonicNow();
    link_.setTime(now);
    moveRobot(false);
    if (const auto command = link_.takeCommand()) {
      plant().advance(link_.lastHeard().time - start);
      machine_.command(command->first);
    }
    machine_.advance(now - start, now);
    if (machine_.waitsFor().empty()) {
      publish(-1);
    } else if (now - start > kToldAfter && !std::exchange(told, true)) {
      fmt::print(stderr, "plant: waiting for {} on {}\n", machine_.waitsFor(), options_.url);
    }
  }
  if (const std::string refused = bus_.refused().text(); !refused.empty())
    fmt::print(stderr, "plant: {}\n", refused);
}

}  // namespace

void runPlant(const Experiment& experiment, const ProcessOptions& options,
              const std::function<bool()>& stop) {
  if (options.lockstep) requireSimulated(experiment);
  warnOfOpenBus("plant", options.url);
  refuseKeyedLockstep(options);
  MachineProcess machine(experiment, options);
  if (options.lockstep)
    machine.inLockstep(stop);
  else
    machine.inRealTime(stop);
}

}  // namespace ves
