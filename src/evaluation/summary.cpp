// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <utility>

#include "ves/core/coordinates.hpp"
#include "ves/evaluation/contact_pairs.hpp"
#include "ves/evaluation/drift_samples.hpp"
#include "ves/evaluation/evidence.hpp"
#include "ves/evaluation/indicators.hpp"
#include "ves/evaluation/tool_motion.hpp"
#include "ves/realtime/latency.hpp"

namespace ves {
namespace {

constexpr double kStill = 0.5;   // [s] without commanded motion: the sensor's filter has settled
constexpr double kMoved = 1e-6;  // [m | rad] least range of a coordinate that counts as moving

bool running(const Row& row) { return row.state.phase == static_cast<int>(Phase::kRunning); }

SegmentKind kindOf(const Row& row) { return static_cast<SegmentKind>(row.state.kind); }

/// Trajectory and admittance segments: what the experiment is about.
bool measured(const Row& row) {
  const SegmentKind kind = kindOf(row);
  return running(row) && row.hasTruePose() &&
         (kind == SegmentKind::kTrajectory || kind == SegmentKind::kAdmittance ||
          kind == SegmentKind::kPath);
}

struct Tracking {
  double low = HUGE_VAL, high = -HUGE_VAL;  // of where it should be
  double rising = 0.0, falling = 0.0;       // largest error with the rate positive, negative
  double peak = 0.0;                        // and at all
  double sum_e2 = 0.0, sum_ev = 0.0, sum_v2 = 0.0;
  std::int64_t n = 0;

  void add(double due, double actual, double rate) {
    const double e = due - actual;
    low = std::min(low, due);
    high = std::max(high, due);
    peak = std::max(peak, std::abs(e));
    if (rate > 0.0) rising = std::max(rising, std::abs(e));
    if (rate < 0.0) falling = std::max(falling, std::abs(e));
    sum_e2 += e * e;
    sum_ev += e * rate;
    sum_v2 += rate * rate;
    ++n;
  }
  double rms() const { return std::sqrt(sum_e2 / static_cast<double>(n)); }
  /// The delay that explains most of the error: e = lag * rate, least squares.
  double lag() const { return sum_ev / sum_v2; }
};

void addTracking(const Series& series, nlohmann::ordered_json& out) {
  Tracking tracking[6];
  for (const Row& row : series.rows)
    if (measured(row))
      for (int i = 0; i < 6; ++i)
        tracking[i].add(row.state.x_desired[i], row.truth.x[i], row.state.x_dot[i]);
  for (int i = 0; i < 6; ++i) {
    const Tracking& t = tracking[i];
    if (!(t.high - t.low > kMoved)) continue;
    const std::string name(coordinate(i).name), unit(coordinate(i).unit);
    out[fmt::format("{}_peak_to_peak_{}", name, unit)] = t.high - t.low;
    out[fmt::format("{}_error_max_{}", name, unit)] = t.peak;
    if (i == 2) {  // all legs extend, or retract, together
      out["z_error_max_extending_m"] = t.rising;
      out["z_error_max_retracting_m"] = t.falling;
    }
    out[fmt::format("{}_error_rms_{}", name, unit)] = t.rms();
    if (t.sum_v2 > 0.0) out[name + "_lag_s"] = t.lag();
  }
}

/// Of the coordinate that moves most, an angle counted at the joints' radius.
void addIndicators(const Series& series, nlohmann::ordered_json& out) {
  const double radius = jointRadius(series.experiment.controller.geometry);
  std::vector<TrackedMotion> segments[6];
  const Row* before = nullptr;
  Vec6 low = Vec6::Constant(HUGE_VAL), high = -low;
  for (const Row& row : series.rows) {
    if (!measured(row)) continue;
    const bool goes_on = before && before->state.segment == row.state.segment &&
                         before->state.header.sequence + 1 == row.state.header.sequence;
    before = &row;
    low = low.cwiseMin(Vec6::Map(row.state.x_desired));
    high = high.cwiseMax(Vec6::Map(row.state.x_desired));
    for (int i = 0; i < 6; ++i) {
      if (!goes_on) segments[i].emplace_back();
      segments[i].back().u.push_back(row.state.x_desired[i]);
      segments[i].back().y.push_back(row.truth.x[i]);
    }
  }
  Vec6 range = high - low;
  range.tail<3>() *= radius;
  int most = 0;
  if (!(range.maxCoeff(&most) > kMoved)) return;
  const TrackingIndicators t =
      trackingIndicators(std::move(segments[most]), series.experiment.controller.periodSeconds());
  if (t.points == 0) return;
  out["tracking_coordinate"] = coordinate(most).name;
  out["tracking_delay_s"] = t.delay;
  out["tracking_rms"] = t.rms;
  out["tracking_paei_amplitude"] = t.paei_amplitude;
  out["tracking_paei_phase_rad"] = t.paei_phase;
  out["tracking_fdb_amplitude"] = t.fdb_amplitude;
  out["tracking_fdb_phase_rad"] = t.fdb_phase;
  out["tracking_fdb_delay_s"] = t.fdb_delay;
}

/// What gravity compensation leaves, once a calibration has been made.
void addWrench(const Series& series, nlohmann::ordered_json& out) {
  struct Largest {
    double force = 0.0, moment = 0.0;
    bool any = false;
    void add(const double (&w)[6]) {
      force = std::max(force, std::hypot(w[0], w[1], w[2]));
      moment = std::max(moment, std::hypot(w[3], w[4], w[5]));
      any = true;
    }
  } still, moving;
  bool calibrated = false;
  double still_since = HUGE_VAL;
  for (const Row& row : series.rows) {
    if (!Vec6::Map(row.state.x_dot).isZero(0.0) || still_since == HUGE_VAL) still_since = row.t;
    if (!running(row)) continue;
    if (kindOf(row) == SegmentKind::kCalibration) {
      calibrated = true;
      continue;
    }
    if (!calibrated) continue;
    (row.t - still_since > kStill ? still : moving).add(row.state.dynamic);
  }
  const auto write = [&](const char* name, const Largest& l) {
    if (!l.any) return;
    out[fmt::format("dynamic_force_max_{}_n", name)] = l.force;
    out[fmt::format("dynamic_moment_max_{}_nm", name)] = l.moment;
  };
  write("still", still);
  write("moving", moving);
}

/// 4.1.2: how far the sensor drifts, with what, and how much of it a calibration leaves after
/// hours.
void addDrift(const Series& series, nlohmann::ordered_json& out) {
  const std::vector<DriftSample> all = driftSamples(series);
  if (all.size() < 3) return;
  out["drift_samples"] = all.size();
  const auto correlation = [&](int i) {
    Eigen::ArrayX2d both(all.size(), 2);
    for (std::size_t n = 0; n < all.size(); ++n)
      both.row(static_cast<Eigen::Index>(n)) << all[n].wrench(i), all[n].temperature;
    both.rowwise() -= both.colwise().mean().eval();
    const Eigen::VectorXd wrench = both.col(0), temperature = both.col(1);
    return wrench.dot(temperature) / (wrench.norm() * temperature.norm());
  };
  const auto residual = [&](int i, double hours) {
    double most = 0.0;
    for (const DriftSample& a : all)
      for (const DriftSample& b : all)
        if (std::abs(b.t - a.t - 3600.0 * hours) < 60.0)
          most = std::max(most, std::abs(b.wrench(i) - a.wrench(i)));
    return most;
  };
  for (int i = 0; i < 6; ++i) {
    const auto [low, high] = std::minmax_element(
        all.begin(), all.end(),
        [i](const DriftSample& a, const DriftSample& b) { return a.wrench(i) < b.wrench(i); });
    const std::string name = std::string(wrenchComponent(i).name) + "_drift_";
    const std::string unit(wrenchComponent(i).unit);
    out[name + "peak_to_peak_" + unit] = high->wrench(i) - low->wrench(i);
    out[name + "after_3h_max_" + unit] = residual(i, 3.0);
    out[name + "after_4h_max_" + unit] = residual(i, 4.0);
    out[name + "temperature_correlation"] = correlation(i);
  }
}

/// What makes an emulation differ from its base, the likeliest first, and what is to be done.
std::string adviceOf(const Experiment& e) {
  const ControllerConfig& c = e.controller;
  if (c.wrench_filter.any())
    return "the dead band or low-pass of controller.wrench_filter (docs/compensation.md)";
  if (!c.compensation.feed_forward || !c.compensation.observer || !c.compensation.inertia)
    return "the servos' lag and the robot's inertia, which are not taken out; set feed_forward, "
           "observer and inertia of controller.compensation (docs/compensation.md)";
  if (!c.compensation.aided)
    return "the sensor's noise (controller.compensation.wrench=aided, docs/compensation.md), or a "
           "mass "
           "that is not as believed (--masses FILE, docs/identification.md)";
  if (e.plant.task.world)
    return "the sensor's noise while something is touched or held, which no model takes out "
           "(docs/vehicles.md), or a mass or a load that is not as believed (--masses FILE, "
           "docs/identification.md)";
  return "a mass or a load that is not as believed (--masses FILE, docs/identification.md)";
}

/// How far a vehicle was from where it was let go, and how much it turned, whichever way.
void addFlight(const Series& series, nlohmann::ordered_json& out) {
  std::optional<Transform> first, last;
  double turned = 0.0;
  eachTick(series, [&](const Row& row, double) {
    const Transform X_EP = emulatedPose(row.state);
    if (!first) first = X_EP;
    if (last) turned += rotationVector(X_EP.R * last->R.transpose()).norm();
    last = X_EP;
  });
  if (!last) return;
  out["flown_m"] = (last->p - first->p).norm();
  out["turned_rad"] = turned;
}

/// How far the platform was from the robot on its base in free space.
void addEmulation(const Series& series, const std::optional<Emulation>& e,
                  nlohmann::ordered_json& out) {
  if (!e) {
    if (const std::string why = letGoOf(series).whyNotCompared(); !why.empty())
      out["emulation_not_compared"] = why;
    return;
  }
  const Distance error = distance(e->platform, e->base), moved = travel(e->base);
  const Amplitude most = amplitude(series.experiment, e->base);
  const bool flies = series.experiment.controller.moving_frame.enabled;
  const auto share = [&](const char* key, double rms, double of) {
    if (of > kMoved && !flies) out[key] = rms / of;  // of what is only shown of a flight
  };
  if (flies) addFlight(series, out);
  out["emulation_amplitude_m"] = most.position;
  out["emulation_amplitude_rad"] = most.attitude;
  share("emulation_error_position_share", error.rms_position, most.position);
  share("emulation_error_attitude_share", error.rms_attitude, most.attitude);
  out["emulation_travel_m"] = moved.peak_position;
  out["emulation_error_rms_m"] = error.rms_position;
  out["emulation_error_max_m"] = error.peak_position;
  out["emulation_travel_rad"] = moved.peak_attitude;
  out["emulation_error_rms_rad"] = error.rms_attitude;
  out["emulation_error_max_rad"] = error.peak_attitude;
  const double off = std::max(out.value("emulation_error_position_share", 0.0),
                              out.value("emulation_error_attitude_share", 0.0));
  constexpr double kFarOff = 0.2;  // [-] of the amplitude
  if (off > kFarOff) out["emulation_advice"] = adviceOf(series.experiment);
  const std::optional<ToolMotion> tool = toolMotion(series, e);
  if (!tool) return;
  const ToolDistance carried = distance(tool->actual, tool->at_rest),
                     missed = distance(tool->actual, tool->on_base);
  out["tool_displacement_rms_m"] = carried.rms;
  out["tool_displacement_max_m"] = carried.peak;
  out["tool_error_rms_m"] = missed.rms;
  out["tool_error_max_m"] = missed.peak;
}

/// Of a real-time run: the medians and tails of its times, their histograms, and the missed ticks.
void addTiming(const Series& series, nlohmann::ordered_json& out) {
  const timing_t* last = nullptr;
  for (const Row& row : series.rows)
    if (row.has_timing) last = &row.timing;
  if (!last) return;
  const auto write = [&](const std::string& name, std::int64_t timing_t::*value) {
    std::vector<double> all;
    for (const Row& row : series.rows)
      if (row.has_timing)
        all.push_back(static_cast<double>(row.timing.*value) * kSecondPerNanosecond);
    const Latency latency = latencyOf(all);
    out[name + "_median_s"] = latency.median;
    out[name + "_p99_s"] = latency.p99;
    out[name + "_max_s"] = latency.max;
  };
  write("wake_up_late", &timing_t::late_ns);
  write("tick_compute", &timing_t::compute_ns);
  write("stage_receive", &timing_t::receive_ns);
  write("stage_tick", &timing_t::tick_ns);
  write("stage_send", &timing_t::send_ns);
  write("stage_tell", &timing_t::tell_ns);
  write("sample_age", &timing_t::sample_age_ns);
  write("legs_age", &timing_t::legs_age_ns);
  write("wrench_age", &timing_t::wrench_age_ns);
  write("joints_age", &timing_t::joints_age_ns);
  write("sample_to_command", &timing_t::sample_to_command_ns);
  if (last->clock_uncertainty_ns >= 0) {
    out["clock_offset_s"] = static_cast<double>(last->clock_offset_ns) * kSecondPerNanosecond;
    out["clock_uncertainty_s"] =
        static_cast<double>(last->clock_uncertainty_ns) * kSecondPerNanosecond;
  }
  // Counts below 1, 2, 4, .. us, the last bin everything beyond.
  out["wake_up_late_histogram"] = last->late;
  out["tick_compute_histogram"] = last->compute;
  out["sample_age_histogram"] = last->sample_age;
  out["sample_to_command_histogram"] = last->sample_to_command;
  out["ticks_missed"] = last->missed;
  out["ticks_missed_woke_late"] = last->missed_woke_late;
  out["ticks_missed_ran_long"] = last->missed_ran_long;
  out["samples_rejected"] = Rejections{last->samples_malformed, last->samples_out_of_range,
                                       last->samples_of_another, last->samples_old}
                                .text();
  out["messages_ignored"] = Refused{last->messages_forged, last->messages_replayed}.text();
}

}  // namespace

nlohmann::ordered_json summarise(const Series& series, const RunResult& result) {
  ReferenceMotions references;
  return summarise(series, result, references);
}

nlohmann::ordered_json summarise(const Series& series, const RunResult& result,
                                 ReferenceMotions& references) {
  nlohmann::ordered_json out;
  out["scenario"] = series.experiment.name;
  out["description"] = series.experiment.description;
  out["configuration_hash"] = series.experiment.source.hash();
  out["seed"] = series.experiment.plant.seed;
  out["version"] = series.version;
  out["substitute_values"] = series.experiment.source.substitutes;
  out["ended"] = name(result.phase);
  out["trips"] = nlohmann::ordered_json::array();
  if (!series.rows.empty()) {
    const Tripped latched(static_cast<std::uint32_t>(series.rows.back().state.latched));
    latched.forEach([&](Check check) { out["trips"].push_back(name(check)); });
  }
  if (const std::string why = whyEarly(series); !why.empty()) out["ended_early"] = why;
  if (result.phase == Phase::kDisarmed)
    out["arming_was_asked"] =
        std::any_of(series.rows.begin(), series.rows.end(), [](const Row& row) {
          const auto request = static_cast<Request>(row.state.request);
          return request == Request::kArm || request == Request::kStart;
        });
  out["first_cause"] = name(result.cause);
  out["first_cause_tick"] = result.cause_tick;
  for (const Row& row : series.rows)
    if (row.state.header.sequence == result.cause_tick ||
        (result.phase == Phase::kDisarmed && &row == &series.rows.back()))
      out["first_cause_evidence"] = evidence(result.cause, row, series.experiment);
  out["ticks"] = result.ticks;
  out["simulated_s"] = result.simulated;
  out["wall_s"] = result.wall;
  out["messages_lost"] = result.lost;
  out["messages_malformed"] = result.malformed;
  out["log_events_lost"] = result.log_lost;
  out["log_trouble"] = result.log_trouble;
  out["real_time_factor"] = result.wall > 0.0 ? result.simulated / result.wall : 0.0;
  addTracking(series, out);
  addIndicators(series, out);
  const std::optional<Emulation> e = emulation(series, references);
  addEmulation(series, e, out);
  addContacts(series, e, out);
  addEnergy(series, out);
  addWrench(series, out);
  addDrift(series, out);
  addTiming(series, out);
  return out;
}

void writeSummary(const nlohmann::ordered_json& summary, const std::string& file) {
  std::ofstream out(file);
  out << summary.dump(2) << "\n";
  out.flush();
  if (!out) throw InputError(file + ": cannot be written");
}

}  // namespace ves
