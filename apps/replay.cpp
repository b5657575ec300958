// SPDX-License-Identifier: BSD-3-Clause
//
// ves replay: a recorded run through the controller once more.
#include <fmt/format.h>

#include "commands.hpp"
#include "logs.hpp"
#include "options.hpp"
#include "ves/core/build.hpp"
#include "ves/run/replay.hpp"

namespace ves::app {

int replayCommand(int argc, char** argv) {
  CLI::App cli(
      "Feeds the recorded samples of a log through the controller and tells what happened. "
      "Needs nothing but the log.",
      "ves replay");
  std::string log, with;
  bool check = false;
  ReplayOptions options;
  asLog(cli.add_option("log", log, "a run's folder, its LCM event log, or one of lcm-logger"))
      ->required();
  cli.add_flag("--check", check,
               "compare every command and state bit for bit; differences: status 1");
  cli.add_option("--speed", options.speed, "times real time; as fast as it goes by default")
      ->check(inRange(1e-3, 1e6));
  cli.add_option(
      "--with", with,
      "what would the controller have done with this scenario? Also for a log without one");
  return run(cli, argc, argv, [&] {
    std::optional<Experiment> other;
    if (!with.empty()) {
      other = loadExperiment(findScenario(with, configFolder()));
      applyStabilityCheck(*other);
      options.with = &*other;
    }
    Phase phase = Phase::kDisarmed;
    std::int32_t segment = -1;
    SegmentKind kind = SegmentKind::kCount;
    const ReplayResult r = replay(log, options, [&](const TickState& state) {
      if (state.phase == phase && state.segment == segment && state.kind == kind) return;
      phase = state.phase;
      segment = state.segment;
      kind = state.kind;
      fmt::print("  tick {:>7}  {}{}\n", state.tick, name(phase),
                 phase == Phase::kRunning ? fmt::format(": {}", name(kind)) : "");
    });
    if (r.name.empty())
      fmt::print("{}: without a configuration, {} ticks replayed\n", log, r.ticks);
    else
      fmt::print("{}: {} (configuration {}, version {}), {} ticks replayed\n", log, r.name, r.hash,
                 r.version, r.ticks);
    if (!r.name.empty() && !r.same_arithmetic)
      fmt::print(
          "this log is of a build with another arithmetic than this one's ({}): the last bit "
          "may differ\n",
          build().arithmetic);
    if (r.stability == Stability::kUnstable || r.stability == Stability::kUnknown)
      fmt::print("admittance control was refused: the stability of its loop was '{}'\n",
                 kStabilityNames[static_cast<std::size_t>(r.stability)]);
    if (r.cause != Check::kCount)
      fmt::print("stopped in tick {} by: {}\n", r.cause_tick, name(r.cause));
    if (other)
      fmt::print(
          "with {}: commanded pose differs by at most {:.3f} {:.3f} {:.3f} mm, {:.4f} {:.4f} "
          "{:.4f} deg\n",
          other->name, r.pose_difference(0) * 1e3, r.pose_difference(1) * 1e3,
          r.pose_difference(2) * 1e3, r.pose_difference(3) / kDegree,
          r.pose_difference(4) / kDegree, r.pose_difference(5) / kDegree);
    if (!check) return kDone;
    fmt::print("{} of {} states and commands differ\n", r.different, r.messages);
    if (r.first)
      fmt::print("first in tick {} (byte {}): {} recorded {}, replayed {}\n", r.first->tick,
                 r.first->offset, r.first->field, r.first->recorded, r.first->replayed);
    return r.different == 0 ? kDone : kTripped;
  });
}

}  // namespace ves::app
