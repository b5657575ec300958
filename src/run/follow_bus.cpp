// SPDX-License-Identifier: BSD-3-Clause
#include "ves/run/follow_bus.hpp"

#include "ves/bus/bus.hpp"
#include "ves/bus/channels.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {

bool followBus(const std::string& url, const std::function<bool()>& stop,
               const std::function<void(const experiment_t&)>& begin,
               const std::function<void(const LogEvent&)>& take) {
  constexpr std::int64_t kSecond = 1'000'000'000;  // [ns]
  const Identity self = Identity::draw();
  Bus bus(url);
  std::optional<Identity> controller;
  bool described = false;
  std::int64_t heard = 0, asked = 0, queries = 0;  // [ns], [ns], [-]
  bus.subscribe({channel::kExperiment},
                [&](const std::string&, const void* data, std::uint32_t size) {
                  const auto m = decode<experiment_t>(data, size);
                  if (!m || described || !controller || m->header.source != controller->source)
                    return;
                  begin(*m);
                  described = true;
                });
  bus.subscribe(channel::kRecorded,
                [&](const std::string& from, const void* data, std::uint32_t size) {
                  if (!wellFormed(from, data, size)) return;
                  if (from == channel::kState) {
                    const auto m = decode<state_t>(data, size);
                    if (!controller) controller = Identity{m->header.source, m->header.epoch};
                    if (m->header.source == controller->source) heard = monotonicNow();
                  }
                  if (!described) return;
                  LogEvent event;
                  event.time_us = wallNow() / 1000;
                  event.channel = from;
                  const auto* bytes = static_cast<const std::uint8_t*>(data);
                  event.data.assign(bytes, bytes + size);
                  take(event);
                });
  while (!stop()) {
    bus.wait(100);
    bus.drain();
    bus.rethrow();
    const std::int64_t now = monotonicNow();
    if (controller && now - heard > 2 * kSecond) break;
    if (!controller || described || now - asked < kSecond) continue;
    asked = now;
    query_t query;
    query.header = header(self, queries++, now);
    bus.publish(channel::kQuery, query);
  }
  return described;
}

}  // namespace ves
