// SPDX-License-Identifier: BSD-3-Clause
//
// Where the legs and the platform are: counts to lengths (2.7b), implausible readings left out,
// forward kinematics (2.23), and the servo model beside the servos.
#pragma once

#include "ves/control/leg_commander.hpp"
#include "ves/control/monitors.hpp"
#include "ves/control/servo_adaptation.hpp"
#include "ves/control/tick_clock.hpp"

namespace ves {

/// The legs and the platform as measured.
struct Measured {
  Vec6 L = Vec6::Zero();  // [m]
  Transform X_IP;         // by forward kinematics of L; the last that was found
  Pose pose;              // X_IP about home
  bool solved = false;    // forward kinematics found X_IP for this L
};

class LegEstimator {
 public:
  explicit LegEstimator(const ControllerConfig& config);

  /// `following`: the legs follow what was sent.
  const Measured& update(const SampleStream& samples, const Elapsed& elapsed, bool following,
                         const LegCommander& sent) noexcept;
  /// The command of `tick` leaves at `time` [ns] of the machine's clock.
  void sent(const LegCounts& counts, std::int64_t tick, std::int64_t time) noexcept;

  const Measured& measured() const noexcept { return measured_; }
  const LegReadings& readings() const noexcept { return readings_; }
  const Vec6& recentSpeed() const noexcept { return speed_.speed(); }  // [m/s] as commanded
  const ServoObserver& servo() const noexcept { return servo_; }
  const ServoGains& gains() const noexcept { return adaptation_.gains(); }  // in use
  /// [s] that its model is behind `time` [ns]; five periods at most.
  double age(std::int64_t time) const noexcept {
    const double age = static_cast<double>(time - servo_.time()) * kSecondPerNanosecond;
    return std::clamp(age, 0.0, 5.0 * period_);
  }
  /// Measured lengths, and rates and accelerations by the servo model as the sample's wrench shows
  /// them; of a controller that compensates inertia.
  const LegMotion& feltMotion() const noexcept { return felt_; }

 private:
  void adapt(const Sample& sample) noexcept;

  Geometry geometry_;
  LegCodec codec_;
  double period_;  // [s]
  SafetyLimits limits_;
  bool feels_, adapts_;
  ServoObserver servo_;
  ServoAdaptation adaptation_;
  LegReadings readings_;
  LegSpeed speed_;
  Measured measured_;
  LegMotion felt_;
};

}  // namespace ves
