// SPDX-License-Identifier: BSD-3-Clause
//
// The momentum of a robot whose joints move on a base at rest. Its rate is the reaction of
// Newton-Euler (Appendix A), and so are sums of it over time, without what sampled forces lose.
#pragma once

#include "ves/robot/robot_model.hpp"

namespace ves {

/// Linear and angular momentum about L0o in L0, stacked. [N s, N m s]
Vec6 jointMomentum(const RobotModel& robot, const JointVector& q,
                   const JointVector& q_dot) noexcept;

}  // namespace ves
