// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/leg_slave.hpp"

#include <algorithm>

namespace ves::plant {

LegSlave::LegSlave(const LegSlaveGains& gains, std::int32_t count) noexcept : gains_(gains) {
  history_.fill(2 * static_cast<std::int64_t>(count));
}

void LegSlave::read(std::int32_t count, std::int32_t reference) noexcept {
  switch (phase_++) {
    case 0: first_ = count; return;
    case 1: {
      // X(k) in half counts, so that the average of two readings stays exact.
      const std::int64_t X = first_ + count;
      const std::int64_t E = 2 * static_cast<std::int64_t>(reference) - X;
      const std::int64_t U = gains_.K_P * E - gains_.K_D * (X - history_[3]);  // [1/512 digit]
      std::copy_backward(history_.begin(), history_.end() - 1, history_.end());
      history_[0] = X;
      const std::int64_t digits = (U + 256) >> 9;
      code_ = static_cast<std::int32_t>(std::clamp<std::int64_t>(digits, -kFullScale, kFullScale));
      return;
    }
    default: phase_ = 0;
  }
}

}  // namespace ves::plant
