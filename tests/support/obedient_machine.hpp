// SPDX-License-Identifier: BSD-3-Clause
//
// Controllers under a test's hands, on a machine without dynamics: no plant, so a second of it
// takes a millisecond.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "support/rig.hpp"
#include "ves/control/test_platform.hpp"

namespace ves::test {

/// Controllers on one machine that goes where the first of them tells it, at once, and whose sensor
/// and joints follow a script. The others hear the same and command nothing.
class ObedientMachine {
 public:
  explicit ObedientMachine(const Experiment& e)
      : e_(e), counts_per_wrench_(wrenchPerCount(e.controller.sensor, Mat3::Identity()).inverse()) {
    const Geometry& g = e_.controller.geometry;
    legs_ = legCounts(e_.controller.legs, legLengths(g, g.fromHome({})));
    in_.sample.switches = kAllSwitchesClosed;
    in_.sample.adc[6] = (e_.controller.safety.pressure_min + e_.controller.safety.pressure_max) / 2;
    add();
  }
  void add() {
    platforms_.push_back(std::make_unique<TestPlatform>(e_.controller));
    states_.emplace_back();
  }
  /// `force` F_Po_I beyond the weight of the tick before, the first joint `q` [rad] from its place.
  void tick(const Vec6& force = Vec6::Zero(), double q = 0.0) {
    Sample& s = in_.sample;
    in_.time = (in_.tick + 1) * kTick;
    if (in_.tick % every_ == 0) measure(force, q);
    for (std::size_t i = 0; i < platforms_.size(); ++i) states_[i] = platforms_[i]->tick(in_);
    ++in_.tick;
    in_.order = {};
    legs_ = first().command.engaged ? legCounts(e_.controller.legs, first().legs.L) : s.legs;
  }
  /// From now on only every so many ticks find a new sample.
  void sampleEvery(int ticks) { every_ = ticks; }
  void open(std::uint32_t switches) { in_.sample.switches = switches; }
  void rest(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
  }
  /// Of the next tick; its number.
  std::int64_t give(Order order) {
    order.id.sequence = ++given_;
    in_.order = order;
    return given_;
  }
  /// Is obeyed.
  void order(Request request, const Segment& s = {}) {
    give({request, s, {}});
    for (tick(); first().refusal == Refusal::kChecking;) tick();
    EXPECT_EQ(first().refusal, Refusal::kNone) << name(first().refusal);
  }
  void until(Phase phase) {
    for (int i = 0; i < 3000 && first().phase != phase; ++i) tick();
    ASSERT_EQ(first().phase, phase) << name(first().phase) << ", " << name(first().cause);
  }
  const TickState& first() const { return states_.front(); }
  const TickState& last() const { return states_.back(); }

 private:
  void measure(const Vec6& force, double q) {
    Sample& s = in_.sample;
    ++s.sequence;
    s.time = s.legs_time = s.wrench_time = s.joints_time = in_.time;
    const Vec6 counts = counts_per_wrench_ * (first().static_wrench.stacked() + force);
    for (std::size_t i = 0; i < 6; ++i)
      s.adc[i] = static_cast<std::int32_t>(std::lround(counts(static_cast<Eigen::Index>(i))));
    s.q = e_.plant.task.initial_joints;
    s.q(0) += q;
    s.legs = legs_;
  }

  Experiment e_;
  Mat6 counts_per_wrench_;
  std::vector<std::unique_ptr<TestPlatform>> platforms_;
  std::vector<TickState> states_;
  TickInput in_;
  LegCounts legs_;
  int every_ = 1;
  std::int64_t given_ = 0;
};

}  // namespace ves::test
