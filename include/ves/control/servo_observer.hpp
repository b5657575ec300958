// SPDX-License-Identifier: BSD-3-Clause
//
// Speed and acceleration of the legs, which nothing measures, and their lengths below a count: the
// servo model, run beside the servos and corrected by the readings.
#pragma once

#include "ves/control/modelled_servos.hpp"
#include "ves/math/butterworth.hpp"

namespace ves {

/// Runs the servo model beside the servos. It is where the newest sample was taken, not where the
/// tick is: what a sample says is compared with the model at its own time, however old it is. All
/// times are [ns] of the machine's clock.
///
/// A reading bounds the length to its count; the estimate is moved no further than to the count's
/// edge, so what the model knows below a count stays.
class ServoObserver {
 public:
  /// Without `feels` it knows no filtered acceleration.
  ServoObserver(const ServoModel& servo, double period, bool feels = true);

  /// At rest at L, where all commands so far have led.
  void reset(const Vec6& L, std::int64_t time) noexcept;

  /// See ModelledServos.
  void send(const Vec6& reference, std::int64_t tick, std::int64_t time) noexcept {
    servos_.send(reference, tick, time);
  }
  void arrived(std::int64_t tick, std::int64_t time) noexcept { servos_.arrived(tick, time); }
  void use(const ServoGains& gains) noexcept { servos_.use(gains); }
  void advance(std::int64_t time) noexcept;

  /// What the transducers read at `time`, now or before.
  void correct(const Vec6& L, std::int64_t time) noexcept;

  const ServoModel& model() const noexcept { return servos_.model(); }
  std::int64_t time() const noexcept { return servos_.time(); }         // [ns] where it is
  const Vec6& length() const noexcept { return servos_.length(); }      // [m]
  const Vec6& velocity() const noexcept { return servos_.velocity(); }  // [m/s]
  /// [m] what the LegSlaves' readings will be too long, on average over a period that begins
  /// `later` [s], the legs moving on at L_dot. Adding this offset to the reference cancels the
  /// quantisation; without it a leg comes to rest at the edge of a count, wherever in the count it
  /// should be.
  Vec6 rounding(const Vec6& L_dot, double later) const noexcept;
  /// [m/s^2] as the wrench that was read at `time` shows it: behind the sensor's filter, averaged
  /// over the sensor's window, sensor_delay before. The mean of the filtered acceleration is the
  /// change of the filtered speed.
  Vec6 filteredAcceleration(std::int64_t time) const noexcept;
  /// The legs' motion from one time to another, and its moments: int t^n dL, t [s] after `from`.
  Motions moments(std::int64_t from, std::int64_t to) const noexcept;

 private:
  using Channels = ModelledServos::Channels;

  struct Instant {
    std::int64_t time = 0;  // [ns]
    Vec6 L = Vec6::Zero(), v = Vec6::Zero();
    Vec6 filtered_v = Vec6::Zero(), filtered_a = Vec6::Zero(), filtered_a_rate = Vec6::Zero();
    Vec6 a = Vec6::Zero();  // [m/s^2] after it
  };
  void remember() noexcept;
  Instant at(std::int64_t time) const noexcept;

  static constexpr std::size_t kInstants = 64;  // [-] three periods at least

  ModelledServos servos_;
  double period_;         // [s] of the controller
  bool feels_;            // runs the sensor's filter
  std::int64_t between_;  // [ns] two instants that are remembered, at least
  Butterworth2<kLegs> filter_;
  Butterworth2<kLegs>::Step whole_;        // of an update
  std::array<Instant, kInstants> past_{};  // a ring: the newest at the number so far, less one
  std::size_t remembered_ = 0;
};

}  // namespace ves
