// SPDX-License-Identifier: BSD-3-Clause
//
// ves collect: the data collection routine, on a recorded run.
#include <fmt/format.h>
#include <cmath>
#include <fstream>
#include <iostream>

#include "commands.hpp"
#include "logs.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/ordered_log.hpp"
#include "ves/core/build.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/export/parquet.hpp"
#include "ves/export/ros2.hpp"
#include "ves/run/follow_bus.hpp"
#include "ves/series/series.hpp"

namespace ves::app {

namespace {

int writeMcap(const Series& series, const std::string& log, const std::string& file) {
  const std::optional<Emulation> both = emulation(series);
  const BasePoses poses = both ? basePoses(series, both->base) : BasePoses();
  McapExport out(series.experiment, series.version.empty() ? describeBuild() : series.version, file,
                 [&](const Row& row) { return at(poses, row.state); });
  Damage damage;  // told with the series
  OrderedLog reader(log, &damage);
  for (LogEvent event; reader.next(event);) out.add(event);
  out.finish();
  return kDone;
}

/// The rows that are asked for, one after the other.
template <typename F>
void eachRow(const Series& series, double from, double duration, double rate, F f) {
  double next = from;
  for (const Row& row : series.rows) {
    // Half a nanosecond: times are whole nanoseconds in seconds.
    if (row.t < next - 0.5e-9 || row.t > from + duration) continue;
    if (rate > 0.0) next += 1.0 / rate;
    f(row);
  }
}

ParquetWriter tableOf(const Series& series, const std::vector<Column>& columns,
                      const std::string& file) {
  std::vector<ParquetWriter::Column> of;
  for (const Column& column : columns) of.push_back({column.name, column.text != nullptr});
  return {file, of, {{"ves", series.version}, {"experiment", series.experiment.name}}};
}

void addRow(const std::vector<Column>& columns, const Row& row, ParquetWriter& out) {
  for (const Column& column : columns)
    if (column.text)
      out.add(column.text(row));
    else
      out.add(column.value(row));
}

/// The run on the bus as it happens.
int followIntoMcap(const std::string& url, const std::string& file) {
  catchSignals();
  fmt::print(stderr, "waiting for a run on {}; Ctrl-C ends\n", url);
  std::optional<FollowedBase> base;
  std::optional<McapExport> out;
  const auto begin = [&](const experiment_t& m) {
    const Experiment e = parseExperiment(m.resolved, channel::kExperiment);
    base.emplace(e);
    out.emplace(e, m.version, file, [&](const Row& row) {
      base->add(row);
      return base->at(row.state);
    });
  };
  if (!followBus(
          url, [] { return stop_requested != 0; }, begin,
          [&](const LogEvent& event) { out->add(event); }))
    throw InputError(fmt::format("bus {}: no run, nothing is written", url));
  out->finish();
  return kDone;
}

}  // namespace

int collectCommand(int argc, char** argv) {
  CLI::App cli("Takes variables out of a log, as CSV with the unit in every column's name.",
               "ves collect");
  std::string log, out, mcap, parquet, scenario, url = kDefaultUrl, join;
  bool follow = false;
  std::vector<std::string> select;
  bool list = false;
  double rate = 0.0, from = 0.0, duration = HUGE_VAL;
  asLog(cli.add_option("log", log, "a run's folder, or its LCM event log"));
  cli.add_option("--select", select,
                 "columns, or beginnings of their names: z_ fx_dynamic; all by default");
  cli.add_flag("--list", list, "only the names of the columns, and what they mean");
  cli.add_option("--rate", rate, "[Hz] rows per second; every tick by default")
      ->check(inRange(1e-6, 1e6));
  cli.add_option("--from", from, "[s] since the first tick")->check(inRange(0.0, 1e9));
  cli.add_option("--duration", duration, "[s]; to the end by default")->check(inRange(0.0, 1e9));
  cli.add_option("--out", out, "file; standard output by default");
  cli.add_option("--parquet", parquet, "the same table as a Parquet file, for pandas and others")
      ->check(endsWith({".parquet"}));
  cli.add_option("--mcap", mcap, "everything into this MCAP file for Foxglove, PlotJuggler, Rerun")
      ->check(endsWith({".mcap"}));
  cli.add_flag("--follow", follow, "the run on the bus instead of a log, with --mcap");
  addScenarioOfLog(cli, scenario);
  addUrl(cli, url, "LCM bus, with --follow");
  addJoin(cli, join);
  return run(cli, argc, argv, [&] {
    if (follow == !log.empty() || (follow && mcap.empty()))
      throw InputError("want a log, or --follow with --mcap FILE");
    if ((list || !out.empty()) + !parquet.empty() + !mcap.empty() > 1)
      throw InputError("want one of --out or --list, --parquet and --mcap");
    if (!mcap.empty())
      refuse(cli, {"--select", "--rate", "--from", "--duration"},
             "beside --mcap, which has everything");
    if (list) refuse(cli, {"--rate", "--from", "--duration"}, "beside --list");
    if (follow)
      refuse(cli, {"--scenario"}, "beside --follow");
    else
      refuse(cli, {"--url", "--join"}, "without --follow");
    if (!mcap.empty()) requireReplaceable("--mcap", mcap, "\x89MCAP");
    joinIfNamed(join);
    if (follow) return followIntoMcap(url, mcap);
    const Series series = seriesOf(log, scenario);
    if (!mcap.empty()) return writeMcap(series, log, mcap);
    std::vector<Column> chosen;
    std::vector<bool> used(select.size(), false);
    for (const Column& column : columns(series.experiment))
      if (selected(column.name, select, used)) chosen.push_back(column);
    for (std::size_t i = 0; i < select.size(); ++i)
      if (!used[i])
        throw InputError(
            fmt::format("--select {}: no column begins so; --list names them", select[i]));

    if (!series.rows.empty() && from > series.rows.back().t)
      throw InputError(fmt::format("--from {}: the log ends at {} s", from, series.rows.back().t));

    if (!parquet.empty()) {
      requireReplaceable("--parquet", parquet, "PAR1");
      ParquetWriter table = tableOf(series, chosen, parquet);
      eachRow(series, from, duration, rate, [&](const Row& row) { addRow(chosen, row, table); });
      table.finish();
      return kDone;
    }
    std::ofstream file;
    if (!out.empty()) {
      requireReplaceable("--out", out, "t_s");
      file.open(out);
      if (!file) throw InputError(fmt::format("--out {}: cannot be written", out));
    }
    std::ostream& to = out.empty() ? std::cout : file;
    if (list) {
      for (const Column& column : chosen)
        to << fmt::format("{:<36} {}\n", column.name, column.meaning);
    } else {
      to << csvHeader(chosen) << "\n";
      eachRow(series, from, duration, rate,
              [&](const Row& row) { to << csvRow(chosen, row) << "\n"; });
    }
    to.flush();
    if (!to)
      throw InputError(fmt::format("{}: {}", out.empty() ? "standard output" : "--out " + out,
                                   std::strerror(errno)));
    return kDone;
  });
}

}  // namespace ves::app
