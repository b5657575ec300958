// SPDX-License-Identifier: BSD-3-Clause
//
// Servo valve, cylinder and Temposonics transducer of one leg (report, section 2.4).
#pragma once

#include <cmath>
#include <cstdint>

#include "ves/contract/sample.hpp"

namespace ves::plant {

struct ActuatorModel {
  double gain_extend = 0.0;   // [m/s/A] K of (2.17) for positive current
  double gain_retract = 0.0;  // [m/s/A] K of (2.17) for negative current
  double tau = 0.0;           // [s]
  double length_min = 0.0;    // [m] stroke ends
  double length_max = 0.0;    // [m]
};

/// y(s)/i(s) = K / (s (tau s + 1)), (2.17), exactly while the current is constant. The valve's
/// position decides which side of the piston is fed, so the current's sign chooses K.
class Actuator {
 public:
  Actuator(const ActuatorModel& model, double length) noexcept : model_(model), L_(length) {}

  /// Holds `current` [A] for dt [s]; `decay` is e^{-dt/tau}. The piston stops dead at a stroke end.
  void advance(double current, double dt, double decay) noexcept {
    const double v_end = (current > 0.0 ? model_.gain_extend : model_.gain_retract) * current;
    L_ += v_end * dt + (v_ - v_end) * model_.tau * (1.0 - decay);
    v_ = v_end + (v_ - v_end) * decay;
    if (std::abs(v_) < kRest) v_ = 0.0;  // a closed valve's decay ends in slow denormal numbers
    a_ = (v_end - v_) / model_.tau;
    if (L_ <= model_.length_min || L_ >= model_.length_max) {
      L_ = L_ <= model_.length_min ? model_.length_min : model_.length_max;
      v_ = a_ = 0.0;
    }
  }

  double length() const noexcept { return L_; }        // [m]
  double velocity() const noexcept { return v_; }      // [m/s]
  double acceleration() const noexcept { return a_; }  // [m/s^2]

 private:
  static constexpr double kRest = 1e-100;  // [m/s]
  ActuatorModel model_;
  double L_;        // [m]
  double v_ = 0.0;  // [m/s]
  double a_ = 0.0;  // [m/s^2]
};

/// 14-bit counter of the pulse's transit time, (2.7b).
struct Temposonics {
  double offset = 0.0;  // [m] length at the middle of count 0
  double scale = 0.0;   // [m/count]

  std::int32_t count(double length) const noexcept;
};

}  // namespace ves::plant
