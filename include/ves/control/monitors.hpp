// SPDX-License-Identifier: BSD-3-Clause
//
// Safety checks that need a memory of earlier ticks.
#pragma once

#include "ves/control/safety_checks.hpp"

namespace ves {

/// The speed [m/s] that each leg has had lately: rises at once, falls away over `memory` [s].
class LegSpeed {
 public:
  void step(const Vec6& L_dot, double period, double memory) noexcept {
    speed_ = L_dot.cwiseAbs().cwiseMax(speed_ * (1.0 - period / memory));
  }
  const Vec6& speed() const noexcept { return speed_; }

 private:
  Vec6 speed_ = Vec6::Zero();
};

/// Readings of the legs: one that no leg can have reached since the last is rejected; the one
/// before is kept. More than reading_patience in a row are a fault.
class LegReadings {
 public:
  /// `speed` is what the legs were told lately, `time` [s] has passed since the last reading.
  /// Returns the accepted lengths.
  const Vec6& take(const SafetyLimits& limits, const Vec6& L, const Vec6& speed,
                   double time) noexcept;
  /// Accepts whatever comes next: the legs did not follow our commands.
  void reset() noexcept { known_ = false; }

  bool good(const SafetyLimits& limits) const noexcept { return wrong_ <= limits.reading_patience; }

 private:
  bool known_ = false;
  int wrong_ = 0;  // [-] in a row
  Vec6 L_ = Vec6::Zero();
};

/// Six readings that stay bit for bit the same while the weight they carry should have changed one.
class FrozenSensor {
 public:
  /// `expected` [count] is what the static load alone reads.
  void take(const AdcCounts& adc, const Vec6& expected) noexcept;
  bool good(const SafetyLimits& limits) const noexcept {
    return same_ < limits.frozen_samples || !(change_ > limits.frozen_counts);
  }

 private:
  AdcCounts last_{};
  Vec6 expected_ = Vec6::Zero();
  int same_ = 0;         // [-] samples
  double change_ = 0.0;  // [count] of the expected since then
};

/// Ticks that came late: woke late, or the one before ran long. Never made up for.
class Overruns {
 public:
  /// `missed` ticks before this one, which is `tick`.
  void take(std::int64_t tick, std::int64_t missed) noexcept;
  bool good(const SafetyLimits& limits, std::int64_t ticks_per_second) const noexcept;

 private:
  static constexpr std::size_t kKept = kMostOverruns + 1;
  std::array<std::int64_t, kKept> late_{};  // ticks, a ring
  std::size_t count_ = 0;                   // [-] so far
  std::int64_t missed_ = 0;                 // [-] before the last tick
  std::int64_t tick_ = 0;
};

/// Energy of the emulated base, while the robot stands still: a sampled, lagging loop can feed it
/// (Appendix E), and then it grows window after window, or goes on swinging against the envelope.
class Oscillation {
 public:
  /// `energy` [J]; `held`: the envelope slows a motion; `q` the robot's joints, `moved` [rad | m]
  /// what counts as moving.
  void take(const SafetyLimits& limits, double energy, bool held, const JointVector& q,
            double moved, double period) noexcept;
  void reset() noexcept { *this = Oscillation(); }
  bool good(const SafetyLimits& limits) const noexcept { return grown_ < limits.growing_windows; }

 private:
  double time_ = 0.0;  // [s] in this window
  double most_ = 0.0;  // [J] in this window
  double last_ = 0.0;  // [J] in the one before
  bool held_ = false;  // in this window
  int grown_ = 0;      // [-] windows in a row
  JointVector q_ = JointVector::Zero();
};

}  // namespace ves
