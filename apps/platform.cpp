// SPDX-License-Identifier: BSD-3-Clause
//
// ves platform: joints, legs and limits of a Stewart platform.
#include <fmt/format.h>

#include "ves/config/platform.hpp"

#include "app.hpp"
#include "commands.hpp"
#include "ves/core/coordinates.hpp"
#include "ves/plant/nominal_servo.hpp"

namespace ves::app {
namespace {

std::string shown(const Vec3& p) {
  return fmt::format("{:>10.4f}{:>10.4f}{:>10.4f}", p.x(), p.y(), p.z());
}

void printLegs(const Platform& p) {
  const Vec6 home = legLengths(p.geometry, p.geometry.fromHome({}));
  fmt::print("\n  leg   base joint in I [m]{:>11}platform joint in P [m]{:>12}{:>10}{:>10}\n", "",
             "home [m]", "least", "most");
  for (int i = 0; i < kLegs; ++i) {
    const auto k = static_cast<std::size_t>(i);
    fmt::print("  {:<3}{}   {}{:>11.4f}{:>10.4f}{:>10.4f}\n", i + 1, shown(p.geometry.p_IBi_I[k]),
               shown(p.geometry.p_PPi_P[k]), home(i), p.use.leg_least(i), p.use.leg_most(i));
  }
}

void printLimits(const Platform& p) {
  const Stroke stroke = derivedStroke(p.use);
  const SafetyLimits derived =
      derivedLimits(p.use, {p.actuator.length_min, p.actuator.length_max},
                    plant::nominalServo(p.gains, p.actuator, p.transducer));
  fmt::print("\n  {:<34}{:>12}{:>12}\n", "", "in use", "derived");
  const auto row = [](const char* key, double used, double follows) {
    fmt::print("  {:<34}{:>12.4f}{:>12.4f}\n", key, used, follows);
  };
  row("legs.stroke_min_m", p.actuator.length_min, stroke.min);
  row("legs.stroke_max_m", p.actuator.length_max, stroke.max);
  row("legs.offset_m", p.transducer.offset,
      derivedOffset({p.actuator.length_min, p.actuator.length_max}, p.transducer.scale));
  const SafetyLimits& l = p.limits;
  row("safety.leg_min_m", l.leg_min, derived.leg_min);
  row("safety.leg_max_m", l.leg_max, derived.leg_max);
  row("safety.joint_cone_deg", l.joint_cone / kDegree, derived.joint_cone / kDegree);
  row("safety.leg_clearance_m", l.leg_clearance, derived.leg_clearance);
  row("safety.plate_angle_deg", l.plate_angle / kDegree, derived.plate_angle / kDegree);
  row("safety.condition_number", l.condition, derived.condition);
  row("safety.leg_velocity_m_per_s", l.leg_velocity, derived.leg_velocity);
  row("safety.position_error_m", l.position_error, derived.position_error);
  row("safety.position_error_still_m", l.position_error_still, derived.position_error_still);
  row("safety.position_error_lag_s", l.position_error_lag, derived.position_error_lag);
  row("safety.reading_jump_m", l.reading_jump, derived.reading_jump);
}

/// Each coordinate alone, up to three times as far as the limits of motion let it.
void printTravel(const Platform& p) {
  constexpr double kFarther = 3.0, kMostAngle = 85.0 * kDegree;
  fmt::print("\n  from home, one coordinate alone {:>10}   the other limits let it go\n", "may go");
  for (int i = 0; i < 6; ++i) {
    const Coordinate& c = coordinate(i);
    const double allowed = i < 3 ? p.limits.translation : p.limits.rotation,
                 farthest = i < 3 ? kFarther * allowed : std::min(kMostAngle, kFarther * allowed);
    std::string ways;
    for (const double sign : {-1.0, 1.0}) {
      const Travel way = travel(p.geometry, p.limits, i, sign, farthest);
      ways += way.ends == Check::kMotionLimits
                  ? fmt::format("   beyond {:+.4g}", sign * farthest / c.yaml)
                  : fmt::format("   {:+.4g} ({})", sign * way.distance / c.yaml, name(way.ends));
    }
    fmt::print("  {:<8}{:<24}{:>10.4g}{}\n", c.name, fmt::format("[{}]", c.yaml_unit),
               allowed / c.yaml, ways);
  }
}

}  // namespace

int platformCommand(int argc, char** argv) {
  CLI::App cli(
      "A Stewart platform as it is understood: where its legs stand, how long they are at home and "
      "over the workspace, the limits in use beside those that follow from the geometry, and how "
      "far each coordinate goes.",
      "ves platform");
  std::string file;
  std::vector<std::string> sets;
  cli.add_option("file", file, "name in config/platforms or config/scenarios, or a .yaml file")
      ->required();
  cli.add_option("--set", sets, "KEY.PATH=VALUE as if it stood in the file")
      ->allow_extra_args(false);
  return run(cli, argc, argv, [&] {
    const std::filesystem::path path = findPlatform(file, configFolder());
    const Platform p = loadPlatform(path, sets);
    const Transform home = p.geometry.fromHome({});
    fmt::print("{}: condition number {:.3f} at home, at most {:.3f} in the workspace\n",
               path.string(), conditionNumber(p.geometry, home), p.use.condition);
    fmt::print("  a leg: {:.4g} um a count, {:.4g} m/s extending, {:.4g} m/s retracting\n",
               1e6 * p.transducer.scale,
               velocityGain(p.actuator.gain_extend, p.gains, p.transducer) *
                   servoRail(p.gains, p.transducer),
               velocityGain(p.actuator.gain_retract, p.gains, p.transducer) *
                   servoRail(p.gains, p.transducer));
    printLegs(p);
    printLimits(p);
    printTravel(p);
    fmt::print(
        "\n  The workspace: each coordinate alone as far as it may go, and all at once half as "
        "far.\n  `derived` for a value in the file takes what stands in the last column.\n");
    return kDone;
  });
}

}  // namespace ves::app
