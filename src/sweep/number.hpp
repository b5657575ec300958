// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <charconv>
#include <cmath>
#include <string>

namespace ves {

inline constexpr double kDeviations = 1.959963984540054;  // [-] that 95 % are within

/// False where a text is no finite number, and nothing else.
inline bool toNumber(const std::string& text, double& x) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), x);
  return error == std::errc() && end == text.data() + text.size() && std::isfinite(x);
}

}  // namespace ves
