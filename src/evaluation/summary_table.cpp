// SPDX-License-Identifier: BSD-3-Clause
//
// The summary as a person reads it.
#include <fmt/format.h>

#include "ves/core/coordinates.hpp"
#include "ves/evaluation/contact_pairs.hpp"
#include "ves/evaluation/summary.hpp"

namespace ves {

std::string table(const nlohmann::ordered_json& s) {
  const auto number = [&](const std::string& key) {
    return s.contains(key) ? s[key].get<double>() : NAN;
  };
  std::string out = fmt::format("{}\n\n", s["description"].get<std::string>());
  out += fmt::format("  ended {} after {:.2f} s ({} ticks), {:.4g} x real time, {} substitutes\n",
                     s["ended"].get<std::string>(), number("simulated_s"),
                     s["ticks"].get<std::int64_t>(), number("real_time_factor"),
                     s["substitute_values"].get<int>());
  if (const std::string why = s.value("ended_early", ""); !why.empty())
    out += fmt::format("  ended early: {}\n", why);
  if (s["messages_lost"].get<std::int64_t>() > 0)
    out += fmt::format("  {} messages were lost (machine too busy?): the log has holes\n",
                       s["messages_lost"].get<std::int64_t>());
  if (s["log_events_lost"].get<std::int64_t>() > 0)
    out += fmt::format("  {}: {} events of the log lost\n", s["log_trouble"].get<std::string>(),
                       s["log_events_lost"].get<std::int64_t>());
  if (s["messages_malformed"].get<std::int64_t>() > 0)
    out += fmt::format("  {} malformed messages on the bus, not recorded\n",
                       s["messages_malformed"].get<std::int64_t>());
  std::string cause = s["first_cause"].get<std::string>();
  if (const std::string why = s.value("first_cause_evidence", ""); !why.empty())
    cause += fmt::format(" ({})", why);
  if (s["ended"] == name(Phase::kDisarmed) && s.value("arming_was_asked", true))
    out += fmt::format("  never armed: {}\n", s["first_cause"] == name(Check::kCount)
                                                  ? "no stream of new samples long enough"
                                                  : cause);
  if (!s["trips"].empty())
    out += fmt::format("  stopped in tick {} by: {}\n", s["first_cause_tick"].get<std::int64_t>(),
                       cause);
  if (const std::string rejected = s.value("samples_rejected", ""); !rejected.empty())
    out += fmt::format("  {}\n", rejected);
  if (s.contains("emulation_not_compared"))
    out += fmt::format("  emulation not compared with the base in free space: {}\n",
                       s["emulation_not_compared"].get<std::string>());
  if (s.contains("emulation_error_rms_m")) {
    const auto share = [&](const char* key) {
      return s.contains(key) ? fmt::format(" ({:.3g} %)", 100.0 * number(key)) : "";
    };
    out += fmt::format(
        "  emulation off by {:.3f} mm{} and {:.4f} deg{} rms,\n"
        "           at most {:.3f} mm and {:.4f} deg: beside the robot on its base in\n"
        "           free space, which {} {:.3f} mm and {:.4f} deg from rest\n",
        number("emulation_error_rms_m") * 1e3, share("emulation_error_position_share"),
        number("emulation_error_rms_rad") / kDegree, share("emulation_error_attitude_share"),
        number("emulation_error_max_m") * 1e3, number("emulation_error_max_rad") / kDegree,
        s.contains("flown_m") ? "is shown to go" : "goes", number("emulation_amplitude_m") * 1e3,
        number("emulation_amplitude_rad") / kDegree);
    if (s.contains("flown_m"))
      out += fmt::format("           The laboratory flew along: {:.2f} m and {:.2f} turns\n",
                         number("flown_m"), number("turned_rad") / (2.0 * M_PI));
    if (s.contains("emulation_advice"))
      out += fmt::format("           WARNING: more than 20 % off. Likeliest:\n           {}\n",
                         s["emulation_advice"].get<std::string>());
  }
  bool head = false;
  for (int i = 0; i < 6; ++i) {
    const std::string c(coordinate(i).name), unit(coordinate(i).unit);
    if (!s.contains(c + "_error_rms_" + unit)) continue;
    if (!std::exchange(head, true))
      out += fmt::format(
          "\n  where trajectories or admittance control run:\n"
          "  {:<8}{:>16}{:>16}{:>16}{:>10}\n",
          "", "moved", "error, peak", "error, rms", "lag");
    const double scale = coordinate(i).shown;
    const std::string_view shown = coordinate(i).shown_unit;
    const auto cell = [&](const std::string& what) {
      return fmt::format("{:.3f} {:<3}", number(c + what + unit) * scale, shown);
    };
    // A coordinate that is only held somewhere else has no rate to lag behind.
    const double lag = number(c + "_lag_s");
    out += fmt::format("  {:<8}{:>16}{:>16}{:>16}{:>10}\n", c, cell("_peak_to_peak_"),
                       cell("_error_max_"), cell("_error_rms_"),
                       std::isnan(lag) ? "-" : fmt::format("{:.1f} ms", lag * 1e3));
  }
  if (s.contains("z_error_max_extending_m"))
    out += fmt::format("  z error  {:.1f} mm extending, {:.1f} mm retracting\n",
                       number("z_error_max_extending_m") * 1e3,
                       number("z_error_max_retracting_m") * 1e3);
  if (s.contains("tool_error_rms_m"))
    out += fmt::format(
        "  tool     carried {:.3f} mm off by the base ({:.3f} rms); off by {:.3f} mm rms, {:.3f} "
        "mm at most\n",
        number("tool_displacement_max_m") * 1e3, number("tool_displacement_rms_m") * 1e3,
        number("tool_error_rms_m") * 1e3, number("tool_error_max_m") * 1e3);
  if (s.contains("tracking_delay_s"))
    out += fmt::format(
        "  tracking {} late by {:.1f} ms; rms {:.2f} %, amplitude {:.4f}, phase {:.2f} deg (PAEI; "
        "by frequencies {:.4f}, {:.2f} deg)\n",
        s["tracking_coordinate"].get<std::string>(), number("tracking_delay_s") * 1e3,
        number("tracking_rms") * 100.0, number("tracking_paei_amplitude"),
        number("tracking_paei_phase_rad") / kDegree, number("tracking_fdb_amplitude"),
        number("tracking_fdb_phase_rad") / kDegree);
  if (s.contains("contacts")) out += contactTable(s);
  if (s.contains("energy_put_in_j"))
    out += fmt::format("  energy   the emulation has put in {:+.3f} mJ, {:.3f} at most{}\n",
                       number("energy_put_in_j") * 1e3, number("energy_put_in_max_j") * 1e3,
                       s.contains("energy_paid_j")
                           ? fmt::format("; {:.3f} mJ damped away", number("energy_paid_j") * 1e3)
                           : "");
  for (const char* when : {"still", "moving"}) {
    const std::string force = fmt::format("dynamic_force_max_{}_n", when);
    if (s.contains(force))
      out +=
          fmt::format("  wrench without gravity, platform {:<7} at most {:8.3f} N, {:8.3f} N m\n",
                      when, number(force), number(fmt::format("dynamic_moment_max_{}_nm", when)));
  }
  if (s.contains("drift_samples")) {
    out += fmt::format("\n  {:<8}{:>16}{:>16}{:>16}{:>24}\n", "drift", "peak to peak", "after 3 h",
                       "after 4 h", "temperature correlation");
    for (int i = 0; i < 6; ++i) {
      const std::string w(wrenchComponent(i).name), unit(wrenchComponent(i).unit);
      const auto cell = [&](const char* what) {
        return fmt::format("{:.3f} {:<3}", number(w + what + unit), wrenchComponent(i).shown_unit);
      };
      out += fmt::format("  {:<8}{:>16}{:>16}{:>16}{:>24.3f}\n", w, cell("_drift_peak_to_peak_"),
                         cell("_drift_after_3h_max_"), cell("_drift_after_4h_max_"),
                         number(w + "_drift_temperature_correlation"));
    }
  }
  if (s.contains("wake_up_late_median_s")) {
    out += fmt::format(
        "  timing   woke {:.0f} us late (p99 {:.0f}, max {:.0f}), computed {:.0f} us (p99 {:.0f}), "
        "sample {:.1f} ms old\n",
        number("wake_up_late_median_s") * 1e6, number("wake_up_late_p99_s") * 1e6,
        number("wake_up_late_max_s") * 1e6, number("tick_compute_median_s") * 1e6,
        number("tick_compute_p99_s") * 1e6, number("sample_age_median_s") * 1e3);
    constexpr double kAlike = 1e-4;  // [s]
    const double age = number("sample_age_median_s");
    bool apart = false;
    for (const char* piece : {"legs", "wrench", "joints"})
      apart = apart || std::abs(number(piece + std::string("_age_median_s")) - age) > kAlike;
    if (apart)
      out += fmt::format("           legs {:.1f} ms old, wrench {:.1f}, joints {:.1f}\n",
                         number("legs_age_median_s") * 1e3, number("wrench_age_median_s") * 1e3,
                         number("joints_age_median_s") * 1e3);
    if (s.contains("clock_offset_s") && number("clock_offset_s") != 0.0)
      out += fmt::format("           the machine's clock is {:.6f} s ahead of ours, +-{:.2f} ms\n",
                         number("clock_offset_s"), number("clock_uncertainty_s") * 1e3);
    const auto missed = s["ticks_missed"].get<std::int64_t>();
    out += missed == 0 ? "           no tick missed\n"
                       : fmt::format(
                             "           {} ticks missed: {} woken late for, {} after one "
                             "that ran long\n",
                             missed, s["ticks_missed_woke_late"].get<std::int64_t>(),
                             s["ticks_missed_ran_long"].get<std::int64_t>());
  }
  return out;
}

}  // namespace ves
