// SPDX-License-Identifier: BSD-3-Clause
//
// Logs that a command is told to read.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "ves/config/experiment.hpp"
#include "ves/series/series.hpp"

namespace ves::app {

/// A run's folder stands for the log in it; `newest` for the run in ves-runs that was made last,
/// refused where there is none.
std::string logOf(const std::string& given);
CLI::Option* asLog(CLI::Option* option);

/// For logs of lcm-logger that began after the configuration was announced.
void addScenarioOfLog(CLI::App& cli, std::string& scenario);
std::optional<Experiment> scenarioOfLog(const std::string& scenario);

/// What of it is damaged is said.
Series seriesOf(const std::string& log, const std::string& scenario);
void printDamage(const Damage& damage);

}  // namespace ves::app
