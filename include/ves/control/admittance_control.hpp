// SPDX-License-Identifier: BSD-3-Clause
//
// Admittance control: the admittance model, slowed before the limits, its energy watched.
#pragma once

#include "ves/control/controller_config.hpp"
#include "ves/control/energy_account.hpp"
#include "ves/control/hindsight.hpp"
#include "ves/control/monitors.hpp"
#include "ves/control/moving_frame.hpp"
#include "ves/control/path_checks.hpp"
#include "ves/control/tick_clock.hpp"
#include "ves/control/vehicle_change.hpp"

namespace ves {

/// What a step of admittance control is made of.
struct AdmittanceInput {
  const Wrench& F_Po_E;        // E is I where the laboratory rests
  const Wrench& at_port;       // F_Po_I, the same before dead band and low-pass
  const Mat6& noise;           // covariance of F_Po_E's noise (wrenchNoise)
  const CarriedBody& body;     // the composite body that is compensated
  double share;                // [-] of the compensation
  const WrenchTiming& wrench;  // when F_Po_E was read
  bool touches;                // something does, as far as that is known
  const Lesson& lesson;        // what was found out
  const JointVector& q;        // of the robot
  const Vec6& L;               // [m] lengths last commanded
  const Transform& X_IP;       // as measured
  const ServoObserver& servo;  // how the platform has moved
};

class AdmittanceControl {
 public:
  explicit AdmittanceControl(const ControllerConfig& config);

  /// Shown at rest at x; M_1 is the composite body that is compensated, in I, `age` [s] that of the
  /// wrench, `share` [-] of the compensation that is in.
  void begin(const Vec6& x, const Mat6& M_1, double age, double share) noexcept;

  /// What to show one period on. `last` was commanded in the tick before. A wrench that is not
  /// finite leaves the model as it is: the finite check stops the run.
  ///
  /// With the inertia compensated the model goes from wrench to wrench, by their own times, and the
  /// command is what it foretells for the end of the period.
  const PathPoint<6>& step(const AdmittanceInput& in, const PathPoint<6>& last,
                           const PathChecks& checks) noexcept;

  /// Why the vehicle cannot become as ordered.
  Refusal refuses(const VehicleOrder& order) const noexcept {
    return model_.refuses(change_.ordered(order), inertia_);
  }
  /// Another vehicle: by and by while this one is emulated, else at once.
  void change(const VehicleOrder& order, bool emulated) noexcept;

  /// Thrusters of the vehicle that is emulated are on from the next step on, unless it is refused.
  Refusal fire(const ThrustOrder& order) noexcept { return model_.fire(order); }

  /// Nothing is emulated from now on: the laboratory rests where it is.
  void end() noexcept { frame_.rest(); }
  /// The energy is watched from now on only.
  void forget() noexcept { oscillation_.reset(); }

  const MovingFrame& frame() const noexcept { return frame_; }
  /// How a platform turned by R_IP is emulated; `since` [s]: of a wrench after the last step's. The
  /// wrench shows what floats as it was, and not as it is turned when it is read.
  Emulated emulated(const Mat3& R_IP, double since) const noexcept {
    if (!asShown()) return frame_.emulated(R_IP);
    Emulated out = frame_.emulated(R_IP, model_.atWrench(), since);
    out.v -= model_.letGo();
    return out;
  }

  const Oscillation& oscillation() const noexcept { return oscillation_; }
  const EnergyAccount& energy() const noexcept { return energy_; }
  const VehicleFactors& vehicle() const noexcept { return model_.factors(); }
  Thrust thrust() const noexcept { return model_.thrust(); }
  const VehicleChange& vehicleChange() const noexcept { return change_; }
  double scale() const noexcept { return scale_; }  // [-] of the last step, 1: all of it was taken

 private:
  bool asShown() const noexcept { return frame_.enabled() || (inertia_ && model_.floats()); }
  void slowInsideEnvelope(const PathPoint<6>& last, const Vec6& L,
                          const PathChecks& checks) noexcept;

  AdmittanceModel model_;
  MovingFrame frame_;
  PathPoint<6> shown_;
  Hindsight hindsight_;
  bool inertia_, aided_;  // compensated, what the model feels
  double wrench_delay_;   // [s]
  double ahead_ = 0.0;    // [s] of the last wrench, that is shown
  bool begins_ = true;    // the first step: what was before it does not count
  int unknown_ = 1;       // [-] steps until hindsight knows what the robot was let go with: with a
                          // vehicle that flies it has that motion a step later
  Oscillation oscillation_;
  double shaken_ = 0.0;  // [J] by the ground so far
  PortWork port_;
  EnergyAccount energy_;
  VehicleChange change_;
  double period_;       // [s]
  double joint_moves_;  // [rad | m] what counts as a motion of the robot
  Braking braking_;     // before the limits
  double slow_;         // [m/s] no leg of such a speed is too fast
  PathChecks inside_;   // a little inside the limits
  double reach_ = 0.0;  // [m] of a leg's joint per rate of the fixed angles, at most
  double scale_ = 1.0;
};

}  // namespace ves
