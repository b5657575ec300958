// SPDX-License-Identifier: BSD-3-Clause
#include "readers.hpp"

#include <fmt/format.h>

namespace ves {
namespace {

/// The platform must be allowed to stand at home.
void requireHome(const Section& s, const SafetyLimits& l, const Geometry& geometry) {
  const Transform home = geometry.fromHome({});
  const Vec6 L = legLengths(geometry, home);
  for (int i = 0; i < kLegs; ++i)
    if (!(L(i) >= l.leg_min && L(i) <= l.leg_max))
      s.fail(L(i) < l.leg_min ? "leg_min_m" : "leg_max_m",
             fmt::format("leg {} is {:.4f} m at home, want [{:.4f}, {:.4f}] around it", i + 1, L(i),
                         l.leg_min, l.leg_max));
  const LegGap gap = nearestLegs(geometry, home);
  if (!(gap.distance >= l.leg_clearance))
    s.fail("leg_clearance_m", fmt::format("legs {} and {} are {:.4f} m apart at home, want at most "
                                          "that",
                                          gap.first + 1, gap.second + 1, gap.distance));
  const LegSlope slope = flattestLeg(geometry, home);
  if (!(slope.angle >= l.plate_angle))
    s.fail("plate_angle_deg", fmt::format("leg {} stands at {:.2f} deg to a plate at home, want at "
                                          "most that",
                                          slope.leg + 1, slope.angle / kDegree));
  const double condition = conditionNumber(geometry, home);
  if (!(condition <= l.condition))
    s.fail("condition_number", fmt::format("it is {:.3g} at home, want more than that", condition));
}

}  // namespace

WorkspaceUse readWorkspace(Section s, const Geometry& geometry) {
  return workspaceUse(geometry, s.number("translation_m", kTiny, 10.0),
                      s.number("rotation_deg", kTiny, 85.0) * kDegree);
}

SafetyLimits readSafety(Section s, const Geometry& geometry, const WorkspaceUse& use,
                        const Legs& legs, double volts_per_count) {
  const SafetyLimits derived =
      derivedLimits(use, {legs.actuator.length_min, legs.actuator.length_max},
                    plant::nominalServo(legs.gains, legs.actuator, legs.transducer));
  SafetyLimits l;
  l.leg_velocity = s.numberOr("leg_velocity_m_per_s", kTiny, 10.0, derived.leg_velocity);
  l.position_error = s.numberOr("position_error_m", kTiny, 10.0, derived.position_error);
  l.position_error_still =
      s.numberOr("position_error_still_m", kTiny, 10.0, derived.position_error_still);
  l.position_error_lag = s.numberOr("position_error_lag_s", 0.0, 10.0, derived.position_error_lag);
  l.reading_jump = s.numberOr("reading_jump_m", kTiny, 10.0, derived.reading_jump);
  // Logs from before these were keys lack them, and ran with these numbers.
  const auto known = [&](const char* key, double lo, double hi, double before) {
    return s.has(key) ? s.number(key, lo, hi) : before;
  };
  l.reading_speed = known("reading_speed", 1.0, 100.0, 1.5);
  l.speed_memory = known("speed_memory_s", 0.01, 100.0, 0.3);
  l.reading_patience = static_cast<int>(known("reading_patience", 0.0, 100.0, 1.0));
  l.window = known("growth_window_s", 0.01, 100.0, 0.5);
  l.window_growth = known("window_growth", 1.0, 100.0, 1.2);
  l.translation = s.number("translation_m", kTiny, 10.0);
  l.rotation = s.number("rotation_deg", kTiny, 85.0) * kDegree;
  l.leg_min = s.numberOr("leg_min_m", kTiny, 20.0, derived.leg_min);
  l.leg_max = s.numberOr("leg_max_m", l.leg_min, 20.0, derived.leg_max);
  l.joint_cone = s.numberOr("joint_cone_deg", kTiny, 180.0, derived.joint_cone / kDegree) * kDegree;
  l.leg_clearance = s.numberOr("leg_clearance_m", 0.0, 10.0, derived.leg_clearance);
  l.plate_angle = s.numberOr("plate_angle_deg", 0.0, 80.0, derived.plate_angle / kDegree) * kDegree;
  l.condition = s.numberOr("condition_number", 1.0, 1e9, derived.condition);
  constexpr double kSquareCentimetre = 1e-4, kLitre = 1e-3;
  l.bore_area = s.number("bore_area_cm2", kTiny, 1e4) * kSquareCentimetre;
  l.rod_side_area = s.number("rod_side_area_cm2", kTiny, 1e4) * kSquareCentimetre;
  l.flow = s.number("flow_l_per_s", kTiny, 1e3) * kLitre;
  l.stale_ticks = static_cast<int>(s.integer("stale_ticks", 0, 1000));
  l.stall_ticks = static_cast<int>(s.integer("stall_ticks", 0, 1000));
  l.overruns = static_cast<int>(s.integer("overruns_per_second", 0, kMostOverruns));
  const auto counts = [&](const char* key) {
    return static_cast<int>(std::lround(s.number(key, -10.0, 10.0) / volts_per_count));
  };
  l.pressure_min = counts("pressure_min_v");
  l.pressure_max = counts("pressure_max_v");
  l.frozen_samples = static_cast<int>(s.integer("frozen_samples", 1, 1000));
  l.frozen_counts = s.number("frozen_counts", 0.0, 65536.0);
  l.growing_windows = static_cast<int>(s.integer("growing_windows", 1, 1000));
  l.growth_floor = s.number("growth_floor_j", 0.0, 1e6);
  l.tool_singularity = known("tool_singularity", 0.0, 1.0, 0.01);
  l.start_force = s.number("start_force_n", kTiny, 1e6);
  l.start_moment = s.number("start_moment_nm", kTiny, 1e6);
  requireHome(s, l, geometry);
  s.finish();
  return l;
}

}  // namespace ves
