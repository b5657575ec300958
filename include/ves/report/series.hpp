// SPDX-License-Identifier: BSD-3-Clause
//
// A run as a table: one row a tick, read back from its log.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "ves/config/experiment.hpp"
#include "ves/transport/messages.hpp"

namespace ves {

/// A tick of the controller, beside what the machine truly did when its sample was taken.
struct Row {
  double t = 0.0;  // [s] since the first tick
  state_t state;
  truth_t truth;
  bool has_truth = false;
  timing_t timing;
  bool has_timing = false;  // real time only
};

struct Series {
  Experiment experiment;
  std::string version;
  std::vector<Row> rows;
};

/// Throws InputError when the file is no log, or a log without its configuration.
Series readSeries(const std::string& log);

/// A column of the table; its name ends with its unit.
struct Column {
  std::string name;
  std::function<double(const Row&)> value;
};
std::vector<Column> columns(const Experiment& experiment);

/// Lines of a table, without their end.
std::string csvHeader(const std::vector<Column>& columns);
std::string csvRow(const std::vector<Column>& columns, const Row& row);

/// Throws InputError when the file cannot be written.
void writeCsv(const Series& series, const std::string& file);

}  // namespace ves
