// SPDX-License-Identifier: BSD-3-Clause
//
// Motions of the simulated robot's joints.
#pragma once

#include <cstdint>

#include "ves/math/quintic.hpp"
#include "ves/robot/robot_model.hpp"

namespace ves {

/// A fifth-order motion of one joint, from wherever it is.
struct RobotMove {
  int joint = 0;          // [-] from 0
  double target = 0.0;    // [rad | m]
  double duration = 1.0;  // [s]

  bool operator==(const RobotMove&) const = default;
};

/// Trajectory generation of a robot (report, chapter 3): every joint on its own polynomial.
class JointPaths {
 public:
  /// At rest at q.
  JointPaths(int joints, const JointVector& q) noexcept;

  /// Begins at `now` [ns], from the motion the joint has. Refused (false) when there is no such
  /// joint, a value is not a number or the duration not positive.
  bool move(const RobotMove& move, std::int64_t now) noexcept;

  /// `later` [s] after `now` [ns].
  JointState at(std::int64_t now, double later = 0.0) const noexcept;
  bool moving(std::int64_t now) const noexcept;

 private:
  struct Path {
    std::int64_t start = 0;  // [ns]
    Quintic<1> path;
  };
  int joints_;
  std::array<Path, kMaxJoints> paths_;
};

}  // namespace ves
