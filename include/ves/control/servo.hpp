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

#include <array>

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
  double sensor_window = 0.0;   // [s] over which its readings are averaged; 0: one reading
  double sensor_delay = 0.0;    // [s] by which it is later than all of that says
  double sensor_scale = 1.0;    // [-] of the robot's modelled inertia that it shows
  LegCodec readings;            // of the transducers
  double jitter = 0.0;          // [s] by which the time of a reading may be wrong
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
/// `legs`. E never exceeds the rail; `share` of 0 is the report's reference, L.
Vec6 feedForward(const ServoModel& servo, const LegMotion& legs, double lead, double period,
                 double share) noexcept;

/// Runs the servo model beside the servos, counts and all: speed and acceleration of the legs,
/// which nothing measures, the acceleration as the wrench shows it, and the length below a count.
///
/// It is where the newest sample was taken, not where the tick is: what a sample says is compared
/// with the model at its own time, however old it is. All times are [ns] of the machine's clock.
///
/// A reading bounds the length to its count; the estimate is moved no further than to the count's
/// edge, so what the model knows below a count stays.
class ServoObserver {
 public:
  /// `phase` [-] of an update is to pass until the first: the LegSlaves' initial phase is
  /// unknown, and it drifts through all values.
  ServoObserver(const ServoModel& servo, double period, double phase = 0.5);

  /// At rest at L, where all commands so far have led.
  void reset(const Vec6& L, std::int64_t time) noexcept;

  /// Command `tick` leaves at `time`; it counts as arrived then until arrived() knows better.
  void send(const Vec6& reference, std::int64_t tick, std::int64_t time) noexcept;
  void arrived(std::int64_t tick, std::int64_t time) noexcept;

  /// On to `time`; after more than a few periods the model has come to rest, and the rest is left
  /// out.
  void advance(std::int64_t time) noexcept;

  /// What the transducers read at `time`, now or before.
  void correct(const Vec6& L, std::int64_t time) noexcept;

  std::int64_t time() const noexcept { return now_; }   // [ns] where it is
  const Vec6& length() const noexcept { return L_; }    // [m]
  const Vec6& velocity() const noexcept { return v_; }  // [m/s]
  /// [m] what the LegSlaves' readings will be too long, on average over a period that begins
  /// `later` [s], the legs moving on at L_dot. Adding this offset to the reference cancels the
  /// quantisation; without it a leg comes to rest at the edge of a count, wherever in the count it
  /// should be.
  Vec6 rounding(const Vec6& L_dot, double later) const noexcept;
  /// [m/s^2] as the wrench that was read at `time` shows it: behind the sensor's filter, averaged
  /// over the sensor's window, sensor_delay before. The mean of the filtered acceleration is the
  /// change of the filtered speed.
  Vec6 filteredAcceleration(std::int64_t time) const noexcept;

 private:
  using Channels = Eigen::Array<double, kLegs, 1>;

  /// What passes in one length of time under a constant current.
  struct Passage {
    double dt = 0.0;  // [s]
    Channels decay;   // e^{-dt/tau}
    Butterworth2<kLegs>::Step filter;
  };
  struct Command {
    std::int64_t tick = -1, time = 0;  // [-], [ns] when it came
    Vec6 reference = Vec6::Zero();     // [m]
  };
  struct Instant {
    std::int64_t time = 0;  // [ns]
    Vec6 L = Vec6::Zero(), v = Vec6::Zero();
    Vec6 filtered_v = Vec6::Zero(), filtered_a = Vec6::Zero(), filtered_a_rate = Vec6::Zero();
  };
  Passage passage(double dt) const noexcept;
  double reading(int leg, double L, double v) const noexcept;
  double reference(int leg) const noexcept;
  void pass(const Passage& passage) noexcept;
  void update() noexcept;
  void remember() noexcept;
  Instant at(std::int64_t time) const noexcept;

  static constexpr std::size_t kCommands = 16;
  static constexpr std::size_t kInstants = 64;  // [-] three periods at least

  ServoModel servo_;
  std::int64_t period_;   // [ns] of the controller
  std::int64_t between_;  // [ns] two instants that are remembered, at least
  double to_update_;      // [s] until the next one
  Butterworth2<kLegs> filter_;
  Passage whole_;         // of an update
  std::int64_t now_ = 0;  // [ns]
  Vec6 L_ = Vec6::Zero(), v_ = Vec6::Zero(), v_end_ = Vec6::Zero();
  std::array<Command, kCommands> commands_{};  // rings: the newest at the number so far, less one
  std::size_t sent_ = 0;
  std::array<Instant, kInstants> past_{};
  std::size_t remembered_ = 0;
};

}  // namespace ves
