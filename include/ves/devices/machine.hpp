// SPDX-License-Identifier: BSD-3-Clause
//
// A machine put together from simulated and real pieces, as the scenario's `machine` says.
#pragma once

#include <memory>
#include <string_view>

#include "ves/bus/bus.hpp"
#include "ves/config/experiment.hpp"
#include "ves/devices/simulation.hpp"
#include "ves/devices/tracker.hpp"

namespace ves::devices {

class Machine {
 public:
  /// Throws InputError where a piece cannot be reached.
  Machine(const Experiment& experiment, Bus& bus);

  /// To the legs; the simulated robot takes its cues from it.
  void command(const LegCommand& command) noexcept;

  /// Time passes, up to `until` of the simulation's clock, which `now` is on the host's [ns]. The
  /// simulated pieces follow the legs and joints that are real.
  void advance(std::int64_t until, std::int64_t now) noexcept;

  /// What the machine is now, every piece with its own stamp, by the host's clock; nothing while a
  /// piece has not been heard: waitsFor() names it.
  const std::optional<Sample>& sample() const noexcept { return sample_; }
  std::string_view waitsFor() const noexcept { return waits_for_; }

  plant::Plant& plant() noexcept { return simulation_.plant(); }
  /// Whether Truth is what happened, and not what was concluded from real legs.
  bool knowsTruth() const noexcept { return !real_legs_; }

 private:
  Simulation simulation_;
  std::unique_ptr<Legs> real_legs_;
  std::unique_ptr<ForceSensor> real_sensor_;
  std::unique_ptr<Robot> real_robot_;
  std::unique_ptr<Switches> real_switches_;
  LegCodec codec_;
  Tracker<kLegs> leg_tracker_;
  Tracker<kMaxJoints> joint_tracker_;
  std::optional<Sample> sample_;
  std::string_view waits_for_;
};

}  // namespace ves::devices
