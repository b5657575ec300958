// SPDX-License-Identifier: BSD-3-Clause
//
// How often something rare happens: subset simulation (Au and Beck, 2001). A thousand runs tell a
// probability of a millionth as a product of shares of a tenth: of all runs the tenth that came
// nearest to the limit is kept, each of them is the beginning of a chain of runs that stay as near,
// and so on until the limit is passed by a tenth.
#pragma once

#include <cstdint>
#include <vector>

namespace ves {

class SubsetSimulation {
 public:
  static constexpr std::int64_t kSteps = 10;  // [-] of a chain; a tenth of a level begins the next
  static constexpr int kMostLevels = 9;       // [-] down to 1e-9

  struct Estimate {
    double probability = 0.0;      // [-]
    double low = 0.0, high = 0.0;  // [-] of 95 %, as if levels were independent of each other
    int levels = 1;                // [-]
  };
  /// Runs that can be made now, in any order, numbered from 0 on.
  struct Batch {
    std::int64_t first = 0, size = 0;
  };

  /// Of so many numbers, each uniform in [0, 1]. `runs` of a level: a multiple of ten, 100 or more.
  SubsetSimulation(std::size_t numbers, std::int64_t runs, std::uint64_t seed);

  /// Without any: it is done.
  Batch next() const { return done_ ? Batch{taken_, 0} : Batch{taken_, batch_}; }
  /// [-] The numbers of a run of next().
  std::vector<double> numbers(std::int64_t run) const;
  /// How far beyond the limit each run of next() came, in order: above 0 it happened. NaN, of a run
  /// without a value: it did not. Throws std::domain_error where so many come equally near that a
  /// level tells nothing.
  void take(const std::vector<double>& beyond);

  /// After the last: of all; before: of nothing.
  const Estimate& estimate() const { return estimate_; }
  /// [-] Never more.
  static std::int64_t most(std::int64_t runs) {
    return runs + (kMostLevels - 1) * (runs - runs / kSteps);
  }

 private:
  struct Sample {
    std::vector<double> numbers;
    double beyond = 0.0;
  };
  void finishLevel();
  double correlation(double threshold, double share) const;

  std::size_t count_;  // [-] of numbers
  std::int64_t runs_, chains_;
  std::uint64_t seed_;
  bool done_ = false;
  std::int64_t taken_ = 0, batch_;  // [-] runs
  double threshold_;                // that chains stay beyond
  std::vector<double> width_;       // [-] of a chain's steps, to each side
  std::vector<Sample> level_;       // chain after chain within a step, step after step
  double variance_ = 0.0;           // [-] of the estimate, relative
  Estimate estimate_;
};

}  // namespace ves
