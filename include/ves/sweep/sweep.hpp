// SPDX-License-Identifier: BSD-3-Clause
//
// One scenario many times, over a grid or random draws of its values, on all cores. What a run is
// depends on its number alone, so neither the workers nor a kill in between change a row.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "ves/config/experiment.hpp"
#include "ves/sweep/figure.hpp"
#include "ves/sweep/subset.hpp"

namespace ves {

/// How the draws of a combination lie: each for itself; as a Latin hypercube, with one in each of
/// so many parts of every key's range; as Sobol's points, which leave no part of all keys' ranges
/// out, with digits exchanged at random; or ever nearer to a limit that is seldom passed. The two
/// before that know how many runs there will be.
enum class SweepDesign { kUniform, kLatin, kSobol, kSubset };

/// The runs of a sweep: every combination of the varied values, `draws` times.
class SweepPlan {
 public:
  /// "KEY=V1,V2,.." or "KEY=FROM:TO:COUNT". Throws InputError.
  void vary(const std::string& option);
  /// "KEY=FROM:TO", uniform in between, another one each run. Throws InputError.
  void draw(const std::string& option);
  /// Draws of the keys that take nothing else are whole numbers, both ends as likely as what is
  /// between. Throws InputError where an end is none.
  void drawWhole(const std::function<bool(const std::string& key)>& takes_only_whole);
  /// Runs of each combination, each with a noise seed of its own unless `seed` is varied.
  void repeat(std::int64_t draws) { draws_ = draws; }
  void seed(std::uint64_t seed) { seed_ = seed; }
  /// After all of that. Throws InputError where Sobol's points are too many.
  void lay(SweepDesign design);

  /// [-] At most, of subset simulation. Throws InputError beyond a thousand million.
  std::int64_t size() const;
  std::vector<std::string> keys() const;
  /// All that a sweep is, for a person and to compare.
  std::string text() const;
  /// Which runs a subset simulation wants next, and what came of them; null: of another design.
  SubsetSimulation* subset() { return subset_ ? &*subset_ : nullptr; }
  const SubsetSimulation* subset() const { return subset_ ? &*subset_ : nullptr; }
  /// "KEY=VALUE" of run `run`, keys() in order; of a subset simulation, of its next ones.
  std::vector<std::string> overrides(std::int64_t run) const;
  /// Applies them. Throws InputError, which names the option of each.
  void put(const std::vector<std::string>& overrides, Value& scenario) const;

 private:
  void take(const std::string& key, const std::string& option) const;

  struct Varied {
    std::string key;
    std::vector<std::string> values;
  };
  struct Drawn {
    std::string key;
    double from = 0.0, to = 0.0;
    bool whole = false;
  };
  double share(std::int64_t run, std::size_t key) const;  // [-] of a key's range

  std::vector<Varied> varied_;
  std::vector<Drawn> drawn_;
  std::int64_t draws_ = 1;
  std::uint64_t seed_ = 1;
  SweepDesign design_ = SweepDesign::kUniform;
  std::optional<SubsetSimulation> subset_;
  std::vector<std::uint32_t> points_;  // Sobol's, of kPointBits, a run's after another
};

struct SweepOptions {
  std::filesystem::path scenario;
  std::vector<std::string> overrides;  // of every run
  std::filesystem::path file;          // CSV; what it has already is not run again
  int workers = 1;                     // [-] runs at a time
  int rank = 0, ranks = 1;             // [-] of several sweeps that share the runs and a folder
  std::optional<Figure> figure;        // that is told of all rows; a subset simulation's question
  double until = 0.0;                  // half of its interval, at which it is enough; 0: never
};

struct SweepProgress {
  std::int64_t done = 0, of = 0;  // [-] runs, of this rank
  double elapsed = 0.0;           // [s]
  std::int64_t run_now = 0;       // [-] of `done`, by this call
};

struct SweepResult {
  std::int64_t rows = 0;      // [-] in the file
  std::int64_t not_good = 0;  // [-] of them: stopped by a check, refused, or not a valid scenario
  bool complete = false;      // the file has all runs, in order, or as many as are enough
  std::optional<Figure::Estimate> figure;
  int levels = 0;  // [-] of a subset simulation
};

/// Before anything is made or run. Throws InputError where the figure is no column of numbers, or
/// not what the design wants.
void requireFigure(const SweepPlan& plan, const SweepOptions& options);

/// Runs what is missing. `stop` is looked at before every run; it and `shown` may be called
/// by any thread, `shown` by one at a time. Throws InputError.
SweepResult sweep(SweepPlan& plan, const SweepOptions& options,
                  const std::function<void(const SweepProgress&)>& shown,
                  const std::function<bool()>& stop);

}  // namespace ves
