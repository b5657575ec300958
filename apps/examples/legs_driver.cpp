// SPDX-License-Identifier: BSD-3-Clause
//
// A driver of six legs, everything else of the machine being simulated (docs/machine.md):
//
//   build/release/apps/examples/legs_driver z_sine [URL]
//   ./ves run z_sine --set machine.legs=external          in another terminal
//
// Put your hardware where the three functions of MockLegs are. Ends with Ctrl-C.
#include <csignal>
#include <cstdio>

#include "ves/realtime/realtime.hpp"
#include "ves/transport/bus.hpp"
#include "ves/transport/channels.hpp"

namespace {

using namespace ves;

constexpr std::int64_t kPeriod = 2'000'000;  // [ns]
volatile std::sig_atomic_t over = 0;

/// Where the hardware goes: counts are (L - leg_offset)/leg_scale of VES_SETUP.
class MockLegs {
 public:
  explicit MockLegs(const LegCounts& home) { std::copy(home.begin(), home.end(), at_); }

  void read(sample_t& sample) const {
    for (int i = 0; i < 6; ++i) sample.legs[i] = static_cast<std::int32_t>(std::lround(at_[i]));
    sample.adc[6] = 9830;  // [count] 3 V of hydraulic pressure
  }
  void follow(const LegCounts& reference) {
    constexpr double kLag = 0.1;  // [-] of the way in a period
    for (std::size_t i = 0; i < 6; ++i) at_[i] += kLag * (reference[i] - at_[i]);
  }
  void stay() {}

 private:
  double at_[6];  // [count]
};

void drive(const Experiment& experiment, const std::string& url) {
  const Identity self = Identity::draw();
  Bus bus(url);
  PlantLink link(bus, std::nullopt);  // who has the legs, and which commands count
  const ControllerConfig& c = experiment.controller;
  const LegCounts home = legCounts(c.legs, legLengths(c.geometry, c.geometry.fromHome(Pose())));
  MockLegs legs(home);
  std::optional<plant::LegWatchdog> watchdog;  // once a command engages
  std::int64_t sequence = 0;
  for (Ticker ticker(kPeriod); !over;) {
    ticker.wait();
    bus.drain();
    const std::int64_t now = monotonicNow();
    link.setTime(now);
    if (const auto command = link.takeCommand()) {
      if (!watchdog && command->first.engaged)
        watchdog.emplace(experiment.plant.watchdog, command->first.rest, home);
      if (watchdog) watchdog->take(command->first, now);
    }
    if (watchdog)
      legs.follow(watchdog->reference(now));
    else
      legs.stay();
    sample_t sample{};
    sample.header = header(self, sequence++, now);
    sample.legs_time_ns = now;
    legs.read(sample);
    bus.publish(channel::kLegs, sample);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, [](int) { over = 1; });
  std::signal(SIGTERM, [](int) { over = 1; });
  try {
    if (argc < 2) throw InputError("usage: legs_driver SCENARIO [URL]");
    const Experiment experiment = loadExperiment(findScenario(argv[1], "config"));
    drive(experiment, withKey(argc > 2 ? argv[2] : kDefaultUrl, experiment.key_file));
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "legs_driver: %s\n", error.what());
    return 2;
  }
}
