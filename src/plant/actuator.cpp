// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/actuator.hpp"

#include <algorithm>
#include <cmath>

namespace ves::plant {

std::int32_t Temposonics::count(double length) const noexcept {
  const double counts = std::floor((length - offset) / scale + 0.5);
  return static_cast<std::int32_t>(std::clamp(counts, 0.0, static_cast<double>(kMaxLegCount)));
}

}  // namespace ves::plant
