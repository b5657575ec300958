// SPDX-License-Identifier: BSD-3-Clause
#include "ves/simulation/lockstep.hpp"

namespace ves {

bool plausible(const Sample& s) noexcept {
  constexpr std::int64_t kMaxSequence = 100'000'000'000;  // [-] 30 years of 100 Hz
  constexpr std::int32_t kAdcMin = -32768, kAdcMax = 32767;
  constexpr double kMaxJointValue = 1e3;                  // [rad | m]
  constexpr double kColdest = -273.15, kHottest = 200.0;  // [C]
  bool good = s.sequence >= 0 && s.sequence <= kMaxSequence;
  for (const std::int32_t count : s.adc) good = good && count >= kAdcMin && count <= kAdcMax;
  for (const std::int32_t count : s.legs)
    good = good && count >= 0 && count <= plant::Temposonics::kMaxCount;
  for (const double q : s.q) good = good && q >= -kMaxJointValue && q <= kMaxJointValue;
  constexpr std::int64_t kMaxTime = INT64_MAX / 8;  // [ns] 36 years
  good = good && s.time <= kMaxTime;
  for (const std::int64_t t : {s.legs_time, s.wrench_time, s.joints_time})
    good = good && t >= 0 && t <= s.time;
  good = good && s.command_time >= 0 && s.command_time <= kMaxTime;
  good = good && s.faults <= kAllPieces;
  return good && s.temperature >= kColdest && s.temperature <= kHottest;
}

const TickState& Lockstep::tick() noexcept {
  sample_ = plant_.sample();
  if (disturb) disturb(sample_);
  if (!gate || plausible(sample_)) input.sample = sample_;
  input.time = input.tick * period_;
  state_ = &platform_.tick(input);
  return *state_;
}

void Lockstep::advance(std::int64_t missed) noexcept {
  input.tick += 1 + state_->idle + missed;
  if (!disconnected) plant_.command(state_->command);
  plant_.advance(input.tick * period_);
}

}  // namespace ves
