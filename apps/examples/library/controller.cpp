// SPDX-License-Identifier: BSD-3-Clause
//
// The controller against the simulated machine, tick by tick: controller SCENARIO.yaml
#include <cstdio>
#include <ves/config/experiment.hpp>
#include <ves/plant/lockstep.hpp>

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "controller SCENARIO.yaml\n"), 2;
  try {
    ves::Experiment e = ves::loadExperiment(argv[1], {});
    const std::string refused = ves::applyStabilityCheck(e);
    if (!refused.empty()) return std::fprintf(stderr, "controller: %s\n", refused.c_str()), 2;

    ves::Lockstep machine(e.controller, e.plant);
    machine.step({ves::Request::kStart, {}, {}});
    const auto done = [](ves::Phase p) {
      return p == ves::Phase::kParked || p == ves::Phase::kStopped;
    };
    while (!done(machine.state().phase)) {
      const ves::TickState& s = machine.step();
      if (s.tick % 100 != 0) continue;
      std::printf("%3lld s  %-9s  z %8.3f mm commanded %8.3f measured   force %8.2f N\n",
                  static_cast<long long>(s.tick / 100), name(s.phase).data(), 1e3 * s.motion.x(2),
                  1e3 * s.measured.p.z(), s.dynamic.f.z());
    }
    return machine.state().phase == ves::Phase::kParked ? 0 : 1;
  } catch (const std::exception& error) {
    return std::fprintf(stderr, "controller: %s\n", error.what()), 2;
  }
}
