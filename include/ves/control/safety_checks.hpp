// SPDX-License-Identifier: BSD-3-Clause
//
// Safety checks (Appendix C). Each is one function that tells whether its requirement holds, and
// one bit. NaN fails every check.
#pragma once

#include <array>
#include <cstdint>

#include "ves/contract/check.hpp"
#include "ves/contract/sample.hpp"

namespace ves {

struct SafetyLimits {
  double leg_velocity = 0.0;          // [m/s] commanded
  double position_error = 0.0;        // [m] commanded minus measured length, at most
  double position_error_still = 0.0;  // [m] the same, of a leg at rest
  double position_error_lag = 0.0;    // [s] and so much more per speed of the leg
  double reading_jump = 0.0;          // [m] of a leg at rest, from one sample to the next,
  double reading_speed = 1.0;         // [-] and so much more, times the speed it had lately;
  double speed_memory = 1.0;          // [s] over which that speed is forgotten
  int reading_patience = 0;           // [-] readings in a row that may be impossible
  double translation = 0.0;           // [m] of each coordinate from home
  double rotation = 0.0;              // [rad] of each coordinate from home
  double leg_min = 0.0;               // [m]
  double leg_max = 0.0;               // [m]
  double joint_cone = 0.0;            // [rad] half angle about a joint's own axis
  double leg_clearance = 0.0;         // [m] least distance between the axes of two legs
  double plate_angle = 0.0;           // [rad] least angle between a leg and a plate
  double condition = 0.0;             // [-] largest condition number of the Jacobian
  double bore_area = 0.0;             // [m^2] fed when a leg extends
  double rod_side_area = 0.0;         // [m^2] fed when it retracts
  double flow = 0.0;                  // [m^3/s] of one leg
  int stale_ticks = 0;                // [-] ticks without a new sample
  int stall_ticks = 0;                // [-] ticks missed in a row
  double alone = HUGE_VAL;            // [s] without a command before the legs go by themselves
  int overruns = 0;                   // [-] late ticks in one second
  int pressure_min = 0;               // [count]
  int pressure_max = 0;               // [count]
  int frozen_samples = 0;             // [-] with six identical readings
  double frozen_counts = 0.0;         // [count] by which the weight should have changed one of them
  int growing_windows = 0;            // [-] in a row, each with more energy than the last
  double window = 1.0;                // [s] of these,
  double window_growth = 1.0;         // [-] more than this is growth,
  double growth_floor = 0.0;          // [J] below which nothing is said
  double tool_singularity = 0.0;  // [-] of the simulated robot, where its tool paths are refused
  double start_force = 0.0;   // [N] measured, gravity compensated, when admittance control begins
  double start_moment = 0.0;  // [N m]
};

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

/// No two legs come closer than leg_clearance, and no leg lies down on a plate.
bool collideCheck(const SafetyLimits&, const Geometry&, const Transform& X_IP) noexcept;

/// Every coordinate is inside the workspace.
bool motionLimitsCheck(const SafetyLimits&, const Pose& x) noexcept;

/// Every leg is within its stroke.
bool actuatorLimitsCheck(const SafetyLimits&, const Vec6& L) noexcept;

/// The flow that each leg's change of length takes is available.
bool flowLimitsCheck(const SafetyLimits&, const Vec6& L, const Vec6& L_last,
                     double period) noexcept;

/// The condition number of the Jacobian is small: far from singular poses.
bool conditioningCheck(const SafetyLimits&, const Geometry&, const Transform& X_IP) noexcept;

/// Axes of the ball joints: along the legs at home.
class JointAxes {
 public:
  explicit JointAxes(const Geometry& geometry) noexcept;

  /// Every leg is inside the cones of its base and platform joints.
  bool check(const SafetyLimits&, const Geometry&, const Transform& X_IP) const noexcept;

 private:
  std::array<Vec3, kLegs> base_I_{};      // [-] unit vectors
  std::array<Vec3, kLegs> platform_P_{};  // [-]
};

/// Least distance between the segments ab and cd.
double segmentDistance(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) noexcept;

}  // namespace ves
