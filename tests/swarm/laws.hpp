// SPDX-License-Identifier: BSD-3-Clause
//
// What must hold in every tick of every life (docs/safety.md numbers the laws). They look at what
// leaves the controller and at where the simulated legs truly are; none trusts what a check said.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <unordered_map>

#include "ves/config/experiment.hpp"

namespace ves::swarm {

/// A law that was broken.
struct Finding {
  std::string law;
  std::int64_t tick = 0;  // [-] of the life
  std::string what;
};

/// A command that the machine took.
struct Taken {
  std::int64_t source = 0;
  std::int64_t tick = 0;  // [-] of its controller
  LegCommand command;
};

class Laws {
 public:
  /// `only`: the law that is looked at; empty: all.
  Laws(const Experiment& experiment, const std::string& only);

  /// Time goes on; `tick` of the life.
  void at(std::int64_t tick) noexcept { tick_ = tick; }

  /// A controller begins: nothing before counts.
  void controllerBegins(std::int64_t source);
  /// Its process has ended by itself.
  void controllerEnds(bool said_how, const std::string& how);
  /// Its process is gone, or misses ticks: nobody waits for answers.
  void controllerSilent();
  /// An order that was sent to it.
  void ordered(const OrderId& id);
  /// An order went into this tick, and this came of it.
  void ticked(const TickInput& in, const TickState& state);

  void machineBegins();
  /// The machine after a step; `taken` before it. `time` [ns] of its own. `loops_closed`: of
  /// safety.
  void machine(std::int64_t time, const plant::Truth& truth, const std::optional<Taken>& taken,
               bool loops_closed);
  /// Of somebody who is not to be obeyed.
  void ghost(std::int64_t source) { ghost_ = source; }

  void broken(const std::string& law, const std::string& what);
  const std::optional<Finding>& finding() const { return finding_; }

 private:
  /// What a controller said with a command.
  struct Said {
    Vec6 L = Vec6::Zero();  // [m] the checked lengths
    bool stopped = false;
  };

  void checked(const TickState& s);
  void reference(const TickState& s);
  void continuous(const TickState& s);
  void orders(const TickState& s);
  void trips(const TickState& s);
  void permitted(const TickInput& in, const TickState& s);

  void follow(std::int64_t time, const plant::Truth& truth, const Taken& taken);
  void frozen(std::int64_t time, const plant::Truth& truth);
  void alone(std::int64_t time, const plant::Truth& truth);

  const Experiment& experiment_;
  const ControllerConfig& c_;
  PathChecks checks_;
  double period_, count_;  // [s], [m]
  double at_rest_;         // [m] off the checked lengths
  // Legs that give way: 1/w of the lowest mode; their play, and how far their oil is bent when
  // seals break away.
  double swings_ = 0.0, slips_ = 0.0;  // [s], [m]
  Vec6 L_home_;
  const std::string& only_;
  std::int64_t tick_ = 0;
  std::optional<Finding> finding_;

  // The controller.
  std::int64_t source_ = 0;
  std::optional<TickState> last_;
  Vec6 desired_rate_ = Vec6::Zero();  // at last_.desired
  std::optional<Vec6> last_checked_;
  bool permission_ = false, start_permission_ = false;  // to engage, to run a program
  bool trusted_ = true;                                 // the machine's process is the first one
  struct Waiting {
    std::int64_t since = 0;  // [-] tick of the life
    std::optional<Refusal> answer;
  };
  std::unordered_map<std::int64_t, Waiting> orders_;  // by sequence
  std::unordered_map<std::int64_t, Said> said_;       // by tick of source_
  std::int64_t stopping_since_ = -1;                  // [-]

  // The machine.
  std::int64_t ghost_ = 0;
  bool heard_ours_ = false;
  bool engaged_ = false;           // a command that engaged was taken
  std::int64_t engaged_time_ = 0;  // [ns] the last such
  Vec6 anchor_ = Vec6::Zero();     // [m] the checked lengths that came with it
  bool frozen_ = false;
  std::int64_t frozen_time_ = 0;                                 // [ns]
  Vec6 frozen_low_ = Vec6::Zero(), frozen_high_ = Vec6::Zero();  // [m] from the anchor
  bool loops_open_ = false;       // one has been, since the last command that engaged
  std::int64_t loop_opened_ = 0;  // [ns]
  std::optional<Vec6> alone_from_;
};

}  // namespace ves::swarm
