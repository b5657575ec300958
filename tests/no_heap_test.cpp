// SPDX-License-Identifier: BSD-3-Clause
//
// The control path and the plant's stepping never touch the heap, whatever the tick does.
#include <gtest/gtest.h>

#include "support/malloc_guard.hpp"
#include "ves/config/experiment.hpp"

namespace ves {
namespace {

Experiment experiment(const std::string& name, const std::vector<std::string>& set = {}) {
  return loadExperiment(std::string(VES_TEST_CONFIG_DIR) + "/scenarios/" + name + ".yaml", set);
}

TEST(MallocGuard, CountsAnAllocation) {  // the test that the others can fail
  test::MallocGuard guard;
  std::unique_ptr<int> p(new int(1));
  EXPECT_GE(guard.count(), 1);
}

class NoHeap : public testing::TestWithParam<const char*> {};

TEST_P(NoHeap, FromArmingToParking) {
  for (const char* base :
       {"seed=1",
        "base={mass_diagonal: [500,500,500,250,250,250], damping_diagonal: "
        "[500,400,300,200,100,90], stiffness_diagonal: [1500,2500,4000,1500,1000,2000]}"}) {
    const Experiment e = experiment(GetParam(), {base});
    TestPlatform platform(e.controller);
    plant::Plant plant(e.plant);
    TickInput in;
    in.order.request = Request::kStart;
    const TickState* state = nullptr;
    test::MallocGuard guard;
    for (; in.tick < 6000 && !platform.done(); ++in.tick) {
      in.sample = plant.sample();
      state = &platform.tick(in);
      plant.command(state->command);
      plant.advance((in.tick + 1) * e.controller.period);
    }
    const std::int64_t calls = guard.count();
    EXPECT_EQ(calls, 0);
    EXPECT_EQ(state->phase, Phase::kParked);
  }
}

TEST_P(NoHeap, ThroughATripAndTheHold) {
  const Experiment e = experiment(GetParam());
  TestPlatform platform(e.controller);
  plant::Plant plant(e.plant);
  TickInput in;
  in.order.request = Request::kStart;
  test::MallocGuard guard;
  for (; in.tick < 600; ++in.tick) {
    in.sample = plant.sample();
    if (in.tick > 300) in.sample.q(0) = NAN;
    if (in.tick > 350) in.sample.legs[2] = 0;
    const TickState& state = platform.tick(in);
    plant.command(state.command);
    plant.advance((in.tick + 1) * e.controller.period);
  }
  const std::int64_t calls = guard.count();
  EXPECT_EQ(calls, 0);
  EXPECT_TRUE(platform.done());
}

INSTANTIATE_TEST_SUITE_P(Scenarios, NoHeap,
                         testing::Values("puma_on_table_4_1", "free_decay", "ramp", "alpha_sine"),
                         [](const auto& test) { return std::string(test.param); });

}  // namespace
}  // namespace ves
