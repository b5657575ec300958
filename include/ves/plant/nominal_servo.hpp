// SPDX-License-Identifier: BSD-3-Clause
//
// The servos as the controller may model them: what a LegSlave's gains make of an actuator.
#pragma once

#include "ves/control/servo.hpp"
#include "ves/plant/actuator.hpp"
#include "ves/plant/leg_slave.hpp"

namespace ves::plant {

/// [m] of a leg's error at which the D/A converter is at its full scale.
double servoRail(const LegSlaveGains& gains, const Temposonics& transducer);

/// [1/s] speed of a leg per its error, below the rail; `gain` [m/s/A] of the actuator.
double velocityGain(double gain, const LegSlaveGains& gains, const Temposonics& transducer);

/// [s] by which the derivative gain weighs the speed: over the four updates of X(k) - X(k-4).
double derivativeTime(const LegSlaveGains& gains);

/// All legs alike, without any delay on the way to them.
ServoModel nominalServo(const LegSlaveGains& gains, const ActuatorModel& actuator,
                        const Temposonics& transducer);

}  // namespace ves::plant
