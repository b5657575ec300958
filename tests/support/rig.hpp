// SPDX-License-Identifier: BSD-3-Clause
//
// Controller and plant in lockstep under a test's hands.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>

#include "support/robots.hpp"
#include "ves/config/experiment.hpp"
#include "ves/plant/lockstep.hpp"

namespace ves::test {

inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
inline constexpr std::int64_t kTick = 10'000'000;  // [ns]

inline const std::vector<std::string> kCompensated = {"controller.compensation.feed_forward=true",
                                                      "controller.compensation.observer=true",
                                                      "controller.compensation.inertia=true"};

/// A scenario whose admittance control begins whatever the stability check would say: that takes
/// a tenth of a second, and few tests are about it.
inline Experiment experiment(const std::string& name, std::vector<std::string> set = {},
                             const std::vector<std::string>& more = {}) {
  set.insert(set.end(), more.begin(), more.end());
  set.insert(set.begin(),
             {"controller.stability=forced", "controller.stability_uncompensated=forced"});
  return loadExperiment(configDir() + "/scenarios/" + name + ".yaml", set);
}

/// The same as a person loads it: nobody has looked yet.
inline Experiment unassessed(const std::string& name, const std::vector<std::string>& set = {}) {
  return loadExperiment(configDir() + "/scenarios/" + name + ".yaml", set);
}

inline const ControllerConfig& puma() {
  static const ControllerConfig config = experiment("puma_on_table_4_1").controller;
  return config;
}

/// A sample of the machine's that came in time.
inline Sample numbered(std::int64_t sequence) {
  Sample s;
  s.sequence = sequence;
  s.time = s.legs_time = s.wrench_time = s.joints_time = sequence * kTick;
  return s;
}

inline Segment segment(SegmentKind kind, double duration = 0.0) {
  Segment s;
  s.kind = kind;
  s.duration = duration;
  return s;
}

inline Segment sine(int coordinate, double amplitude, double frequency, double duration) {
  Segment s = segment(SegmentKind::kTrajectory, duration);
  s.trajectory.motion[static_cast<std::size_t>(coordinate)] = AxisMotion::kSine;
  s.trajectory.amplitude(coordinate) = amplitude;
  s.trajectory.frequency(coordinate) = frequency;
  return s;
}

inline Segment ramp(int coordinate, double to, double duration) {
  Segment s = segment(SegmentKind::kTrajectory, duration);
  s.trajectory.motion[static_cast<std::size_t>(coordinate)] = AxisMotion::kRamp;
  s.trajectory.final(coordinate) = to;
  return s;
}

/// Parked, or stopped by a check.
inline bool done(const TickState& s) {
  return s.phase == Phase::kParked || s.phase == Phase::kStopped;
}

/// Controller and plant in lockstep, an operator beside them.
class Rig {
 public:
  explicit Rig(const Experiment& e) : loop_(e.controller, e.plant) { loop_.gate = false; }

  const TickState& tick(Request request = Request::kNone, const Segment& s = {}) {
    return loop_.step({request, s, {}});
  }
  const TickState& give(const Order& order) { return loop_.step(order); }
  /// The same until it is answered: a path is gone through first.
  const TickState& order(Request request, const Segment& s = {}) {
    for (tick(request, s); state().refusal == Refusal::kChecking;) tick();
    return state();
  }
  const TickState& run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
    return state();
  }
  const TickState& until(const std::function<bool(const TickState&)>& what, int at_most = 5000) {
    for (int i = 0; i < at_most && !what(tick()); ++i) {
    }
    return state();
  }
  const TickState& until(Phase phase, int at_most = 5000) {
    return until([&](const TickState& s) { return s.phase == phase; }, at_most);
  }
  const TickState& arm() {
    run(20);
    tick(Request::kArm);
    return until(Phase::kArmed);
  }
  TickInput& in() { return loop_.input; }
  plant::Plant& plant() { return loop_.plant(); }
  const TickState& state() const { return loop_.state(); }
  void disturb(std::function<void(Sample&)> f) { loop_.disturb = std::move(f); }

 private:
  Lockstep loop_;
};

}  // namespace ves::test
