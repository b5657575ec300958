// SPDX-License-Identifier: BSD-3-Clause
//
// What the platform should do next: the admittance model, or trajectory generation along a plan.
//
// The admittance model says where to be in the next tick, trajectory generation where to be in this
// one (Appendix C). A plan that begins in motion goes on from where and when that was meant, until
// it rests: so no instant of the path is left out, or said twice.
#pragma once

#include "ves/control/admittance_control.hpp"
#include "ves/control/motion_plan.hpp"

namespace ves {

class MotionGenerator {
 public:
  explicit MotionGenerator(const ControllerConfig& config)
      : settings_{config.periodSeconds(), config.gentle}, path_(config.path), admittance_(config) {}

  /// Begins a segment at `tick` from what was last commanded; the rest is AdmittanceControl's.
  void begin(const Segment& segment, std::int64_t tick, const Mat6& M_1, double age,
             double share) noexcept;
  /// Begins to brake, and then to stay.
  void brake(const Braking& braking) noexcept;
  /// Begins a gentle move to the home pose.
  void goHome() noexcept;

  /// `emulated`: the admittance model runs, and goes over to it by and by.
  void changeVehicle(const VehicleOrder& order, bool emulated) noexcept {
    admittance_.change(order, emulated);
  }

  /// The emulated vehicle's thrusters, from the next step on.
  Refusal fire(const ThrustOrder& order) noexcept {
    return emulates_ ? admittance_.fire(order) : Refusal::kNotEmulated;
  }

  /// (C.2) to (C.7): the next state of the base.
  Waypoint<6> admittanceModel(const AdmittanceInput& in, const PathChecks& checks) noexcept;
  /// (C.8) to (C.10), moves and recorded paths.
  Waypoint<6> trajectoryGeneration() noexcept;

  /// What was commanded in this tick.
  void commit(const Waypoint<6>& x) noexcept;
  /// The last commanded pose is held from now on.
  void hold() noexcept;
  /// Nothing is emulated any more.
  void endEmulation() noexcept;

  SegmentKind kind() const noexcept { return segment_.kind; }
  bool emulates() const noexcept { return emulates_; }  // the admittance model runs
  /// The plan is at its end; a monitor segment at `tick` too. A calibration ends by itself.
  bool over(std::int64_t tick) const noexcept;
  bool moving() const noexcept { return !motion_.x_dot.isZero(0.0); }
  /// Ticks after `tick` in which a monitor segment takes no sample.
  std::int64_t idleTicks(std::int64_t tick) const noexcept;

  const Waypoint<6>& motion() const noexcept { return motion_; }  // last commanded
  const Vec6& desired() const noexcept { return desired_; }       // at this very tick
  const AdmittanceControl& admittance() const noexcept { return admittance_; }
  /// How a platform turned by R_IP is emulated; `since` [s]: of a wrench after the last step's.
  Emulated emulated(const Mat3& R_IP, double since) const noexcept {
    return emulates_ ? admittance_.emulated(R_IP, since) : admittance_.frame().emulated(R_IP);
  }
  MotionPlan planned(const Segment& segment) const noexcept {
    return MotionPlan::of(settings_, segment, motion_);
  }
  const RecordedPath& path() const noexcept { return path_; }

 private:
  void follow(const MotionPlan& plan) noexcept;

  PlanSettings settings_;
  RecordedPath path_;
  AdmittanceControl admittance_;
  Segment segment_;
  bool emulates_ = false;  // the admittance model runs
  MotionPlan plan_;
  double ahead_ = 0.0;           // [s] of the plan's points
  std::int64_t n_ = 0;           // [-] periods of the plan so far
  std::int64_t start_tick_ = 0;  // [-] of the segment
  Waypoint<6> motion_;
  Vec6 desired_ = Vec6::Zero();
};

}  // namespace ves
