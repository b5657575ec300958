// SPDX-License-Identifier: BSD-3-Clause
//
// What the controller knows of the six servos, and what it makes of that knowledge. Beyond the
// report, which sends lengths and lets the servos lag.
//
// A leg, from its reference r to its length L, with v its speed:
//
//   v_end = K E,  E = r - L(t - a) - d v,  |E| <= rail      LegSlave, D/A, servo valve
//   tau v' + v = v_end,  L' = v                             cylinder, (2.17)
//
// K [1/s] depends on the sign of E. A LegSlave compares every `update`; it reads the length a
// before that, and r reaches it `delay` after the tick that sent it.
#pragma once

#include "ves/control/leg_communication.hpp"
#include "ves/kinematics/stewart.hpp"
#include "ves/math/butterworth.hpp"

namespace ves {

struct ServoModel {
  Vec6 extend = Vec6::Zero();   // [1/s] velocity gain K for E > 0
  Vec6 retract = Vec6::Zero();  // [1/s] and for E < 0
  Vec6 tau = Vec6::Zero();      // [s]
  Vec6 delay = Vec6::Zero();    // [s]
  double derivative = 0.0;      // [s] d
  double update = 0.0;          // [s]
  double reading_age = 0.0;     // [s] a
  double rail = 0.0;            // [m] E at the D/A converter's full scale
  double sensor_cutoff = 0.0;   // [rad/s] of the filter that the wrench passes
  LegCodec readings;            // of the transducers
  double jitter = 0.0;          // [s] by which the time of a reading may be wrong
};

/// [s] by which a wrench is late where the admittance model uses it: the sensor's filter, and half
/// of the period for which it is held.
inline double wrenchDelay(const ServoModel& servo, double period) noexcept {
  return M_SQRT2 / servo.sensor_cutoff + 0.5 * period;
}

/// Reference that takes each leg where `legs` says: the inverse of the closed servo, which is of
/// type one. `lead` [s] is how much after this tick `legs` is meant.
///
/// With everything that delays it, v_end(t) = K (r(t - D) - L(t - D + A)), where D is half a period
/// of the held command, the way to the LegSlave and its own update and hold, and A = D less hold
/// and age of the reading. So r = L(t + A) + (L' + tau L'')(t + D) / K + d L', by Taylor from
/// `legs`. E never exceeds the rail; `share` of 0 is the report's reference, L.
Vec6 feedForward(const ServoModel& servo, const LegMotion& legs, double lead, double period,
                 double share) noexcept;

/// Runs the servo model beside the servos, counts and all: speed and acceleration of the legs,
/// which nothing measures, the acceleration as the wrench's filter shows it, and the length below a
/// count.
///
/// A reading bounds the length to its count; the estimate is moved no further than to the count's
/// edge, so what the model knows below a count stays.
class ServoObserver {
 public:
  /// `phase` [-] of an update is to pass until the first: the LegSlaves' initial phase is
  /// unknown, and it drifts through all values.
  ServoObserver(const ServoModel& servo, double period, double phase = 0.5);

  /// At rest at L.
  void reset(const Vec6& L) noexcept;

  /// A period passes under `reference`.
  void advance(const Vec6& reference) noexcept;

  /// What the transducers read now.
  void correct(const Vec6& L) noexcept;

  const Vec6& length() const noexcept { return L_; }    // [m]
  const Vec6& velocity() const noexcept { return v_; }  // [m/s]
  /// [m] what the LegSlaves' readings will be too long, on average over the coming period, the legs
  /// moving on at L_dot. Adding this offset to the reference cancels the quantisation; without it a
  /// leg comes to rest at the edge of a count, wherever in the count it should be.
  Vec6 rounding(const Vec6& L_dot) const noexcept;
  /// [m/s^2] behind the wrench's filter.
  Vec6 filteredAcceleration() const noexcept { return filter_.output().matrix(); }

 private:
  using Channels = Eigen::Array<double, kLegs, 1>;

  /// What passes in one length of time under a constant current.
  struct Passage {
    double dt = 0.0;  // [s]
    Channels decay;   // e^{-dt/tau}
    Butterworth2<kLegs>::Step filter;
  };
  Passage passage(double dt) const noexcept;
  double reading(int leg, double L, double v) const noexcept;
  void pass(const Passage& passage) noexcept;
  void update(const Vec6& reference) noexcept;

  ServoModel servo_;
  double period_;
  double to_update_;  // [s] until the next one
  Butterworth2<kLegs> filter_;
  Passage whole_;  // of an update
  Vec6 L_ = Vec6::Zero(), v_ = Vec6::Zero(), v_end_ = Vec6::Zero();
  Vec6 reference_ = Vec6::Zero();  // of the period before
};

}  // namespace ves
