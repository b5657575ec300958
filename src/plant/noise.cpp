// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/noise.hpp"

#include <gsl/gsl_randist.h>
#include <gsl/gsl_rng.h>

namespace ves::plant {
namespace {

gsl_rng* generator(void* p) { return static_cast<gsl_rng*>(p); }

}  // namespace

Noise::Noise(std::uint32_t seed)
    : generator_(gsl_rng_alloc(gsl_rng_mt19937), [](void* p) { gsl_rng_free(generator(p)); }) {
  gsl_rng_set(generator(generator_.get()), seed);
}

double Noise::normal() noexcept {
  return gsl_ran_gaussian_ziggurat(generator(generator_.get()), 1.0);
}

}  // namespace ves::plant
