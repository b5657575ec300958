// SPDX-License-Identifier: BSD-3-Clause
//
// Kuklinski's iterative compensation of gravity (Appendix B, second paragraph), for a robot whose
// masses nobody knows.
//
//   slow pass   the platform follows the path x_i, the robot its motion, both so slowly that what
//               the sensor feels is weight (and bias): g_i(t)
//   fast pass   the same at full speed: w_i(t). The admittance model, fed w_i - g_i, answers y_i(t)
//   next        x_i+1 = (1 - weight) x_i + weight y_i, until y_i is x_i
//
// Its limits: the robot must repeat one motion that is known beforehand, every experiment costs
// many runs, and it converges only where the model answers its own motion with less than itself:
// mass ratio over twice the damping ratio well below one, or a short run.
#pragma once

#include <functional>

#include "ves/run/run.hpp"

namespace ves {

struct IterativeOptions {
  int slower = 10;                   // [-] times, of a slow pass
  double weight = 0.5;               // [-] of the model's answer, 0 to 1
  int most = 20;                     // [-] iterations
  double translation = 0.1e-3;       // [m] where it stops
  double rotation = 0.01 * kDegree;  // [rad]
};

/// y_i - x_i, the largest of the run.
struct IterativeChange {
  double translation = 0.0;  // [m]
  double rotation = 0.0;     // [rad]
};

struct IterativeResult {
  std::vector<IterativeChange> changes;  // one an iteration
  bool converged = false;
  Check stopped_by = Check::kCount;  // a pass that a check stopped
  RecordedPath path;                 // the last x
  double machine_time = 0.0;         // [s] of all passes, as the machine counts
};

/// Of the scenario's first admittance segment, in lockstep. `shown` after every iteration. Throws
/// InputError when there is no such segment.
IterativeResult compensateIteratively(const Experiment& experiment, const IterativeOptions& options,
                                      const std::function<void(const IterativeChange&)>& shown);

}  // namespace ves
