// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/robot_load.hpp"

#include <Eigen/LU>

#include "ves/control/gravity_compensation.hpp"

namespace ves {

StaticLoad::StaticLoad(const ControllerConfig& config)
    : payload_(config.payload),
      gravity_(config.gravity),
      S_proc_(config.sensor.C_proc.inverse()),
      filters_(config.compensation.inertia),
      filter_(config.servo.sensor_cutoff),
      filter_step_(filter_.prepare(config.periodSeconds())) {}

void StaticLoad::update(const JointVector& q, const Mat3& R_IP, bool engaged,
                        double share) noexcept {
  F_So_S_ = staticWrench(payload_, q, R_IP, gravity_);
  const Vec6 weight = F_So_S_.stacked();
  counts_ = S_proc_ * weight;
  if (!filters_ || !weight.allFinite()) return;
  if (engaged)
    filter_.advance(filter_step_, weight.array());
  else
    filter_.settle(weight.array());
  F_So_S_ = Wrench::from(weight + share * (filter_.output().matrix() - weight));
}

RobotInertia::RobotInertia(const ControllerConfig& config)
    : compensated_(config.compensation.inertia),
      mass_update_(config.compensation.mass_update),
      geometry_(config.geometry),
      carried_(carried(config.payload)),
      X_PL0_(config.payload.X_PL0()) {}

Wrench RobotInertia::update(std::int64_t count, const JointVector& q, const Transform& X_IP,
                            const LegMotion& legs, bool engaged, double share) noexcept {
  if (!compensated_ || !engaged) return {};
  if (count % mass_update_ == 0)
    composite_P_ = combine(RigidBody{}, X_PL0_, compositeBody(carried_, q));
  M_1_ = share * spatialMass(rotated(X_IP.R, composite_P_));
  BodyMotion P;
  if (!forwardMotion(geometry_, X_IP, legs, P)) return {};
  Vec6 acceleration;
  acceleration << P.a, P.alpha;
  return Wrench::from(M_1_ * acceleration);
}

}  // namespace ves
