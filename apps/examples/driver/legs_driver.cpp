// SPDX-License-Identifier: BSD-3-Clause
//
// A driver of six legs, everything else of the machine being simulated (docs/machine.md). It knows
// the bus and nothing else of VES: no scenario, no simulation.
//
//   build/release/apps/examples/legs_driver [URL]
//   ./ves run z_sine --set machine.legs=external          in another terminal
//
// Put your hardware where the three functions of MockLegs are. Ends with Ctrl-C.
#include <cmath>
#include <csignal>
#include <cstdio>

#include "ves/bus/bus.hpp"
#include "ves/bus/channels.hpp"
#include "ves/contract/leg_watchdog.hpp"
#include "ves/core/errors.hpp"
#include "ves/realtime/realtime.hpp"

namespace {

using namespace ves;

constexpr std::int64_t kPeriod = 2'000'000;  // [ns]
volatile std::sig_atomic_t over = 0;

/// Where the hardware goes: a length is setup.legs.offset + count * setup.legs.scale.
class MockLegs {
 public:
  explicit MockLegs(const MachineSetup& setup)
      : pressure_((setup.pressure_min + setup.pressure_max) / 2) {
    std::copy(setup.leg_home.begin(), setup.leg_home.end(), at_);
  }

  void read(Sample& sample) const {
    for (std::size_t i = 0; i < 6; ++i)
      sample.legs[i] = static_cast<std::int32_t>(std::lround(at_[i]));
    sample.adc[kWrenchChannels] = pressure_;
  }
  void follow(const LegCounts& reference) {
    constexpr double kLag = 0.1;  // [-] of the way in a period
    for (std::size_t i = 0; i < 6; ++i) at_[i] += kLag * (reference[i] - at_[i]);
  }
  void stay() {}

 private:
  double at_[6];           // [count]
  std::int32_t pressure_;  // [count]
};

void drive(const std::string& url) {
  const Identity self = Identity::draw();
  Bus bus(url);
  SetupLink controller(bus, self);
  while (!over && !controller.wait(100)) {
  }
  if (over) return;
  const MachineSetup setup = *controller.setup();
  PlantLink link(bus, std::nullopt);  // who has the legs, and which commands count
  MockLegs legs(setup);
  std::optional<LegWatchdog> watchdog;  // once a command engages
  Sample sample;
  for (Ticker ticker(kPeriod); !over;) {
    ticker.wait();
    bus.drain();
    const std::int64_t now = monotonicNow();
    link.setTime(now);
    if (const auto command = link.takeCommand()) {
      if (!watchdog && command->first.engaged)
        watchdog.emplace(setup.watchdog, command->first.rest, setup.leg_home);
      if (watchdog) watchdog->take(command->first, now);
    }
    if (watchdog)
      legs.follow(watchdog->reference(now));
    else
      legs.stay();
    ++sample.sequence;
    sample.time = sample.legs_time = now;
    legs.read(sample);
    bus.publish(channel::kLegs, toMessage(sample, self));
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGINT, [](int) { over = 1; });
  std::signal(SIGTERM, [](int) { over = 1; });
  try {
    if (argc > 2) throw InputError("usage: legs_driver [URL]");
    drive(argc > 1 ? argv[1] : kDefaultUrl);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "legs_driver: %s\n", error.what());
    return 2;
  }
}
