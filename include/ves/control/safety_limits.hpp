// SPDX-License-Identifier: BSD-3-Clause
//
// The numbers that the safety checks compare with, and their keys in the section `safety` of a
// configuration. A new one: a member, a line in limitTable(), a value in config/ves.yaml.
#pragma once

#include <cmath>
#include <tuple>

#include "ves/contract/members.hpp"
#include "ves/math/frames.hpp"

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

/// [-] safety.overruns_per_second, at most.
inline constexpr int kMostOverruns = 1000;

/// One of them: its key, and what a configuration may say there, in the key's unit.
template <typename T>
struct Limit {
  const char* key;
  T& value;
  double least, most;
  double unit = 1.0;     // [value/key's unit]
  bool derives = false;  // `derived`: what follows from the platform
  double before = NAN;   // of configurations from before it was a key
};
template <typename T, typename... Rest>
Limit(const char*, T&, Rest...) -> Limit<T>;

/// All but `alone`, which is the legs' own. `volts_per_count`: of the converter.
template <typename L>
constexpr auto limitTable(L& l, double volts_per_count) {
  constexpr double kTiny = 1e-12, kSquareCentimetre = 1e-4, kLitre = 1e-3;
  const double volt = 1.0 / volts_per_count;
  return std::tuple{
      Limit{"leg_velocity_m_per_s", l.leg_velocity, kTiny, 10.0, 1.0, true},
      Limit{"position_error_m", l.position_error, kTiny, 10.0, 1.0, true},
      Limit{"position_error_still_m", l.position_error_still, kTiny, 10.0, 1.0, true},
      Limit{"position_error_lag_s", l.position_error_lag, 0.0, 10.0, 1.0, true},
      Limit{"reading_jump_m", l.reading_jump, kTiny, 10.0, 1.0, true},
      Limit{"reading_speed", l.reading_speed, 1.0, 100.0, 1.0, false, 1.5},
      Limit{"speed_memory_s", l.speed_memory, 0.01, 100.0, 1.0, false, 0.3},
      Limit{"reading_patience", l.reading_patience, 0.0, 100.0, 1.0, false, 1.0},
      Limit{"translation_m", l.translation, kTiny, 10.0},
      Limit{"rotation_deg", l.rotation, kTiny, 85.0, kDegree},
      Limit{"leg_min_m", l.leg_min, kTiny, 20.0, 1.0, true},
      Limit{"leg_max_m", l.leg_max, kTiny, 20.0, 1.0, true},
      Limit{"joint_cone_deg", l.joint_cone, kTiny, 180.0, kDegree, true},
      Limit{"leg_clearance_m", l.leg_clearance, 0.0, 10.0, 1.0, true},
      Limit{"plate_angle_deg", l.plate_angle, 0.0, 80.0, kDegree, true},
      Limit{"condition_number", l.condition, 1.0, 1e9, 1.0, true},
      Limit{"bore_area_cm2", l.bore_area, kTiny, 1e4, kSquareCentimetre},
      Limit{"rod_side_area_cm2", l.rod_side_area, kTiny, 1e4, kSquareCentimetre},
      Limit{"flow_l_per_s", l.flow, kTiny, 1e3, kLitre},
      Limit{"stale_ticks", l.stale_ticks, 0.0, 1000.0},
      Limit{"stall_ticks", l.stall_ticks, 0.0, 1000.0},
      Limit{"overruns_per_second", l.overruns, 0.0, kMostOverruns},
      Limit{"pressure_min_v", l.pressure_min, -10.0, 10.0, volt},
      Limit{"pressure_max_v", l.pressure_max, -10.0, 10.0, volt},
      Limit{"frozen_samples", l.frozen_samples, 1.0, 1000.0},
      Limit{"frozen_counts", l.frozen_counts, 0.0, 65536.0},
      Limit{"growing_windows", l.growing_windows, 1.0, 1000.0},
      Limit{"growth_window_s", l.window, 0.01, 100.0, 1.0, false, 0.5},
      Limit{"window_growth", l.window_growth, 1.0, 100.0, 1.0, false, 1.2},
      Limit{"growth_floor_j", l.growth_floor, 0.0, 1e6},
      Limit{"tool_singularity", l.tool_singularity, 0.0, 1.0, 1.0, false, 0.01},
      Limit{"start_force_n", l.start_force, kTiny, 1e6},
      Limit{"start_moment_nm", l.start_moment, kTiny, 1e6},
  };
}

static_assert(std::tuple_size_v<decltype(limitTable(*static_cast<SafetyLimits*>(nullptr), 1.0))> +
                      1 ==
                  members<SafetyLimits>(),
              "each limit but `alone` has a line in limitTable()");

}  // namespace ves
