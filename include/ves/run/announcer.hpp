// SPDX-License-Identifier: BSD-3-Clause
//
// The configuration on the bus, for whoever comes late.
#pragma once

#include <atomic>
#include <string>
#include <thread>

#include "ves/transport/bus.hpp"

namespace ves {

/// Publishes VES_EXPERIMENT and VES_SETUP at once, once a second while disarmed, and when a VES_QUERY asks, at
/// most five times a second. By a thread and a socket of its own: the control path never waits for
/// it.
class Announcer {
 public:
  /// Throws InputError when the bus cannot be opened.
  Announcer(const std::string& url, const experiment_t& experiment, const setup_t& setup);
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
  bool asked_ = false;
  std::atomic<bool> disarmed_{true}, over_{false};
  std::thread thread_;
};

}  // namespace ves
