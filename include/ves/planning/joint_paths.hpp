// SPDX-License-Identifier: BSD-3-Clause
//
// Motions of the simulated robot's joints: one joint to a target, or all along a planned path.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "ves/contract/robot_order.hpp"
#include "ves/math/quintic.hpp"

namespace ves {

/// A motion of all joints that was planned: fifth-order pieces, one behind the other. Before its
/// start and behind its end it rests.
class JointTrajectory {
 public:
  /// At rest at q.
  explicit JointTrajectory(const JointVector& q) : start_(q) {}

  /// A further piece, to the values, rates and accelerations `to`; `from` has those of its start.
  /// The caller lets values and rates meet.
  void add(const JointState& from, const JointState& to, double duration);

  JointState at(double t) const noexcept;            // t [s] since its start
  double duration() const noexcept { return end_; }  // [s]
  const JointVector& start() const noexcept { return start_; }
  const JointVector& end() const noexcept {
    return pieces_.empty() ? start_ : pieces_.back().path.end();
  }
  /// The same way, taken so many times slower.
  JointTrajectory slower(double times) const;

  bool operator==(const JointTrajectory&) const = default;

 private:
  struct Piece {
    double start = 0.0;  // [s]
    Quintic<kMaxJoints> path;
    bool operator==(const Piece&) const = default;
  };
  JointVector start_;
  double end_ = 0.0;  // [s]
  std::vector<Piece> pieces_;
};

/// Trajectory generation of a robot (report, chapter 3): every joint on its own polynomial, or all
/// on a planned trajectory.
class JointPaths {
 public:
  /// At rest at q.
  JointPaths(int joints, const JointVector& q) noexcept;

  /// Begins at `now` [ns], from the motion the joint has. Refused (false) when there is no such
  /// joint, it is on a trajectory, a value is not a number or the duration not positive.
  bool move(const RobotMove& move, std::int64_t now) noexcept;

  /// Begins at `now` [ns]. Refused (false) unless all joints rest where the trajectory begins, to
  /// kNear.
  bool follow(std::shared_ptr<const JointTrajectory> trajectory, std::int64_t now) noexcept;

  /// `later` [s] after `now` [ns].
  JointState at(std::int64_t now, double later = 0.0) const noexcept;
  bool moving(std::int64_t now) const noexcept;

  static constexpr double kNear = 1e-6;  // [rad | m]

 private:
  struct Path {
    std::int64_t start = 0;  // [ns]
    Quintic<1> path;
  };
  bool following(std::int64_t now, double later) const noexcept;
  void rest(const JointVector& q) noexcept;

  int joints_;
  std::array<Path, kMaxJoints> paths_;
  std::shared_ptr<const JointTrajectory> trajectory_;
  std::int64_t trajectory_start_ = 0;  // [ns]
};

}  // namespace ves
