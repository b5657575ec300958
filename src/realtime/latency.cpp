// SPDX-License-Identifier: BSD-3-Clause
#include "ves/realtime/latency.hpp"

namespace ves {

Latency latencyOf(std::vector<double> seconds) {
  Latency out;
  out.n = std::ssize(seconds);
  if (seconds.empty()) return out;
  std::sort(seconds.begin(), seconds.end());
  const auto at = [&](double share) {
    return seconds[static_cast<std::size_t>(share * static_cast<double>(seconds.size() - 1))];
  };
  out.median = at(0.5);
  out.p99 = at(0.99);
  out.max = at(1.0);
  return out;
}

}  // namespace ves
