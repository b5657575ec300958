// SPDX-License-Identifier: BSD-3-Clause
#include "row.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <iterator>
#include <utility>
#include <vector>

#include "ves/analysis/gate.hpp"
#include "ves/evaluation/summary.hpp"

namespace ves {
namespace {

/// Numbers of a run's summary that make columns.
constexpr const char* kNumbers[] = {"simulated_s",
                                    "emulation_travel_m",
                                    "emulation_error_rms_m",
                                    "emulation_error_max_m",
                                    "emulation_error_rms_rad",
                                    "x_peak_to_peak_m",
                                    "x_error_max_m",
                                    "x_error_rms_m",
                                    "y_peak_to_peak_m",
                                    "y_error_max_m",
                                    "y_error_rms_m",
                                    "z_peak_to_peak_m",
                                    "z_error_max_m",
                                    "z_error_rms_m",
                                    "alpha_peak_to_peak_rad",
                                    "alpha_error_max_rad",
                                    "alpha_error_rms_rad",
                                    "beta_peak_to_peak_rad",
                                    "beta_error_max_rad",
                                    "beta_error_rms_rad",
                                    "gamma_peak_to_peak_rad",
                                    "gamma_error_max_rad",
                                    "gamma_error_rms_rad",
                                    "dynamic_force_max_still_n",
                                    "dynamic_moment_max_still_nm",
                                    "dynamic_force_max_moving_n",
                                    "dynamic_moment_max_moving_nm",
                                    "tracking_delay_s",
                                    "tracking_rms",
                                    "energy_put_in_max_j",
                                    "contacts",
                                    "contacts_free_space",
                                    "contact_peak_n",
                                    "contact_peak_free_space_n",
                                    "contact_restitution",
                                    "contact_restitution_free_space",
                                    "contact_energy_error"};

/// Of a run's values those that a controller knows of: the check looks at nothing else.
std::string believed(const std::vector<std::string>& values) {
  std::string out;
  for (const std::string& one : values)
    if (one.rfind("seed=", 0) != 0 && one.rfind("plant_mismatch", 0) != 0 &&
        one.rfind("reality", 0) != 0)
      out += one + "\n";
  return out;
}

Judged judge(ControllerConfig c, const RobotTask& task) {
  std::string diverges = applyStabilityCheck(c, task);
  return {std::move(diverges), c.stability, c.stability_uncompensated, c.stable_for,
          c.stable_for_uncompensated};
}

}  // namespace

std::string headerOf(const SweepPlan& plan) {
  std::string line = "run";
  for (const std::string& key : plan.keys()) line += fmt::format(",{}", csvField(key));
  line += fmt::format(",{},first_cause_tick", fmt::join(kWords, ","));
  for (const char* number : kNumbers) line += fmt::format(",{}", number);
  return line;
}

std::string rowOf(const SweepPlan& plan, const Value& scenario, std::int64_t run,
                  SharedByRuns& shared) {
  std::string row = fmt::format("{}", run);
  const std::vector<std::string> values = plan.overrides(run);
  for (const std::string& one : values)
    row += fmt::format(",{}", csvField(one.substr(one.find('=') + 1)));
  const std::string rest = std::string(std::size(kNumbers), ',');
  try {
    Value document = scenario;
    plan.put(values, document);
    Experiment e = buildExperiment(std::move(document), {});
    if (wantsAdmittance(e.controller.program)) {
      const auto known =
          shared.verdicts.of(believed(values), [&] { return judge(e.controller, e.plant.task); });
      if (known->stability == Stability::kUnstable)
        return row + ",refused," + csvField(known->diverges) + "," + rest;
      ControllerConfig& c = e.controller;
      c.stability = known->stability;
      c.stability_uncompensated = known->uncompensated;
      c.stable_for = known->stable_for;
      c.stable_for_uncompensated = known->stable_for_uncompensated;
    }
    const RecordedRun recorded = recordLockstep(e);
    const RunResult& result = recorded.result;
    const auto summary = summarise(recorded.series, result, shared.references);
    row += fmt::format(",{},{},{}", result.aborted ? "aborted" : name(result.phase),
                       name(result.cause), result.cause_tick);
    for (const char* number : kNumbers)
      row += summary.contains(number) ? fmt::format(",{}", summary[number].get<double>()) : ",";
    return row;
  } catch (const WouldStop& error) {
    return row + ",refused," + csvField(error.what()) + "," + rest;
  } catch (const InputError& error) {
    return row + ",invalid," + csvField(error.what()) + "," + rest;
  }
}

}  // namespace ves
