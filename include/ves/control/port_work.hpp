// SPDX-License-Identifier: BSD-3-Clause
//
// The work that the wrench at the port does on the platform, from one reading to the next.
#pragma once

#include "ves/control/controller_config.hpp"
#include "ves/control/servo_observer.hpp"

namespace ves {

/// The wrench is known by one reading a tick, behind the sensor's filter; the motion by the servo
/// model (ServoObserver), within a tick too.
///
/// A polynomial through the readings says what the filter let through, S, and what went in was
/// F = S + sqrt(2)/w S' + S''/w^2.
class PortWork {
 public:
  explicit PortWork(const ControllerConfig& config) noexcept;

  /// Nothing is known of the past.
  void reset() noexcept { known_ = 0; }

  struct Work {
    /// [J] since the reading before, by a parabola through the last three. Its second derivative
    /// lags by half a period: in a contact of a few periods that is rather too little work on a
    /// platform that gives way (docs/contact.md, Passivity).
    double newest = 0.0;
    /// [J] from the reading before that to the reading before, by a cubic through the last four.
    double settled = 0.0;
  };

  /// On the platform, now at X_IP; nothing without enough readings, or when F_Po_I is not new. It
  /// was read at `time` [ns] of the servo model's clock.
  Work take(const Wrench& F_Po_I, std::int64_t time, const Transform& X_IP,
            const ServoObserver& servo) noexcept;

 private:
  using Polynomial = Motions;  // [N | N m] coefficients of 1, t, t^2, t^3
  struct Reading {
    std::int64_t time = 0;  // [ns] of the middle of its window
    Vec6 F = Vec6::Zero();
  };
  static constexpr int kReadings = 4;

  double seconds(int from, int to) const noexcept;  // [s] between two readings
  Polynomial parabola(int middle) const noexcept;
  double work(const Polynomial& S, const Motions& moments) const noexcept;

  Geometry geometry_;
  std::int64_t late_;     // [ns] a reading's end after its middle
  std::int64_t longest_;  // [ns] between two readings that belong together
  double slope_;          // [s] sqrt(2)/w
  double curvature_;      // [s^2] 1/w^2, less what the mean over a window adds
  std::array<Reading, kReadings> last_{};
  int known_ = 0;                      // [-] of them
  Motions moments_ = Motions::Zero();  // of the platform, between the last two
};

}  // namespace ves
