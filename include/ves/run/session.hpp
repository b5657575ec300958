// SPDX-License-Identifier: BSD-3-Clause
//
// A controller process with everything around it: the bus, the recorder, the plant if it is ours,
// and the operator's orders.
#pragma once

#include <memory>
#include <optional>

#include "ves/bus/asking.hpp"
#include "ves/run/process.hpp"
#include "ves/run/run.hpp"

namespace ves {

class Session {
 public:
  using OnState = std::function<void(const state_t&)>;
  using OnMessage =
      std::function<void(const std::string& channel, const void* data, std::uint32_t size)>;

  /// Starts the processes. Records everything on the bus to options.process.log, except in
  /// lockstep, where the controller does: it is the one that misses nothing.
  Session(const Experiment& experiment, const LaunchOptions& options);

  /// `f` sees every state of our controller.
  void onState(OnState f) { on_state_ = std::move(f); }
  /// `f` sees every well-formed message on the bus, states included.
  void onMessage(OnMessage f) { on_message_ = std::move(f); }

  /// Handles what has arrived, waiting for at most so long, or until `descriptor` can be read:
  /// true when it can. Throws InputError when the plant has ended before the controller.
  bool listen(int milliseconds, int descriptor = -1);

  bool running() { return controller_->running(); }
  const std::optional<state_t>& state() const { return state_; }

  /// Sends an order until a state shows that it has been heard: why it was refused, if it was;
  /// nothing when the controller does not answer. kChecking: it had not been answered when there
  /// was something to read from the descriptor, which goes before.
  std::optional<Refusal> order(const Order& order, int descriptor = -1);

  /// Asks something of the simulated robot; robotOrders() tells whether it does it.
  void orderRobot(const RobotOrder& order);
  /// By the newest sample.
  struct RobotOrderCounts {
    std::int64_t taken = 0, refused = 0;
    std::int64_t answered() const { return taken + refused; }
  };
  const RobotOrderCounts& robotOrders() const { return robot_orders_; }

  /// A gentle end, as by Ctrl-C.
  void interrupt();

  /// Of a controller that has ended. Throws InputError when it did so in disorder.
  RunResult result();

  std::int64_t recorded() const { return heard_; }  // [-] states

 private:
  void receive(const std::string& channel, const void* data, std::uint32_t size);

  const Experiment& experiment_;
  bool paced_;  // by a clock that somebody may hold
  Identity self_ = Identity::draw();
  Bus bus_;
  std::unique_ptr<LogWriter> log_;
  std::string log_file_;
  std::int64_t start_;  // [ns]
  std::unique_ptr<Process> plant_, controller_;
  bool interrupted_ = false;
  std::optional<state_t> state_;
  std::int64_t heard_ = 0;        // [-] states
  std::int64_t orders_ = 0;       // [-] given
  std::optional<Asking> asking_;  // the last of those to the controller
  std::int64_t machine_ = 0;      // header.source of its samples; 0: none yet
  RobotOrderCounts robot_orders_;
  RunResult result_;
  OnState on_state_;
  OnMessage on_message_;
};

}  // namespace ves
