// SPDX-License-Identifier: BSD-3-Clause
//
// A run as a table: one row a tick, read back from its log.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "ves/bus/event_log.hpp"
#include "ves/bus/messages.hpp"
#include "ves/run/run.hpp"

namespace ves {

/// A tick of the controller, beside what the machine truly did when its sample was taken.
struct Row {
  double t = 0.0;  // [s] since the first tick
  state_t state;
  truth_t truth;
  bool has_truth = false;
  /// The true leg lengths fitted a pose.
  bool hasTruePose() const { return has_truth && truth.legs_agree; }
  sample_t sample;
  bool has_sample = false;
  timing_t timing;
  bool has_timing = false;  // real time only
};

struct Series {
  Experiment experiment;
  std::string version;
  std::vector<Row> rows;
  Damage damage;  // what of the log could not be used
};

/// Makes rows of the messages of a log, or of a bus, as they come.
class RowMaker {
 public:
  /// A row is whole when the next state arrives: what belongs to it has been seen by then.
  std::optional<Row> add(const LogEvent& event, const std::string& log);
  void add(const truth_t& truth) { truths_.put(truth.header.sequence, truth); }
  void add(const sample_t& sample) { samples_.put(sample.header.sequence, sample); }
  void add(const timing_t& timing);  // of the last state
  std::optional<Row> add(const state_t& state);
  /// The last one.
  std::optional<Row> finish() { return std::exchange(row_, std::nullopt); }

 private:
  Recent<truth_t> truths_;
  Recent<sample_t> samples_;
  std::optional<Row> row_;
  std::optional<std::int64_t> start_;  // [ns] of the first state
};

/// The first controller's run in a log. Damage is passed over and told. Throws InputError when the
/// file is no log, or a log without its configuration or a tick.
Series readSeries(const std::string& log, const Experiment* without = nullptr);

/// A run in lockstep as rows, without a log between: the same rows.
struct RecordedRun {
  Series series;
  RunResult result;
};
RecordedRun recordLockstep(const Experiment& experiment);

/// Of a state's command.
Laboratory laboratoryOf(const state_t& state) noexcept;
/// X_EP about home as commanded; without a laboratory that flies x itself.
Transform emulatedPose(const state_t& state) noexcept;

/// X_PT, the joints at q. The robot has a tool.
Transform toolInP(const Experiment& experiment, const JointVector& q);
/// X_IT, the platform at x [m, rad] from home, the joints at q. The robot has a tool.
Transform toolPose(const Experiment& experiment, const Vec6& x, const JointVector& q);

/// [m] of x, y, z, or [rad] of the fixed angles.
double coordinateOf(const Transform& X_IT, int i);

/// A body whose mass is learnt.
struct LearntBody {
  std::string name;       // "link_0", ..., "hand"
  double believed = 0.0;  // [kg]
};
/// In the order of BodyMasses.
std::vector<LearntBody> learntBodies(const Experiment& experiment);

/// Whether a push lasts.
bool pushed(const truth_t& truth) noexcept;

/// A column of the table; its name ends with its unit.
struct Column {
  std::string name;
  std::function<double(const Row&)> value;
  std::string meaning;
  std::function<std::string(const Row&)> text;  // what a person reads for it; empty: the number
};
std::vector<Column> columns(const Experiment& experiment);

/// True when the name begins with one of `select`, which is then marked as used; or select is
/// empty. Time is always taken.
bool selected(const std::string& name, const std::vector<std::string>& select,
              std::vector<bool>& used);

/// As a field of a table (RFC 4180); a new line becomes a space.
std::string csvField(const std::string& text);

/// The fields of a line of a table.
std::vector<std::string> csvFields(const std::string& line);

/// Lines of a table, without their end.
std::string csvHeader(const std::vector<Column>& columns);
std::string csvRow(const std::vector<Column>& columns, const Row& row);

/// All columns, and `more`. Throws InputError when the file cannot be written.
void writeCsv(const Series& series, const std::vector<Column>& more, const std::string& file);

}  // namespace ves
