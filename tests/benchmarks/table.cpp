// SPDX-License-Identifier: BSD-3-Clause
//
// Runs the benchmarks, each several times and interleaved: medians and spreads as a table and as
// JSON, and what is compared within one run as ratios.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "ves/bus/bus.hpp"
#include "ves/core/errors.hpp"

namespace {

using Json = nlohmann::ordered_json;

constexpr int kRepetitions = 9;

/// Collects every repetition [ns].
class Collector : public benchmark::BenchmarkReporter {
 public:
  struct Row {
    std::string name;
    std::vector<double> ns;
    std::map<std::string, std::vector<double>> counters;
    std::string error;
    std::int64_t family = 0;  // in order of definition
  };

  bool ReportContext(const Context&) override { return true; }
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration) continue;
      Row& row = find(run.run_name.function_name +
                      (run.run_name.args.empty() ? "" : "/" + run.run_name.args));
      row.family = run.family_index;
      if (run.error_occurred) {
        row.error = run.error_message;
        continue;
      }
      const bool wall = !run.run_name.time_type.empty();
      const double unit = benchmark::GetTimeUnitMultiplier(run.time_unit);
      double ns = 1e9 * (wall ? run.GetAdjustedRealTime() : run.GetAdjustedCPUTime()) / unit;
      if (const auto items = run.counters.find("items_per_second"); items != run.counters.end())
        ns = 1e9 / items->second.value;
      row.ns.push_back(ns);
      for (const auto& [name, counter] : run.counters)
        if (name != "items_per_second") row.counters[name].push_back(counter.value);
    }
  }
  std::vector<Row> rows() const {
    std::vector<Row> out = rows_;
    std::stable_sort(out.begin(), out.end(),
                     [](const Row& a, const Row& b) { return a.family < b.family; });
    return out;
  }

 private:
  Row& find(const std::string& name) {
    for (Row& row : rows_)
      if (row.name == name) return row;
    rows_.emplace_back().name = name;
    return rows_.back();
  }
  std::vector<Row> rows_;
};

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return NAN;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(
      std::lround(share * static_cast<double>(values.size() - 1)))];
}

Json machine() {
  const benchmark::CPUInfo& cpu = benchmark::CPUInfo::Get();
  Json out;
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.rfind("model name", 0) == 0) {
      out["processor"] = line.substr(line.find(':') + 2);
      break;
    }
  out["cores"] = cpu.num_cpus;
  out["megahertz"] = cpu.cycles_per_second / 1e6;
  out["compiler"] = "g++ " __VERSION__;
  out["flags"] = VES_BENCH_FLAGS;
  return out;
}

std::string time(double ns) {
  if (ns < 1e3) return fmt::format("{:.0f} ns", ns);
  if (ns < 1e6) return fmt::format("{:.2f} us", ns * 1e-3);
  return fmt::format("{:.1f} ms", ns * 1e-6);
}

/// What is asked of this code, within this run.
struct Ratio {
  const char* what;
  double value;
  const char* asked;
};

std::vector<Ratio> ratios(const Json& results) {
  const auto ns = [&](const char* name) {
    return results.contains(name) ? results[name].value("median_ns", NAN) : NAN;
  };
  const auto counter = [&](const char* name, const char* which) {
    return results.contains(name) ? results[name].value(which, NAN) : NAN;
  };
  return {
      {"forward kinematics, warm, over KDL's fixed-base PUMA",
       ns("ForwardPoseWarm") / ns("KdlFixedBasePuma"), "<= 0.87"},
      {"  its iterations", counter("ForwardPoseWarm", "iterations"), "<= 3.5"},
      {"  failures in a million poses", counter("ForwardPoseMillion", "failures"), "0"},
      {"KDL's fixed-base PUMA over Newton-Euler on the moving base",
       ns("KdlFixedBasePuma") / ns("NewtonEulerMovingBasePuma"), ">= 2.5"},
      {"controller tick [us]", 1e-3 * ns("ControllerTick"), "<= 8"},
      {"  with compensation [us]", 1e-3 * ns("ControllerTickCompensated"), "<= 8"},
      {"  and adaptation, aided wrench [us]", 1e-3 * ns("ControllerTickLearningAided"), ""},
      {"  99.9th percentile over median", counter("ControllerTickTail", "p999_over_median"),
       "<= 3"},
      {"lockstep, times real time", counter("LockstepDemo", "x_real_time"), ">= 500"},
      {"  over the bus", counter("LockstepDemoOverTheBus", "x_real_time"), ""},
  };
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App cli("Speed of the hot paths; read as ratios within one run.", "ves bench");
  std::string filter = ".", json, beside;
  int repetitions = kRepetitions;
  cli.add_option("--only", filter, "those whose name this regular expression finds");
  cli.add_option("--repetitions", repetitions, "of each")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  cli.add_option("--json", json, "write the results there too");
  cli.add_option("--beside", beside, "JSON of another run, as a column")->check(CLI::ExistingFile);
  try {
    cli.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return cli.exit(error);
    fmt::print(stderr, "ves bench: {} (see --help)\n", error.what());
    return 2;
  }
  try {
    ves::enterPrivateBus();  // nobody else is to hear it
  } catch (const ves::InputError&) {
  }
  Json other;
  if (!beside.empty()) {
    std::ifstream in(beside);
    other = Json::parse(in, nullptr, false);
    if (!other.is_object() || !other.contains("results")) {
      fmt::print(stderr, "ves bench: --beside {}: not the JSON of a bench\n", beside);
      return 2;
    }
  }

  std::vector<std::string> arguments = {argv[0], "--benchmark_filter=" + filter,
                                        "--benchmark_min_time=0.02",
                                        "--benchmark_enable_random_interleaving=true",
                                        fmt::format("--benchmark_repetitions={}", repetitions)};
  std::vector<char*> given;
  for (std::string& argument : arguments) given.push_back(argument.data());
  int count = static_cast<int>(given.size());
  benchmark::Initialize(&count, given.data());
  Collector collector;
  if (benchmark::RunSpecifiedBenchmarks(&collector) == 0) {
    fmt::print(stderr, "ves bench: --only {}: finds none\n", filter);
    return 2;
  }

  Json out;
  out["machine"] = machine();
  const std::string processor = out["machine"].value("processor", "unknown processor");
  fmt::print("{}, {} cores, {}\n\n{:<28}{:>12}{:>24}{}\n", processor,
             out["machine"]["cores"].get<int>(), VES_BENCH_FLAGS, "", "median",
             "of the middle half", beside.empty() ? "" : fmt::format("{:>12}", "beside"));
  Json& results = out["results"];
  for (const Collector::Row& row : collector.rows()) {
    if (!row.error.empty()) {
      fmt::print("{:<28}not run: {}\n", row.name, row.error);
      continue;
    }
    Json& r = results[row.name];
    r["median_ns"] = quantile(row.ns, 0.5);
    r["first_quartile_ns"] = quantile(row.ns, 0.25);
    r["third_quartile_ns"] = quantile(row.ns, 0.75);
    r["repetitions"] = row.ns.size();
    std::string remark;
    for (const auto& [name, values] : row.counters) {
      r[name] = quantile(values, 0.5);
      remark += fmt::format("  {} {:.4g}", name, quantile(values, 0.5));
    }
    std::string column;
    if (!beside.empty())
      column = fmt::format("{:>12}", other["results"].contains(row.name)
                                         ? time(other["results"][row.name]["median_ns"])
                                         : "-");
    fmt::print("{:<28}{:>12}{:>24}{}{}\n", row.name, time(quantile(row.ns, 0.5)),
               time(quantile(row.ns, 0.25)) + " .. " + time(quantile(row.ns, 0.75)), column,
               remark);
  }
  fmt::print("\n");
  for (const Ratio& ratio : ratios(results)) {
    if (!std::isfinite(ratio.value)) continue;
    out["ratios"][ratio.what] = ratio.value;
    fmt::print("{:<62}{:>9.4g}   {}\n", ratio.what, ratio.value,
               *ratio.asked ? std::string("aim ") + ratio.asked : "");
  }
  if (!json.empty()) {
    std::ofstream file(json);
    file << out.dump(2) << "\n";
    if (!file.flush()) {
      fmt::print(stderr, "ves bench: --json {}: cannot be written\n", json);
      return 2;
    }
  }
  return 0;
}
