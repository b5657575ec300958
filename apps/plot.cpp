// SPDX-License-Identifier: BSD-3-Clause
//
// ves plot: columns of a recorded run as a picture.
#include <fmt/format.h>
#include <cmath>

#include "commands.hpp"
#include "logs.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "ves/pictures/figure.hpp"
#include "ves/series/series.hpp"

namespace ves::app {
namespace {

/// What a column's name ends with: "m", "n", "rad_per_s".
std::string unitOf(const std::string& name) {
  static const char* const kUnits[] = {"m_per_s2", "rad_per_s2", "m_per_s", "rad_per_s",
                                       "count",    "bits",       "rad",     "nm",
                                       "m",        "n",          "c",       "s"};
  for (const char* unit : kUnits) {
    const std::string end = std::string("_") + unit;
    if (name.size() > end.size() && name.compare(name.size() - end.size(), end.size(), end) == 0)
      return unit;
  }
  return "";
}

}  // namespace

int plotCommand(int argc, char** argv) {
  CLI::App cli("Columns of a recorded run as a picture, those of one unit in one panel.",
               "ves plot");
  std::string log, scenario, out = "plot.svg";
  std::vector<std::string> select;
  double from = 0.0, duration = HUGE_VAL;
  asLog(cli.add_option("log", log, "a run's folder, or its LCM event log"))->required();
  cli.add_option("--select", select, "columns, or beginnings of their names (ves collect --list)")
      ->required();
  cli.add_option("--from", from, "[s] since the first tick")->check(inRange(0.0, 1e9));
  cli.add_option("--duration", duration, "[s]; to the end by default")->check(inRange(0.0, 1e9));
  cli.add_option("--out", out, "SVG file")->capture_default_str()->check(endsWith({".svg"}));
  addScenarioOfLog(cli, scenario);
  return run(cli, argc, argv, [&] {
    constexpr std::size_t kMostPanels = 8;
    const Series series = seriesOf(log, scenario);
    std::vector<bool> used(select.size(), false);
    std::vector<std::pair<std::string, Panel>> panels;  // by unit
    for (const Column& column : columns(series.experiment)) {
      if (column.name == "t_s" || !selected(column.name, select, used)) continue;
      const std::string unit = unitOf(column.name);
      auto at = std::find_if(panels.begin(), panels.end(),
                             [&](const auto& one) { return one.first == unit; });
      if (at == panels.end())
        at = panels.insert(
            at, {unit, {"time [s]", unit.empty() ? "-" : fmt::format("[{}]", unit), {}, false}});
      std::vector<Line>& lines = at->second.lines;
      const Line line =
          lineOf(column.name, series, static_cast<int>(lines.size()), [&](const Row& row) {
            return row.t < from || row.t > from + duration ? NAN : column.value(row);
          });
      if (!line.x.empty()) lines.push_back(line);
    }
    for (std::size_t i = 0; i < select.size(); ++i)
      if (!used[i])
        throw InputError(fmt::format(
            "--select {}: no column begins so; ves collect --list names them", select[i]));
    std::vector<Panel> all;
    for (const auto& [unit, panel] : panels)
      if (!panel.lines.empty()) all.push_back(panel);
    if (all.empty()) throw InputError("--select: the columns have no number in that time");
    if (all.size() > kMostPanels)
      throw InputError(fmt::format("--select: {} units, want at most {}", all.size(), kMostPanels));
    writeGiven("--out", out, svgFile(all));
    fmt::print("{}\n", out);
    return kDone;
  });
}

}  // namespace ves::app
