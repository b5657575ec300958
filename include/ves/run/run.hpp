// SPDX-License-Identifier: BSD-3-Clause
//
// Ways to run an experiment: both halves in one process in lockstep, or each half as a process of
// its own over the bus, in lockstep or in real time.
#pragma once

#include <functional>
#include <string>

#include "ves/bus/bus.hpp"
#include "ves/bus/event_log.hpp"
#include "ves/config/experiment.hpp"

namespace ves {

/// How a run ended.
struct RunResult {
  std::int64_t ticks = 0;  // [-]
  double simulated = 0.0;  // [s]
  double wall = 0.0;       // [s]
  Phase phase = Phase::kDisarmed;
  Check cause = Check::kCount;  // of a stop; or why it never armed
  std::int64_t cause_tick = -1;
  bool aborted = false;  // the program could not go on: a calibration or a start was refused
  Refusal aborted_by = Refusal::kNone;  // why, of a start
  bool let_go = false;         // asked to end before it was armed, or after a stop was reset
  std::int64_t lost = 0;       // [-] messages that could not be sent, or were not heard
  std::int64_t log_lost = 0;   // [-] events that could not be written
  std::string log_trouble;     // why
  std::int64_t malformed = 0;  // [-] messages on our channels that are none of ours; not recorded

  std::string rejected;  // samples that the controller did not let in, by cause

  bool good() const { return (phase == Phase::kParked && !aborted) || let_go; }
};

/// Called after every tick; may give an order. An order for a segment needs no id here.
using Watch = std::function<Order(const TickState&)>;

experiment_t describe(const Experiment& experiment, const Identity& from, std::int64_t time);

/// What a tick in lockstep says, as a bus would carry it.
struct TickMessages {
  truth_t truth;
  sample_t sample;
  state_t state;
  leg_command_t command;
};

/// Takes what a run in lockstep says.
class RunRecorder {
 public:
  virtual ~RunRecorder() = default;
  virtual void begin(const Experiment& experiment, const Identity& controller) = 0;
  virtual void tick(const TickMessages& messages, std::int64_t time) = 0;  // [ns]
  virtual void order(const operator_t& order, std::int64_t time) = 0;
};

/// Throws InputError where a piece of the machine is real: lockstep has no time for it.
void requireSimulated(const Experiment& experiment);

/// The experiment in one process without a bus, as fast as it goes; bit-identical for one seed.
/// `first` is the order of the first tick.
RunResult runLockstep(const Experiment& experiment, LogWriter* log, const Watch& watch,
                      Request first = Request::kStart);
RunResult runRecorded(const Experiment& experiment, RunRecorder* recorder, const Watch& watch,
                      Request first = Request::kStart);

struct ProcessOptions {
  std::string url = kDefaultUrl;
  bool lockstep = false;
  std::optional<double> pace;  // [-] of real time, in lockstep; none: as fast as it goes
  bool realtime = false;       // insist on SCHED_FIFO and locked memory
  bool start = false;          // the program at once; else the controller waits for orders
  std::string log;             // file, empty: none
  std::string flight;          // folder of flight records, empty: none
};

/// The controller's process. Returns when the program is over, a check has stopped it, or the
/// machine is silent.
RunResult runController(const Experiment& experiment, const ProcessOptions& options,
                        const Watch& watch);

/// The plant's process. Returns when `stop` becomes true.
void runPlant(const Experiment& experiment, const ProcessOptions& options,
              const std::function<bool()>& stop);

struct LaunchOptions {
  ProcessOptions process;
  std::filesystem::path program;   // `ves`, which is controller and plant too
  std::filesystem::path scenario;  // resolved experiment file, for both
  bool plant = true;               // ours too; else one is on the bus
};

/// Both as processes; records everything on the bus to options.process.log. `watch` sees the states
/// that pass.
RunResult runProcesses(const Experiment& experiment, const LaunchOptions& options,
                       const std::function<void(const state_t&)>& watch,
                       const std::function<bool()>& stop);

}  // namespace ves
