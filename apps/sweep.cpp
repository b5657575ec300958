// SPDX-License-Identifier: BSD-3-Clause
//
// ves sweep: one scenario over many values.
#include <fmt/format.h>
#include <unistd.h>

#include "commands.hpp"
#include "runner.hpp"
#include "ves/config/keys.hpp"
#include "ves/core/build.hpp"
#include "ves/export/parquet.hpp"
#include "ves/series/series.hpp"
#include "ves/sweep/sweep.hpp"

namespace ves::app {
namespace {

/// Our place among the processes that mpirun (or srun) has started; {0, 1} without.
std::pair<int, int> place() {
  for (const auto& [rank, size] : {std::pair{"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"},
                                   {"PMI_RANK", "PMI_SIZE"},
                                   {"SLURM_PROCID", "SLURM_NTASKS"}}) {
    const char *r = std::getenv(rank), *s = std::getenv(size);
    if (!r || !s) continue;
    // A batch script itself is no task of a step; one that srun has started is.
    if (std::string_view(rank) == "SLURM_PROCID" && !std::getenv("SLURM_STEP_NUM_TASKS")) continue;
    const int of = std::atoi(s), at = std::atoi(r);
    if (of >= 1 && at >= 0 && at < of) return {at, of};
  }
  return {0, 1};
}

std::string duration(double seconds) {
  if (seconds < 100.0) return fmt::format("{:.0f} s", seconds);
  if (seconds < 6000.0) return fmt::format("{:.0f} min", seconds / 60.0);
  return fmt::format("{:.1f} h", seconds / 3600.0);
}

/// What the scenario's readers ask of its keys.
AskedKey askedOf(const std::string& scenario, const std::vector<std::string>& sets) {
  Value document = loadDocument(scenario);
  for (const std::string& set : sets) applyOverride(document, set);
  AskedKey asked;
  askKeys(document, asked);
  return asked;
}

bool takesOnlyWhole(const AskedKey& asked, const std::string& key) {
  const AskedKey* at = &asked;
  for (std::size_t from = 0; from <= key.size();) {
    const std::size_t end = std::min(key.find('.', from), key.size());
    const auto next = at->keys.find(key.substr(from, end - from));
    if (next == at->keys.end()) return false;
    at = &next->second;
    from = end + 1;
  }
  return at->kinds == AskedKey::kInteger;
}

/// The rows of a table, beside it. Columns are numbers where every field is one, or empty.
std::filesystem::path writeParquet(const std::filesystem::path& csv, const std::string& plan) {
  const auto eachLine = [&](const std::function<void(const std::vector<std::string>&)>& f) {
    std::ifstream in(csv);
    for (std::string line; std::getline(in, line);) f(csvFields(line));
  };
  const auto number = [](const std::string& field) {
    char* end = nullptr;
    const double x = std::strtod(field.c_str(), &end);
    return field.empty() || *end ? std::nullopt : std::optional(x);
  };
  std::vector<ParquetWriter::Column> columns;
  eachLine([&](const std::vector<std::string>& fields) {
    const bool header = columns.empty();
    for (std::size_t i = 0; i < fields.size(); ++i)
      if (header)
        columns.push_back({fields[i]});
      else if (!fields[i].empty() && !number(fields[i]))
        columns[i].words = true;
  });
  std::filesystem::path file = csv;
  file.replace_extension(".parquet");
  ParquetWriter out(file.string(), columns, {{"ves", describeBuild()}, {"sweep", plan}});
  bool header = true;
  eachLine([&](const std::vector<std::string>& fields) {
    for (std::size_t i = 0; i < fields.size() && !header; ++i)
      if (fields[i].empty())
        out.add();
      else if (columns[i].words)
        out.add(fields[i]);
      else
        out.add(*number(fields[i]));
    header = false;
  });
  out.finish();
  return file;
}

/// What is wrong with the first and the last run is told before hours have passed. A motion that
/// a check would stop is a row's own matter, unless both have one. The scenario's name.
std::string requireRuns(const SweepPlan& plan, const SweepOptions& options) {
  std::string name, stopped;
  for (const std::int64_t run : {std::int64_t{0}, plan.subset() ? 0 : plan.size() - 1}) {
    Value document = loadDocument(options.scenario);
    for (const std::string& set : options.overrides) applyOverride(document, set);
    plan.put(plan.overrides(run), document);
    try {
      name = buildExperiment(std::move(document), {}).name;
    } catch (const WouldStop& error) {
      stopped = fmt::format("run {}: {}", run, error.what());
    }
  }
  if (name.empty()) throw InputError(stopped);
  if (!stopped.empty()) fmt::print(stderr, "{}; its row says so\n", stopped);
  return name;
}

}  // namespace

int sweepCommand(int argc, char** argv) {
  CLI::App cli(
      "A scenario in lockstep over every combination of the varied values, or random draws, on all "
      "cores: one row a run in sweep.csv. The same rows whatever the number of workers; the same "
      "command again goes on where it ended. Under mpirun every process takes its share; they meet "
      "in one folder.",
      "ves sweep");
  std::string scenario, out, figure;
  double until = 0.0;
  bool parquet = false;
  const std::vector<std::string> designs = {"uniform", "latin", "sobol", "subset"};
  std::string laid = designs.front();
  std::vector<std::string> sets, vary, draw;
  std::int64_t runs = 1;
  std::uint64_t seed = 1;
  const auto [rank, ranks] = place();
  int workers = ranks > 1 ? 1 : allCores();
  cli.add_option("scenario", scenario, "name in config/scenarios, or a .yaml file")->required();
  cli.add_option("--vary", vary, "KEY=V1,V2,.. or KEY=FROM:TO:COUNT")->allow_extra_args(false);
  cli.add_option("--draw", draw, "KEY=FROM:TO, uniform, another one each run")
      ->allow_extra_args(false);
  cli.add_option("--runs", runs, "of each combination, each with its own noise")
      ->check(CLI::Range(1, 100'000'000))
      ->capture_default_str();
  cli.add_option(
         "--design", laid,
         "how draws lie: uniform, latin (hypercube), sobol, or subset: ever nearer to --figure's "
         "limit, --runs a level, to tell how often it is passed where that is rare")
      ->check(CLI::IsMember(designs));
  cli.add_option("--figure", figure,
                 "COLUMN, whose mean is told, or COLUMN>LIMIT: how often; with 95 % confidence");
  cli.add_option("--until", until, "half of that interval, at which no more runs are needed")
      ->check(aboveZero())
      ->needs("--figure");
  cli.add_option("--seed", seed, "of draws and noise")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{UINT32_MAX}))
      ->capture_default_str();
  cli.add_option("--set", sets, "KEY.PATH=VALUE of every run")->allow_extra_args(false);
  addWorkers(cli, workers, "runs at a time");
  cli.add_option("--out", out, "folder; ves-runs/sweep-SCENARIO by default");
  cli.add_flag("--parquet", parquet, "sweep.parquet beside sweep.csv, for pandas and others");
  return run(cli, argc, argv, [&, rank = rank, ranks = ranks] {
    SweepPlan plan;
    for (const std::string& option : vary) plan.vary(option);
    for (const std::string& option : draw) plan.draw(option);
    plan.repeat(runs);
    plan.seed(seed);
    if (draw.empty() && runs == 1) refuse(cli, {"--seed"}, "without --draw or --runs");
    const std::vector<std::string> varied = plan.keys();
    for (const std::string& set : sets)
      if (const std::string key = set.substr(0, set.find('='));
          std::find(varied.begin(), varied.end(), key) != varied.end())
        throw InputError(fmt::format("--set {}: is another one each run, leave it out", key));
    const auto design =
        static_cast<SweepDesign>(std::find(designs.begin(), designs.end(), laid) - designs.begin());
    plan.lay(design);
    if (plan.size() == 1) throw InputError("one run only: want more values of --vary, or --runs");
    SweepOptions options;
    options.scenario = findScenario(scenario, configFolder());
    options.overrides = sets;
    options.workers = workers;
    options.rank = rank;
    options.ranks = ranks;
    if (!figure.empty()) options.figure = Figure(figure);
    options.until = until;
    if (until > 0.0 && ranks > 1)
      throw InputError("--until: looks at rows one after the other, want one process");
    if (until > 0.0 && design != SweepDesign::kUniform)
      throw InputError("--until: a design has all of its runs, want --design uniform");
    if (!draw.empty())
      plan.drawWhole([asked = askedOf(options.scenario, sets)](const std::string& key) {
        return takesOnlyWhole(asked, key);
      });
    const std::string name = requireRuns(plan, options);
    if (out.empty()) out = "ves-runs/sweep-" + name;
    requireFigure(plan, options);
    options.file = makeFolder(out) / "sweep.csv";
    catchSignals();
    const bool terminal = isatty(STDERR_FILENO) != 0;
    const SweepResult result = sweep(
        plan, options,
        [&](const SweepProgress& p) {
          if (!terminal) return;
          const double rate = static_cast<double>(p.run_now) / std::max(p.elapsed, 1e-9);
          fmt::print(stderr, "\r{} of {}, {:.1f} a second, {} left        ", p.done, p.of, rate,
                     duration(static_cast<double>(p.of - p.done) / rate));
        },
        [] { return stop_requested != 0; });
    if (terminal) fmt::print(stderr, "\r{:60}\r", "");
    if (!result.complete) {
      const bool others = ranks > 1 && !stop_requested;
      fmt::print("{} of {}{} runs so far; {}\n", result.rows, plan.subset() ? "at most " : "",
                 plan.size(),
                 others ? fmt::format("the last of the {} processes puts them together", ranks)
                        : "the same command goes on");
      return others ? kDone : kTripped;
    }
    fmt::print("{} runs{}\n{}\n", result.rows,
               result.not_good ? fmt::format(", {} of them not to their end", result.not_good) : "",
               options.file.string());
    if (parquet) fmt::print("{}\n", writeParquet(options.file, plan.text()).string());
    if (result.figure) {
      const Figure::Estimate& f = *result.figure;
      const char* none =
          design == SweepDesign::kUniform || result.levels ? "" : ", or closer by its design";
      fmt::print("{}: {:.4g}, {:.4g} to {:.4g} with 95 % confidence{}, of {} runs{}{}\n", figure,
                 f.value, f.low, f.high, none, f.of,
                 result.levels
                     ? fmt::format(" in {} level{}", result.levels, result.levels > 1 ? "s" : "")
                     : "",
                 f.without ? fmt::format("; {} have none", f.without) : "");
      if (until > 0.0 && !(f.half() <= until))
        fmt::print("not within {:g}: want more --runs\n", until);
    }
    return kDone;
  });
}

}  // namespace ves::app
