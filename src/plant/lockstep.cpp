// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/lockstep.hpp"

#include "ves/contract/plausible.hpp"

namespace ves {

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
