// SPDX-License-Identifier: BSD-3-Clause
//
//   ticks                 the names of the cases
//   ticks CASE [TIMES]    its ticks, for what counts their instructions; TIMES over, for what
//   samples
//                         where their time goes
#include <fmt/format.h>

#include <cstdlib>

#include "support/under_way.hpp"

namespace ves {

/// What is counted (instructions.py): a tick by itself, between those of the plant.
__attribute__((noinline)) void countedTick(TestPlatform& platform, const TickInput& in) {
  platform.tick(in);
}

int run(const std::string& name, int times) {
  for (const test::TickCase& one : test::tickCases()) {
    if (one.name != name) continue;
    test::UnderWay run(one.set, one.scenario, one.since);
    const TestPlatform before = run.platform;
    std::vector<TickInput> inputs;
    while (inputs.size() < static_cast<std::size_t>(one.ticks)) {
      run.step();
      inputs.push_back(run.used);
    }
    for (int i = 0; i < times; ++i) {
      TestPlatform platform = before;
      for (const TickInput& in : inputs) countedTick(platform, in);
    }
    fmt::print("{}\n", inputs.size());
    return 0;
  }
  return 2;
}

}  // namespace ves

int main(int argc, char** argv) {
  if (argc == 1)
    for (const ves::test::TickCase& one : ves::test::tickCases()) fmt::print("{}\n", one.name);
  if (argc == 1) return 0;
  return argc == 2 || argc == 3 ? ves::run(argv[1], argc == 3 ? std::atoi(argv[2]) : 1) : 2;
}
