// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/motion_plan.hpp"

#include <algorithm>
#include <cmath>

namespace ves {
namespace {

/// Braking to rest as one quintic; nothing when it rests already.
Quintic<6> braking(const PathPoint<6>& from, const Braking& rate) {
  const double time = brakeTime(from.x_dot, rate);
  if (!(time > 0.0)) return {};
  PathPoint<6> start = atRest(from.x);
  start.x_dot = from.x_dot;
  return {start, from.x + 0.5 * time * from.x_dot, time};
}

double gentleDuration(const GentleMotion& gentle, const Vec6& from, const Vec6& to) {
  const double distance = (to - from).head<3>().norm(), angle = (to - from).tail<3>().norm();
  return std::max({1.0, kQuinticPeakRate * distance / gentle.speed,
                   kQuinticPeakRate * angle / gentle.rotation});
}

}  // namespace

PathPoint<6> atRest(const Vec6& x) noexcept {
  PathPoint<6> point;
  point.x = x;
  return point;
}

double brakeTime(const Vec6& v, const Braking& braking) noexcept {
  return std::max(v.head<3>().norm() / braking.translation, v.tail<3>().norm() / braking.rotation);
}

MotionPlan MotionPlan::move(const PlanSettings& settings, const PathPoint<6>& from,
                            const Vec6& target, double duration) noexcept {
  MotionPlan plan = brake(settings, from, settings.gentle.braking);
  const Vec6 rest = plan.move_.end();
  if (duration <= 0.0) duration = gentleDuration(settings.gentle, rest, target);
  plan.move_ = Quintic<6>(atRest(rest), target, duration);
  plan.steps_ =
      static_cast<std::int64_t>(std::ceil((plan.brake_.duration() + duration) / plan.period_));
  return plan;
}

MotionPlan MotionPlan::brake(const PlanSettings& settings, const PathPoint<6>& from,
                             const Braking& rate) noexcept {
  MotionPlan plan;
  plan.period_ = settings.period;
  plan.brake_ = braking(from, rate);
  const Vec6 rest = plan.brake_.duration() > 0.0 ? plan.brake_.end() : from.x;
  plan.move_ = Quintic<6>(atRest(rest), rest, plan.period_);
  plan.steps_ = static_cast<std::int64_t>(std::ceil(plan.brake_.duration() / plan.period_));
  return plan;
}

MotionPlan MotionPlan::of(const PlanSettings& settings, const Segment& segment,
                          const PathPoint<6>& from) noexcept {
  if (segment.kind == SegmentKind::kMove)
    return move(settings, from, segment.target.stacked(), segment.duration);
  MotionPlan plan;
  plan.kind_ = segment.kind == SegmentKind::kPath ? Kind::kPath : Kind::kTrajectory;
  plan.period_ = settings.period;
  plan.steps_ = std::llround(segment.duration / plan.period_);
  plan.trajectory_ = segment.trajectory;
  plan.start_ = from.x;
  return plan;
}

bool MotionPlan::swings() const noexcept {
  return kind_ == Kind::kTrajectory &&
         std::find(trajectory_.motion.begin(), trajectory_.motion.end(), AxisMotion::kSine) !=
             trajectory_.motion.end();
}

PathPoint<6> MotionPlan::at(std::int64_t n, const RecordedPath& path) const noexcept {
  switch (kind_) {
    case Kind::kPath: return recordedPath(path, n, period_);
    case Kind::kTrajectory: return trajectoryGeneration(trajectory_, start_, n, steps_, period_);
    case Kind::kMove: break;
  }
  const double t = static_cast<double>(n) * period_;
  return t < brake_.duration() ? brake_.at(t) : move_.at(t - brake_.duration());
}

void Rehearsal::begin(const MotionPlan& plan, const Vec6& L) noexcept {
  plan_ = plan;
  stride_ = std::max<std::int64_t>(1, plan.steps() / kPoses);
  poses_ = (plan.steps() + stride_ - 1) / stride_ + 1;
  if (plan.swings() && stride_ > 1) {
    stride_ = 0;
    poses_ = 2 * kPoses;
  }
  k_ = last_ = 0;
  L_last_ = L;
  failure_ = Check::kCount;
  under_way_ = true;
}

/// [-] periods of the k-th pose; the last pose is the plan's last.
std::int64_t Rehearsal::periods(std::int64_t k) const noexcept {
  constexpr double kGolden = 0.6180339887498949;  // [-] whose multiples fill every interval evenly
  if (k + 1 == poses_) return plan_.steps();
  if (stride_ > 0) return k * stride_;
  const double place = kGolden * static_cast<double>(k);
  return static_cast<std::int64_t>((place - std::floor(place)) *
                                   static_cast<double>(plan_.steps()));
}

void Rehearsal::advance(const PathChecks& checks, double period,
                        const RecordedPath& path) noexcept {
  for (std::int64_t looked = 0; looked < kPosesATick && k_ < poses_; ++looked, ++k_) {
    const std::int64_t n = periods(k_);
    const PathPoint<6> at = plan_.at(n, path);
    const Pose x = Pose::from(at.x);
    const BodyMotion P = bodyMotion(checks.geometry().home(), x, at.x_dot, at.x_ddot);
    const LegMotion legs = legMotion(checks.geometry(), P);
    // From one sample to the next, and at the sample itself.
    const double since = static_cast<double>(std::max<std::int64_t>(1, n - last_)) * period;
    Tripped t =
        checks.pose(P.X, x, legs.L) | checks.step(legs.L + period * legs.L_dot, legs.L, period);
    if (k_ == 0 || stride_ > 0) t = t | checks.step(legs.L, L_last_, since);
    L_last_ = legs.L;
    last_ = n;
    if (!t.any()) continue;
    failure_ = t.first();
    break;
  }
  under_way_ = failure_ == Check::kCount && k_ < poses_;
}

}  // namespace ves
