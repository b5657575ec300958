// SPDX-License-Identifier: BSD-3-Clause
//
// Leg communication (Appendix C): the one place where a command is made. What it sent last is what
// the legs hold when a tick sends nothing.
#pragma once

#include <algorithm>

#include "ves/control/controller_config.hpp"
#include "ves/control/servo_observer.hpp"

namespace ves {

/// How much of the compensation is in: it comes and goes over Compensation::ramp.
class CompensationShare {
 public:
  CompensationShare(const Compensation& compensation, double period)
      : any_(compensation.any()), change_(period / compensation.ramp) {}

  void advance() noexcept {
    value_ = any_ && wanted_ ? std::min(1.0, value_ + change_) : std::max(0.0, value_ - change_);
  }
  void reset() noexcept { value_ = 0.0; }
  void want(bool in) noexcept { wanted_ = in; }

  bool wanted() const noexcept { return wanted_; }
  bool exists() const noexcept { return any_; }
  double value() const noexcept { return value_; }  // [-]

 private:
  bool any_;
  double change_;  // [-] in a tick
  bool wanted_ = true;
  double value_ = 0.0;
};

class LegCommander {
 public:
  explicit LegCommander(const ControllerConfig& config);

  /// (C.13): counts of `legs`, which are meant `lead` [s] after this tick. `share` [-] of the
  /// compensation takes out the servos' lag and, by the model `servo`, which is `age` [s] behind
  /// this tick, the counts. A length that is not finite leaves the counts as they are.
  void command(const LegMotion& legs, bool engaged, std::int32_t segment, double lead, double share,
               const ServoObserver& servo, double age) noexcept;
  /// The last lengths are held.
  void hold() noexcept;
  /// Whether the legs may go home should no further command come.
  void allowPark(bool park) noexcept { command_.park = park; }

  /// [m] where the legs should be in this tick: the last command's lengths or, with the servos' lag
  /// taken out, those brought to now. `lead` [s] is what the last command was ahead of its tick.
  Vec6 expected(double lead, double share) const noexcept;

  const LegCommand& command() const noexcept { return command_; }
  const LegMotion& legs() const noexcept { return legs_; }       // last commanded
  const Vec6& reference() const noexcept { return reference_; }  // [m] what the servos were told

 private:
  Vec6 referenceOf(const LegMotion& legs, double lead, double share, const ServoObserver& servo,
                   double age) const noexcept;

  LegCodec codec_;
  Compensation compensation_;
  double period_;             // [s]
  double leg_min_, leg_max_;  // [m]
  LegCommand command_;
  LegMotion legs_;
  Vec6 reference_ = Vec6::Zero();
  Vec6 rounding_residual_ = Vec6::Zero();  // [m] of the commands so far
};

}  // namespace ves
