// SPDX-License-Identifier: BSD-3-Clause
//
// ves doctor: can this machine keep the loop's time?
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include "commands.hpp"
#include "runner.hpp"
#include "ves/core/build.hpp"
#include "ves/doctor/doctor.hpp"
#include "ves/evaluation/summary.hpp"
#include "ves/run/process.hpp"

namespace ves::app {
namespace {

void show(const Finding& f) {
  const char* mark = f.state == Finding::State::kGood     ? "ok    "
                     : f.state == Finding::State::kAdvice ? "advice"
                                                          : "BAD   ";
  fmt::print("{} {:<16} {}\n", mark, f.what, f.found);
  if (!f.remedy.empty()) fmt::print("{:<24}-> {}\n", "", f.remedy);
}

void show(const char* what, const Latency& l, const std::string& remark = "") {
  fmt::print("       {:<32}{:>9.0f}{:>9.0f}{:>9.0f}   {}\n", what, l.median * 1e6, l.p99 * 1e6,
             l.max * 1e6, remark);
}

/// Numbers of a summary as a latency.
Latency of(const nlohmann::json& summary, const std::string& name) {
  return {summary[name + "_median_s"], summary[name + "_p99_s"], summary[name + "_max_s"],
          summary["ticks"]};
}

/// Our own controller and plant for a while, as two processes in real time.
nlohmann::json ourLoop(double seconds, const std::string& url) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / fmt::format("ves-doctor-{}", getpid());
  const std::vector<std::string> arguments = {
      "run",
      "free_decay",
      "--url",
      url,
      "--no-plots",
      "--out",
      folder.string(),
      "--set",
      fmt::format("program=[{{calibration: {{}}}}, {{admittance: {{duration_s: {}}}}}]", seconds)};
  std::fflush(stdout);
  const int out = dup(STDOUT_FILENO), err = dup(STDERR_FILENO), null = open("/dev/null", O_WRONLY);
  dup2(null, STDOUT_FILENO);
  dup2(null, STDERR_FILENO);
  Process run(ownProgram(), arguments);
  dup2(out, STDOUT_FILENO);
  dup2(err, STDERR_FILENO);
  for (const int fd : {out, err, null}) close(fd);
  run.wait();
  nlohmann::json summary;
  if (std::ifstream in(folder / "summary.json"); in)
    summary = nlohmann::json::parse(in, nullptr, false);
  std::filesystem::remove_all(folder);
  return summary;
}

}  // namespace

int doctorCommand(int argc, char** argv) {
  CLI::App cli(
      "Checks this machine for real-time runs: kernel, privileges, clock, bus, and how late things "
      "are, beside cyclictest (when installed) and a bare echo over LCM in the same minute. Status "
      "1 when a run would not work.",
      "ves doctor");
  double seconds = 5.0;
  std::string url = kDefaultUrl;
  cli.add_option("--seconds", seconds, "of each measurement")
      ->check(inRange(0.1, 3600.0))
      ->capture_default_str();
  addUrl(cli, url);
  return run(cli, argc, argv, [&] {
    std::vector<Finding> findings = examine(readMachineFacts());
    const bool shared = busWorks(url);
    bool alone = shared;
    if (!shared) {
      try {
        enterPrivateBus();
        alone = true;
      } catch (const InputError&) {
      }
    }
    using State = Finding::State;
    if (shared)
      findings.push_back({State::kGood, "bus", url + ": messages come back", ""});
    else
      findings.push_back({alone ? State::kAdvice : State::kBad, "bus",
                          url + ": nothing comes back" +
                              (alone ? "; a private bus does work (--private-bus)" : ""),
                          "ip link set lo multicast on; ip route add 224.0.0.0/4 dev lo"});
    bool bad = false, realtime = true;
    for (const Finding& f : findings) {
      show(f);
      bad |= f.state == State::kBad;
      if (f.what == "scheduler") realtime = f.state == State::kGood;
    }
    if (!alone) return kTripped;

    constexpr std::int64_t kPeriod = 10'000'000;  // [ns]
    fmt::print("\n       {:<32}{:>9}{:>9}{:>9}   [us]\n", "how late, at 100 Hz", "median", "99 %",
               "most");
    const auto loop = ourLoop(seconds, url);
    const bool ran = loop.is_object() && loop.contains("wake_up_late_median_s");
    if (ran) {
      show("our controller wakes", of(loop, "wake_up_late"));
      show("takes its messages in", of(loop, "stage_receive"));
      show("ticks", of(loop, "stage_tick"));
      show("sends its command", of(loop, "stage_send"));
      show("from waking to the command", of(loop, "tick_compute"));
    }
    if (realtime) claimRealtime(80, false);
    show("a bare ticker wakes", wakeUp(seconds, kPeriod), realtime ? "SCHED_FIFO" : "best effort");
    if (const auto reference = cyclictest(seconds, kPeriod, realtime))
      show("cyclictest", *reference, realtime ? "SCHED_FIFO" : "best effort");
    else
      fmt::print("       {:<32}not installed: apt install rt-tests\n", "cyclictest");
    const int times = static_cast<int>(200.0 * seconds);
    const Latency bare = echo(url, times);
    show("LCM there and back", bare, "bare, two processes");
    const Latency ours = response(
        loadExperiment(configFolder() / "scenarios" / "puma_on_table_4_1.yaml"), url, times);
    show("sample to command", ours,
         fmt::format("our controller in between: {:.2f} x", ours.median / bare.median));
    if (!ran) {
      fmt::print("BAD    a run of our own did not end well: try {} demo\n", frontDoor());
      return kTripped;
    }
    if (const std::string rejected = loop.value("samples_rejected", ""); !rejected.empty())
      fmt::print("       {}\n", rejected);
    fmt::print("       {} of {} ticks missed\n", loop["ticks_missed"].get<std::int64_t>(),
               loop["ticks"].get<std::int64_t>());
    return bad ? kTripped : kDone;
  });
}

}  // namespace ves::app
