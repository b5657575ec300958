// SPDX-License-Identifier: BSD-3-Clause
//
// ves faults: injects every fault of the table and says what happened.
#include <fmt/format.h>

#include "commands.hpp"
#include "options.hpp"
#include "ves/core/spelling.hpp"
#include "ves/faults/soak.hpp"
#include "ves/faults/table.hpp"

namespace ves::app {
namespace {

void printRow(const FaultRow& row, const FaultOutcome& seen) {
  std::string detected = "-", deviation = "-";
  if (seen.ticks >= 0)
    detected = fmt::format("{} ({:.0f} ms)", seen.ticks,
                           static_cast<double>(seen.ticks) * seen.period * 1e3);
  if (seen.peak_deviation >= 0.0) deviation = fmt::format("{:.1f} mm", seen.peak_deviation * 1e3);
  fmt::print(
      "{:<5} {} {}\n        expected  {}\n        seen      {}\n        detected  {:<14} "
      "peak deviation  {}\n",
      row.id, seen.as_expected ? "ok  " : "MISS", row.fault, row.expected, seen.what, detected,
      deviation);
  std::fflush(stdout);
}

void printMarkdownRow(const FaultRow& row, const FaultOutcome& seen) {
  fmt::print("| {} | {} | {} | {}{} | {} | {} |\n", row.id, row.fault, row.expected,
             seen.as_expected ? "" : "**not as expected:** ", seen.what,
             seen.ticks < 0 ? std::string("-")
                            : fmt::format("{} / {:.0f} ms", seen.ticks,
                                          static_cast<double>(seen.ticks) * seen.period * 1e3),
             seen.peak_deviation < 0.0 ? std::string("-")
                                       : fmt::format("{:.1f}", seen.peak_deviation * 1e3));
  std::fflush(stdout);
}

int kill(const FaultBench& bench, int times) {
  const auto rows = faultTable(bench);
  const auto row =
      std::find_if(rows.begin(), rows.end(), [](const FaultRow& r) { return r.id == "F15"; });
  int good = 0;
  for (int i = 0; i < times && !stop_requested; ++i) {
    good += row->run().as_expected;
    fmt::print(stderr, "\r  {} of {} kill trials passed", good, i + 1);
  }
  fmt::print(stderr, "\n");
  return good == times ? kDone : kTripped;
}

using Sets = std::vector<std::string>;

/// Settings of what goes beyond the report.
Sets compensationOf(const std::string& name) {
  if (name == "published") return {};
  const std::string key = "controller.compensation.";
  Sets sets = {key + "feed_forward=true", key + "observer=true", key + "inertia=true",
               "sensor.readings_per_tick=4"};
  if (name == "adapting") sets.insert(sets.end(), {key + "adaptation=true", key + "wrench=aided"});
  return sets;
}

/// Which row was meant, as far as its name tells.
std::string rowMeant(const std::string& id, const std::vector<FaultRow>& rows) {
  std::vector<std::string> ids;
  for (const FaultRow& row : rows) ids.push_back(row.id);
  const std::string meant = nearest(id, ids);
  return meant.empty() ? "want one that --list names" : fmt::format("did you mean '{}'?", meant);
}

}  // namespace

int faultsCommand(int argc, char** argv) {
  CLI::App cli(
      "Injects every fault of the table, most in lockstep, some into real processes, and says "
      "what was expected and what happened. With --scenario on a robot, base and platform of one's "
      "own: which of them reacts otherwise than the table promises. Status 1 when a row is not as "
      "expected.",
      "ves faults");
  std::vector<std::string> only;
  bool lockstep = false, list = false, markdown = false;
  std::int64_t ticks = 0;
  std::uint32_t seed = 1;
  int times = 0;
  FaultBench bench;
  std::string scenario, compensation = "published";
  cli.add_option("--scenario", scenario,
                 "name or file: its robot, base, platform and settings, with the table's programs");
  cli.add_option("--set", bench.sets, "KEY=VALUE, for every row")->allow_extra_args(false);
  cli.add_option("--amplitude", bench.amplitude,
                 "times the table's motions; a heavy robot's sensor may not bear them")
      ->check(inRange(1e-3, 1.0))
      ->capture_default_str();
  cli.add_option("--compensation", compensation, "published, compensated, or adapting (and aided)")
      ->check(CLI::IsMember({"published", "compensated", "adapting"}))
      ->capture_default_str();
  cli.add_option("names", only, "rows, as F3 F12; all by default");
  cli.add_flag("--lockstep", lockstep, "leave out the rows with real processes");
  cli.add_flag("--list", list, "only the faults and what is expected");
  cli.add_flag("--markdown", markdown, "as a table for a page");
  cli.add_option("--soak", ticks, "instead: so many ticks of random faults and recoveries")
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{1'000'000'000'000}));
  cli.add_option("--seed", seed, "of the soak");
  cli.add_option("--kill", times, "instead: kill a controller at so many random moments")
      ->check(CLI::Range(1, 100'000));
  return run(cli, argc, argv, [&] {
    bench.config = configFolder();
    bench.program = ownProgram();
    if (!scenario.empty()) bench.scenario = scenario;
    const Sets more = compensationOf(compensation);
    bench.sets.insert(bench.sets.begin(), more.begin(), more.end());
    catchSignals();
    if (ticks > 0)
      refuse(cli, {"names", "--list", "--markdown", "--lockstep", "--amplitude", "--kill"},
             "beside --soak");
    else
      refuse(cli, {"--seed"}, "without --soak");
    if (times > 0)
      refuse(cli,
             {"names", "--list", "--markdown", "--lockstep", "--amplitude", "--compensation",
              "--scenario", "--set"},
             "beside --kill, which is of z_sine");
    if (list) refuse(cli, {"--markdown", "--amplitude", "--compensation"}, "beside --list");
    if (ticks > 0) {
      Experiment e = loadExperiment(findScenario(bench.scenario, bench.config), bench.sets);
      applyStabilityCheck(e);
      const SoakResult r = soak(e, ticks, seed, [&](std::int64_t done) {
        fmt::print(stderr, "\r  {:.1f} of {:.1f} million ticks", static_cast<double>(done) * 1e-6,
                   static_cast<double>(ticks) * 1e-6);
      });
      fmt::print(stderr, "\n");
      fmt::print("{} ticks, {} faults, {} stops, {} recoveries, hash {:016x}{}\n", r.ticks,
                 r.faults, r.stops, r.recoveries, r.hash,
                 r.violated.empty() ? "" : "\nVIOLATED " + r.violated);
      return r.violated.empty() ? kDone : kTripped;
    }
    const auto rows = faultTable(bench);
    const bool own = scenario.empty() && bench.sets.empty();
    for (const std::string& id : only) {
      const auto row =
          std::find_if(rows.begin(), rows.end(), [&](const FaultRow& r) { return id == r.id; });
      if (row == rows.end())
        throw InputError(fmt::format("'{}': no such row, {}", id, rowMeant(id, rows)));
      if (lockstep && row->processes)
        throw InputError(fmt::format("{}: is of real processes, want no --lockstep", id));
      if (!list && !own && !row->any_machine)
        throw InputError(fmt::format(
            "{}: is about the table's own machine or about none, want no --scenario or --set", id));
    }
    if (!list && !lockstep) enterPrivateBus();
    if (times > 0) return kill(bench, times);
    if (markdown)
      fmt::print(
          "| | fault | expected | seen | detected [ticks / time] | peak deviation [mm] |\n"
          "|---|---|---|---|---|---|\n");
    int missed = 0, ran = 0;
    std::string left_out;
    for (const FaultRow& row : rows) {
      if (!only.empty() && std::find(only.begin(), only.end(), row.id) == only.end()) continue;
      if (lockstep && row.processes) continue;
      if (list) {
        fmt::print("{:<5} {}\n        {}\n", row.id, row.fault, row.expected);
        continue;
      }
      if (stop_requested) continue;
      if (!own && !row.any_machine) {
        left_out += (left_out.empty() ? "" : " ") + row.id;
        continue;
      }
      const FaultOutcome seen = row.run();
      (markdown ? printMarkdownRow : printRow)(row, seen);
      ++ran;
      missed += !seen.as_expected;
    }
    if (!list && !markdown)
      fmt::print("{} of {} rows as expected{}\n", ran - missed, ran,
                 own ? "" : fmt::format(" on {}", bench.scenario));
    if (!left_out.empty())
      fmt::print(stderr, "left out, as they are about the table's own machine or about none: {}\n",
                 left_out);
    return missed == 0 ? kDone : kTripped;
  });
}

}  // namespace ves::app
