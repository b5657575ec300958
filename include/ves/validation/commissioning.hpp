// SPDX-License-Identifier: BSD-3-Clause
//
// From a machine that nobody has told about to one belief file: what is moved, what is found, and
// what error of the emulation to expect before and after.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "ves/evaluation/identified.hpp"
#include "ves/identification/pose_plan.hpp"
#include "ves/validation/page.hpp"

namespace ves {

struct CommissioningOptions {
  double seconds = 100.0;  // [s] of the machine's time, at most
  double accuracy = 1e-3;  // [-] of the weight's wrench; fewer poses where that is met
  PosePlanOptions poses = {.attitudes = 12, .poses = 3, .most_range = 0.75};
};

struct Commissioning {
  /// Home, calibration, a shake, the poses, home: nothing about in the workspace, no admittance.
  Experiment experiment;
  double seconds = 0.0;  // [s] that it takes, about
  std::optional<PosePlan> plan;
  std::string no_plan;  // why there is none
};

/// What commissions the scenario's machine, without what the scenario believes of it already.
/// Throws InputError where its limits leave no room.
Commissioning commissioningOf(const Experiment& scenario, const CommissioningOptions& options);

/// What the run has used of a range; more than kRoom of it is too much.
struct RangeUse {
  static constexpr double kRoom = 0.8;  // [-]
  std::string name;
  double used = 0.0;  // [-] of the range, from its middle
};

/// What the run found.
struct Commissioned {
  std::vector<RangeUse> ranges;  // of the sensor's channels and of the legs
  std::optional<CalibrationRecord> calibration;
  std::optional<IdentifiedMasses> masses;
  std::string no_masses;  // why not
  std::optional<IdentifiedServo> servo;
  std::string no_servo;
};
Commissioned commissioned(const Series& series, const Commissioning& commissioning);

/// YAML for --belief, of the scenario that was commissioned. A bias holds with the masses that it
/// was found with.
std::string beliefOf(const Commissioned& found, const Experiment& scenario,
                     const std::string& comment);

/// The emulation's error over the base's travel, rms, in lockstep on a simulated machine.
struct EmulationError {
  double position = 0.0, attitude = 0.0;  // [-]
  std::string stopped;                    // by which check; empty: it went on to its end
};

struct ErrorForecast {
  EmulationError told;      // the scenario as it was, on the machine that was found
  EmulationError believed;  // with the belief, on that machine
  /// The root of the sum of squares with one after the other off by all that the belief allows:
  /// masses, centres, the links' own inertia, servo gains and timing.
  EmulationError off;
  std::string refused;  // with the belief, why admittance control would be; empty: it is not
};

/// `believing`: the scenario with its belief. None where the program emulates nothing.
std::optional<ErrorForecast> forecastError(const Experiment& scenario, const Experiment& believing,
                                           const Commissioned& found);

/// What a person reads, on a terminal or a page.
std::vector<Table> tablesOf(const Series& series, const Commissioning& commissioning,
                            const Commissioned& found,
                            const std::optional<ErrorForecast>& forecast);

}  // namespace ves
