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

/// What they do while nobody commands: the last reference, or slowly home when the last command let
/// them and its silence lasts.
LegCounts whileSilent(const LegCommand& last, const LegCounts& home,
                      const plant::Watchdog& watchdog, std::int64_t silence) {
  if (!last.park || silence <= watchdog.park_after) return last.counts;
  const double share = std::min(1.0, static_cast<double>(silence - watchdog.park_after) /
                                         static_cast<double>(watchdog.park_time));
  LegCounts out = last.counts;
  for (std::size_t i = 0; i < 6; ++i)
    out[i] += static_cast<std::int32_t>(std::lround(share * (home[i] - out[i])));
  return out;
}

void drive(const Experiment& experiment, const std::string& url) {
  const Identity self = Identity::draw();
  Bus bus(url);
  PlantLink link(bus, std::nullopt);  // who has the legs, and which commands count
  const ControllerConfig& c = experiment.controller;
  const LegCounts home = legCounts(c.legs, legLengths(c.geometry, c.geometry.fromHome(Pose())));
  MockLegs legs(home);
  LegCommand last;
  std::int64_t heard = 0, sequence = 0;
  for (Ticker ticker(kPeriod); !over;) {
    ticker.wait();
    bus.drain();
    const std::int64_t now = monotonicNow();
    link.setTime(now);
    if (const auto command = link.takeCommand()) {
      last = command->first;
      heard = now;
    }
    if (last.engaged)
      legs.follow(whileSilent(last, home, experiment.plant.watchdog, now - heard));
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
