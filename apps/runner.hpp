// SPDX-License-Identifier: BSD-3-Clause
//
// What `run`, `demo` and `controller` share: an experiment from start to its folder of results.
#pragma once

#include <fcntl.h>
#include <fmt/chrono.h>
#include <poll.h>
#include <unistd.h>

#include <fstream>

#include "options.hpp"
#include "outputs.hpp"
#include "print.hpp"
#include "ves/page/web_server.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/results/results.hpp"
#include "ves/run/process.hpp"

namespace ves::app {

inline constexpr int kRecorderPriority = 10;  // [-] SCHED_FIFO, below both processes

struct RunnerOptions : Options {
  std::string out;
  bool overwrite = false;
  bool two_processes = false;
  bool plots = true;
  bool view = false;
  bool on_bus = false;  // prepareBus() was here

  void addOut(CLI::App& cli) {
    auto* const folder =
        cli.add_option("--out", out, "folder for the results; a new one in ves-runs by default");
    cli.add_flag("--overwrite", overwrite, "where a run is in that folder already")->needs(folder);
  }
  /// Nothing waits on a bus or a clock then.
  bool oneProcess() const { return process.lockstep && !two_processes && !process.pace && !view; }
  void requireUsed(const CLI::App& cli) const {
    if (oneProcess())
      refuse(cli, {"--url", "--private-bus", "--join", "--realtime"},
             "beside --lockstep: it is one process");
  }
  void addView(CLI::App& cli) {
    cli.add_flag("--view", view, "show it in a browser meanwhile; prints the address");
  }
  void addQuiet(CLI::App& cli) {
    cli.add_flag("--quiet", quiet, "no progress and no table; warnings and errors only");
  }
};

inline void writeFile(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file);
  out << text;
  out.flush();
  if (!out) throw InputError(file.string() + ": cannot be written");
}

/// The folder of the results, and in it the resolved experiment for the processes to read.
inline LaunchOptions prepareFolder(RunnerOptions& options, const Experiment& experiment) {
  const std::filesystem::path folder =
      options.out.empty()
          ? claimNewFolder(fmt::format("ves-runs/{}-{:%Y%m%d-%H%M%S}", experiment.name,
                                       fmt::localtime(std::time(nullptr))))
          : claimFolder(options.out);
  if (!options.overwrite)
    requireWithout(folder, options.out,
                   {"run.lcmlog", "experiment.yaml", "series.csv", "summary.json", "contacts.csv",
                    "masses.yaml", "belief.yaml", "commission.html"});
  LaunchOptions launch;
  launch.program = ownProgram();
  launch.scenario = folder / "experiment.yaml";
  writeFile(launch.scenario, experiment.source.resolved());
  options.process.log = (folder / "run.lcmlog").string();
  launch.process = options.process;
  return launch;
}

/// A bus that works; `alone`: nobody else needs to be on it.
inline void prepareBus(RunnerOptions& options, bool alone) {
  if (std::exchange(options.on_bus, true)) return;
  if (alone && !options.private_bus && options.join.empty() && !busWorks(options.process.url)) {
    fmt::print(stderr, "multicast does not come back on this machine: using a private bus\n");
    options.private_bus = true;
  }
  options.enterBus();
  // Asked here first, so that a refusal is said once.
  if (options.process.realtime) claimRealtime(kRecorderPriority, true);
}

/// A recording that is not whole is no success.
inline int statusOf(const RunResult& result) {
  if (result.log_lost > 0)
    throw InputError(fmt::format("run.lcmlog: {}: {} events of the log lost", result.log_trouble,
                                 result.log_lost));
  return result.good() ? kDone : kTripped;
}

/// `ves view` on a socket of this network, for a bus that may be in another. Waits until a browser
/// has opened the page, so that nobody misses the beginning.
class ViewBeside {
 public:
  ViewBeside(const std::string& url, const std::filesystem::path& results)
      : listener_(listenOn("127.0.0.1", {})), url_(url), results_(results.string()) {}

  /// Once the bus is entered.
  void start() {
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0) throw InputError("--view: no pipe to be had");
    setenv(kViewToken, listener_.token.c_str(), 1);
    for (const int fd : {listener_.descriptor, ends[1]}) fcntl(fd, F_SETFD, 0);
    process_ = std::make_unique<Process>(
        ownProgram(), std::vector<std::string>{"view", "--url", url_, "--listener",
                                               std::to_string(listener_.descriptor), "--ready",
                                               std::to_string(ends[1]), "--results", results_});
    unsetenv(kViewToken);
    close(listener_.descriptor);
    close(ends[1]);
    fmt::print("watch it at {}\n", listener_.url());
    std::fflush(stdout);
    waitFor(ends[0]);
    close(ends[0]);
  }

 private:
  static void waitFor(int ready) {
    constexpr int kPatience = 60;  // [s]
    fmt::print(stderr, "it begins when a browser has opened that page, in {} s at the latest\n",
               kPatience);
    const std::int64_t until = monotonicNow() + kPatience * 1'000'000'000LL;
    pollfd wait{ready, POLLIN, 0};
    while (!stop_requested && monotonicNow() < until && poll(&wait, 1, 100) == 0) {
    }
  }

  Listener listener_;
  std::string url_, results_;
  std::unique_ptr<Process> process_;
};

/// From start to its log, with a line that tells how far it is.
inline RunResult execute(RunnerOptions& options, const Experiment& experiment,
                         LaunchOptions& launch, bool tells = true) {
  tells = tells && !options.quiet;
  const bool one_process = options.oneProcess();
  catchSignals();
  Progress progress(experiment);
  RunResult result;
  std::optional<ViewBeside> view;
  if (one_process) {
    LogWriter writer(launch.process.log);
    result = runLockstep(experiment, &writer, [&](const TickState& state) {
      double x[6];
      Vec6::Map(x) = state.motion.x;
      if (tells) progress.show(state.phase, state.segment, state.tick, x);
      return stop_requested ? Order{Request::kStop, {}, {}} : Order();
    });
  } else {
    if (options.view)
      view.emplace(options.process.url,
                   launch.scenario.parent_path());  // browsers are not on a private bus
    prepareBus(options, launch.plant);
    if (view) view->start();
    launch.process.start = true;
    result = runProcesses(
        experiment, launch,
        [&](const state_t& s) {
          if (tells) progress.show(static_cast<Phase>(s.phase), s.segment, s.header.sequence, s.x);
        },
        [] { return stop_requested != 0; });
  }
  progress.end();
  return result;
}

inline int runExperiment(const CLI::App& cli, RunnerOptions& options) {
  options.requireUsed(cli);
  if (options.process.lockstep && options.view && !options.process.pace) options.process.pace = 1.0;
  Experiment experiment = options.load();
  printWarnings(experiment, options.verbose);
  warnOfInstability(experiment);
  LaunchOptions launch = prepareFolder(options, experiment);
  const RunResult result = execute(options, experiment, launch);
  const std::string table = writeResults(launch.scenario.parent_path(), result, options.plots);
  if (!options.quiet)
    fmt::print("{}", table);
  else if (!result.good())
    fmt::print(stderr, "ves run: {}\n", whyNot(result, launch.process.log));
  return statusOf(result);
}

}  // namespace ves::app
