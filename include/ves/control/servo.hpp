// SPDX-License-Identifier: BSD-3-Clause
//
// What the controller knows of the six servos, and the reference that takes a leg where it should
// be. Beyond the report, which sends lengths and lets the servos lag.
//
// A leg, from its reference r to its length L, with v its speed:
//
//   v_end = K E,  E = r - L(t - a) - d v,  |E| <= rail      LegSlave, D/A, servo valve
//   tau v' + v = v_end,  L' = v                             cylinder, (2.17)
//
// K [1/s] depends on the sign of E. A LegSlave compares every `update`; it reads the length a
// before that, and r reaches it `delay` after the tick that sent it.
//
// Where both edges of a valve are open at null, by an E of `opening`, both pass for small E: there
// v_end = (K_extend + K_retract) E, and beyond K (E + what is open). Where they overlap, by an
// `opening` below zero, nothing passes for small E, and beyond K (E - what overlaps).
//
// Seals that rub press the oil the other way once a leg turns round. While that is new, the oil
// gives way and a pressure feedback closes the valve, by an E of twice `friction` at first:
//
//   E = r - L(t - a) - d v - friction (z - z_T),  z' = |v|/way (sign v - z),  T z_T' = z - z_T
#pragma once

#include "ves/contract/leg_communication.hpp"
#include "ves/kinematics/stewart.hpp"

namespace ves {

struct ServoModel {
  static constexpr int kSpan = 4;  // [-] updates that the derivative gain looks back

  Vec6 extend = Vec6::Zero();    // [1/s] velocity gain K for E > 0
  Vec6 retract = Vec6::Zero();   // [1/s] and for E < 0
  Vec6 tau = Vec6::Zero();       // [s]
  Vec6 delay = Vec6::Zero();     // [s]
  Vec6 opening = Vec6::Zero();   // [m] of both edges at null; below zero: they overlap
  Vec6 friction = Vec6::Zero();  // [m]
  double friction_time = 0.03;   // [s] T, for which a turn is felt
  double friction_way = 1e-4;    // [m] over which z turns
  double derivative = 0.0;       // [s] d
  double update = 0.0;           // [s]
  double reading_age = 0.0;      // [s] a
  double rail = 0.0;             // [m] E at the D/A converter's full scale
  double sensor_cutoff = 0.0;    // [rad/s] of the filter that the wrench passes
  double sensor_window = 0.0;    // [s] over which its readings are averaged; 0: one reading
  int sensor_readings = 1;       // [-] that it is the mean of
  double filter_cutoff = 0.0;    // [rad/s] of the filter that the accelerations pass; 0: none
  double sensor_delay = 0.0;     // [s] by which it is later than all of that says
  double sensor_scale = 1.0;     // [-] of the robot's modelled inertia that it shows
  LegCodec readings;             // of the transducers
  double jitter = 0.0;           // [s] by which the time of a reading may be wrong
};

/// [m/s] v_end of leg i for E [m], and E for v_end: the same curve, but for an overlap, which is
/// crossed on a slope.
double speedOf(const ServoModel& servo, int i, double E) noexcept;
Vec6 speedsOf(const ServoModel& servo, const Vec6& E) noexcept;
double differenceOf(const ServoModel& servo, int i, double v_end) noexcept;
/// [1/s] of each leg where v_end rises most with E, in either direction.
Vec6 steepest(const ServoModel& servo) noexcept;
/// True where both edges of leg i's valve pass, and where neither does.
bool nearNull(const ServoModel& servo, int i, double E) noexcept;
bool isLapped(const ServoModel& servo, int i, double E) noexcept;
/// [-] times 1/K: that slope.
inline constexpr double kThroughLap = 2.0;

/// What the seals of six legs do to their valves.
class SealFriction {
 public:
  /// They have rested.
  void settle() noexcept { settled_ = z_; }
  void reset() noexcept { z_ = settled_ = Channels::Zero(); }
  /// [m] of E that it takes, on average over the next dt [s] of legs that move at v.
  Vec6 turn(const ServoModel& servo, const Vec6& v, double dt) noexcept;

 private:
  using Channels = Eigen::Array<double, kLegs, 1>;
  Channels z_ = Channels::Zero(), settled_ = Channels::Zero();  // [-]
};

/// [s] by which a wrench is late where the admittance model uses it: the sensor's filter, its mean,
/// and half of the period for which it is held.
inline double wrenchDelay(const ServoModel& servo, double period) noexcept {
  return M_SQRT2 / servo.sensor_cutoff + 0.5 * servo.sensor_window + servo.sensor_delay +
         0.5 * period;
}

/// Reference that takes each leg where `legs` says: the inverse of the closed servo, which is of
/// type one. `lead` [s] is how much after this tick `legs` is meant.
///
/// With everything that delays it, v_end(t) = K (r(t - D) - L(t - D + A)), where D is half a period
/// of the held command, the way to the LegSlave and its own update and hold, and A = D less hold
/// and age of the reading. So r = L(t + A) + (L' + tau L'')(t + D) / K + d L', by Taylor from
/// `legs`, and `rubs` [m] of E more, which friction will take. E never exceeds the rail; `share` of
/// 0 is the report's reference, L.
Vec6 feedForward(const ServoModel& servo, const LegMotion& legs, double lead, double period,
                 double share, const Vec6& rubs = Vec6::Zero()) noexcept;

/// [s] D of leg i.
inline double commandDelay(const ServoModel& servo, int i, double lead, double period) noexcept {
  // The command's middle, half an update until a LegSlave looks, half an update's hold.
  return 0.5 * period + servo.delay(i) + servo.update - lead;
}

}  // namespace ves
