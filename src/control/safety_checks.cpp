// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/safety_checks.hpp"

#include <algorithm>
#include <cmath>

namespace ves {

bool velocityCheck(const SafetyLimits& limits, const Vec6& L, const Vec6& L_last,
                   double period) noexcept {
  return (L - L_last).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= limits.leg_velocity * period;
}

bool positionErrorCheck(const SafetyLimits& limits, const Vec6& L_expected, const Vec6& L_measured,
                        const Vec6& speed) noexcept {
  bool near = true;
  for (int i = 0; i < kLegs; ++i) {
    const double error = std::abs(L_expected(i) - L_measured(i));
    near = near && error <= limits.position_error &&
           error <= limits.position_error_still + limits.position_error_lag * speed(i);
  }
  return near;
}

bool leftAloneCheck(const SafetyLimits& limits, std::int64_t missed, double period) noexcept {
  return static_cast<double>(missed + 1) * period < limits.alone;
}

bool pieceAgeCheck(const SafetyLimits& limits, const Sample& sample, double period) noexcept {
  return static_cast<double>(sample.oldest()) * kSecondPerNanosecond <= limits.stale_ticks * period;
}

bool pressureCheck(const SafetyLimits& limits, const AdcCounts& adc) noexcept {
  return adc[kWrenchChannels] >= limits.pressure_min && adc[kWrenchChannels] <= limits.pressure_max;
}

bool saturationCheck(const AdcCounts& adc) noexcept {
  constexpr std::int32_t kLow = -32768, kHigh = 32767;  // [count]
  bool inside = true;
  for (std::size_t i = 0; i < kWrenchChannels; ++i)
    inside = inside && adc[i] > kLow && adc[i] < kHigh;
  return inside;
}

double segmentDistance(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) noexcept {
  // Minimise |a + s u - c - t v| over the unit square: the unconstrained foot, then clamped.
  const Vec3 u = b - a, v = d - c, w = a - c;
  const double uu = u.squaredNorm(), vv = v.squaredNorm();
  const double uv = u.dot(v), uw = u.dot(w), vw = v.dot(w);
  const double det = uu * vv - uv * uv;
  double s = det > 1e-12 * uu * vv ? std::clamp((uv * vw - vv * uw) / det, 0.0, 1.0) : 0.0;
  double t = (uv * s + vw) / vv;
  if (t < 0.0 || t > 1.0) {
    t = std::clamp(t, 0.0, 1.0);
    s = std::clamp((uv * t - uw) / uu, 0.0, 1.0);
  }
  return (w + s * u - t * v).norm();
}

bool collideCheck(const SafetyLimits& limits, const Geometry& geometry, const Transform& X_IP,
                  const LegLines& lines) noexcept {
  std::array<Vec3, kLegs> p_IPi_I;
  for (std::size_t i = 0; i < kLegs; ++i) p_IPi_I[i] = X_IP * geometry.p_PPi_P[i];
  bool clear = true;
  std::array<Vec3, kLegs> along;
  for (std::size_t i = 0; i < kLegs; ++i)
    along[i] = lines.J.row(static_cast<Eigen::Index>(i)).head<3>();
  const double nearest = limits.leg_clearance * limits.leg_clearance;
  for (std::size_t i = 0; i < kLegs; ++i)
    for (std::size_t j = i + 1; j < kLegs; ++j) {
      // No segments come nearer than the lines that they lie on.
      const Vec3 normal = along[i].cross(along[j]);
      const double apart = normal.dot(geometry.p_IBi_I[i] - geometry.p_IBi_I[j]);
      clear = clear && (apart * apart > nearest * normal.squaredNorm() ||
                        segmentDistance(geometry.p_IBi_I[i], p_IPi_I[i], geometry.p_IBi_I[j],
                                        p_IPi_I[j]) >= limits.leg_clearance);
    }
  const double least = std::sin(limits.plate_angle);
  const Vec3 normal_I = X_IP.R.col(2);
  for (const Vec3& leg : along) clear = clear && leg.z() >= least && leg.dot(normal_I) >= least;
  return clear;
}

bool conditioningCheck(const SafetyLimits& limits, const LegLines& lines,
                       double joint_radius) noexcept {
  return conditionNumber(lines, joint_radius) <= limits.condition;
}

bool motionLimitsCheck(const SafetyLimits& limits, const Pose& x) noexcept {
  return x.p.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= limits.translation &&
         x.rpy.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= limits.rotation;
}

bool actuatorLimitsCheck(const SafetyLimits& limits, const Vec6& L) noexcept {
  return L.minCoeff<Eigen::PropagateNaN>() >= limits.leg_min &&
         L.maxCoeff<Eigen::PropagateNaN>() <= limits.leg_max;
}

bool flowLimitsCheck(const SafetyLimits& limits, const Vec6& L, const Vec6& L_last,
                     double period) noexcept {
  bool available = true;
  for (int i = 0; i < kLegs; ++i) {
    const double rate = (L(i) - L_last(i)) / period;
    const double flow = std::abs(rate) * (rate > 0.0 ? limits.bore_area : limits.rod_side_area);
    available = available && flow <= limits.flow;
  }
  return available;
}

JointAxes::JointAxes(const Geometry& geometry) noexcept {
  const Transform home = geometry.fromHome({});
  for (std::size_t i = 0; i < kLegs; ++i) {
    base_I_[i] = (home * geometry.p_PPi_P[i] - geometry.p_IBi_I[i]).normalized();
    platform_P_[i] = home.R.transpose() * base_I_[i];
  }
}

bool JointAxes::check(const SafetyLimits& limits, const Mat3& R_IP,
                      const LegLines& lines) const noexcept {
  const double least = std::cos(limits.joint_cone);
  bool inside = true;
  for (std::size_t i = 0; i < kLegs; ++i) {
    const Vec3 along = lines.J.row(static_cast<Eigen::Index>(i)).head<3>();
    inside = inside && along.dot(base_I_[i]) >= least && along.dot(R_IP * platform_P_[i]) >= least;
  }
  return inside;
}

}  // namespace ves
