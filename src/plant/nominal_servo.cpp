// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/nominal_servo.hpp"

namespace ves::plant {
namespace {

constexpr double kFractional = 256.0;  // eight bits of U, (2.7a)
constexpr double kUpdate = static_cast<double>(kUpdatePeriod) * kSecondPerNanosecond;

}  // namespace

double servoRail(const LegSlaveGains& gains, const Temposonics& transducer) {
  const double digits_per_count = gains.K_P / kFractional;
  return LegSlave::kFullScale / digits_per_count * transducer.scale;
}

double velocityGain(double gain, const LegSlaveGains& gains, const Temposonics& transducer) {
  const double current =  // [A] at the D/A converter's full scale
      LegSlave::kFullScale * LegSlave::kVoltsPerDigit * LegSlave::kAmperesPerVolt;
  return gain * current / servoRail(gains, transducer);
}

double derivativeTime(const LegSlaveGains& gains) {
  return ServoModel::kSpan * kUpdate * gains.K_D / gains.K_P;
}

ServoModel nominalServo(const LegSlaveGains& gains, const ActuatorModel& actuator,
                        const Temposonics& transducer) {
  ServoModel s;
  s.rail = servoRail(gains, transducer);
  s.extend.setConstant(velocityGain(actuator.gain_extend, gains, transducer));
  s.retract.setConstant(velocityGain(actuator.gain_retract, gains, transducer));
  s.tau.setConstant(actuator.tau);
  s.update = kUpdate;
  s.derivative = derivativeTime(gains);
  s.reading_age = 0.5 * static_cast<double>(kTransducerPeriod) * kSecondPerNanosecond;
  s.readings.offset.setConstant(transducer.offset);
  s.readings.scale.setConstant(transducer.scale);
  return s;
}

}  // namespace ves::plant
