// SPDX-License-Identifier: BSD-3-Clause
//
// The newest reading of a force sensor, or the mean of the newest ones, as counts of the converter
// that the controller knows.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "ves/devices/devices.hpp"

namespace ves::devices {

class WrenchWindow {
 public:
  /// `to_counts` [count per unit of a reading]; the readings of `window` [ns] before the newest are
  /// averaged; 0: that one alone.
  WrenchWindow(const Mat6& to_counts, std::int64_t window)
      : to_counts_(to_counts), window_(window), taken_(8192) {}

  void take(const Vec6& reading, bool fault, std::int64_t time) noexcept {
    taken_[count_++ % taken_.size()] = {reading, fault, time};
  }
  /// False before the first. As faulty as the worst of the window.
  bool read(WrenchReading& out) const noexcept {
    if (count_ == 0) return false;
    Vec6 sum = Vec6::Zero();
    std::size_t n = 0;
    out.time = newest(0).time;
    out.fault = false;
    for (; n < std::min(count_, taken_.size()); ++n) {
      const Taken& one = newest(n);
      if (n > 0 && one.time <= out.time - window_) break;
      sum += one.reading;
      out.fault = out.fault || one.fault;
    }
    const Vec6 converter = to_counts_ * (sum / static_cast<double>(n));
    for (int i = 0; i < kWrenchChannels; ++i)
      out.counts[static_cast<std::size_t>(i)] =
          static_cast<std::int32_t>(std::lround(std::clamp(converter(i), -32768.0, 32767.0)));
    return true;
  }

 private:
  struct Taken {
    Vec6 reading = Vec6::Zero();
    bool fault = false;
    std::int64_t time = 0;  // [ns]
  };
  const Taken& newest(std::size_t back) const noexcept {
    return taken_[(count_ - 1 - back) % taken_.size()];
  }

  Mat6 to_counts_;
  std::int64_t window_;       // [ns]
  std::vector<Taken> taken_;  // a ring: more than a second of 7000
  std::size_t count_ = 0;     // [-] so far
};

}  // namespace ves::devices
