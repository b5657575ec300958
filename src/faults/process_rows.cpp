// SPDX-License-Identifier: BSD-3-Clause
#include <arpa/inet.h>
#include <signal.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <random>

#include "rows.hpp"
#include "ves/bus/channels.hpp"
#include "ves/faults/bus_observer.hpp"
#include "ves/run/process.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;
using Arguments = std::vector<std::string>;

constexpr double kLegSlack = 0.01;  // [m] by which a leg may swing past a limit

/// A controller and a plant as processes, the controller in full swing.
class Pair {
 public:
  Pair(const fs::path& config, const fs::path& program)
      : program_(program),
        file_((config / "scenarios" / "z_sine.yaml").string()),
        limits_(loadExperiment(file_).controller.safety) {
    plant = std::make_unique<Process>(program, Arguments{"plant", file_});
    startController({"--start"});
  }
  void startController(Arguments arguments) {
    arguments.insert(arguments.begin(), {"controller", file_});
    // The machine may be busy; what a row injects is not that.
    for (const char* set : {"safety.stall_ticks=60", "safety.overruns_per_second=50"})
      arguments.insert(arguments.end(), {"--set", set});
    controller = std::make_unique<Process>(program_, arguments);
  }
  bool swinging(BusObserver& bus, std::int64_t commands = 300) const {
    const std::int64_t from = bus.engaged;
    return bus.until([&] { return bus.engaged > from + commands; });
  }
  const SafetyLimits& limits() const { return limits_; }

  std::unique_ptr<Process> plant, controller;

 private:
  fs::path program_;
  std::string file_;
  SafetyLimits limits_;
};

/// "legs 212 mm inside their limits"
std::string margin(const BusObserver& bus, const SafetyLimits& limits) {
  const double outside = bus.outside(limits);
  return fmt::format("legs {:.0f} mm {} their limits", std::abs(outside) * 1e3,
                     outside > 0.0 ? "OUTSIDE" : "inside");
}

/// Datagrams at the bus's address that are no LCM messages, or broken ones, whole and in parts; at
/// last the two that end liblcm 1.3.1 (lcm-proj/lcm#628): offset and size of a part wrap.
void floodMalformed(int count) {
  const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(7667);
  to.sin_addr.s_addr = inet_addr("239.255.76.67");
  const auto send = [&](const std::string& datagram) {
    sendto(fd, datagram.data(), datagram.size(), 0, reinterpret_cast<const sockaddr*>(&to),
           sizeof to);
  };
  const std::string channels[] = {channel::kLegCommand, channel::kSample,     channel::kState,
                                  channel::kOperator,   std::string(60, 'x'), ""};
  std::mt19937 random(1);
  for (int i = 0; i < count; ++i) {
    const std::string name = channels[random() % std::size(channels)] + '\0';
    std::string noise(random() % 1400, ' ');
    for (char& c : noise) c = static_cast<char>(random());
    switch (i % 4) {
      case 0: send(noise); break;
      case 1: send("LC02" + noise); break;
      case 2: send("LC02" + noise.substr(0, 4) + name + noise); break;
      case 3: send("LC03" + noise.substr(0, 12) + std::string(4, '\0') + name + noise); break;
    }
    if (i % 200 == 0) usleep(2000);
  }
  const std::string name = channel::kLegCommand + '\0', head("LC03\0\0\0\1\0\0\0\144", 12);
  send(head + std::string("\0\0\0\0\0\0\0\3", 8) + name);
  send(head + std::string("\377\377\377\360\0\1\0\3", 8) + std::string(64, 'x'));
  close(fd);
}

FaultOutcome neverSwung() { return outcome(false, "never in swing"); }

FaultOutcome plantKilled(const fs::path& config, const fs::path& program) {
  BusObserver bus;
  Pair pair(config, program);
  if (!pair.swinging(bus)) return neverSwung();
  pair.plant->signal(SIGKILL);
  pair.plant->wait();
  const std::int64_t last_sample = bus.state.sample_sequence, last_tick = bus.state.header.sequence;
  const bool stopped = bus.until([&] { return bus.phase() == Phase::kStopped; });
  const std::int64_t waited = bus.state.cause_tick - last_tick;
  FaultOutcome out =
      outcome(stopped && bus.cause() == Check::kStale && pair.controller->wait() == 1,
              fmt::format("{}: {}, {} samples after the last", name(bus.phase()), name(bus.cause()),
                          bus.state.sample_sequence - last_sample),
              std::max<std::int64_t>(0, waited));
  return out;
}

FaultOutcome controllerKilled(const fs::path& config, const fs::path& program,
                              std::int64_t commands) {
  BusObserver bus;
  Pair pair(config, program);
  if (!pair.swinging(bus, commands)) return neverSwung();
  pair.controller->signal(SIGKILL);
  pair.controller->wait();
  const bool rests = bus.rests();
  const std::int64_t engaged = bus.engaged, dead = bus.controller;
  pair.startController({"--no-menu"});
  std::int64_t states = 0;
  const bool waits = bus.until([&] {
    if (bus.controller != dead && states == 0) states = bus.states;
    return states > 0 && bus.states > states + 100;
  });
  return outcome(
      rests && waits && bus.engaged == engaged && bus.outside(pair.limits()) <= kLegSlack,
      fmt::format("legs {}, {}; successor engaged {} of {} ticks", rests ? "rest" : "MOVE",
                  margin(bus, pair.limits()), bus.engaged - engaged, bus.states - states));
}

FaultOutcome malformedFlood(const fs::path& config, const fs::path& program) {
  BusObserver bus;
  Pair pair(config, program);
  if (!pair.swinging(bus, 100)) return neverSwung();
  floodMalformed(100'000);
  const bool alive = pair.plant->running();
  const int status = pair.controller->wait();
  const bool rests = bus.rests();
  const bool orderly = status == 0 || status == 1;
  return outcome(alive && orderly && rests && bus.outside(pair.limits()) <= kLegSlack,
                 fmt::format("plant {}, controller {}, legs {}, {}", alive ? "alive" : "DEAD",
                             status == 0   ? "parked"
                             : status == 1 ? fmt::format("stopped: {}", name(bus.cause()))
                                           : fmt::format("ended with status {}", status),
                             rests ? "rest" : "MOVE", margin(bus, pair.limits())));
}

FaultOutcome processorsHogged(const fs::path& config, const fs::path& program) {
  BusObserver bus;
  Process hog1("/bin/sh", {"-c", "while :; do :; done"});
  Process hog2("/bin/sh", {"-c", "while :; do :; done"});
  Pair pair(config, program);
  const int status = pair.controller->wait();
  bus.bus.drain();
  // A stop is as good, when its cause is that time ran out.
  const bool late = bus.cause() == Check::kOverrun || bus.cause() == Check::kStale;
  return outcome((status == 0 || (status == 1 && late)) && bus.outside(pair.limits()) <= kLegSlack,
                 fmt::format("{} with {} late ticks, {}",
                             status == 0   ? "parked"
                             : status == 1 ? fmt::format("stopped: {}", name(bus.cause()))
                                           : fmt::format("ended with status {}", status),
                             bus.state.late_ticks, margin(bus, pair.limits())));
}

}  // namespace

std::vector<FaultRow> processRows(const FaultBench& bench) {
  const fs::path &config = bench.config, &program = bench.program;
  // Another moment at each call, the same ones in each run.
  const auto moments = std::make_shared<std::mt19937>(15);
  return {{"F14", "the machine's process is killed", "controlled stop: sample age", true,
           [=] { return plantKilled(config, program); }},
          {"F15", "the controller is killed",
           "legs come to rest inside their limits; its successor waits", true,
           [=] {
             return controllerKilled(config, program,
                                     5 + static_cast<std::int64_t>((*moments)() % 700));
           }},
          {"F21", "100000 malformed datagrams on the bus",
           "the run goes on or stops, and the legs rest", true,
           [=] { return malformedFlood(config, program); }},
          {"F37", "both processors hogged", "the run goes on, or stops for lack of time", true,
           [=] { return processorsHogged(config, program); }}};
}

}  // namespace ves
