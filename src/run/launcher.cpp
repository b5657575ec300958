// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstring>

#include "ves/realtime/realtime.hpp"
#include "ves/run/run.hpp"
#include "ves/transport/channels.hpp"

namespace ves {
namespace {

/// A child that ends with us.
class Process {
 public:
  Process(const std::filesystem::path& program, const std::vector<std::string>& arguments) {
    std::vector<char*> argv;
    std::string name = program.string();
    argv.push_back(name.data());
    std::vector<std::string> copies = arguments;
    for (std::string& argument : copies) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const pid_t parent = getpid();
    pid_ = fork();
    if (pid_ < 0) throw InputError(fmt::format("{}: cannot be started: {}", name, strerror(errno)));
    if (pid_ > 0) return;
    setpgid(0, 0);  // a Ctrl-C on the terminal is the launcher's to interpret
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() != parent) _exit(1);
    execv(name.c_str(), argv.data());
    fmt::print(stderr, "{}: cannot be started: {}\n", name, strerror(errno));
    _exit(127);
  }
  ~Process() {
    if (running()) {
      signal(SIGTERM);
      waitpid(pid_, &status_, 0);
    }
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  bool running() {
    if (pid_ > 0 && waitpid(pid_, &status_, WNOHANG) == pid_) pid_ = 0;
    return pid_ > 0;
  }
  void signal(int number) {
    if (pid_ > 0) kill(pid_, number);
  }
  /// Exit status of an ended child, -1 when a signal ended it.
  int status() const { return WIFEXITED(status_) ? WEXITSTATUS(status_) : -1; }

 private:
  pid_t pid_ = 0;
  int status_ = 0;
};

std::int64_t wallClock() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace

RunResult runProcesses(const Experiment& experiment, const LaunchOptions& options,
                       const std::function<void(const state_t&)>& watch,
                       const std::function<bool()>& stop) {
  const ProcessOptions& process = options.process;
  Bus bus(process.url);
  std::unique_ptr<LogWriter> log;
  // In lockstep the controller records: it is the one that misses nothing.
  if (!process.log.empty() && !process.lockstep) {
    log = std::make_unique<LogWriter>(process.log);
    log->write(channel::kExperiment, describe(experiment, {}, 0), wallClock());
  }
  RunResult result;
  std::int64_t source = 0;  // of our controller: the first to be heard
  std::int64_t heard = 0;   // [-] of its states
  bus.subscribe(
      "VES_(SAMPLE|LEG_COMMAND|STATE|TRUTH|TIMING|ROBOT|OPERATOR)",
      [&](const std::string& channel, const void* data, std::uint32_t size) {
        if (log) log->write(channel, data, size, wallClock());
        if (channel != channel::kState) return;
        const auto state = decode<state_t>(data, size);
        if (!state) return;
        if (source == 0) source = state->header.source;
        if (state->header.source != source) return;
        ++heard;
        result.ticks = state->count + 1;
        result.simulated =
            static_cast<double>((state->header.sequence + 1) * experiment.controller.period) *
            kSecondPerNanosecond;
        result.uncalibrated = state->calibration == static_cast<int>(Calibration::Status::kRefused);
        result.phase = static_cast<Phase>(state->phase);
        result.cause = result.phase == Phase::kDisarmed
                           ? Tripped(static_cast<std::uint32_t>(state->tripped)).first()
                           : static_cast<Check>(state->cause);
        result.cause_tick = state->cause_tick;
        watch(*state);
      });

  std::vector<std::string> shared = {options.scenario.string(), "--url", process.url};
  if (process.lockstep) shared.push_back("--lockstep");
  if (process.realtime) shared.push_back("--realtime");
  std::vector<std::string> arguments = shared;
  arguments.push_back("--start");
  if (process.lockstep && !process.log.empty())
    arguments.insert(arguments.end(), {"--log", process.log});

  const std::int64_t start = monotonicNow();
  Process plant(options.programs / "ves-plant", shared);
  Process controller(options.programs / "ves-controller", arguments);
  bool asked = false;
  while (controller.running()) {
    bus.wait(50);
    bus.drain();
    if (!plant.running() && !asked) {
      controller.signal(SIGTERM);
      throw InputError(fmt::format("ves-plant ended early, status {}", plant.status()));
    }
    if (stop() && !std::exchange(asked, true)) controller.signal(SIGINT);
  }
  bus.drain();
  result.wall = static_cast<double>(monotonicNow() - start) * kSecondPerNanosecond;
  if (controller.status() != 0 && controller.status() != 1)
    throw InputError(fmt::format("ves-controller ended with status {}", controller.status()));
  // The last state may be lost on the way; the exit status is not.
  if (controller.status() == 0) result.phase = Phase::kParked;
  if (controller.status() == 1 && result.good()) result.phase = Phase::kStopped;
  result.lost = bus.failed() + (log ? log->lost() + result.ticks - heard : 0);
  return result;
}

}  // namespace ves
