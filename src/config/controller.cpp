// SPDX-License-Identifier: BSD-3-Clause
#include "readers.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ves {
namespace {

Stability readStability(Section& controller, const char* key) {
  if (!controller.has(key)) return Stability::kUnknown;
  const std::string text = controller.choice(
      key, {kStabilityNames[0], kStabilityNames[1], kStabilityNames[2], kStabilityNames[3]});
  return static_cast<Stability>(
      std::find(std::begin(kStabilityNames), std::end(kStabilityNames), text) -
      std::begin(kStabilityNames));
}

/// [s] written by the stability check where the loop grows, slowly; without the key for good.
double readStableFor(Section& controller, const char* key) {
  return controller.has(key) ? controller.number(key, 0.0, 1e9) : HUGE_VAL;
}

/// What goes beyond the report; without the key all of it is off.
Compensation readCompensation(Section& controller) {
  Compensation c;
  if (!controller.has("compensation")) return c;
  Section s = controller.section("compensation");
  c.feed_forward = s.flag("feed_forward");
  c.observer = s.flag("observer");
  c.inertia = s.flag("inertia");
  if (c.inertia && !c.observer) s.fail("inertia", "needs the observer, want 'observer: true'");
  c.mass_update = static_cast<int>(s.integer("mass_update_ticks", 1, 1'000'000));
  c.ramp = s.number("ramp_s", 0.01, 5.0);  // the gate looks at its two ends
  c.jitter = s.number("reading_jitter_s", 0.0, 0.1);
  c.adaptation = s.flag("adaptation");
  if (c.adaptation && !c.observer)
    s.fail("adaptation", "needs the observer, want 'observer: true'");
  c.adaptation_limit = s.number("adaptation_limit", 0.0, 10.0);
  c.forgetting = s.number("forgetting_s", 1.0, 1e6);
  c.aided = s.choice("wrench", {"raw", "aided"}) == "aided";
  if (c.aided && !c.inertia)
    s.fail("wrench", "'aided' needs the robot's inertia taken out, want 'inertia: true'");
  if (s.has("learns_masses")) c.learns_masses = s.flag("learns_masses");
  if (c.learns_masses && !c.aided)
    s.fail("learns_masses", "needs the robot's model beside the sensor, want 'wrench: aided'");
  if (s.has("hand_mass_kg")) c.hand_mass = s.number("hand_mass_kg", 0.0, 1e4);
  if (s.has("hand_center_m")) c.hand_center = s.number("hand_center_m", 0.0, 10.0);
  c.gate = s.number("gate_deviations", 0.0, 100.0);
  c.gate_hold = s.number("gate_hold_s", 0.0, 100.0);
  c.timing_error = s.number("timing_error_s", 0.0, 0.005);
  if (s.has("joint_jerk_rad_or_m_per_s3"))
    c.joint_jerk = s.number("joint_jerk_rad_or_m_per_s3", 1e-3, 1e6);
  c.gain_error = s.number("gain_error", 0.0, 0.5);
  c.mass_error = s.number("mass_error", 0.0, 0.5);
  s.finish();
  return c;
}

/// Off without the key.
Passivity readPassivity(Section& controller) {
  Passivity p;
  if (!controller.has("passivity")) return p;
  Section s = controller.section("passivity");
  p.enabled = s.flag("enabled");
  p.reserve = s.number("reserve_j", 0.0, 1e6);
  p.damping = s.number("damping_per_s", 0.0, 20.0);  // explicit: stable to 2 a period
  s.finish();
  return p;
}

/// Off without the key.
MovingFrameSettings readMovingFrame(Section& controller, const Compensation& compensation) {
  MovingFrameSettings f;
  if (!controller.has("moving_frame")) return f;
  Section s = controller.section("moving_frame");
  f.enabled = s.flag("enabled");
  if (f.enabled && !compensation.aided)
    s.fail("enabled",
           "what the laboratory does to the robot has to be told from what the robot does, "
           "want 'wrench: aided' in controller.compensation");
  f.share = s.number("share", 0.01, 1.0);
  f.acceleration = s.number("acceleration_m_per_s2", 1e-4, 10.0);
  f.angular_acceleration = s.number("acceleration_deg_per_s2", 1e-3, 1e3) * kDegree;
  f.steady_in_contact = s.flag("steady_in_contact");
  s.finish();
  return f;
}

/// Off without the key.
WrenchFilterSettings readWrenchFilter(Section& controller) {
  WrenchFilterSettings f;
  if (!controller.has("wrench_filter")) return f;
  Section s = controller.section("wrench_filter");
  f.dead_band = s.vector("dead_band_n_or_nm", 6, 0.0, 1e6);
  f.low_pass = s.vector("low_pass_hz", 6, 0.0, 1e4);
  s.finish();
  return f;
}

}  // namespace

void readController(Section s, ControllerConfig& c) {
  c.period = s.integer("period_ns", 1'000'000, 1'000'000'000);
  c.gentle.speed = s.number("gentle_speed_m_per_s", 1e-3, 1.0);
  c.gentle.rotation = s.number("gentle_rotation_deg_per_s", 1e-1, 100.0) * kDegree;
  const auto braking = [&](const std::string& kind) -> Braking {
    return {s.number(kind + "_braking_m_per_s2", 1e-3, 100.0),
            s.number(kind + "_rotation_braking_deg_per_s2", 1e-1, 1e4) * kDegree};
  };
  c.gentle.braking = braking("gentle");
  c.stop_braking = braking("stop");
  c.arming_samples = static_cast<int>(s.integer("arming_samples", 1, 10'000));
  c.stability = readStability(s, "stability");
  c.stability_uncompensated = readStability(s, "stability_uncompensated");
  c.stable_for = readStableFor(s, "stable_for_s");
  c.stable_for_uncompensated = readStableFor(s, "stable_for_uncompensated_s");
  if (s.has("most_growth")) c.most_growth = s.number("most_growth", 1.0, 100.0);
  c.tare_ramp = s.number("tare_ramp_s", 0.01, 100.0);
  c.compensation = readCompensation(s);
  c.passivity = readPassivity(s);
  c.moving_frame = readMovingFrame(s, c.compensation);
  c.wrench_filter = readWrenchFilter(s);
  Section still = s.section("still");
  c.stillness.leg_counts = static_cast<int>(still.integer("leg_counts", 0, 1000));
  c.stillness.joint = still.number("joint_rad_or_m", 0.0, 1.0);
  c.stillness.deviation = still.number("deviation_counts", kTiny, 1e4);
  c.stillness.bias = still.number("bias_v", kTiny, 10.0);  // [V] until the sensor is known
  still.finish();
  s.finish();
}

}  // namespace ves
