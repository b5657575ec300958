// SPDX-License-Identifier: BSD-3-Clause
//
// What a recorded run tells of the machine: masses of its robot, servos of its legs, time and scale
// of its force sensor, each as the record that a controller takes.
#pragma once

#include "ves/config/calibration.hpp"
#include "ves/config/masses.hpp"
#include "ves/config/servo.hpp"
#include "ves/identification/mass_parameters.hpp"
#include "ves/identification/sensor_timing.hpp"
#include "ves/identification/servo_identification.hpp"
#include "ves/series/series.hpp"

namespace ves {

/// A calibration that has just been made; `setup` as Provenance::calibrated.
CalibrationRecord calibrationOf(const state_t& state, const std::string& setup, double temperature);

struct IdentifiedMasses {
  SeparableCombinations combinations;
  MassEstimate estimate;
  std::vector<StaticInterval> rests;
  MassRecord record;
};

/// From the stretches in which platform and robot stand still. Throws std::domain_error where they
/// do not tell.
IdentifiedMasses identifiedMasses(const Series& series);

/// The robot as a run has learnt it (learns_masses), without what was in its hand; none where no
/// mass was learnt.
std::optional<MassRecord> learntMasses(const Series& series);

struct IdentifiedServo {
  ServoEstimate legs;
  std::optional<SensorEstimate> sensor;
  std::string why;  // there is no `sensor`
  ServoRecord record;
};

/// From the longest stretch under command without a gap, which moves every leg both ways. Throws
/// std::domain_error where it does not tell.
ServoEstimate identifiedLegs(const Series& series);
/// The legs too, unless they are known; the sensor, which tells while the robot stands still.
IdentifiedServo identifiedServo(const Series& series,
                                const std::optional<ServoEstimate>& legs = {});

}  // namespace ves
