// SPDX-License-Identifier: BSD-3-Clause
#include "ves/report/series.hpp"

#include <fmt/format.h>
#include <fmt/os.h>

#include <cmath>
#include <deque>
#include <unordered_map>

#include "ves/transport/channels.hpp"
#include "ves/transport/event_log.hpp"

namespace ves {
namespace {

// A tick uses one of the newest samples; older truths can go.
constexpr std::size_t kTruthsKept = 4096;  // [-]

}  // namespace

Series readSeries(const std::string& log) {
  Series series;
  bool configured = false;
  std::unordered_map<std::int64_t, truth_t> truths;  // by sequence of the sample
  std::deque<std::int64_t> order;
  LogReader reader(log);
  LogEvent event;
  while (reader.next(event)) {
    const auto fail = [&](const char* what) {
      throw InputError(fmt::format("{}: byte {}: {}", log, event.offset, what));
    };
    if (event.channel == channel::kExperiment) {
      if (configured) continue;
      const auto message = event.as<experiment_t>();
      if (!message) fail("not an experiment_t of this version");
      series.experiment = parseExperiment(message->resolved, log + ":configuration");
      series.version = message->version;
      configured = true;
    } else if (event.channel == channel::kTruth) {
      const auto truth = event.as<truth_t>();
      if (!truth) fail("not a truth_t of this version");
      truths[truth->header.sequence] = *truth;
      order.push_back(truth->header.sequence);
      if (order.size() > kTruthsKept) {
        truths.erase(order.front());
        order.pop_front();
      }
    } else if (event.channel == channel::kState) {
      const auto state = event.as<state_t>();
      if (!state) fail("not a state_t of this version");
      Row row;
      row.state = *state;
      const auto truth = truths.find(state->sample_sequence);
      row.has_truth = truth != truths.end();
      if (row.has_truth) row.truth = truth->second;
      series.rows.push_back(row);
    } else if (event.channel == channel::kTiming && !series.rows.empty()) {
      const auto timing = event.as<timing_t>();
      if (!timing) fail("not a timing_t of this version");
      series.rows.back().timing = *timing;
      series.rows.back().has_timing = true;
    }
  }
  if (!configured)
    throw InputError(
        fmt::format("{}: no configuration in this log (channel {})", log, channel::kExperiment));
  for (Row& row : series.rows)
    row.t = static_cast<double>(row.state.header.time_ns - series.rows[0].state.header.time_ns) *
            kSecondPerNanosecond;
  return series;
}

std::vector<Column> columns(const Experiment& experiment) {
  static constexpr const char* kCoordinate[] = {"x", "y", "z", "alpha", "beta", "gamma"};
  static constexpr const char* kWrench[] = {"fx", "fy", "fz", "mx", "my", "mz"};
  std::vector<Column> out;
  const auto add = [&](std::string name, auto value) { out.push_back({std::move(name), value}); };
  const auto addPose = [&](const char* what, const char* length, const char* angle,
                           const double(state_t::*field)[6]) {
    for (int i = 0; i < 6; ++i)
      add(fmt::format("{}_{}_{}", kCoordinate[i], what, i < 3 ? length : angle),
          [=](const Row& r) { return (r.state.*field)[i]; });
  };
  const auto addWrench = [&](const char* what, const double(state_t::*field)[6]) {
    for (int i = 0; i < 6; ++i)
      add(fmt::format("{}_{}_{}", kWrench[i], what, i < 3 ? "n" : "nm"),
          [=](const Row& r) { return (r.state.*field)[i]; });
  };
  const auto addLegs = [&](const char* what, const char* unit, const double(state_t::*field)[6]) {
    for (int i = 0; i < 6; ++i)
      add(fmt::format("leg{}_{}_{}", i + 1, what, unit),
          [=](const Row& r) { return (r.state.*field)[i]; });
  };

  add("t_s", [](const Row& r) { return r.t; });
  add("tick", [](const Row& r) { return static_cast<double>(r.state.header.sequence); });
  add("phase", [](const Row& r) { return static_cast<double>(r.state.phase); });
  add("segment", [](const Row& r) { return static_cast<double>(r.state.segment); });
  addPose("commanded", "m", "rad", &state_t::x);
  addPose("commanded_rate", "m_per_s", "rad_per_s", &state_t::x_dot);
  addPose("commanded_acceleration", "m_per_s2", "rad_per_s2", &state_t::x_ddot);
  addPose("due", "m", "rad", &state_t::x_due);
  addPose("measured", "m", "rad", &state_t::x_measured);
  for (int i = 0; i < 6; ++i)
    add(fmt::format("{}_actual_{}", kCoordinate[i], i < 3 ? "m" : "rad"),
        [=](const Row& r) { return r.has_truth ? r.truth.x[i] : NAN; });
  addWrench("total", &state_t::total);
  addWrench("static", &state_t::fixed);
  addWrench("dynamic", &state_t::dynamic);
  addLegs("commanded", "m", &state_t::leg);
  addLegs("commanded_rate", "m_per_s", &state_t::leg_dot);
  addLegs("commanded_acceleration", "m_per_s2", &state_t::leg_ddot);
  addLegs("measured", "m", &state_t::leg_measured);
  for (int i = 0; i < static_cast<int>(experiment.joint_names.size()); ++i)
    add(fmt::format(
            "{}_{}", experiment.joint_names[static_cast<std::size_t>(i)],
            experiment.controller.payload.robot.link(i).type == JointType::kRevolute ? "rad" : "m"),
        [=](const Row& r) { return r.has_truth ? r.truth.q[i] : NAN; });
  add("tripped_bits", [](const Row& r) { return static_cast<double>(r.state.tripped); });
  add("latched_bits", [](const Row& r) { return static_cast<double>(r.state.latched); });
  add("sample_sequence", [](const Row& r) { return static_cast<double>(r.state.sample_sequence); });
  add("late_s", [](const Row& r) {
    return r.has_timing ? static_cast<double>(r.timing.late_ns) * kSecondPerNanosecond : NAN;
  });
  add("compute_s", [](const Row& r) {
    return r.has_timing ? static_cast<double>(r.timing.compute_ns) * kSecondPerNanosecond : NAN;
  });
  return out;
}

void writeCsv(const Series& series, const std::string& file) {
  try {
    auto out = fmt::output_file(file);
    const std::vector<Column> all = columns(series.experiment);
    for (std::size_t i = 0; i < all.size(); ++i) out.print("{}{}", i ? "," : "", all[i].name);
    out.print("\n");
    for (const Row& row : series.rows) {
      for (std::size_t i = 0; i < all.size(); ++i)
        out.print("{}{}", i ? "," : "", all[i].value(row));
      out.print("\n");
    }
  } catch (const std::system_error& error) {
    throw InputError(fmt::format("{}: cannot be written: {}", file, error.what()));
  }
}

}  // namespace ves
