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

/// PUMA on six modes, seven seconds after the start: it is emulated.
struct UnderWay {
  Experiment e;
  TestPlatform platform{e.controller};
  plant::Plant plant{e.plant};
  TickInput in, used;

  explicit UnderWay(const std::vector<std::string>& set = {})
      : e(experiment("puma_on_table_4_1", set)) {
    in.order.request = Request::kStart;
    while (in.tick < 700) step();
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
};
inline const std::vector<TickCase>& tickCases() {
  static const std::vector<TickCase> cases = [] {
    std::vector<TickCase> all = {{"published", {}}};
    const auto add = [&](const std::string& name, std::vector<std::string> more) {
      std::vector<std::string> set = {
          "controller.compensation.feed_forward=true", "controller.compensation.observer=true",
          "controller.compensation.inertia=true", "sensor.readings_per_tick=4"};
      set.insert(set.end(), more.begin(), more.end());
      all.push_back({name, set});
    };
    add("compensated", {});
    add("adaptation_aided",
        {"controller.compensation.adaptation=true", "controller.compensation.wrench=aided"});
    add("learning_masses",
        {"controller.compensation.wrench=aided", "controller.compensation.learns_masses=true"});
    return all;
  }();
  return cases;
}

}  // namespace ves::test
