// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <random>

#include "ves/robot/payload.hpp"

namespace ves::test {

/// Every body's mass and centre believed wrongly, each by its own share of up to a tenth, beside a
/// common one.
inline void misbelieve(Payload& payload, std::mt19937& random) {
  constexpr double kMost = 0.1;
  std::uniform_real_distribution<double> off(-kMost, kMost);
  const double common = 1.0 + off(random);
  const auto change = [&](RigidBody& body) {
    body = scaledDensity(common * (1.0 + off(random)), body);
    body.p_BoBcm_B *= 1.0 + off(random);
  };
  change(payload.robot.base);
  for (int i = 0; i < payload.robot.size; ++i)
    change(payload.robot.links[static_cast<std::size_t>(i)].body);
}

}  // namespace ves::test
