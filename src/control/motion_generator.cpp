// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/motion_generator.hpp"

#include <algorithm>
#include <cmath>

namespace ves {

void MotionGenerator::begin(const Segment& segment, std::int64_t tick, const Mat6& M_1, double age,
                            double share) noexcept {
  segment_ = segment;
  follow(planned(segment));
  start_tick_ = tick;
  if (segment.kind != SegmentKind::kAdmittance) return;
  admittance_.begin(motion_.x, M_1, age, share);
  emulates_ = true;
}

void MotionGenerator::brake(const Braking& braking) noexcept {
  segment_ = {};
  segment_.kind = SegmentKind::kMove;
  follow(MotionPlan::brake(settings_, motion_, braking));
}

void MotionGenerator::goHome() noexcept {
  segment_ = {};
  segment_.kind = SegmentKind::kMove;
  follow(MotionPlan::move(settings_, motion_, Vec6::Zero(), 0.0));
}

/// From where and when the motion was meant; at rest it may as well be now.
void MotionGenerator::follow(const MotionPlan& plan) noexcept {
  endEmulation();
  plan_ = plan;
  n_ = 0;
  ahead_ = moving() ? motion_.ahead : 0.0;
}

Waypoint<6> MotionGenerator::admittanceModel(const AdmittanceInput& in,
                                             const PathChecks& checks) noexcept {
  ++n_;
  return {admittance_.step(in, motion_, checks), settings_.period};
}

Waypoint<6> MotionGenerator::trajectoryGeneration() noexcept {
  ++n_;  // where a plan starts, the platform is already
  switch (segment_.kind) {
    case SegmentKind::kMove:
    case SegmentKind::kTrajectory:
    case SegmentKind::kPath: return {plan_.at(n_, path_), ahead_};
    case SegmentKind::kCalibration:
    case SegmentKind::kMonitor:
    case SegmentKind::kAdmittance:
    case SegmentKind::kCount: break;
  }
  return {atRest(motion_.x)};
}

void MotionGenerator::commit(const Waypoint<6>& x) noexcept {
  desired_ = x.ahead > 0.0 ? motion_.x : x.x;
  motion_ = x;
}

void MotionGenerator::hold() noexcept {
  motion_ = {atRest(motion_.x)};
  desired_ = motion_.x;
  admittance_.forget();
  endEmulation();
}

void MotionGenerator::endEmulation() noexcept {
  emulates_ = false;
  admittance_.end();
}

bool MotionGenerator::over(std::int64_t tick) const noexcept {
  return (segment_.kind == SegmentKind::kMonitor ? tick - start_tick_ : n_) >= plan_.steps();
}

std::int64_t MotionGenerator::idleTicks(std::int64_t tick) const noexcept {
  if (segment_.kind != SegmentKind::kMonitor) return 0;
  const std::int64_t interval = std::llround(segment_.interval / settings_.period);
  if (interval <= kCalibrationSamples) return 0;
  const std::int64_t since = tick - start_tick_, into = since % interval;
  if (into < kCalibrationSamples - 1) return 0;
  return std::max<std::int64_t>(0, std::min(interval - into, plan_.steps() - since) - 1);
}

}  // namespace ves
