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
  /// Without a rate nobody can set one. With one the machine says it, once a second.
  Pace(Bus& bus, const Identity& machine, std::optional<double> rate)
      : bus_(bus), machine_(machine), rate_(rate) {
    if (!rate_) return;
    bus.subscribe({channel::kPace},
                  [this](const std::string&, const void* data, std::uint32_t size) {
                    if (const auto m = decode<pace_t>(data, size)) take(*m);
                  });
  }

  /// [ms] until the machine's `time` [ns] is due, at most 50.
  int wait(std::int64_t time, std::int64_t now) {
    constexpr int kMost = 50;                      // [ms]
    constexpr std::int64_t kBehind = 200'000'000;  // [ns] that are made up for
    constexpr std::int64_t kTold = 1'000'000'000;  // [ns]
    if (!rate_) return 0;
    if (told_ == 0 || now - told_ > kTold) {
      told_ = now;
      bus_.publish(channel::kPace, pace_t{header(machine_, said_++, now), 0, *rate_});
    }
    if (*rate_ <= 0.0) return kMost;
    if (!since_) since_ = {time, now};
    const double due =
        static_cast<double>(since_->wall) + static_cast<double>(time - since_->time) / *rate_;
    const double left = due - static_cast<double>(now);
    if (left < -static_cast<double>(kBehind)) since_ = {time, now};
    return left <= 0.0 ? 0 : static_cast<int>(std::min<double>(kMost, std::ceil(left * 1e-6)));
  }

 private:
  void take(const pace_t& m) {
    const bool good = m.rate == 0.0 || (m.rate >= kLeastPace && m.rate <= kMostPace);
    const bool ours = m.machine == 0 || m.machine == machine_.source;
    if (!good || !ours || m.header.source == machine_.source) return;
    rate_ = m.rate;
    since_.reset();
    told_ = 0;
  }

  Bus& bus_;
  Identity machine_;
  std::int64_t told_ = 0, said_ = 0;  // [ns], [-]
  std::optional<double> rate_;        // [-]
  struct Since {
    std::int64_t time, wall;  // [ns]
  };
  std::optional<Since> since_;
};

}  // namespace ves
