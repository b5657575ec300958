// SPDX-License-Identifier: BSD-3-Clause
//
// Which poses to look at: few platform attitudes, several robot poses in each, chosen so that the
// regressor of what is unknown is well conditioned.
#pragma once

#include "ves/control/test_platform.hpp"
#include "ves/identification/mass_parameters.hpp"

namespace ves {

struct PosePlan {
  struct Attitude {
    Vec3 rpy = Vec3::Zero();     // [rad]
    std::vector<JointVector> q;  // [rad | m] one after the other
  };
  std::vector<Attitude> attitudes;
  double condition = 0.0;         // [-] of the scaled regressor, biases included
  double condition_random = 0.0;  // [-] of the random plan it began with
};

struct PosePlanOptions {
  int attitudes = 16;          // [-]
  int poses = 3;               // [-] of the robot in each
  double tilt = 20 * kDegree;  // [rad] most, about x and about y
  int exchanges = 3000;        // [-] tried
  std::uint32_t seed = 1;
};

/// Exchanges one attitude or one robot pose at a time for a random one, and keeps what lowers the
/// condition number. Inside the joints' ranges (half a turn or 1 m about their middle at most), the
/// platform's safety limits, and four fifths of the sensor's range by the masses in `setup`, on the
/// way too, from `start` and home. The same for one seed. Throws std::domain_error when no pose
/// fits.
PosePlan planPoses(const StaticSetup& setup, const SeparableCombinations& combinations,
                   const ControllerConfig& controller, const JointVector& start,
                   const PosePlanOptions& options);

}  // namespace ves
