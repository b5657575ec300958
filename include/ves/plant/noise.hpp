// SPDX-License-Identifier: BSD-3-Clause
//
// Seeded Gaussian noise.
#pragma once

#include <cstdint>
#include <memory>

namespace ves::plant {

/// Seeded Gaussian noise: the same seed gives the same values. Drawing allocates nothing.
class Noise {
 public:
  explicit Noise(std::uint32_t seed);
  double normal() noexcept;

 private:
  std::unique_ptr<void, void (*)(void*)> generator_;  // GSL's, which no header of ours shows
};

}  // namespace ves::plant
