// SPDX-License-Identifier: BSD-3-Clause
//
// Leg communication (Appendix C): the one place where a command is made. It sends lengths that were
// checked, or holds the last ones that were: those, and not what the servos were told to get there,
// which with the servos' lag taken out is ahead of them. Every command says where the legs rest
// should it be the last.
#pragma once

#include <algorithm>

#include "ves/control/checked.hpp"
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

  /// (C.13): counts of what was checked; where it does not pass, hold(). `share` [-] of the
  /// compensation takes out the servos' lag and, by the model `servo`, which is `age` [s] behind
  /// this tick, the counts.
  void send(const Checked& next, std::int32_t segment, double share, const ServoObserver& servo,
            double age) noexcept;
  /// The last checked lengths are held.
  void hold() noexcept;
  /// The legs are not commanded; they are at `legs`, or were last where these are not finite.
  void release(const LegMotion& legs) noexcept;
  /// Whether the legs may go home should no further command come.
  void allowPark(bool park) noexcept { command_.park = park; }
  /// How the laboratory flies.
  void fly(const Laboratory& laboratory) noexcept { command_.laboratory = laboratory; }

  /// [m] where the legs should be in this tick: the last command's lengths or, with the servos' lag
  /// taken out, those brought to now.
  Vec6 expected(double share) const noexcept;

  const LegCommand& command() const noexcept { return command_; }
  const LegMotion& legs() const noexcept { return legs_; }       // last commanded
  const Vec6& reference() const noexcept { return reference_; }  // [m] what the servos were told

 private:
  Vec6 referenceOf(const LegMotion& legs, double ahead, double share, const ServoObserver& servo,
                   double age) noexcept;
  Vec6 rubbing(const ServoModel& servo, const LegMotion& legs, double ahead) noexcept;

  LegCodec codec_;
  Compensation compensation_;
  double period_;             // [s]
  double leg_min_, leg_max_;  // [m]
  LegCommand command_;
  LegMotion legs_;
  double ahead_ = 0.0;  // [s] of the last command's lengths after its tick
  Vec6 reference_ = Vec6::Zero();
  SealFriction friction_;                  // of the legs as commanded
  Vec6 rounding_residual_ = Vec6::Zero();  // [m] of the commands so far
};

}  // namespace ves
