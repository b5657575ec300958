// SPDX-License-Identifier: BSD-3-Clause
#include "logs.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "app.hpp"
#include "ves/core/errors.hpp"

namespace ves::app {
namespace {

std::filesystem::path newestRun() {
  std::error_code error;
  std::filesystem::path newest;
  std::filesystem::file_time_type when;
  for (const auto& entry : std::filesystem::directory_iterator("ves-runs", error)) {
    const std::filesystem::path log = entry.path() / "run.lcmlog";
    const auto written = std::filesystem::last_write_time(log, error);
    if (error || (!newest.empty() && written <= when)) continue;
    newest = entry.path();
    when = written;
  }
  if (newest.empty()) throw CLI::ValidationError("newest: there is no run in ves-runs");
  return newest;
}

}  // namespace

std::string logOf(const std::string& given) {
  std::error_code error;
  const bool named = given == "newest" && !std::filesystem::exists(given, error);
  const std::filesystem::path path = named ? newestRun() : std::filesystem::path(given);
  return std::filesystem::is_directory(path, error) ? (path / "run.lcmlog").string() : given;
}

CLI::Option* asLog(CLI::Option* option) { return option->transform(logOf); }

void addScenarioOfLog(CLI::App& cli, std::string& scenario) {
  cli.add_option("--scenario", scenario, "of a log without a configuration");
}

std::optional<Experiment> scenarioOfLog(const std::string& scenario) {
  if (scenario.empty()) return {};
  return loadExperiment(findScenario(scenario, configFolder()));
}

void printDamage(const Damage& damage) {
  for (const std::string& line : damage.lines()) fmt::print(stderr, "warning: {}\n", line);
}

Series seriesOf(const std::string& log, const std::string& scenario) {
  const std::optional<Experiment> without = scenarioOfLog(scenario);
  Series series = readSeries(log, without ? &*without : nullptr);
  if (without && !series.version.empty())
    throw InputError(
        fmt::format("--scenario {}: {} has its own configuration; leave it out", scenario, log));
  printDamage(series.damage);
  return series;
}

}  // namespace ves::app
