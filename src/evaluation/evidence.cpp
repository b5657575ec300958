// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/evidence.hpp"

#include <fmt/format.h>

#include "ves/analysis/platform.hpp"
#include "ves/control/path_checks.hpp"
#include "ves/core/coordinates.hpp"

namespace ves {
namespace {

/// What was to be commanded when a check of the path failed.
struct Proposed {
  Pose x;
  Transform X_IP;
  Vec6 L;  // [m]
};

/// A freeze commands the pose before once more: what failed is a period farther.
Proposed proposed(const Row& row, const ControllerConfig& c) {
  const auto at = [&](double t) {
    const Vec6 x = Vec6::Map(row.state.x) + t * Vec6::Map(row.state.x_dot) +
                   0.5 * t * t * Vec6::Map(row.state.x_ddot);
    Proposed out{Pose::from(x), c.geometry.fromHome(Pose::from(x)), {}};
    out.L = legLengths(c.geometry, out.X_IP);
    return out;
  };
  const Proposed now = at(0.0);
  const bool passes = !PathChecks(c.safety, c.geometry).pose(now.X_IP, now.x, now.L).any();
  return passes ? at(c.periodSeconds()) : now;
}

std::string legOutside(const Proposed& p, const SafetyLimits& limits) {
  for (int i = 0; i < kLegs; ++i) {
    if (p.L(i) >= limits.leg_min && p.L(i) <= limits.leg_max) continue;
    return fmt::format("leg {} at {:.4f} m, want [{}, {}] (safety.leg_min_m, leg_max_m)", i + 1,
                       p.L(i), limits.leg_min, limits.leg_max);
  }
  return {};
}

std::string coordinateOutside(const Proposed& p, const SafetyLimits& limits) {
  for (int i = 0; i < 6; ++i) {
    const double most = i < 3 ? limits.translation : limits.rotation, x = p.x.stacked()(i);
    if (std::abs(x) <= most) continue;
    const Coordinate& c = coordinate(i);
    return fmt::format("{} at {:.1f} {}, want at most {:.1f} (safety.{})", c.name, x * c.shown,
                       c.shown_unit, most * c.shown, i < 3 ? "translation_m" : "rotation_deg");
  }
  return {};
}

/// The two legs that are nearest, or the leg that lies flattest on a plate.
std::string legsTooClose(const Proposed& p, const Geometry& g, const SafetyLimits& limits) {
  const LegGap gap = nearestLegs(g, p.X_IP);
  if (!(gap.distance >= limits.leg_clearance))
    return fmt::format("legs {} and {} are {:.1f} mm apart, want {:.1f} (safety.leg_clearance_m)",
                       gap.first + 1, gap.second + 1, gap.distance * 1e3,
                       limits.leg_clearance * 1e3);
  const LegSlope slope = flattestLeg(g, p.X_IP);
  if (slope.angle >= limits.plate_angle) return {};
  return fmt::format("leg {} is {:.1f} deg from a plate, want {:.1f} (safety.plate_angle_deg)",
                     slope.leg + 1, slope.angle / kDegree, limits.plate_angle / kDegree);
}

std::string farFromRound(const Proposed& p, const Geometry& g, const SafetyLimits& limits) {
  return fmt::format("condition number {:.3g}, want at most {:.3g} (safety.condition_number)",
                     conditionNumber(g, p.X_IP), limits.condition);
}

std::string legBehind(const Row& row, const SafetyLimits& limits) {
  int worst = 0;
  double most = -1.0;
  for (int i = 0; i < kLegs; ++i)
    if (const double off = std::abs(row.state.leg[i] - row.state.leg_measured[i]); off > most)
      most = off, worst = i;
  return fmt::format(
      "leg {} is {:.1f} mm from its command (safety.position_error_still_m {:.1f} mm, more with "
      "speed, at most {:.1f})",
      worst + 1, most * 1e3, limits.position_error_still * 1e3, limits.position_error * 1e3);
}

std::string pressure(const Row& row, const Experiment& e) {
  const double volts = e.plant.sensor.volts_per_count;
  return fmt::format("{:.2f} V, want [{:.2f}, {:.2f}] (safety.pressure_min_v, pressure_max_v)",
                     row.sample.adc[kWrenchChannels] * volts,
                     e.controller.safety.pressure_min * volts,
                     e.controller.safety.pressure_max * volts);
}

std::string saturated(const Row& row) {
  for (int i = 0; i < kWrenchChannels; ++i)
    if (row.sample.adc[i] <= -32768 || row.sample.adc[i] >= 32767)
      return fmt::format("channel {} at {} counts: choose a smaller gain (sensor.gain)",
                         wrenchComponent(i).name, row.sample.adc[i]);
  return {};
}

/// The limits that a check looks at, as the configuration has them.
std::string limitsOf(Check check, const Experiment& e) {
  const std::string keys = fmt::format(" {} ", kChecks[static_cast<std::size_t>(check)].limits);
  SafetyLimits l = e.controller.safety;
  std::string out;
  const auto add = [&](const auto& limit) {
    if (keys.find(fmt::format(" {} ", limit.key)) == std::string::npos) return;
    out += fmt::format("{}safety.{} {:.4g}", out.empty() ? "" : ", ", limit.key,
                       limit.value / limit.unit);
  };
  std::apply([&](const auto&... limit) { (add(limit), ...); },
             limitTable(l, e.plant.sensor.volts_per_count));
  return out;
}

}  // namespace

std::string evidence(Check check, const Row& row, const Experiment& e) {
  if (check >= Check::kCount) return {};  // it never armed
  const SafetyLimits& limits = e.controller.safety;
  const Geometry& g = e.controller.geometry;
  const Proposed p = proposed(row, e.controller);
  std::string out;
  switch (check) {
    case Check::kActuatorLimits: out = legOutside(p, limits); break;
    case Check::kMotionLimits: out = coordinateOutside(p, limits); break;
    case Check::kCollide: out = legsTooClose(p, g, limits); break;
    case Check::kConditioning: out = farFromRound(p, g, limits); break;
    case Check::kPositionError: out = legBehind(row, limits); break;
    case Check::kPressure: out = row.has_sample ? pressure(row, e) : ""; break;
    case Check::kSensorSaturated: out = row.has_sample ? saturated(row) : ""; break;
    default: break;
  }
  return out.empty() ? limitsOf(check, e) : out;
}

std::string stillnessViolation(const state_t& s, const Experiment& experiment) {
  const auto i = static_cast<std::size_t>(s.violation_index);
  const StillnessLimits& limits = experiment.controller.stillness;
  const std::string channel(i < 6 ? kWrenchComponents[i].name : "a channel");
  switch (static_cast<StillnessViolation>(s.violation)) {
    case StillnessViolation::kLeg:
      return fmt::format("leg {} moved by {} counts ({} allowed: controller.still.leg_counts)",
                         i + 1, s.violation_amount, limits.leg_counts);
    case StillnessViolation::kJoint: {
      const bool known = i < experiment.robot.joint_names.size();
      const bool turns =
          known && experiment.controller.payload.robot.jointLink(s.violation_index).type ==
                       JointType::kRevolute;
      return fmt::format("{} moved by {:.4f} {} ({} allowed: controller.still.joint_rad_or_m)",
                         known ? experiment.robot.joint_names[i] : fmt::format("joint {}", i + 1),
                         s.violation_amount, turns ? "rad" : "m", limits.joint);
    }
    case StillnessViolation::kChannel:
      return fmt::format(
          "{} scatters by {:.1f} counts ({} allowed: controller.still.deviation_counts): something "
          "shakes it",
          channel, s.violation_amount, limits.deviation);
    case StillnessViolation::kBias:
      return fmt::format(
          "{} would have a bias of {:.0f} counts ({:.0f} allowed: controller.still.bias_v): it "
          "carries a load that is not "
          "in the model, or less than that",
          channel, s.violation_amount, limits.bias);
    case StillnessViolation::kNone:
    case StillnessViolation::kCount: break;
  }
  return "no stream of new samples";
}

std::string refusedSegment(Refusal why) {
  return fmt::format("a segment of the program was refused: {}", name(why));
}

std::string whyEarly(const Series& series) {
  const auto stop = std::find_if(series.rows.begin(), series.rows.end(), [](const Row& row) {
    return row.state.request == static_cast<int>(Request::kStop) &&
           row.state.phase == static_cast<int>(Phase::kReturning);
  });
  // One that holds, and has nothing left to do, is not cut short.
  const bool idle = stop != series.rows.end() && stop != series.rows.begin() &&
                    std::prev(stop)->state.phase == static_cast<int>(Phase::kArmed);
  if (stop != series.rows.end() && !idle)
    return fmt::format("a stop was requested at {:.2f} s", stop->t);
  const auto first = std::find_if(series.rows.begin(), series.rows.end(),
                                  [](const Row& row) { return row.state.aborted != 0; });
  if (first == series.rows.end()) return {};
  const state_t& s = first->state;
  if (s.aborted_by != 0) return refusedSegment(static_cast<Refusal>(s.aborted_by));
  return fmt::format("the calibration was refused: {}", stillnessViolation(s, series.experiment));
}

}  // namespace ves
