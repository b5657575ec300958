// SPDX-License-Identifier: BSD-3-Clause
//
// Controller and plant in lockstep under a test's hands.
#pragma once

#include <functional>

#include "support/robots.hpp"
#include "ves/config/experiment.hpp"

namespace ves::test {

inline Experiment experiment(const std::string& name, const std::vector<std::string>& set = {}) {
  return loadExperiment(configDir() + "/scenarios/" + name + ".yaml", set);
}

inline Segment segment(SegmentKind kind, double duration = 0.0) {
  Segment s;
  s.kind = kind;
  s.duration = duration;
  return s;
}

inline Segment sine(int coordinate, double amplitude, double frequency, double duration) {
  Segment s = segment(SegmentKind::kTrajectory, duration);
  s.trajectory[static_cast<std::size_t>(coordinate)] = {AxisMotion::kSine, 0.0, amplitude,
                                                        frequency};
  return s;
}

/// Controller and plant in lockstep, an operator beside them.
class Rig {
 public:
  explicit Rig(const Experiment& e) : e_(e), platform_(e.controller), plant_(e.plant) {}

  const TickState& tick(Request request = Request::kNone, const Segment& s = {}) {
    in_.order = {request, s, {}};
    in_.sample = plant_.sample();
    if (disturb_) disturb_(in_.sample);
    state_ = &platform_.tick(in_);
    in_.tick += 1 + state_->idle;
    plant_.command(state_->command);
    plant_.advance(in_.tick * e_.controller.period);
    return *state_;
  }
  const TickState& run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
    return *state_;
  }
  const TickState& until(Phase phase, int at_most = 5000) {
    for (int i = 0; i < at_most && tick().phase != phase; ++i) {
    }
    return *state_;
  }
  const TickState& arm() {
    run(20);
    tick(Request::kArm);
    return until(Phase::kArmed);
  }
  const TickState& until(const std::function<bool(const TickState&)>& what, int at_most = 5000) {
    for (int i = 0; i < at_most && !what(tick()); ++i) {
    }
    return *state_;
  }
  TickInput& in() { return in_; }
  plant::Plant& plant() { return plant_; }
  const TickState& state() const { return *state_; }
  void disturb(std::function<void(Sample&)> f) { disturb_ = std::move(f); }

 private:
  Experiment e_;
  TestPlatform platform_;
  plant::Plant plant_;
  TickInput in_;
  const TickState* state_ = nullptr;
  std::function<void(Sample&)> disturb_;
};

}  // namespace ves::test
