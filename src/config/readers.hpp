// SPDX-License-Identifier: BSD-3-Clause
//
// One reader a section of the configuration. Each takes all of its section's keys, and throws
// InputError with the line of what is wrong.
#pragma once

#include <cmath>
#include <optional>

#include "ves/analysis/platform.hpp"
#include "ves/config/document.hpp"
#include "ves/config/experiment.hpp"
#include "ves/config/urdf.hpp"

namespace ves {

inline constexpr double kAny = HUGE_VAL;
inline constexpr double kTiny = 1e-12;  // least positive value that is taken

/// A coordinate of six, in its unit of configurations; the key ends with that unit.
double readCoordinate(Section& s, const std::string& key, int i);
Pose readPose(Section s);
/// Nanoseconds from seconds, to the nearest.
std::int64_t readTime(Section& s, std::string_view key);
/// mass_kg, center_m, inertia_kg_m2
RigidBody readBody(Section s);
/// [kg m^2] of a uniform box with edges `size` [m], about its centre.
Mat3 boxInertia(double mass, const Vec3& size);
/// A uniform box; its centre is at the frame's origin unless `center_m` says otherwise.
RigidBody readBox(Section s);

/// platform
Geometry readGeometry(Section s);

/// legs, and legs.watchdog
struct Legs {
  plant::LegSlaveGains gains;
  plant::ActuatorModel actuator;
  plant::Temposonics transducer;
  plant::LegFilters filters = plant::LegFilters::kNone;
  double filter_cutoff = 0.0;
  std::optional<plant::HydraulicModel> hydraulic;
  LegCodec codec;
};
/// What is `derived` follows from what the workspace asks of the legs.
Legs readLegs(Section s, const WorkspaceUse& use);
/// [m^3/s/Pa] of an l/min/MPa.
inline constexpr double kOilFlow = 1e-3 / 60.0 / 1e6;
/// legs.hydraulic; areas and flow are not fitted yet
plant::HydraulicModel readHydraulics(Section s, const plant::ActuatorModel& actuator);

/// sensor
struct Sensor {
  plant::ForceTorqueSensorModel model;
  plant::Climate climate;
  int readings = 1;  // [-] that the machine averages over a controller period
  Transform X_PS;
  RigidBody top_plate_S;
};
Sensor readSensor(Section s);

/// environment; the robot, the platform and gravity are there already
World readEnvironment(Section s, const Experiment& e);

/// base.ground
GroundMotion readGround(Section s);

/// safety.translation_m and rotation_deg, and what they ask of the legs
WorkspaceUse readWorkspace(Section s, const Geometry& geometry);
/// safety
SafetyLimits readSafety(Section s, const Geometry& geometry, const WorkspaceUse& use,
                        const Legs& legs, double volts_per_count);

/// robot
struct Robot {
  UrdfRobot urdf;
  Transform X_PR, X_RL0;
  RigidBody adapter_R;
  JointVector q = JointVector::Zero();
  plant::JointEncoderModel encoders;
  bool gripper_switch = false;
};
Robot readRobot(Section s, const Value& document);
/// Fails at `key` unless the joint may be at q [rad | m].
void requireInLimits(const Section& s, std::string_view key, const UrdfRobot& robot, int joint,
                     double q);

/// controller, into `c`
void readController(Section s, ControllerConfig& c);

/// program, with the events of robot and faults; `out` has the machine and the robot already
void readProgram(Section& root, Experiment& out);

/// machine; `resonance` as derived, where the legs are simulated ones that give way, and as it is
/// told afterwards
MachinePieces readMachine(Section s, std::int64_t controller_period, Resonance& resonance);

/// base.ground, within what the platform may do for as long as the program asks for it
void requireGroundFits(Section& root, const ControllerConfig& c);
void requireFiringsFit(Section& root, const ControllerConfig& c);
/// the recorded path: the steps between its rows, and to its first
void requirePathFits(Section& root, const ControllerConfig& c);
/// Goes through a program's moves and trajectories before it is run, where it is known from where.
class ProgramRehearsal {
 public:
  /// `start` [m, rad] about home: where the platform is before the program; none: nobody knows.
  ProgramRehearsal(const ControllerConfig& c, const std::optional<Pose>& start) : c_(c) {
    if (start) at_ = start->stacked();
  }

  /// Why the next segment would be stopped; empty where it would not, or nobody knows.
  std::string next(const Segment& segment);

 private:
  const ControllerConfig& c_;
  std::optional<Vec6> at_;  // [m, rad] where the platform rests, where that is known
};
/// controller.moving_frame, with what it needs
void requireFrameFits(Section& root, const ControllerConfig& c, const RobotTask& task);

/// plant_mismatch
void readPlantMismatch(Section s, plant::PlantConfig& p);

}  // namespace ves
