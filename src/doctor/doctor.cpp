// SPDX-License-Identifier: BSD-3-Clause
#include "ves/doctor/doctor.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/utsname.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <sstream>
#include <thread>

#include "ves/bus/bus.hpp"
#include "ves/bus/channels.hpp"
#include "ves/config/document.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves {
namespace {

using State = Finding::State;

std::string firstLine(const char* file) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  return line;
}

/// In a child, so that nothing of it stays.
bool granted(bool (*ask)()) {
  const pid_t child = fork();
  if (child == 0) _exit(ask() ? 0 : 1);
  int status = 1;
  return child > 0 && waitpid(child, &status, 0) == child && WIFEXITED(status) &&
         WEXITSTATUS(status) == 0;
}

bool fifo() {
  sched_param param{};
  param.sched_priority = 80;
  return sched_setscheduler(0, SCHED_FIFO, &param) == 0;
}
bool locked() { return mlockall(MCL_CURRENT | MCL_FUTURE) == 0; }

Finding kernel(const MachineFacts& m) {
  Finding f{State::kGood, "kernel", m.kernel, ""};
  if (!m.real_time_kernel) {
    f.state = State::kAdvice;
    f.remedy = "no real-time kernel; for hard limits: apt install linux-image-rt-amd64";
  }
  return f;
}

Finding processors(const MachineFacts& m) {
  Finding f{State::kGood, "processors",
            fmt::format("{}{}", m.processors, m.governor.empty() ? "" : ", governor " + m.governor),
            ""};
  if (m.processors < 2) {
    f.state = State::kAdvice;
    f.remedy = "controller and plant share one core; two are better";
  } else if (!m.governor.empty() && m.governor != "performance") {
    f.state = State::kAdvice;
    f.remedy = "cpupower frequency-set -g performance";
  }
  return f;
}

Finding clockSource(const MachineFacts& m) {
  Finding f{State::kGood, "clock",
            fmt::format("monotonic, {} ns{}", m.clock_resolution,
                        m.clock_source.empty() ? "" : ", source " + m.clock_source),
            ""};
  if (m.clock_resolution > 1000) {
    f.state = State::kBad;
    f.remedy = "no high-resolution timers: boot without highres=off";
  } else if (m.clock_source == "acpi_pm" || m.clock_source == "hpet") {
    f.state = State::kAdvice;
    f.remedy = "a slow clock; boot with clocksource=tsc where the processor's is constant";
  }
  return f;
}

Finding scheduler(const MachineFacts& m) {
  if (m.fifo) return {State::kGood, "scheduler", "SCHED_FIFO granted", ""};
  return {State::kAdvice, "scheduler",
          fmt::format("SCHED_FIFO refused (ulimit -r is {})", m.priority_limit),
          "as root, or '@realtime - rtprio 99' in /etc/security/limits.d; without it: best effort"};
}

Finding memory(const MachineFacts& m) {
  if (m.lockable) return {State::kGood, "memory", "can be locked", ""};
  return {State::kAdvice, "memory",
          fmt::format("cannot be locked (ulimit -l is {} KiB)", m.lock_limit / 1024),
          "as root, or '@realtime - memlock unlimited' in /etc/security/limits.d"};
}

Finding sockets(const MachineFacts& m) {
  constexpr long kEnough = 2 * 1024 * 1024;  // [B] a second of everything on the bus, and more
  Finding f{State::kGood, "socket buffers", fmt::format("at most {} KiB", m.socket_buffer / 1024),
            ""};
  if (m.socket_buffer < kEnough) {
    f.state = State::kAdvice;
    f.remedy =
        fmt::format("messages may be lost under load: sysctl -w net.core.rmem_max={}", kEnough);
  }
  return f;
}

}  // namespace

std::optional<Latency> cyclictestLatency(const std::string& text) {
  constexpr double kMicro = 1e-6;
  std::vector<double> all;
  double max = 0.0;
  long overflows = 0;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    long us = 0, count = 0;
    if (std::sscanf(line.c_str(), "%ld %ld", &us, &count) == 2 && count >= 0 && count < 1'000'000)
      all.insert(all.end(), static_cast<std::size_t>(count), static_cast<double>(us) * kMicro);
    if (std::sscanf(line.c_str(), "# Max Latencies: %ld", &us) == 1)
      max = static_cast<double>(us) * kMicro;
    if (std::sscanf(line.c_str(), "# Histogram Overflows: %ld", &count) == 1 && count > 0 &&
        count < 1'000'000)
      overflows = count;
  }
  all.insert(all.end(), static_cast<std::size_t>(overflows), max);
  if (all.empty()) return {};
  return latencyOf(all);
}

MachineFacts readMachineFacts() {
  MachineFacts m;
  utsname name{};
  uname(&name);
  const std::string version = name.version;
  m.kernel = fmt::format("{} {}, {}", name.sysname, name.release, version);
  m.real_time_kernel =
      version.find("PREEMPT_RT") != std::string::npos || firstLine("/sys/kernel/realtime") == "1";
  m.processors = std::thread::hardware_concurrency();
  m.governor = firstLine("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
  timespec resolution{};
  clock_getres(CLOCK_MONOTONIC, &resolution);
  m.clock_resolution = resolution.tv_sec * 1'000'000'000LL + resolution.tv_nsec;
  m.clock_source = firstLine("/sys/devices/system/clocksource/clocksource0/current_clocksource");
  m.fifo = granted(fifo);
  m.lockable = granted(locked);
  rlimit limit{};
  getrlimit(RLIMIT_RTPRIO, &limit);
  m.priority_limit = limit.rlim_cur;
  getrlimit(RLIMIT_MEMLOCK, &limit);
  m.lock_limit = limit.rlim_cur;
  m.socket_buffer = std::atol(firstLine("/proc/sys/net/core/rmem_max").c_str());
  return m;
}

std::vector<Finding> examine(const MachineFacts& m) {
  return {kernel(m), processors(m), clockSource(m), scheduler(m), memory(m), sockets(m)};
}

Latency wakeUp(double seconds, std::int64_t period) {
  std::vector<double> late;
  const auto ticks = static_cast<std::int64_t>(seconds / kSecondPerNanosecond) / period;
  late.reserve(static_cast<std::size_t>(ticks));
  Ticker ticker(period);
  for (std::int64_t i = 0; i < ticks; ++i) {
    ticker.wait();
    late.push_back(static_cast<double>(ticker.late()) * kSecondPerNanosecond);
  }
  return latencyOf(late);
}

std::optional<Latency> cyclictest(double seconds, std::int64_t period, bool realtime) {
  const std::string command = fmt::format(
      "cyclictest -q {} -i {} -l {} -h 2000 2>/dev/null", realtime ? "-m -p 80" : "", period / 1000,
      static_cast<std::int64_t>(seconds / kSecondPerNanosecond) / period);
  std::FILE* pipe = popen(command.c_str(), "r");
  if (!pipe) return {};
  std::string text;
  char block[4096];
  while (const std::size_t n = std::fread(block, 1, sizeof block, pipe)) text.append(block, n);
  return pclose(pipe) == 0 ? cyclictestLatency(text) : std::nullopt;
}

namespace {

constexpr int kPatience = 200;             // [ms] for one answer
constexpr int kWarm = 20;                  // [-] first ones that do not count
constexpr std::int64_t kPace = 5'000'000;  // [ns]

/// Runs `work` in a process of its own while it lives.
class Other {
 public:
  explicit Other(const std::function<void()>& work) : child_(fork()) {
    if (child_ < 0) throw InputError("doctor: no second process");
    if (child_ > 0) return;
    try {
      work();
    } catch (const std::exception&) {  // its silence is noticed
    }
    _exit(0);
  }
  ~Other() {
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
  }
  Other(const Other&) = delete;
  Other& operator=(const Other&) = delete;

 private:
  pid_t child_;
};

/// From `send(i)` until `heard()` is i, for i from `first`, as often as asked: one every kPace, as
/// in a running loop, so that nobody is still busy with the last.
template <typename Send, typename Heard>
Latency thereAndBack(Bus& bus, int first, int times, const Send& send, const Heard& heard) {
  std::vector<double> all;
  Ticker pace(kPace);
  for (int i = first; i < first + times + kWarm; ++i) {
    pace.wait();
    const std::int64_t sent = send(i);
    while (heard() != i && monotonicNow() - sent < kPatience * 1'000'000LL) bus.wait(kPatience);
    if (heard() == i && i >= first + kWarm)
      all.push_back(static_cast<double>(monotonicNow() - sent) * kSecondPerNanosecond);
  }
  if (all.empty()) throw InputError("doctor: nothing comes back");
  return latencyOf(all);
}

}  // namespace

Latency echo(const std::string& url, int times) {
  constexpr const char* kThere = "VES_ECHO_THERE";
  constexpr const char* kBack = "VES_ECHO_BACK";
  const pid_t parent = getpid();
  const Other other([&] {
    Bus bus(url);
    leg_command_t answer{};
    bus.subscribe({kThere}, [&](const std::string&, const void* data, std::uint32_t size) {
      const auto m = decode<sample_t>(data, size);
      if (!m) return;
      answer.header.sequence = m->header.sequence;
      bus.publish(kBack, answer);
    });
    while (getppid() == parent) bus.wait(kPatience);
  });
  Bus bus(url);
  std::int64_t heard = -1;
  bus.subscribe({kBack}, [&](const std::string&, const void* data, std::uint32_t size) {
    if (const auto m = decode<leg_command_t>(data, size)) heard = m->header.sequence;
  });
  sample_t sample{};
  const auto send = [&](int i) {
    sample.header.sequence = i;
    const std::int64_t now = monotonicNow();
    bus.publish(kThere, sample);
    return now;
  };
  return thereAndBack(bus, 0, times, send, [&] { return heard; });
}

Latency response(const Experiment& experiment, const std::string& url, int times) {
  const pid_t parent = getpid();
  const Other controller([&] {
    ProcessOptions options;
    options.url = url;
    options.lockstep = true;
    options.start = true;
    runController(experiment, options, [&](const TickState&) {
      return getppid() == parent ? Order() : Order{Request::kStop, {}, {}};
    });
  });
  Bus bus(url);
  const Identity self = Identity::draw();
  std::int64_t heard = -2;
  LegCommand command;
  bus.subscribe({channel::kLegCommand},
                [&](const std::string&, const void* data, std::uint32_t size) {
                  const auto m = decode<leg_command_t>(data, size);
                  const auto legs = m ? fromMessage(*m) : std::nullopt;
                  if (!legs) return;
                  command = *legs;
                  heard = m->header.sequence;
                });
  const std::int64_t until = monotonicNow() + 5'000'000'000;
  while (heard < -1 && monotonicNow() < until) bus.wait(kPatience);
  if (heard < -1) throw InputError("doctor: the controller does not answer");
  plant::Plant plant(experiment.plant);
  const auto send = [&](int i) {
    if (i > 0) {
      plant.command(command);
      plant.advance(i * experiment.controller.period);
    }
    Sample sample = plant.sample();
    sample.answers = i - 1;
    const sample_t message = toMessage(sample, self);
    const std::int64_t now = monotonicNow();
    bus.publish(channel::kSample, message);
    return now;
  };
  return thereAndBack(bus, 0, times, send, [&] { return heard; });
}

}  // namespace ves
