// SPDX-License-Identifier: BSD-3-Clause
//
// The file that an identification leaves: what gravity compensation uses instead of the masses of
// the robot's URDF.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "ves/config/document.hpp"
#include "ves/robot/payload.hpp"

namespace ves {

struct MassRecord {
  std::int64_t date = 0;   // [s] since 1970, UTC
  std::string kinematics;  // hash of the geometry it was taken with
  struct Body {
    double mass = 0.0;           // [kg]
    Vec3 moment = Vec3::Zero();  // [kg m] about the origin of its frame
  };
  std::vector<Body> bodies;  // link 0, with all plates, then the links behind the joints
  double deviation = 0.0;    // [-] standard, of the weight's wrench; 0: nobody has said
};

/// YAML, as readMasses() takes it; `comment` on top, its lines without #.
std::string write(const MassRecord& record, const std::string& comment);

/// Throws InputError.
MassRecord readMasses(Section section);

/// What a record depends on: where the sensor, the robot's base and its joints are.
std::string kinematicsOf(const Payload& payload);

/// [-] by which the robot's inertia at q may be wrong: three of the record's deviations, and of the
/// share that is the links' own, which rest tells nothing of, what was `before`.
double massErrorOf(const MassRecord& record, const RobotModel& robot, const JointVector& q,
                   double before);

/// The payload with these masses. As many bodies as it has links.
Payload withMasses(Payload payload, const MassRecord& record);

}  // namespace ves
