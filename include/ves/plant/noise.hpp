// SPDX-License-Identifier: BSD-3-Clause
//
// Seeded Gaussian noise.
#pragma once

#include <gsl/gsl_randist.h>
#include <gsl/gsl_rng.h>

#include <cstdint>
#include <memory>

namespace ves::plant {

/// Seeded Gaussian noise: the same seed gives the same values. Drawing allocates nothing.
class Noise {
 public:
  explicit Noise(std::uint32_t seed) : rng_(gsl_rng_alloc(gsl_rng_mt19937)) {
    gsl_rng_set(rng_.get(), seed);
  }
  double normal() noexcept { return gsl_ran_gaussian_ziggurat(rng_.get(), 1.0); }

 private:
  struct Free {
    void operator()(gsl_rng* rng) const { gsl_rng_free(rng); }
  };
  std::unique_ptr<gsl_rng, Free> rng_;
};

}  // namespace ves::plant
