// SPDX-License-Identifier: BSD-3-Clause
#include "ves/results/series.hpp"
#include "ves/results/tool_motion.hpp"

#include <fmt/compile.h>
#include <fmt/format.h>
#include <fmt/os.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <utility>

#include "ves/base/coordinates.hpp"
#include "ves/transport/channels.hpp"
#include "ves/transport/fields.hpp"

namespace ves {
std::optional<Row> RowMaker::add(const LogEvent& event, const std::string& log) {
  if (event.channel == channel::kState) return add(event.require<state_t>(log));
  if (event.channel == channel::kTruth) {
    add(event.require<truth_t>(log));
  } else if (event.channel == channel::kSample) {
    add(event.require<sample_t>(log));
  } else if (event.channel == channel::kTiming) {
    add(event.require<timing_t>(log));
  }
  return {};
}

void RowMaker::add(const timing_t& timing) {
  if (!row_) return;
  row_->timing = timing;
  row_->has_timing = true;
}

std::optional<Row> RowMaker::add(const state_t& state) {
  Row row;
  row.state = state;
  if (!start_) start_ = state.header.time_ns;
  row.t = static_cast<double>(state.header.time_ns - *start_) * kSecondPerNanosecond;
  const auto take = [&](const auto& from, auto& to, bool& has) {
    const auto* message = from.find(state.sample_sequence);
    has = message != nullptr;
    if (message) to = *message;
  };
  take(truths_, row.truth, row.has_truth);
  take(samples_, row.sample, row.has_sample);
  return std::exchange(row_, row);
}

Series readSeries(const std::string& log) {
  Series series;
  bool configured = false;
  RowMaker rows;
  LogReader reader(log, &series.damage);
  LogEvent event;
  std::optional<Identity> controller;
  std::int64_t tick = -1;
  bool over = false, told = false;
  std::int64_t twice = 0;  // [-] ticks
  while (reader.next(event)) {
    if (event.channel == channel::kState) {
      if (const auto state = event.as<state_t>()) {
        const Identity from{state->header.source, state->header.epoch};
        if (!controller) controller = from;
        const bool same = from.source == controller->source && from.epoch == controller->epoch;
        // In lockstep every controller has the same name, but ticks do not begin anew in a run.
        over = over || (same && state->header.sequence < tick);
        if (!same || over) {
          if (!std::exchange(told, true))
            series.damage.add(fmt::format(
                "{}: byte {}: another controller's run begins here (two logs put together?); its "
                "ticks are left out",
                log, event.offset));
          continue;
        }
        if (state->header.sequence == tick) {  // recorded twice
          ++twice;
          continue;
        }
        tick = state->header.sequence;
      }
    }
    if (event.channel == channel::kExperiment && !configured) {
      const auto message = event.require<experiment_t>(log);
      series.experiment = parseExperiment(message.resolved, log + ":configuration");
      series.version = message.version;
      configured = true;
    }
    try {
      if (const auto row = rows.add(event, log)) series.rows.push_back(*row);
    } catch (const InputError& error) {
      series.damage.add(error.what());
    }
  }
  if (const auto row = rows.finish()) series.rows.push_back(*row);
  if (twice > 0)
    series.damage.add(
        fmt::format("{}: {} ticks stand there twice; each is taken once", log, twice));
  if (series.damage.any() && (!configured || series.rows.empty()))
    throw InputError(series.damage.first());
  if (!configured)
    throw InputError(
        fmt::format("{}: no configuration in this log (channel {})", log, channel::kExperiment));
  return series;
}

namespace {

class SeriesRecorder : public RunRecorder {
 public:
  explicit SeriesRecorder(Series& series) : series_(series) {}
  void begin(const experiment_t& experiment) override { series_.version = experiment.version; }
  void tick(const TickMessages& m, std::int64_t) override {
    rows_.add(m.truth);
    rows_.add(m.sample);
    if (const auto row = rows_.add(m.state)) series_.rows.push_back(*row);
  }
  void order(const operator_t&, std::int64_t) override {}
  void end() {
    if (const auto row = rows_.finish()) series_.rows.push_back(*row);
  }

 private:
  Series& series_;
  RowMaker rows_;
};

}  // namespace

RecordedRun recordLockstep(const Experiment& experiment) {
  RecordedRun out;
  out.series.experiment = experiment;
  SeriesRecorder recorder(out.series);
  out.result = runRecorded(experiment, &recorder, {});
  recorder.end();
  return out;
}

namespace {

/// Every single number of a state that has no column of its own yet.
void addScalars(std::vector<Column>& out) {
  const state_t prototype{};
  forEachField(prototype, [&](const std::string& name, const auto& field) {
    using T = std::remove_cvref_t<decltype(field)>;
    const bool known = std::any_of(out.begin(), out.end(), [&](const Column& c) {
      return c.name == name || c.name == name + "_bits";
    });
    if constexpr (!std::is_array_v<T>) {
      const auto offset =
          reinterpret_cast<const char*>(&field) - reinterpret_cast<const char*>(&prototype);
      if (!known)
        out.push_back({name, [offset](const Row& r) {
                         T value;
                         std::memcpy(&value, reinterpret_cast<const char*>(&r.state) + offset,
                                     sizeof value);
                         return static_cast<double>(value);
                       }});
    }
  });
}

}  // namespace

std::vector<Column> columns(const Experiment& experiment) {
  std::vector<Column> out;
  const auto add = [&](std::string name, auto value) { out.push_back({std::move(name), value}); };
  const auto addPose = [&](const char* what, const char* per, const double(state_t::*field)[6]) {
    for (int i = 0; i < 6; ++i)
      add(fmt::format("{}_{}_{}{}", coordinate(i).name, what, coordinate(i).unit, per),
          [=](const Row& r) { return (r.state.*field)[i]; });
  };
  const auto addWrench = [&](const char* what, const double(state_t::*field)[6]) {
    for (int i = 0; i < 6; ++i)
      add(fmt::format("{}_{}_{}", wrenchComponent(i).name, what, wrenchComponent(i).unit),
          [=](const Row& r) { return (r.state.*field)[i]; });
  };
  const auto addChannels = [&](const char* what, const double(state_t::*field)[6]) {
    for (int i = 0; i < 6; ++i)
      add(fmt::format("{}_{}_count", wrenchComponent(i).name, what),
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
  addPose("commanded", "", &state_t::x);
  addPose("commanded_rate", "_per_s", &state_t::x_dot);
  addPose("commanded_acceleration", "_per_s2", &state_t::x_ddot);
  addPose("desired", "", &state_t::x_desired);
  addPose("measured", "", &state_t::x_measured);
  for (int i = 0; i < 6; ++i)
    add(fmt::format("{}_actual_{}", coordinate(i).name, coordinate(i).unit),
        [=](const Row& r) { return r.hasTruePose() ? r.truth.x[i] : NAN; });
  addWrench("total", &state_t::total);
  addWrench("static", &state_t::static_wrench);
  addWrench("inertial", &state_t::inertial);
  if (experiment.controller.compensation.aided) addWrench("reaction", &state_t::reaction);
  addWrench("dynamic", &state_t::dynamic);
  addLegs("commanded", "m", &state_t::leg);
  addLegs("commanded_rate", "m_per_s", &state_t::leg_dot);
  addLegs("commanded_acceleration", "m_per_s2", &state_t::leg_ddot);
  addLegs("reference", "m", &state_t::reference);
  if (experiment.controller.compensation.adaptation) {
    addLegs("gain_extend", "per_s", &state_t::gain_extend);
    addLegs("gain_retract", "per_s", &state_t::gain_retract);
    addLegs("servo_delay", "s", &state_t::servo_delay);
  }
  addLegs("measured", "m", &state_t::leg_measured);
  for (int i = 0; i < static_cast<int>(experiment.robot.joint_names.size()); ++i)
    add(fmt::format("{}_{}", experiment.robot.joint_names[static_cast<std::size_t>(i)],
                    experiment.controller.payload.robot.jointLink(i).type == JointType::kRevolute
                        ? "rad"
                        : "m"),
        [=](const Row& r) { return r.has_sample ? r.sample.q[i] : NAN; });
  if (experiment.robot.tool()) {
    const auto whole = std::make_shared<const Experiment>(experiment);
    for (int i = 0; i < 6; ++i)
      add(fmt::format("tool_{}_actual_{}", coordinate(i).name, coordinate(i).unit),
          [=](const Row& r) {
            if (!r.hasTruePose()) return static_cast<double>(NAN);
            const JointVector q = JointVector::Map(r.truth.q);
            return coordinateOf(toolPose(*whole, Vec6::Map(r.truth.x), q), i);
          });
  }
  if (experiment.plant.world) {
    const auto truth = [&](const std::string& name, auto value) {
      add(name, [value](const Row& r) { return r.has_truth ? value(r.truth) : NAN; });
    };
    truth("clearance_m", [](const truth_t& m) { return m.clearance; });
    for (int i = 0; i < 6; ++i)
      truth(fmt::format("{}_contact_{}", wrenchComponent(i).name, wrenchComponent(i).unit),
            [i](const truth_t& m) { return m.contact[i]; });
    truth("contacts", [](const truth_t& m) { return static_cast<double>(m.contacts); });
    if (experiment.plant.world->environment.target)
      for (int i = 0; i < 3; ++i) {
        truth(fmt::format("{}_target_m", coordinate(i).name),
              [i](const truth_t& m) { return m.target_p[i]; });
        truth(fmt::format("{}_target_rate_m_per_s", coordinate(i).name),
              [i](const truth_t& m) { return m.target_v[i]; });
      }
  }
  addChannels("bias", &state_t::bias);
  addChannels("deviation", &state_t::deviation);
  addChannels("standard_error", &state_t::standard_error);
  for (int i = 0; i < 6; ++i)
    add(fmt::format("leg{}_command_count", i + 1),
        [=](const Row& r) { return static_cast<double>(r.state.counts[i]); });
  add("temperature_c", [](const Row& r) { return r.has_sample ? r.sample.temperature : NAN; });
  add("tripped_bits", [](const Row& r) { return static_cast<double>(r.state.tripped); });
  add("latched_bits", [](const Row& r) { return static_cast<double>(r.state.latched); });
  addScalars(out);
  add("late_s", [](const Row& r) {
    return r.has_timing ? static_cast<double>(r.timing.late_ns) * kSecondPerNanosecond : NAN;
  });
  add("compute_s", [](const Row& r) {
    return r.has_timing ? static_cast<double>(r.timing.compute_ns) * kSecondPerNanosecond : NAN;
  });
  return out;
}

bool selected(const std::string& name, const std::vector<std::string>& select,
              std::vector<bool>& used) {
  bool take = select.empty() || name == "t_s";
  for (std::size_t i = 0; i < select.size(); ++i)
    if (name.rfind(select[i], 0) == 0) take = used[i] = true;
  return take;
}

std::string csvHeader(const std::vector<Column>& columns) {
  std::string line;
  for (const Column& column : columns) line += (line.empty() ? "" : ",") + column.name;
  return line;
}

std::string csvRow(const std::vector<Column>& columns, const Row& row) {
  std::string line;
  for (const Column& column : columns) {
    if (!line.empty()) line += ',';
    fmt::format_to(std::back_inserter(line), FMT_COMPILE("{}"), column.value(row));
  }
  return line;
}

void writeCsv(const Series& series, const std::vector<Column>& more, const std::string& file) {
  try {
    auto out = fmt::output_file(file);
    std::vector<Column> all = columns(series.experiment);
    all.insert(all.end(), more.begin(), more.end());
    out.print("{}\n", csvHeader(all));
    for (const Row& row : series.rows) out.print("{}\n", csvRow(all, row));
  } catch (const std::system_error& error) {
    throw InputError(fmt::format("{}: cannot be written: {}", file, error.what()));
  }
}

}  // namespace ves
