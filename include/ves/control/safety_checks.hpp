// SPDX-License-Identifier: BSD-3-Clause
//
// Safety checks (Appendix C). Each is one function that tells whether its requirement holds, and
// one bit. NaN fails every check.
#pragma once

#include <array>

#include "ves/contract/check.hpp"
#include "ves/contract/sample.hpp"
#include "ves/control/safety_limits.hpp"

namespace ves {

/// Successive commanded lengths differ by no more than leg_velocity allows in one period.
bool velocityCheck(const SafetyLimits&, const Vec6& L, const Vec6& L_last, double period) noexcept;

/// The measured length is near where the leg should be, which is the commanded one unless the
/// servo's lag is taken out (TestPlatform::expectedLengths); the servo lags, so the more speed
/// [m/s] a leg has had lately, the farther behind it may be.
bool positionErrorCheck(const SafetyLimits&, const Vec6& L_expected, const Vec6& L_measured,
                        const Vec6& speed) noexcept;

/// The ticks missed in a row are fewer than the legs' own watchdog has patience for.
bool leftAloneCheck(const SafetyLimits&, std::int64_t missed, double period) noexcept;

/// No piece of the sample is older than stale_ticks.
bool pieceAgeCheck(const SafetyLimits&, const Sample& sample, double period) noexcept;

/// The pressure's reading is between its limits.
bool pressureCheck(const SafetyLimits&, const AdcCounts& adc) noexcept;

/// No wrench channel reads an end of the 16-bit converter.
bool saturationCheck(const AdcCounts& adc) noexcept;

/// No two legs come closer than leg_clearance, and no leg lies down on a plate; `lines` at X_IP.
bool collideCheck(const SafetyLimits&, const Geometry&, const Transform& X_IP,
                  const LegLines& lines) noexcept;

/// Every coordinate is inside the workspace.
bool motionLimitsCheck(const SafetyLimits&, const Pose& x) noexcept;

/// Every leg is within its stroke.
bool actuatorLimitsCheck(const SafetyLimits&, const Vec6& L) noexcept;

/// The flow that each leg's change of length takes is available.
bool flowLimitsCheck(const SafetyLimits&, const Vec6& L, const Vec6& L_last,
                     double period) noexcept;

/// The condition number of the Jacobian is small: far from singular poses. joint_radius: [m]
/// jointRadius().
bool conditioningCheck(const SafetyLimits&, const LegLines& lines, double joint_radius) noexcept;

/// Axes of the ball joints: along the legs at home.
class JointAxes {
 public:
  explicit JointAxes(const Geometry& geometry) noexcept;

  /// Every leg is inside the cones of its base and platform joints.
  bool check(const SafetyLimits&, const Mat3& R_IP, const LegLines& lines) const noexcept;

 private:
  std::array<Vec3, kLegs> base_I_{};      // [-] unit vectors
  std::array<Vec3, kLegs> platform_P_{};  // [-]
};

/// Least distance between the segments ab and cd.
double segmentDistance(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) noexcept;

}  // namespace ves
