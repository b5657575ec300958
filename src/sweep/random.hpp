// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

namespace ves {

/// splitmix64: a stream of its own for every run and key.
inline std::uint64_t mixed(std::uint64_t seed, std::uint64_t run, std::uint64_t key) {
  std::uint64_t z = seed * 0x9e3779b97f4a7c15u + run * 0xbf58476d1ce4e5b9u + key;
  for (int i = 0; i < 2; ++i) {
    z += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    z ^= z >> 31;
  }
  return z;
}
/// In [0, 1).
inline double uniform(std::uint64_t seed, std::uint64_t run, std::uint64_t key) {
  return static_cast<double>(mixed(seed, run, key) >> 11) * 0x1p-53;
}

}  // namespace ves
