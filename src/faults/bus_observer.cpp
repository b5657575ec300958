// SPDX-License-Identifier: BSD-3-Clause
#include "ves/faults/bus_observer.hpp"

#include "ves/bus/channels.hpp"

#include "ves/realtime/realtime.hpp"

namespace ves {

BusObserver::BusObserver() {
  bus.subscribe({channel::kState, channel::kLegCommand, channel::kTruth},
                [this](const std::string&, const void* data, std::uint32_t size) {
                  if (const auto m = decode<truth_t>(data, size)) {
                    ++truths;
                    legs = Vec6::Map(m->leg);
                    low = std::min(low, legs.minCoeff());
                    high = std::max(high, legs.maxCoeff());
                  }
                  if (const auto m = decode<leg_command_t>(data, size)) engaged += m->engaged;
                  if (const auto m = decode<state_t>(data, size)) {
                    ++states;
                    controller = m->header.source;
                    state = *m;
                  }
                });
}

bool BusObserver::until(const std::function<bool()>& what, double seconds) {
  const std::int64_t end = monotonicNow() + static_cast<std::int64_t>(seconds * 1e9);
  bool yes = what();
  while (!yes && monotonicNow() < end) {
    bus.wait(20);
    yes = what();
  }
  return yes;
}

bool BusObserver::rests() {
  Vec6 last = legs;
  std::int64_t still = 0, seen = truths;
  return until([&] {
    if (truths == seen) return false;
    still = (legs - last).cwiseAbs().maxCoeff() < 1e-5 ? still + truths - seen : 0;
    seen = truths;
    last = legs;
    return still > 100;
  });
}

}  // namespace ves
