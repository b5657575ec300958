// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/actuator.hpp"

#include <algorithm>

namespace ves::plant {

std::int32_t Temposonics::count(double length) const noexcept {
  const double counts = (length - offset) / scale + 0.5;  // to the nearest
  return static_cast<std::int32_t>(std::clamp(counts, 0.0, static_cast<double>(kMaxLegCount)));
}

}  // namespace ves::plant
