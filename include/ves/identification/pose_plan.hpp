// SPDX-License-Identifier: BSD-3-Clause
//
// Which poses to look at: few platform attitudes, several robot poses in each, chosen so that the
// regressor of what is unknown is well conditioned.
#pragma once

#include <cmath>

#include "ves/control/test_platform.hpp"
#include "ves/identification/mass_parameters.hpp"

namespace ves {

struct PosePlan {
  static constexpr double kLook = 2.0;  // [s] that everything stands still for
  // A leg comes to rest at the edge of the transducer's count that it meets first. Where all legs
  // arrive extending, all are short by the same half count, and the attitude is right.
  static constexpr double kBelow = 0.01;    // [m] an attitude is approached from
  static constexpr double kApproach = 1.0;  // [s]

  struct Attitude {
    Vec3 rpy = Vec3::Zero();     // [rad]
    std::vector<JointVector> q;  // [rad | m] one after the other
    std::vector<double> moving;  // [s] to each of q, to the first with the platform
  };
  std::vector<Attitude> attitudes;
  double seconds = 0.0;           // [s] from home to the end of the last look
  double condition = 0.0;         // [-] of the scaled regressor, biases included
  double condition_random = 0.0;  // [-] of the random plan it began with
  /// [-] share of the wrench that masses so identified are wrong by, rms over the plan's poses,
  /// when every look tells a channel to a count.
  double deviation = 0.0;
};

struct PosePlanOptions {
  int attitudes = 16;              // [-]
  int poses = 3;                   // [-] of the robot in each
  double tilt = 20 * kDegree;      // [rad] most, about x and about y
  double speed = 30.0;             // [deg/s | cm/s] of the joints, mean of a move
  double most_seconds = HUGE_VAL;  // [s] a plan that takes longer is worse
  double most_range = 0.8;         // [-] of the sensor's, by the masses in the setup
  int exchanges = 3000;            // [-] tried
  std::uint32_t seed = 1;
};

/// Exchanges one attitude or one robot pose at a time for a random one, and keeps what lowers the
/// condition number, and the time where that is too long. Inside the middle nine tenths of the
/// joints' ranges (half a turn or 1 m about it at most), the platform's safety limits, and four
/// fifths of the sensor's range by the masses in `setup`, on the way too, from `start` and home.
/// The same for one seed. Throws std::domain_error when no pose fits.
PosePlan planPoses(const StaticSetup& setup, const SeparableCombinations& combinations,
                   const ControllerConfig& controller, const JointVector& start,
                   const PosePlanOptions& options);

/// The plan of the fewest attitudes whose `deviation` is at most `accuracy` within
/// `options.most_seconds`; of as many as that time allows where none is, the most accurate.
PosePlan planFewestPoses(const StaticSetup& setup, const SeparableCombinations& combinations,
                         const ControllerConfig& controller, const JointVector& start,
                         const PosePlanOptions& options, double accuracy);

}  // namespace ves
