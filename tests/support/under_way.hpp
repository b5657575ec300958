// SPDX-License-Identifier: BSD-3-Clause
//
// Ticks of a controller that is under way: what is counted and timed.
#pragma once

#include <string>
#include <vector>

#include "support/rig.hpp"
#include "ves/control/test_platform.hpp"
#include "ves/plant/plant.hpp"

namespace ves::test {

/// Seven seconds after the start: a PUMA on six modes, or a scenario's vehicle, is emulated.
struct UnderWay {
  Experiment e;
  TestPlatform platform{e.controller};
  plant::Plant plant{e.plant};
  TickInput in, used;

  explicit UnderWay(const std::vector<std::string>& set = {},
                    const std::string& scenario = "puma_on_table_4_1", std::int64_t since = 700)
      : e(experiment(scenario, set)) {
    in.order.request = Request::kStart;
    while (in.tick < since) step();
  }
  void step() {
    in.sample = plant.sample();
    in.time = plant.time();
    used = in;
    plant.command(platform.tick(in).command);
    plant.advance(++in.tick * e.controller.period);
  }
};

/// A configuration of the controller whose tick has a price.
struct TickCase {
  std::string name;
  std::vector<std::string> set;
  std::string scenario = "puma_on_table_4_1";
  std::int64_t since = 700, ticks = 500;  // [-] since the start
};
inline const std::vector<TickCase>& tickCases() {
  static const std::vector<TickCase> cases = [] {
    std::vector<TickCase> all = {{"published", {}}};
    const auto add = [&](const std::string& name, std::vector<std::string> more) -> TickCase& {
      std::vector<std::string> set = {
          "controller.compensation.feed_forward=true", "controller.compensation.observer=true",
          "controller.compensation.inertia=true", "sensor.readings_per_tick=4"};
      set.insert(set.end(), more.begin(), more.end());
      return all.emplace_back(TickCase{name, set});
    };
    add("compensated", {});
    add("adaptation_aided",
        {"controller.compensation.adaptation=true", "controller.compensation.wrench=aided"});
    add("learning_masses",
        {"controller.compensation.wrench=aided", "controller.compensation.learns_masses=true"});
    // A body that floats, beside modes under the same conditions.
    add("aided_in_space", {"controller.compensation.wrench=aided", "gravity_m_per_s2=0"});
    all.push_back({"floating", {}, "satellite_puma"});
    all.push_back({"in_flight", {}, "satellite_tumbling"});
    // From arming to home, with everything that happens in between.
    TickCase& run = add(
        "whole_run",
        {"controller.compensation.adaptation=true", "controller.compensation.wrench=aided",
         "controller.compensation.learns_masses=true", "controller.passivity.enabled=true",
         "program=[{move: {}}, {calibration: {}}, {excite: {tilt_deg: 2, duration_s: 6}}, "
         "{admittance: "
         "{duration_s: 9}, robot: [{at_s: 1, duration_s: 1, joint: joint_2, to_deg_or_m: -70}, "
         "{at_s: 2.5, gripper: true}, {at_s: 4, duration_s: 1, joint: joint_1, to_deg_or_m: 20}], "
         "faults: [{at_s: 3.5, duration_s: 0.02, fault: samples_lost}, {at_s: 5.5, duration_s: "
         "0.3, fault: "
         "wrench_step, which: 1, counts: 400}, {at_s: 6.5, duration_s: 0.02, fault: "
         "joints_lost}]}]"});
    run.since = 0;
    run.ticks = 2200;
    return all;
  }();
  return cases;
}

}  // namespace ves::test
