// SPDX-License-Identifier: BSD-3-Clause
#include "ves/series/series.hpp"

#include <fmt/compile.h>
#include <fmt/format.h>
#include <fmt/os.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

#include "ves/bus/channels.hpp"
#include "ves/bus/fields.hpp"
#include "ves/bus/ordered_log.hpp"
#include "ves/contract/schema.hpp"
#include "ves/core/build.hpp"
#include "ves/core/coordinates.hpp"

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

Series readSeries(const std::string& log, const Experiment* without) {
  Series series;
  bool configured = false;
  RowMaker rows;
  OrderedLog reader(log, &series.damage);
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
      if (auto row = rows.add(event, log)) series.rows.push_back(std::move(*row));
    } catch (const InputError& error) {
      series.damage.add(error.what());
    }
  }
  if (auto row = rows.finish()) series.rows.push_back(std::move(*row));
  if (!configured && without) {
    series.experiment = *without;
    configured = true;
  }
  if (twice > 0 || reader.repeated() > 0)
    series.damage.add(fmt::format("{}: {} events stand there twice; each is taken once", log,
                                  twice + reader.repeated()));
  if (series.damage.any() && (!configured || series.rows.empty()))
    throw InputError(series.damage.first());
  if (!configured)
    throw InputError(
        fmt::format("{}: no configuration in this log (channel {}); --scenario names one", log,
                    channel::kExperiment));
  return series;
}

namespace {

class SeriesRecorder : public RunRecorder {
 public:
  explicit SeriesRecorder(Series& series) : series_(series) {}
  void begin(const Experiment&, const Identity&) override {
    constexpr std::size_t kRows = 4096;  // [-] of which most runs have fewer: nothing is moved
    series_.version = describeBuild();
    series_.rows.reserve(kRows);
  }
  void tick(const TickMessages& m, std::int64_t) override {
    rows_.add(m.truth);
    rows_.add(m.sample);
    if (auto row = rows_.add(m.state)) series_.rows.push_back(std::move(*row));
  }
  void order(const operator_t&, std::int64_t) override {}
  void end() {
    if (auto row = rows_.finish()) series_.rows.push_back(std::move(*row));
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

std::vector<LearntBody> learntBodies(const Experiment& experiment) {
  const ControllerConfig& c = experiment.controller;
  const MassRegressor regressor(c.payload.robot, c.hand);
  std::vector<LearntBody> out;
  for (const int link : regressor.links())
    out.push_back({fmt::format("link_{}", link + 1), c.payload.robot.bodyOf(link).mass});
  if (regressor.hand() >= 0) out.back() = {"hand", 0.0};
  return out;
}

namespace {

/// "m/s^2" as names of columns end: "m_per_s2".
std::string ending(std::string_view unit) {
  std::string out;
  for (std::size_t i = 0; i < unit.size(); ++i) {
    if (unit[i] == '/')
      out += out.empty() || out == "1" ? "per_" : "_per_";
    else if (unit[i] != '^' && unit[i] != ' ')
      out += unit[i];
  }
  if (out.starts_with("1per_")) out.erase(0, 1);
  std::transform(out.begin(), out.end(), out.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return out;
}

/// What a value of a list is called, and its unit: "x", "m" of "m, rad".
std::pair<std::string, std::string> part(schema::Along along, std::string_view unit, int i,
                                         const std::vector<LearntBody>& bodies) {
  const std::size_t comma = unit.find(", ");
  const std::string_view own = comma == std::string_view::npos ? unit
                               : i < 3                         ? unit.substr(0, comma)
                                                               : unit.substr(comma + 2);
  using enum schema::Along;
  switch (along) {
    case kCoordinates: return {std::string(coordinate(i).name), ending(own)};
    case kWrench:
    case kChannels: return {std::string(wrenchComponent(i).name), ending(own)};
    case kBodies: return {bodies[static_cast<std::size_t>(i)].name, ending(unit)};
    case kBodyAxes:
      return {fmt::format("{}_{}", bodies[static_cast<std::size_t>(i / 3)].name, "xyz"[i % 3]),
              ending(unit)};
    case kAxes: return {std::string(1, "xyz"[i]), ending(unit)};
    case kThrusters: return {fmt::format("thruster_{}", i), ending(unit)};
    case kTurn: return {fmt::format("r{}{}", i / 3 + 1, i % 3 + 1), ""};
    default: return {fmt::format("leg{}", i + 1), ending(own)};
  }
}

/// Every field of a state: a column a number, enumerations and sets by their names.
void addState(const Experiment& e, std::vector<Column>& out) {
  const Propulsion propulsion = propulsionOf(e.controller.vehicle);
  const std::set<std::string_view> hidden = [&] {
    std::set<std::string_view> h;
    if (!e.controller.compensation.aided) h.insert("reaction");
    if (!e.controller.compensation.adaptation)
      h.insert({"gain_extend", "gain_retract", "servo_delay"});
    if (!e.controller.compensation.learns_masses)
      h.insert(
          {"learnt_mass", "learnt_mass_deviation", "learnt_moment", "learnt_moment_deviation"});
    if (!propulsion.any()) h.insert({"vehicle_time", "thrust_left", "thrusters_on"});
    if (!e.controller.moving_frame.enabled)
      h.insert({"laboratory_time_ns", "laboratory_p", "laboratory_R", "laboratory_v",
                "laboratory_w", "laboratory_a", "laboratory_alpha"});
    return h;
  }();
  const std::vector<LearntBody> bodies = learntBodies(e);
  const TickState described{};
  const state_t prototype{};
  forEachPair(described, prototype, [&](const auto& field, const auto& in_message) {
    using V = std::remove_cvref_t<decltype(field.value)>;
    using M = std::remove_cvref_t<decltype(in_message)>;
    const std::ptrdiff_t offset =
        reinterpret_cast<const char*>(&in_message) - reinterpret_cast<const char*>(&prototype);
    const auto read = [offset](const Row& r) -> const M& {
      return *reinterpret_cast<const M*>(reinterpret_cast<const char*>(&r.state) + offset);
    };
    if (hidden.contains(field.name)) return;
    if constexpr (std::is_array_v<M>) {
      const bool of_bodies = field.along == schema::Along::kBodies;
      const int size =
          of_bodies                                  ? static_cast<int>(bodies.size())
          : field.along == schema::Along::kBodyAxes  ? 3 * static_cast<int>(bodies.size())
          : field.along == schema::Along::kThrusters ? propulsion.size
                                                     : static_cast<int>(std::extent_v<M>);
      for (int i = 0; i < size; ++i) {
        const auto [name, unit] = part(field.along, field.unit, i, bodies);
        out.push_back({fmt::format("{}_{}{}{}", name, field.column, unit.empty() ? "" : "_", unit),
                       [=](const Row& r) { return static_cast<double>(read(r)[i]); },
                       field.meaning,
                       {}});
      }
    } else {
      std::string name = field.name;
      // Of some units the name says enough: "ahead_ns"; of some numbers there is none, or several.
      const std::string unit = ending(field.unit);
      const bool has_none = unit == "-" || unit.find('|') != std::string::npos;
      if (!has_none && !name.ends_with("_" + unit)) name += "_" + unit;
      Column column{
          name, [=](const Row& r) { return static_cast<double>(read(r)); }, field.meaning, {}};
      if constexpr (std::is_enum_v<V>)
        column.text = [=](const Row& r) { return std::string(ves::name(static_cast<V>(read(r)))); };
      if constexpr (std::same_as<V, Tripped>)
        column.text = [=](const Row& r) {
          const std::string set = names(Tripped(static_cast<std::uint32_t>(read(r))), "+");
          return set.empty() ? "-" : set;
        };
      out.push_back(column);
    }
  });
}

}  // namespace

Laboratory laboratoryOf(const state_t& state) noexcept {
  Laboratory lab;
  lab.time = state.laboratory_time_ns;
  lab.E_H.X.p = Vec3::Map(state.laboratory_p);
  schema::take(state.laboratory_R, lab.E_H.X.R);
  lab.E_H.v = Vec3::Map(state.laboratory_v);
  lab.E_H.w = Vec3::Map(state.laboratory_w);
  lab.E_H.a = Vec3::Map(state.laboratory_a);
  lab.E_H.alpha = Vec3::Map(state.laboratory_alpha);
  return lab;
}

Transform emulatedPose(const state_t& state) noexcept {
  const Pose x = Pose::from(Vec6::Map(state.x));
  return laboratoryOf(state).E_H.X * Transform{rotation(x.rpy), x.p};
}

Transform toolInP(const Experiment& experiment, const JointVector& q) {
  const Payload& payload = experiment.plant.payload;
  return payload.X_PL0() * experiment.robot.tool()->pose(linkPoses(payload.robot, q));
}

Transform toolPose(const Experiment& experiment, const Vec6& x, const JointVector& q) {
  return experiment.plant.geometry.fromHome(Pose::from(x)) * toolInP(experiment, q);
}

double coordinateOf(const Transform& X_IT, int i) {
  return i < 3 ? X_IT.p(i) : fixedAngles(X_IT.R)(i - 3);
}

bool pushed(const truth_t& truth) noexcept {
  const double since =
      static_cast<double>(truth.header.time_ns - truth.push_began_ns) * kSecondPerNanosecond;
  return truth.pushes > 0 && since < truth.push_duration;
}

std::vector<Column> columns(const Experiment& experiment) {
  std::vector<Column> out;
  const auto add = [&](std::string name, auto value, std::string meaning) {
    out.push_back({std::move(name), value, std::move(meaning), {}});
  };
  const auto sample = [&](const std::string& name, auto value, const char* meaning) {
    add(
        name, [value](const Row& r) { return r.has_sample ? value(r.sample) : NAN; }, meaning);
  };
  const auto truth = [&](const std::string& name, auto value, const char* meaning) {
    add(
        name, [value](const Row& r) { return r.has_truth ? value(r.truth) : NAN; }, meaning);
  };
  const auto timing = [&](const char* name, auto value, const char* meaning) {
    add(
        name,
        [value](const Row& r) {
          return r.has_timing ? static_cast<double>(value(r.timing)) * kSecondPerNanosecond : NAN;
        },
        meaning);
  };

  add(
      "t_s", [](const Row& r) { return r.t; }, "since the first tick");
  add(
      "tick", [](const Row& r) { return static_cast<double>(r.state.header.sequence); },
      "of the controller");
  addState(experiment, out);
  if (experiment.controller.moving_frame.enabled) {
    for (int i = 0; i < 3; ++i)
      add(
          fmt::format("emulated_{}_m", "xyz"[i]),
          [=](const Row& r) { return emulatedPose(r.state).p(i); },
          "commanded, where the vehicle is emulated, from home");
    for (int i = 0; i < 4; ++i)
      add(
          fmt::format("emulated_q{}", "xyzw"[i]),
          [=](const Row& r) { return Eigen::Quaterniond(emulatedPose(r.state).R).coeffs()(i); },
          "the same: its attitude, a quaternion");
  }
  const Propulsion propulsion = propulsionOf(experiment.controller.vehicle);
  for (int i = 0; i < propulsion.wheel_count; ++i)
    add(
        fmt::format("wheel{}_nms", i),
        [wheel = propulsion.wheels[static_cast<std::size_t>(i)]](const Row& r) {
          return wheel.momentum(r.state.vehicle_time);
        },
        "momentum that this reaction wheel has taken, about its axis");
  for (int i = 0; i < 6; ++i)
    add(
        fmt::format("{}_actual_{}", coordinate(i).name, coordinate(i).unit),
        [=](const Row& r) { return r.hasTruePose() ? r.truth.x[i] : NAN; },
        "where the platform truly is");
  for (int i = 0; i < static_cast<int>(experiment.robot.joint_names.size()); ++i)
    sample(
        fmt::format("{}_{}", experiment.robot.joint_names[static_cast<std::size_t>(i)],
                    experiment.controller.payload.robot.jointLink(i).type == JointType::kRevolute
                        ? "rad"
                        : "m"),
        [=](const sample_t& s) { return s.q[i]; }, "joint of the robot");
  if (experiment.robot.tool()) {
    const auto whole = std::make_shared<const Experiment>(experiment);
    for (int i = 0; i < 6; ++i)
      add(
          fmt::format("tool_{}_actual_{}", coordinate(i).name, coordinate(i).unit),
          [=](const Row& r) {
            if (!r.hasTruePose()) return static_cast<double>(NAN);
            const JointVector q = JointVector::Map(r.truth.q);
            return coordinateOf(toolPose(*whole, Vec6::Map(r.truth.x), q), i);
          },
          "where the tool truly is, in inertial axes");
  }
  for (int i = 0; i < 3; ++i)
    truth(
        fmt::format("push_{}_n", wrenchComponent(i).name),
        [i](const truth_t& m) { return pushed(m) ? m.push_force[i] : 0.0; },
        "of the push that lasts, in inertial axes");
  if (experiment.plant.task.world) {
    truth(
        "clearance_m", [](const truth_t& m) { return m.clearance; },
        "of the tool from the nearest surface, least of the last step");
    for (int i = 0; i < 6; ++i)
      truth(
          fmt::format("{}_contact_{}", wrenchComponent(i).name, wrenchComponent(i).unit),
          [i](const truth_t& m) { return m.contact[i]; },
          "on the tool from what it touches, mean over the last step");
    truth(
        "contacts", [](const truth_t& m) { return static_cast<double>(m.contacts); }, "so far");
    if (experiment.plant.task.world->environment.target)
      for (int i = 0; i < 3; ++i) {
        truth(
            fmt::format("{}_target_m", coordinate(i).name),
            [i](const truth_t& m) { return m.target_p[i]; }, "of the body that floats");
        truth(
            fmt::format("{}_target_rate_m_per_s", coordinate(i).name),
            [i](const truth_t& m) { return m.target_v[i]; }, "of the body that floats");
      }
  }
  sample(
      "temperature_c", [](const sample_t& s) { return s.temperature; },
      "of the laboratory, by a thermometer beside the sensor");
  timing(
      "late_s", [](const timing_t& m) { return m.late_ns; }, "by which the tick came late");
  timing(
      "compute_s", [](const timing_t& m) { return m.compute_ns; }, "that the tick took");
  return out;
}

bool selected(const std::string& name, const std::vector<std::string>& select,
              std::vector<bool>& used) {
  bool take = select.empty() || name == "t_s";
  for (std::size_t i = 0; i < select.size(); ++i)
    if (name.rfind(select[i], 0) == 0) take = used[i] = true;
  return take;
}

std::string csvField(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? "\"\"" : std::string(1, c == '\n' ? ' ' : c);
  return out + "\"";
}

std::vector<std::string> csvFields(const std::string& line) {
  std::vector<std::string> out(1);
  bool inside = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (inside && c == '"' && i + 1 < line.size() && line[i + 1] == '"')
      out.back() += line[++i];
    else if (c == '"')
      inside = !inside;
    else if (c == ',' && !inside)
      out.emplace_back();
    else
      out.back() += c;
  }
  return out;
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
    if (column.text)
      line += csvField(column.text(row));
    else
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
