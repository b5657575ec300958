// SPDX-License-Identifier: BSD-3-Clause
//
// ves compare: what runs differ in, as a table and as pictures.
#include <fmt/ranges.h>

#include "commands.hpp"
#include "logs.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "print.hpp"
#include "ves/core/coordinates.hpp"
#include "ves/evaluation/differences.hpp"
#include "ves/validation/page.hpp"

namespace ves::app {
namespace {

constexpr std::size_t kMostRuns = 6;

struct ComparedRun {
  std::string name;
  Series series;
};

std::vector<std::vector<std::string>> rowsOf(const std::vector<KeyDifference>& differences) {
  std::vector<std::vector<std::string>> rows;
  for (const KeyDifference& one : differences) {
    rows.push_back({one.key});
    rows.back().insert(rows.back().end(), one.values.begin(), one.values.end());
  }
  return rows;
}

/// How keys of a summary end, and how a person reads what they name.
struct Unit {
  std::string_view ending;
  const char* shown;
  double times;
};
constexpr Unit kShown[] = {{"_m", "mm", 1e3},     {"_rad", "deg", 180.0 / M_PI},
                           {"_lag_s", "ms", 1e3}, {"_delay_s", "ms", 1e3},
                           {"_s", "s", 1.0},      {"_share", "%", 100.0},
                           {"_j", "mJ", 1e3},     {"_n", "N", 1.0},
                           {"_nm", "N m", 1.0}};

/// A key in words with its unit, what each run has, and of two runs the second over the first.
std::vector<std::string> rowOf(const KeyDifference& one) {
  const auto* unit = std::find_if(std::begin(kShown), std::end(kShown),
                                  [&](const Unit& u) { return one.key.ends_with(u.ending); });
  std::vector<double> numbers;
  for (const std::string& value : one.values) {
    char* end = nullptr;
    numbers.push_back(std::strtod(value.c_str(), &end));
    if (value.empty() || *end != '\0') unit = std::end(kShown);
  }
  std::string name = one.key;
  if (unit == std::end(kShown)) {
    std::vector<std::string> row = {name};
    row.insert(row.end(), one.values.begin(), one.values.end());
    if (one.values.size() == 2) row.push_back("");
    return row;
  }
  name.resize(name.rfind('_'));
  std::replace(name.begin(), name.end(), '_', ' ');
  std::vector<std::string> row = {fmt::format("{} [{}]", name, unit->shown)};
  for (const double x : numbers) row.push_back(fmt::format("{:.4g}", x * unit->times));
  if (numbers.size() == 2)
    row.push_back(numbers[0] != 0.0 ? fmt::format("{:.3g}", numbers[1] / numbers[0]) : "");
  return row;
}

/// What it is all about first.
std::vector<std::vector<std::string>> resultsOf(std::vector<KeyDifference> differences) {
  std::stable_partition(differences.begin(), differences.end(), [](const KeyDifference& one) {
    return one.key.starts_with("emulation_") || one.key.starts_with("tool_error");
  });
  std::vector<std::vector<std::string>> rows;
  for (const KeyDifference& one : differences) rows.push_back(rowOf(one));
  return rows;
}

/// A column of all runs, over the time since each began.
Panel panelOf(const std::vector<ComparedRun>& runs, const std::string& column,
              const std::string& label, double scale) {
  Panel panel{"time [s]", label, {}, false};
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const std::vector<Column> all = columns(runs[k].series.experiment);
    const auto at =
        std::find_if(all.begin(), all.end(), [&](const Column& one) { return one.name == column; });
    if (at == all.end()) continue;
    const Line line = lineOf(runs[k].name, runs[k].series, static_cast<int>(k),
                             [&](const Row& row) { return at->value(row) * scale; });
    if (!line.x.empty()) panel.lines.push_back(line);
  }
  return panel;
}

}  // namespace

int compareCommand(int argc, char** argv) {
  CLI::App cli(
      "Runs side by side: what differs in their configurations and in what came of them, and their "
      "curves over each other on a page.",
      "ves compare");
  std::vector<std::string> given;
  std::string html, scenario;
  cli.add_option("run", given, "folders of runs, or logs")->required()->expected(2, kMostRuns);
  cli.add_option("--html", html, "a page with the tables and overlaid curves")
      ->check(endsWith({".html"}));
  addScenarioOfLog(cli, scenario);
  return run(cli, argc, argv, [&] {
    if (!html.empty()) requireReplaceable("--html", html, "<!DOCTYPE");
    std::vector<ComparedRun> runs;
    std::vector<const Experiment*> experiments;
    std::vector<nlohmann::ordered_json> summaries;
    std::vector<std::string> header = {""};
    ReferenceMotions references;
    for (const std::string& one : given) {
      runs.push_back(
          {std::filesystem::path(one).lexically_normal().string(), seriesOf(logOf(one), scenario)});
      header.push_back(runs.back().name);
    }
    for (const ComparedRun& one : runs) {
      experiments.push_back(&one.series.experiment);
      summaries.push_back(summarise(one.series, resultOf(one.series), references));
    }
    const auto configuration = rowsOf(configurationDifferences(experiments)),
               results = resultsOf(summaryDifferences(summaries));
    std::vector<std::string> beside = header;
    if (runs.size() == 2) beside.push_back("second/first");
    printTable("configuration", header, configuration);
    printTable("results", beside, results);
    if (html.empty()) return kDone;

    Page page;
    page.section("Results");
    page.table(beside, results);
    page.section("Configuration");
    page.table(header, configuration);
    page.section("Curves");
    const auto figure = [&](const std::string& caption, const std::vector<Panel>& panels) {
      if (!panels.front().lines.empty())
        page.figure(caption, panels, "./ves compare " + fmt::format("{}", fmt::join(given, " ")));
    };
    for (int half = 0; half < 2; ++half) {
      std::vector<Panel> pose, wrench;
      for (int i = 3 * half; i < 3 * half + 3; ++i) {
        const Coordinate& c = coordinate(i);
        pose.push_back(panelOf(runs, fmt::format("{}_actual_{}", c.name, c.unit),
                               fmt::format("{} [{}]", c.name, c.shown_unit), c.shown));
        const WrenchComponent& w = wrenchComponent(i);
        wrench.push_back(panelOf(runs, fmt::format("{}_dynamic_{}", w.name, w.unit),
                                 fmt::format("{} [{}]", w.name, w.shown_unit), 1.0));
      }
      figure(half ? "Attitude of the platform." : "Position of the platform, from home.", pose);
      figure(
          half ? "Moment that admittance control feels." : "Force that admittance control feels.",
          wrench);
    }
    writeGiven("--html", html,
               page.html("Runs side by side",
                         fmt::format("{}", fmt::join(header.begin() + 1, header.end(), ", "))));
    return kDone;
  });
}

}  // namespace ves::app
