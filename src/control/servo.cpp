// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/servo.hpp"

#include <algorithm>
#include <cmath>

namespace ves {

Vec6 feedForward(const ServoModel& servo, const LegMotion& legs, double lead, double period,
                 double share) noexcept {
  Vec6 reference;
  for (int i = 0; i < kLegs; ++i) {
    // The command's middle, half an update until a LegSlave looks, half an update's hold.
    const double D = 0.5 * period + servo.delay(i) + servo.update - lead;
    const double A = D - servo.reading_age - 0.5 * servo.update;
    const double v = legs.L_dot(i) + D * legs.L_ddot(i);
    const double v_end = v + servo.tau(i) * legs.L_ddot(i);
    const double E = v_end / (v_end > 0.0 ? servo.extend(i) : servo.retract(i));
    const double ahead = A * (legs.L_dot(i) + 0.5 * A * legs.L_ddot(i)) + servo.derivative * v;
    reference(i) = legs.L(i) + share * (ahead + std::clamp(E, -servo.rail, servo.rail));
  }
  return reference;
}

}  // namespace ves
