// SPDX-License-Identifier: BSD-3-Clause
//
// ves netft-server: the simulated force sensor as an ATI Net F/T.
#include <fmt/format.h>
#include <time.h>

#include "commands.hpp"
#include "logs.hpp"
#include "options.hpp"
#include "ves/bus/channels.hpp"
#include "ves/bus/event_log.hpp"
#include "ves/devices/net_ft_server.hpp"
#include "ves/realtime/realtime.hpp"

namespace ves::app {
namespace {

using devices::NetFtServer;

Wrench reading(const truth_t& truth) { return Wrench::from(Vec6::Map(truth.sensor)); }

/// What the sensor of a recorded run read, along straight lines between its samples.
class RecordedWrench {
 public:
  explicit RecordedWrench(const std::string& log) {
    LogReader reader(log, &damage_);
    LogEvent event;
    while (reader.next(event)) {
      if (event.channel != channel::kTruth) continue;
      const auto truth = event.as<truth_t>();
      if (!truth || (!all_.empty() && truth->header.time_ns <= all_.back().time)) continue;
      all_.push_back({truth->header.time_ns, reading(*truth).stacked()});
    }
    printDamage(damage_);
    if (all_.empty()) throw InputError(fmt::format("{}: no {} in this log", log, channel::kTruth));
  }

  /// `since` [ns] the first sample.
  Wrench at(std::int64_t since) {
    const std::int64_t t = all_.front().time + since;
    while (next_ + 1 < all_.size() && all_[next_].time <= t) ++next_;
    if (next_ == 0) return Wrench::from(all_.front().W);
    const Point &a = all_[next_ - 1], &b = all_[next_];
    const double share = std::clamp(
        static_cast<double>(t - a.time) / static_cast<double>(b.time - a.time), 0.0, 1.0);
    return Wrench::from(a.W + share * (b.W - a.W));
  }
  std::int64_t duration() const { return all_.back().time - all_.front().time; }  // [ns]

 private:
  struct Point {
    std::int64_t time;  // [ns]
    Vec6 W;
  };
  std::vector<Point> all_;
  std::size_t next_ = 0;
  Damage damage_;
};

void sleepUntil(std::int64_t time) {
  const timespec until{time / 1'000'000'000, time % 1'000'000'000};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
}

constexpr std::int64_t kSilence = 100'000'000;   // [ns]
constexpr std::uint32_t kNoSensor = 0x80000010;  // error; no data from the sensor

void announce(const NetFtServer& server, const NetFtServer::Options& options) {
  fmt::print("records on {}:{} (UDP), {} a second to who asks; http://{}:{}/netftapi2.xml\n",
             options.address, server.port(), options.rate, options.address, server.httpPort());
  std::fflush(stdout);
}

void serveLog(NetFtServer& server, RecordedWrench& wrench) {
  const std::int64_t start = monotonicNow();
  // Record by record, each as of the moment when it is due.
  for (std::int64_t due = start; !stop_requested && due - start <= wrench.duration();
       due = server.due()) {
    sleepUntil(due);
    server.set(wrench.at(due - start));
    server.serve(due);
  }
}

/// The sensor of the machine on the bus; until one is there, as it is at rest. One that has fallen
/// silent is at fault.
void serveBus(NetFtServer& server, const Experiment& experiment, const std::string& url) {
  plant::Plant at_rest(experiment.plant);
  at_rest.sample();
  Wrench wrench = at_rest.truth().F_So_S;
  std::int64_t heard = 0;  // [ns]
  Bus bus(withKey(url, experiment.key_file));
  bus.subscribe({channel::kTruth}, [&](const std::string&, const void* data, std::uint32_t size) {
    if (const auto truth = decode<truth_t>(data, size)) {
      wrench = reading(*truth);
      heard = monotonicNow();
    }
  });
  while (!stop_requested) {
    bus.drain();
    const bool silent = heard > 0 && monotonicNow() - heard > kSilence;
    server.set(wrench, silent ? kNoSensor : 0);
    server.serve(monotonicNow());
    sleepUntil(server.due());
  }
}

}  // namespace

int netftServerCommand(int argc, char** argv) {
  CLI::App cli(
      "Serves the simulated force sensor as an ATI Net F/T: of the machine on the bus, or of a "
      "recorded run. Its axes are the sensor's; forces in N, moments in N m.",
      "ves netft-server");
  std::string what, url = kDefaultUrl, join;
  NetFtServer::Options options;
  cli.add_option("what", what, "scenario of the machine on the bus, or the log of a run")
      ->required();
  cli.add_option("--address", options.address, "of this machine to serve on")
      ->capture_default_str();
  cli.add_option("--port", options.port, "UDP; 0: any")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  cli.add_option("--http-port", options.http_port, "0: any")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  cli.add_option("--rate", options.rate, "records a second")
      ->check(CLI::Range(1, NetFtServer::kFastest))
      ->capture_default_str();
  cli.add_option("--serial", options.calibration.serial, "of the calibration")
      ->check([](const std::string& text) {
        const bool plain =
            !text.empty() && text.size() < 32 &&
            std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isalnum(c); });
        return plain ? std::string() : fmt::format("'{}', want letters and digits", text);
      });
  addUrl(cli, url);
  addJoin(cli, join);
  return run(cli, argc, argv, [&] {
    joinIfNamed(join);
    catchSignals();
    const bool log = std::filesystem::is_regular_file(what) &&
                     std::filesystem::path(what).extension() != ".yaml";
    if (log) refuse(cli, {"--url"}, "beside a log");
    std::optional<RecordedWrench> recorded;
    std::optional<Experiment> experiment;
    if (log)
      recorded.emplace(what);
    else
      experiment = loadExperiment(findScenario(what, configFolder()));
    NetFtServer server(options);
    announce(server, options);
    if (recorded)
      serveLog(server, *recorded);
    else
      serveBus(server, *experiment, url);
    fmt::print("{} records sent\n", server.sent());
    return kDone;
  });
}

}  // namespace ves::app
