// SPDX-License-Identifier: BSD-3-Clause
//
// What the page's charts may show: the columns of series.csv, one value a tick.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "ves/evaluation/comparison.hpp"

namespace ves {

/// Whether the program calibrates the sensor, and has done so: before that the wrench without
/// gravity is the sensor's bias, as large as the robot's weight.
bool calibrates(const Program& program) noexcept;
bool calibrated(const state_t& state) noexcept;

class Curves {
 public:
  explicit Curves(const Experiment& experiment);

  /// Of each: "name", which ends with its unit, and "meaning".
  nlohmann::ordered_json description() const;
  std::size_t size() const { return columns_.size() + 6; }
  /// One tick; NaN where nobody knows. `base`: the base in free space, from home.
  std::vector<float> of(const Row& row, const std::optional<Vec6>& base) const;

 private:
  std::vector<Column> columns_;
};

/// Every tick of a recorded run: "t" [s] as base64 of floats; of each curve "name", "meaning",
/// and "value" where it never changes, else "least", "step" and "counts", base64 of 16 bits each:
/// value = least + step count, 65535 for NaN. That is 1/65534 of its range, and no tick is left
/// out.
nlohmann::ordered_json recordedCurves(const Series& series, const BasePoses& base);

}  // namespace ves
