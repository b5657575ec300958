// SPDX-License-Identifier: BSD-3-Clause
//
// Data collection: chosen columns of what passes on the bus, into a CSV file, while things run.
#pragma once

#include <fmt/format.h>

#include <fstream>

#include "ves/console/command.hpp"
#include "ves/series/series.hpp"

namespace ves {

/// Rows of the running collection, into its file.
class Collector {
 public:
  Collector(const Experiment& experiment, const Collection& what) : what_(what) {
    std::vector<bool> used(what.select.size(), false);
    for (const Column& column : columns(experiment))
      if (selected(column.name, what.select, used)) columns_.push_back(column);
    for (std::size_t i = 0; i < used.size(); ++i)
      if (!used[i])
        throw InputError(fmt::format("'{}': no variable's name begins so", what.select[i]));
    out_.open(what.file);
    if (!out_) throw InputError(fmt::format("{}: cannot be written", what.file));
    out_ << csvHeader(columns_) << "\n";
  }

  /// False when the last row has been taken.
  bool add(const LogEvent& event) {
    auto row = maker_.add(event, "bus");
    if (!row) return true;
    if (row->t > what_.duration) return false;
    if (row->t < next_ - kRounding) return true;
    if (what_.rate > 0.0) next_ += 1.0 / what_.rate;
    out_ << csvRow(columns_, *row) << "\n";
    ++rows_;
    return true;
  }

  std::string outcome() {
    out_.flush();
    return out_ ? fmt::format("collected {} rows of {} variables: {}", rows_, columns_.size(),
                              what_.file)
                : fmt::format("{}: could not be written", what_.file);
  }

 private:
  static constexpr double kRounding = 0.5e-9;  // [s]

  Collection what_;
  std::vector<Column> columns_;
  std::ofstream out_;
  RowMaker maker_;
  double next_ = 0.0;
  std::int64_t rows_ = 0;
};

}  // namespace ves
