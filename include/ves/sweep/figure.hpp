// SPDX-License-Identifier: BSD-3-Clause
//
// What a sweep says of a column: its mean, or how often it is beyond a limit, with the interval in
// which that is with 95 % of confidence.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace ves {

class Figure {
 public:
  struct Estimate {
    double value = 0.0;                // [the column's unit], or [-] a probability
    double low = 0.0, high = 0.0;      // of 95 %
    std::int64_t of = 0, without = 0;  // [-] rows that have the column, and that do not

    double half() const { return 0.5 * (high - low); }
  };

  /// "COLUMN", "COLUMN>LIMIT" or "COLUMN<LIMIT". Throws InputError.
  explicit Figure(const std::string& text);

  const std::string& column() const { return column_; }
  /// Without the limit, "COLUMN>": what the runs of a subset simulation hang on.
  std::string question() const { return column_ + (beyond_ ? std::string(1, beyond_) : ""); }
  /// Where the column is. Throws InputError where there is none.
  void find(const std::vector<std::string>& header);
  /// How often it is beyond a limit, and no mean.
  bool counts() const { return beyond_ != 0; }
  /// How far beyond its limit a row's column is [its unit]; NaN where it has none.
  double beyond(const std::vector<std::string>& cells) const;
  /// A row's cells; one whose cell is no number counts as without.
  void add(const std::vector<std::string>& cells);

  /// A mean by the normal distribution, a probability by Wilson's interval, which holds for rare
  /// ones too. Of nothing: everything is possible.
  Estimate estimate() const;

 private:
  std::string text_, column_;
  char beyond_ = 0;  // '>', '<', or 0: the mean
  double limit_ = 0.0;
  std::size_t at_ = 0;
  std::int64_t n_ = 0, without_ = 0;
  double mean_ = 0.0, squares_ = 0.0;  // Welford's; of a probability's ones and zeros
};

}  // namespace ves
