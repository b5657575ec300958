// SPDX-License-Identifier: BSD-3-Clause
#include "print.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "ves/analysis/leaning.hpp"
#include "ves/evaluation/evidence.hpp"
#include "ves/series/series.hpp"

namespace ves::app {
namespace {

void warnOfContacts(const Experiment& experiment) {
  const auto stiff = [](const ContactVerdict& one) {
    return !one.grows && std::abs(one.impact.energy_error) > kMostEnergyError;
  };
  const auto all = assessContacts(experiment.controller, experiment.plant.task, false);
  if (!std::any_of(all.begin(), all.end(), stiff)) return;
  for (const ContactVerdict& one : assessContacts(experiment.controller, experiment.plant.task))
    if (stiff(one)) fmt::print(stderr, "warning: {}\n", explain(one));
}

}  // namespace

void printWarnings(const Experiment& experiment, bool verbose) {
  if (verbose)
    for (const std::string& note : experiment.source.notes) fmt::print(stderr, "note: {}\n", note);
  for (const std::string& warning : experiment.source.warnings)
    fmt::print(stderr, "warning: {}\n", warning);
  if (experiment.source.calibration && age(*experiment.source.calibration) > kCalibrationKeeps)
    fmt::print(stderr,
               "warning: the calibration of {} is {:.1f} h old; its bias drifts, and keeps {} h\n",
               dateText(experiment.source.calibration->date), age(*experiment.source.calibration),
               kCalibrationKeeps);
}

void warnOfInstability(Experiment& experiment) {
  const std::string why = requireStability(experiment);
  if (!why.empty()) fmt::print(stderr, "warning: {}\n", why);
  warnOfContacts(experiment);
}

std::string whyNot(const RunResult& result, const std::string& log) {
  if (result.phase == Phase::kDisarmed)
    return fmt::format(
        "not armed: {}{}",
        result.cause == Check::kCount ? "no stream of new samples long enough" : name(result.cause),
        result.rejected.empty() ? "" : "; " + result.rejected);
  if (result.phase == Phase::kStopped)
    return fmt::format("stopped by the {} check in tick {}", name(result.cause), result.cause_tick);
  if (!result.aborted) return {};
  if (!log.empty()) return whyEarly(readSeries(log));
  return result.aborted_by == Refusal::kNone ? "the calibration was refused"
                                             : refusedSegment(result.aborted_by);
}

void printTable(const std::string& title, const std::vector<std::string>& header,
                const std::vector<std::vector<std::string>>& rows) {
  fmt::print("{}\n", title);
  if (rows.empty()) fmt::print("  nothing\n");
  std::vector<std::size_t> widths(header.size());
  for (std::size_t i = 0; i < header.size(); ++i) {
    widths[i] = header[i].size();
    for (const auto& row : rows) widths[i] = std::max(widths[i], row[i].size());
  }
  const auto line = [&](const std::vector<std::string>& cells) {
    fmt::print("  {:<{}}", cells[0], widths[0]);
    for (std::size_t i = 1; i < cells.size(); ++i) fmt::print("  {:>{}}", cells[i], widths[i]);
    fmt::print("\n");
  };
  if (!rows.empty()) line(header);
  for (const auto& row : rows) line(row);
  fmt::print("\n");
}

std::string asTyped(const std::string& word) {
  constexpr const char* kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=:,./@%";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string::npos) return word;
  std::string out = "'";
  for (const char c : word) out += c == '\'' ? "'\\''" : std::string(1, c);
  return out + "'";
}

}  // namespace ves::app
