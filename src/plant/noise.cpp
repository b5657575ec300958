// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/noise.hpp"

#include <boost/random/normal_distribution.hpp>

namespace ves::plant {

double Noise::normal() noexcept {
  return boost::random::normal_distribution<double>()(generator_);  // which remembers nothing
}

}  // namespace ves::plant
