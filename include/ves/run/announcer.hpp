// SPDX-License-Identifier: BSD-3-Clause
//
// The configuration on the bus, for whoever comes late.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include "ves/bus/bus.hpp"
#include "ves/config/experiment.hpp"

namespace ves {

/// What drivers are told of an experiment.
MachineSetup setupOf(const Experiment& experiment, bool lockstep);

/// Publishes VES_EXPERIMENT and VES_SETUP at once, once a second while disarmed, and when a
/// VES_QUERY asks, at most five times a second. By a thread and a socket of its own: the control
/// path never waits for it.
class Announcer {
 public:
  /// Queries are those that `bus` hears, as long as this lives. Throws InputError when the bus
  /// cannot be opened.
  Announcer(Bus& bus, const std::string& url, const experiment_t& experiment,
            const MachineSetup& setup);
  ~Announcer();
  Announcer(const Announcer&) = delete;
  Announcer& operator=(const Announcer&) = delete;

  void tell(Phase phase) noexcept {
    disarmed_.store(phase == Phase::kDisarmed, std::memory_order_relaxed);
  }

 private:
  void announce();

  Bus bus_;
  experiment_t experiment_;
  setup_t setup_;
  std::atomic<bool> disarmed_{true}, asked_{false};
  std::mutex mutex_;
  std::condition_variable ending_;
  bool over_ = false;
  std::thread thread_;
};

}  // namespace ves
