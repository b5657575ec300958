// SPDX-License-Identifier: BSD-3-Clause
//
// How fast a machine in lockstep goes on: as fast as it is asked to, or by a clock that somebody
// slows down and stops.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "ves/bus/bus.hpp"
#include "ves/bus/channels.hpp"

namespace ves {

class Pace {
 public:
  /// Without a rate nobody can set one.
  Pace(Bus& bus, std::int64_t machine, std::optional<double> rate) : rate_(rate) {
    if (!rate_) return;
    bus.subscribe({channel::kPace},
                  [this, machine](const std::string&, const void* data, std::uint32_t size) {
                    const auto m = decode<pace_t>(data, size);
                    if (!m || !(m->rate >= 0.0 && m->rate <= kMostPace)) return;
                    if (m->machine != 0 && m->machine != machine) return;
                    rate_ = m->rate;
                    since_.reset();
                  });
  }

  /// [ms] until the machine's `time` [ns] is due, at most 50.
  int wait(std::int64_t time, std::int64_t now) {
    constexpr int kMost = 50;                      // [ms]
    constexpr std::int64_t kBehind = 200'000'000;  // [ns] that are made up for
    if (!rate_) return 0;
    if (*rate_ <= 0.0) return kMost;
    if (!since_) since_ = {time, now};
    const double due =
        static_cast<double>(since_->wall) + static_cast<double>(time - since_->time) / *rate_;
    const double left = due - static_cast<double>(now);
    if (left < -static_cast<double>(kBehind)) since_ = {time, now};
    return left <= 0.0 ? 0 : std::min(kMost, static_cast<int>(std::ceil(left * 1e-6)));
  }

 private:
  std::optional<double> rate_;  // [-]
  struct Since {
    std::int64_t time, wall;  // [ns]
  };
  std::optional<Since> since_;
};

}  // namespace ves
