// SPDX-License-Identifier: BSD-3-Clause
//
// One leg under its LegSlave, every reading and rounding as in the plant: what the frequency
// response and the tests of the servo look at.
#pragma once

#include "ves/plant/plant.hpp"

namespace ves {

class OneLeg {
 public:
  /// At rest at `length` [m].
  OneLeg(const plant::LegSlaveGains& gains, const plant::ActuatorModel& actuator,
         const plant::Temposonics& transducer, double length);

  /// A Temposonics period (341 us) passes, the LegSlave told `reference` [m].
  void step(double reference) noexcept;

  double length() const noexcept { return actuator_.length(); }  // [m]
  static constexpr double kStep =                                // [s]
      static_cast<double>(kTransducerPeriod) * kSecondPerNanosecond;

 private:
  plant::Temposonics transducer_;
  plant::Actuator actuator_;
  plant::LegSlave slave_;
  double decay_;  // [-] of the speed in a step
};

struct FrequencyResponse {
  double gain = 0.0;   // [-]
  double phase = 0.0;  // [rad]
};

/// Of a leg of the machine `p` with the gain `gain` [m/s/A] in both directions, to a sine of
/// `amplitude` [m] about mid-stroke, after a second to settle.
FrequencyResponse respond(const plant::PlantConfig& p, double gain, double frequency,
                          double amplitude);

}  // namespace ves
