// SPDX-License-Identifier: BSD-3-Clause
//
// The servos as the controller may model them: what a LegSlave's gains make of an actuator, and the
// oil's swing behind it.
#pragma once

#include "ves/control/controller_config.hpp"
#include "ves/plant/hydraulic_platform.hpp"
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

/// The lowest of the six modes of plate and load on the oil behind closed valves at home, and the
/// least damping of any, by what flows at null with the pressure and by viscous seals; sliding
/// friction is not counted. What four-way legs gain as they turn, without load. `hydraulic` with
/// its areas fitted.
Resonance nominalResonance(const HydraulicModel& hydraulic, const ActuatorModel& gains,
                           const Geometry& geometry, const RigidBody& load_P);

}  // namespace ves::plant
