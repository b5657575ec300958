// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/robot_load.hpp"

#include "ves/control/gravity_compensation.hpp"
#include "ves/math/dense.hpp"

namespace ves {

KnownPayload::KnownPayload(const ControllerConfig& config)
    : empty_(config.payload.robot),
      told_(config.told_loads),
      period_(config.period),
      payload_(config.payload),
      carried_(ves::carried(config.payload)),
      before_(carried_),
      switched_(config.hand.switched) {}

void KnownPayload::update(const Elapsed& elapsed, std::int32_t commanded) noexcept {
  changed_ = learnt_ = learns_;
  learns_ = false;
  gripper_moved_ = gripper_moves_;
  gripper_moves_ = false;
  if (commanded != segment_) {
    if (commanded < segment_) done_.fill(false);  // a program begins anew
    segment_ = commanded;
    began_ = elapsed.tick - elapsed.between - 1;
  }
  const std::int64_t since = (elapsed.tick - began_) * period_;
  for (std::size_t i = 0; i < static_cast<std::size_t>(told_.size); ++i) {
    const Cue& cue = told_.loads[i].cue;
    if (done_[i] || cue.segment != segment_ || since < cue.after) continue;
    done_[i] = true;
    if (!told_.loads[i].known) {
      gripper_moved_ = true;
      continue;
    }
    in_hand_ = told_.loads[i];
    changed_ = true;
    learnt_ = false;  // its weight is new, and not what was carried all along
  }
  if (changed_) take();
}

void KnownPayload::readGripper(std::uint32_t switches) noexcept {
  if (!switched_) return;
  const bool closed = switches & kGripperClosed;
  if (gripper_closed_ && closed != *gripper_closed_) gripper_moves_ = true;
  gripper_closed_ = closed;
}

void KnownPayload::learn(const RobotModel& robot) noexcept {
  empty_ = robot;
  learns_ = true;
}

void KnownPayload::take() noexcept {
  payload_.robot = withLoad(empty_, in_hand_.link, in_hand_.body);
  before_ = carried_;
  carried_ = ves::carried(payload_);
}

StaticLoad::StaticLoad(const ControllerConfig& config)
    : gravity_(config.gravity),
      S_proc_(inverse(config.sensor.C_proc)),
      filters_(config.compensation.inertia),
      filter_(config.servo.sensor_cutoff),
      averages_(config.servo.sensor_window > 0.0) {}

void StaticLoad::update(const KnownPayload& known, const JointVector& q, const Mat3& R_IP,
                        double since, bool engaged, double share) noexcept {
  F_So_S_ = staticWrench(known.payload(), q, R_IP, gravity_);
  const Vec6 weight = F_So_S_.stacked();
  counts_ = S_proc_ * weight;
  if (!filters_ || !weight.allFinite()) return;
  if (known.learnt()) filter_.raise((weight - weight_).array());
  weight_ = weight;
  if (!engaged) {
    filter_.settle(weight.array());
    felt_ = weight;
  } else if (since > 0.0) {
    const Vec6 before = filter_.output().matrix();
    filter_.advance(filter_.prepare(since), weight.array());
    felt_ = filter_.output().matrix();
    if (averages_) felt_ = 0.5 * (before + felt_).eval();
  }
  F_So_S_ = Wrench::from(weight + share * (felt_ - weight));
}

RobotInertia::RobotInertia(const ControllerConfig& config)
    : compensated_(config.compensation.inertia),
      mass_update_(config.compensation.mass_update),
      scale_(config.servo.sensor_scale),
      geometry_(config.geometry) {}

Wrench RobotInertia::update(const KnownPayload& known, std::int64_t count, const JointVector& q,
                            double since, const Transform& X_IP, const Mat3& R_EP,
                            const LegMotion& legs, bool engaged, double share) noexcept {
  if (!compensated_ || !engaged) {
    known_ = false;
    platform_ = {};
    return {};
  }
  const bool first = !known_, other = known_ && known.changed();
  const auto compositeAt = [&](const JointVector& at) {
    return combine(RigidBody{}, known.payload().X_PL0(), compositeBody(known.carried(), at));
  };
  const auto seen = [&](const Mat3& R, const RigidBody& composite_P) -> Seen {
    return {scale_ * spatialMass(rotated(R, composite_P)), R,
            composite_P.mass * composite_P.p_BoBcm_B};
  };
  const bool flies = R_EP != X_IP.R;
  if (other) {  // which has moved as before: its momentum loses nothing on the way
    const RigidBody then = compositeAt(composite_q_);
    I_ = I_before_ = seen(I_.R, then);
    E_ = E_before_ = seen(E_.R, then);
  }
  if (first || other || count % mass_update_ == 0) {
    composite_P_ = compositeAt(q);
    composite_q_ = q;
  }
  known_ = true;
  if (first || since > 0.0) {
    I_before_ = I_;
    E_before_ = E_;
    I_ = seen(X_IP.R, composite_P_);
    E_ = flies ? seen(R_EP, composite_P_) : I_;
    if (first) {
      I_before_ = I_;
      E_before_ = E_;
    }
    since_ = since;
  }
  share_ = share;
  M_1_ = share * I_.whole;
  BodyMotion P;
  if (!forwardMotion(geometry_, X_IP, legs, P)) return {};
  platform_ = P;
  Vec6 momentum_rate = M_1_ * (Vec6() << P.a, P.alpha).finished();
  if (since_ > 0.0) momentum_rate += (M_1_ - share * I_before_.whole).rightCols<3>() * P.w / since_;
  return Wrench::from(momentum_rate);
}

}  // namespace ves
