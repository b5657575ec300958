// SPDX-License-Identifier: BSD-3-Clause
#include "ves/planning/joint_paths.hpp"

#include <algorithm>
#include <cmath>

namespace ves {
namespace {

double seconds(std::int64_t ns) { return static_cast<double>(ns) * kSecondPerNanosecond; }

PathPoint<kMaxJoints> pointOf(const JointState& s) { return {s.q, s.q_dot, s.q_ddot}; }

}  // namespace

void JointTrajectory::add(const JointState& from, const JointState& to, double duration) {
  pieces_.push_back({end_, Quintic<kMaxJoints>(pointOf(from), pointOf(to), duration)});
  end_ += duration;
}

JointState JointTrajectory::at(double t) const noexcept {
  if (!(t >= 0.0) || pieces_.empty()) return {start_};
  if (t >= end_) return {end()};
  const auto next = std::upper_bound(pieces_.begin(), pieces_.end(), t,
                                     [](double x, const Piece& piece) { return x < piece.start; });
  const Piece& piece = *std::prev(next);
  const PathPoint<kMaxJoints> point = piece.path.at(t - piece.start);
  return {point.x, point.x_dot, point.x_ddot};
}

JointTrajectory JointTrajectory::slower(double times) const {
  JointTrajectory out = *this;
  out.end_ *= times;
  for (Piece& piece : out.pieces_) piece = {piece.start * times, piece.path.slower(times)};
  return out;
}

JointPaths::JointPaths(int joints, const JointVector& q) noexcept : joints_(joints) { rest(q); }

void JointPaths::rest(const JointVector& q) noexcept {
  for (int i = 0; i < joints_; ++i) {
    PathPoint<1> point;
    point.x(0) = q(i);
    paths_[static_cast<std::size_t>(i)] = {0, Quintic<1>(point, point.x, 0.0)};
  }
}

bool JointPaths::move(const RobotMove& move, std::int64_t now) noexcept {
  if (move.joint < 0 || move.joint >= joints_ || !std::isfinite(move.target) ||
      !std::isfinite(move.duration) || !(move.duration > 0.0) || following(now, 0.0))
    return false;
  Path& joint = paths_[static_cast<std::size_t>(move.joint)];
  const PathPoint<1> from = joint.path.at(seconds(now - joint.start));
  joint.path = Quintic<1>(from, Eigen::Matrix<double, 1, 1>(move.target), move.duration);
  joint.start = now;
  return true;
}

bool JointPaths::follow(std::shared_ptr<const JointTrajectory> trajectory,
                        std::int64_t now) noexcept {
  constexpr std::int64_t kAtOnce = 1000;  // [ns] what ends by then has ended, however it is rounded
  if (!trajectory || moving(now + kAtOnce)) return false;
  const JointVector off = at(now).q - trajectory->start();
  for (int i = 0; i < joints_; ++i)
    if (!(std::abs(off(i)) <= kNear)) return false;
  rest(trajectory->end());  // where it leaves them
  trajectory_ = std::move(trajectory);
  trajectory_start_ = now;
  return true;
}

bool JointPaths::following(std::int64_t now, double later) const noexcept {
  return trajectory_ && seconds(now - trajectory_start_) + later < trajectory_->duration();
}

JointState JointPaths::at(std::int64_t now, double later) const noexcept {
  if (following(now, later)) return trajectory_->at(seconds(now - trajectory_start_) + later);
  JointState joints;
  for (int i = 0; i < joints_; ++i) {
    const Path& joint = paths_[static_cast<std::size_t>(i)];
    const PathPoint<1> at = joint.path.at(seconds(now - joint.start) + later);
    joints.q(i) = at.x(0);
    joints.q_dot(i) = at.x_dot(0);
    joints.q_ddot(i) = at.x_ddot(0);
  }
  return joints;
}

bool JointPaths::moving(std::int64_t now) const noexcept {
  if (following(now, 0.0)) return true;
  for (int i = 0; i < joints_; ++i) {
    const Path& joint = paths_[static_cast<std::size_t>(i)];
    if (seconds(now - joint.start) < joint.path.duration()) return true;
  }
  return false;
}

}  // namespace ves
