// SPDX-License-Identifier: BSD-3-Clause
//
// A planned motion as a value: a move, a trajectory or a recorded path from where the platform is,
// period by period. Planning changes nothing, so an order can be looked at before it is taken.
#pragma once

#include "ves/control/controller_config.hpp"
#include "ves/control/path_checks.hpp"

namespace ves {

/// The same place, at rest.
PathPoint<6> atRest(const Vec6& x) noexcept;

/// [s] that braking to rest from the rates v takes.
double brakeTime(const Vec6& v, const Braking& braking) noexcept;

/// What planning depends on.
struct PlanSettings {
  double period = 0.0;  // [s]
  GentleMotion gentle;
};

class MotionPlan {
 public:
  /// Nothing: no steps, at the origin.
  MotionPlan() = default;

  /// Brakes from `from` to rest, then goes by a quintic to `target` within `duration` [s]; 0: as
  /// long as is gentle.
  static MotionPlan move(const PlanSettings& settings, const PathPoint<6>& from, const Vec6& target,
                         double duration) noexcept;
  /// Brakes to rest, and stays.
  static MotionPlan brake(const PlanSettings& settings, const PathPoint<6>& from,
                          const Braking& braking) noexcept;
  /// The segment, begun at `from`. One that plans no motion (calibration, monitor, admittance
  /// control) has a length only.
  static MotionPlan of(const PlanSettings& settings, const Segment& segment,
                       const PathPoint<6>& from) noexcept;

  /// n periods after the beginning. `path` is the recorded one.
  PathPoint<6> at(std::int64_t n, const RecordedPath& path) const noexcept;
  std::int64_t steps() const noexcept { return steps_; }  // [-] periods that it lasts
  bool swings() const noexcept;                           // a coordinate goes by a sine

 private:
  enum class Kind { kMove, kTrajectory, kPath };

  Kind kind_ = Kind::kMove;
  double period_ = 0.0;      // [s]
  std::int64_t steps_ = 0;   // [-]
  Quintic<6> brake_, move_;  // one after the other
  Trajectory trajectory_{};
  Vec6 start_ = Vec6::Zero();
};

/// Goes through a move or a trajectory before it begins, some poses a tick: the path checks at up
/// to kPoses poses, and those of a step from each to the next. Of sines that last longer it looks
/// at twice as many places that no period divides: evenly spaced ones may all be alike.
class Rehearsal {
 public:
  static constexpr std::int64_t kPoses = 1000;      // [-]
  static constexpr std::int64_t kPosesATick = 100;  // [-]

  /// `L` [m] is where the legs are.
  void begin(const MotionPlan& plan, const Vec6& L) noexcept;
  void cancel() noexcept { under_way_ = false; }
  bool underWay() const noexcept { return under_way_; }
  /// The next kPosesATick poses.
  void advance(const PathChecks& checks, double period, const RecordedPath& path) noexcept;
  /// The first check that would fail; kCount when none would.
  Check failure() const noexcept { return failure_; }

 private:
  std::int64_t periods(std::int64_t k) const noexcept;

  MotionPlan plan_;
  std::int64_t stride_ = 1;  // [-] periods between poses that follow each other; 0: they do not
  std::int64_t poses_ = 0;   // [-] in all
  std::int64_t k_ = 0;       // [-] poses so far
  std::int64_t last_ = 0;    // [-] periods of the pose before
  Vec6 L_last_ = Vec6::Zero();
  Check failure_ = Check::kCount;
  bool under_way_ = false;
};

}  // namespace ves
