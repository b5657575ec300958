// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/announcer.hpp"

#include <chrono>

#include "ves/realtime/realtime.hpp"
#include "ves/transport/channels.hpp"

namespace ves {

Announcer::Announcer(Bus& bus, const std::string& url, const experiment_t& experiment,
                     const setup_t& setup)
    : bus_(url), experiment_(experiment), setup_(setup) {
  bus.subscribe({channel::kQuery},
                [this](const std::string&, const void* data, std::uint32_t size) {
                  if (decode<query_t>(data, size)) asked_.store(true, std::memory_order_relaxed);
                });
  thread_ = std::thread([this] { announce(); });
}

Announcer::~Announcer() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  ending_.notify_one();
  thread_.join();
}

void Announcer::announce() {
  constexpr std::int64_t kRepeat = 1'000'000'000, kRest = 200'000'000;  // [ns]
  std::int64_t told = monotonicNow() - kRepeat;
  std::unique_lock lock(mutex_);
  for (; !over_; ending_.wait_for(lock, std::chrono::milliseconds(50))) {
    const std::int64_t since = monotonicNow() - told;
    const bool due = disarmed_.load(std::memory_order_relaxed) && since >= kRepeat;
    if (!due && !(since >= kRest && asked_.exchange(false, std::memory_order_relaxed))) continue;
    told = monotonicNow();
    experiment_.header.time_ns = told;
    ++experiment_.header.sequence;
    setup_.header = experiment_.header;
    bus_.publish(channel::kExperiment, experiment_);
    bus_.publish(channel::kSetup, setup_);
  }
}

}  // namespace ves
