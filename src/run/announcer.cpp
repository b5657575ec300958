// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/announcer.hpp"

#include <utility>

#include "ves/realtime/realtime.hpp"
#include "ves/transport/channels.hpp"

namespace ves {

Announcer::Announcer(const std::string& url, const experiment_t& experiment, const setup_t& setup)
    : bus_(url), experiment_(experiment), setup_(setup) {
  bus_.subscribe(channel::kQuery, [this](const std::string&, const void* data, std::uint32_t size) {
    asked_ = asked_ || decode<query_t>(data, size).has_value();
  });
  thread_ = std::thread([this] { announce(); });
}

Announcer::~Announcer() {
  over_ = true;
  thread_.join();
}

void Announcer::announce() {
  constexpr std::int64_t kRepeat = 1'000'000'000, kRest = 200'000'000;  // [ns]
  std::int64_t told = monotonicNow() - kRepeat;
  for (; !over_; bus_.wait(50)) {
    const std::int64_t since = monotonicNow() - told;
    const bool due = disarmed_.load(std::memory_order_relaxed) && since >= kRepeat;
    if (!due && !(asked_ && since >= kRest)) continue;
    asked_ = false;
    told = monotonicNow();
    experiment_.header.time_ns = told;
    ++experiment_.header.sequence;
    setup_.header = experiment_.header;
    bus_.publish(channel::kExperiment, experiment_);
    bus_.publish(channel::kSetup, setup_);
  }
}

}  // namespace ves
