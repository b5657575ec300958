// SPDX-License-Identifier: BSD-3-Clause
//
// Seeded Gaussian noise.
#pragma once

#include <cstdint>
#include <random>

namespace ves::plant {

/// Seeded Gaussian noise: the same seed gives the same values. Drawing allocates nothing.
class Noise {
 public:
  explicit Noise(std::uint32_t seed) : generator_(seed) {}
  double normal() noexcept;

 private:
  std::mt19937 generator_;
};

}  // namespace ves::plant
