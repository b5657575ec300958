// SPDX-License-Identifier: BSD-3-Clause
//
// Numbers in the order of networks, as LCM and Net F/T send them.
#pragma once

#include <cstdint>

namespace ves {

/// Of the first `size` bytes, at most 8; the first is the highest.
inline std::uint64_t bigEndian(const std::uint8_t* bytes, int size) noexcept {
  std::uint64_t value = 0;
  for (int i = 0; i < size; ++i) value = value << 8 | bytes[i];
  return value;
}

}  // namespace ves
