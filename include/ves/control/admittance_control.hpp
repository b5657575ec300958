// SPDX-License-Identifier: BSD-3-Clause
//
// Admittance control: the admittance model, slowed before the limits, its energy watched.
#pragma once

#include "ves/control/controller_config.hpp"
#include "ves/control/monitors.hpp"
#include "ves/control/path_checks.hpp"

namespace ves {

class AdmittanceControl {
 public:
  explicit AdmittanceControl(const ControllerConfig& config);

  /// At rest at x; M_1 is the composite body that is compensated.
  void begin(const Vec6& x, const Mat6& M_1) noexcept;

  /// The coordinates one period on, under F_Po_I. `last` was commanded in the tick before, with the
  /// lengths `L` [m]; q are the robot's joints. A wrench that is not finite leaves the model as it
  /// is: the finite check stops the run.
  const PathPoint<6>& step(const Wrench& F_Po_I, const Mat6& M_1, double share,
                           const JointVector& q, const Vec6& last, const Vec6& L,
                           const PathChecks& checks) noexcept;

  /// The energy is watched from now on only.
  void forget() noexcept { oscillation_.reset(); }

  const Oscillation& oscillation() const noexcept { return oscillation_; }
  double scale() const noexcept { return scale_; }  // [-] of the last step, 1: all of it was taken

 private:
  void slowInsideEnvelope(const Vec6& last, const Vec6& L, const PathChecks& checks) noexcept;

  AdmittanceModel model_;
  Oscillation oscillation_;
  double period_;        // [s]
  double joint_moves_;   // [rad | m] what counts as a motion of the robot
  double growth_floor_;  // [J]
  Braking braking_;      // before the limits
  double scale_ = 1.0;
};

}  // namespace ves
