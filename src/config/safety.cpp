// SPDX-License-Identifier: BSD-3-Clause
#include "readers.hpp"

namespace ves {

SafetyLimits readSafety(Section s, double volts_per_count) {
  SafetyLimits l;
  l.leg_velocity = s.number("leg_velocity_m_per_s", kTiny, 10.0);
  l.position_error = s.number("position_error_m", kTiny, 10.0);
  l.position_error_still = s.number("position_error_still_m", kTiny, 10.0);
  l.position_error_lag = s.number("position_error_lag_s", 0.0, 10.0);
  l.reading_jump = s.number("reading_jump_m", kTiny, 10.0);
  l.translation = s.number("translation_m", kTiny, 10.0);
  l.rotation = s.number("rotation_deg", kTiny, 85.0) * kDegree;
  l.leg_min = s.number("leg_min_m", kTiny, 10.0);
  l.leg_max = s.number("leg_max_m", l.leg_min, 10.0);
  l.joint_cone = s.number("joint_cone_deg", kTiny, 180.0) * kDegree;
  l.leg_clearance = s.number("leg_clearance_m", 0.0, 1.0);
  l.plate_angle = s.number("plate_angle_deg", 0.0, 80.0) * kDegree;
  l.condition = s.number("condition_number", 1.0, 1e9);
  constexpr double kSquareCentimetre = 1e-4, kLitre = 1e-3;
  l.bore_area = s.number("bore_area_cm2", kTiny, 1e4) * kSquareCentimetre;
  l.rod_side_area = s.number("rod_side_area_cm2", kTiny, 1e4) * kSquareCentimetre;
  l.flow = s.number("flow_l_per_s", kTiny, 1e3) * kLitre;
  l.stale_ticks = static_cast<int>(s.integer("stale_ticks", 0, 1000));
  l.stall_ticks = static_cast<int>(s.integer("stall_ticks", 0, 1000));
  l.overruns = static_cast<int>(s.integer("overruns_per_second", 0, 1000));
  const auto counts = [&](const char* key) {
    return static_cast<int>(std::lround(s.number(key, -10.0, 10.0) / volts_per_count));
  };
  l.pressure_min = counts("pressure_min_v");
  l.pressure_max = counts("pressure_max_v");
  l.frozen_samples = static_cast<int>(s.integer("frozen_samples", 1, 1000));
  l.frozen_counts = s.number("frozen_counts", 0.0, 65536.0);
  l.growing_windows = static_cast<int>(s.integer("growing_windows", 1, 1000));
  l.growth_floor = s.number("growth_floor_j", 0.0, 1e6);
  l.start_force = s.number("start_force_n", kTiny, 1e6);
  l.start_moment = s.number("start_moment_nm", kTiny, 1e6);
  s.finish();
  return l;
}

}  // namespace ves
