// SPDX-License-Identifier: BSD-3-Clause
//
// Everything that testPlatform is told before it runs: geometry, payload, sensor, base, limits,
// program. A plain struct; config/experiment.hpp reads it from YAML.
#pragma once

#include "ves/contract/order.hpp"
#include "ves/control/force_measurement.hpp"
#include "ves/control/program.hpp"
#include "ves/control/safety_checks.hpp"
#include "ves/control/servo.hpp"
#include "ves/control/wrench_filter.hpp"
#include "ves/robot/payload.hpp"
#include "ves/vehicle/admittance_model.hpp"

namespace ves {

/// What goes beyond the report (docs/compensation.md); all off: as published.
struct Compensation {
  bool feed_forward = false;       // the servos' lag taken out of the reference
  bool observer = false;           // the servo model beside the servos: lengths below a count
  bool inertia = false;            // the robot's inertia taken out of the wrench, and into the base
  int mass_update = 1;             // [-] ticks for which the robot's composite body is kept
  double ramp = 0.5;               // [s] over which they come in, and go out
  double jitter = 0.0;             // [s] by which the time of a leg's reading may be wrong
  bool adaptation = false;         // the servos' gains and delay learnt while things run
  double adaptation_limit = 1.25;  // [-] times gain_error and timing_error, how far they may go
  double forgetting = 60.0;        // [s] of motion that counts for them, to 1/e
  bool aided = false;              // sensor noise kept out by the robot's model
  bool learns_masses = false;      // from what is kept out
  double hand_mass = 5.0;          // [kg] about what a gripper may hold that nobody told of,
  double hand_center = 0.1;        // [m] and how far from the tool's origin its centre may be
  double gate = 4.5;               // [-] deviations of the noise that a residual has to be above
  double gate_hold = 0.1;          // [s] for which it passes then
  double joint_jerk = 10.0;        // [rad/s^3 | m/s^3] of the robot's joints
  // What the belief may be wrong by, for which the loop has to decay (analysis/gate.hpp).
  double timing_error = 0.0;  // [s] of the wrench
  double gain_error = 0.0;    // [-] of the servos
  double mass_error = 0.0;    // [-] of the robot's bodies, mass and centre

  bool any() const noexcept { return feed_forward || observer; }
  /// [-] by which a body's mass and centre are learnt at most: twice, for a scale common to all
  /// bodies and for its own.
  double mostLearnt() const noexcept { return learns_masses ? 2.0 * mass_error : 0.0; }
  static constexpr double kLeastLearnt = 0.1;  // [-] of a body's mass
  static constexpr double kMostInHand = 3.0;   // [-] deviations of hand_mass and hand_center
};

/// How the laboratory flies along with the vehicle (control/moving_frame.hpp).
struct MovingFrameSettings {
  bool enabled = false;
  double share = 0.5;                           // [-] of the workspace that is used,
  double acceleration = 0.02;                   // [m/s^2] to keep to it, at most
  double angular_acceleration = 0.5 * kDegree;  // [rad/s^2]
  bool steady_in_contact = false;               // none while something is felt
};

/// What keeps the emulation from giving energy (control/energy_account.hpp).
struct Passivity {
  bool enabled = false;
  double reserve = 0.0;  // [J] that it may have given before anything is damped
  double damping = 0.0;  // [1/s] of every mode, at most
};

/// Mean decelerations of a braking motion.
struct Braking {
  double translation = 0.0;  // [m/s^2]
  double rotation = 0.0;     // [rad/s^2]
};

/// The speed of a motion whose duration is not given.
struct GentleMotion {
  double speed = 0.05;           // [m/s] peak
  double rotation = 0.10;        // [rad/s] peak
  Braking braking = {1.5, 2.5};  // of moves that begin in motion, and before the envelope
};

/// What the robot has in hand, as the controller is told at a time of the program.
struct ToldLoad {
  Cue cue;
  int link = -1;      // [-] that carries it; -1: link 0
  RigidBody body;     // in that link's frame; without mass: nothing
  bool known = true;  // what it is; else only that the gripper has closed or opened
};

inline constexpr int kMaxToldLoads = 16;

struct ToldLoads {
  int size = 0;
  std::array<ToldLoad, kMaxToldLoads> loads{};  // by segment and time
};

/// How well the robot's joint angles are known.
struct JointSensors {
  JointVector deviation = JointVector::Zero();  // [rad | m] of a reading: count, play and noise
  double interval = 0.0;                        // [s] between two readings; 0: read when asked
};

/// What gives way between the servos and where the platform is: the oil in the legs under its mass,
/// or structure. One mode.
struct Resonance {
  double frequency = 0.0;  // [rad/s] 0: nothing gives way
  double damping = 0.0;    // [-] ratio, without
  // pressure feedback: speed that a valve takes back per what has given way of late.
  double feedback = 0.0;        // [1/s]
  double feedback_time = 0.03;  // [s] of its high-pass
  // A leg that has just turned is quicker until its two chambers have the pressures of the other
  // direction (four-way valves).
  double turning = 1.0;       // [-] its speed, over the one that it comes to
  double turning_time = 0.1;  // [s] until it does; the gate tries several
};

/// What the controller takes the machine, its load and the vehicle for: from data sheets,
/// identifications and guesses. What judges or decides for it (stability, limits, plans) knows this
/// and nothing more; what the machine truly is, plant::PlantConfig says.
struct Belief {
  Geometry geometry;
  ForceSensor sensor;
  Vec6 bias = Vec6::Zero();          // [count] until a calibration replaces it
  Payload payload;                   // what the sensor carries,
  JointSensors joints;               // whose angles are known so well,
  Hand hand;                         // where the robot holds things,
  ToldLoads told_loads;              // and what it takes in hand
  Vec3 gravity = {0.0, 0.0, -9.81};  // [m/s^2] g_I
  VehicleModel vehicle;
  LegCodec legs;
  ServoModel servo;
  Resonance resonance;  // the lowest, with the least damping of any
};

/// A belief, and what is asked of the controller that holds it.
struct ControllerConfig : Belief {
  std::int64_t period = 10'000'000;  // [ns]
  Compensation compensation;
  Passivity passivity;
  MovingFrameSettings moving_frame;
  WrenchFilterSettings wrench_filter;
  SafetyLimits safety;
  Program program;
  RecordedPath path;                  // of its path segments
  GentleMotion gentle;                // of moves and the return
  Braking stop_braking = {5.0, 8.5};  // of a controlled stop
  int arming_samples = 10;            // [-] consecutive ticks with a new sample before arming
  StillnessLimits stillness;          // of a calibration
  double tare_ramp = 1.0;             // [s] over which a tare takes effect
  Stability stability = Stability::kUnknown;                // of admittance control as configured,
  Stability stability_uncompensated = Stability::kUnknown;  // and with the compensation out

  // [s] of one segment, for which that holds.
  double stable_for = HUGE_VAL, stable_for_uncompensated = HUGE_VAL;
  double most_growth = 1.0;  // [-] of a motion until its segment ends, that is let pass

  /// [s] the longest admittance segment of the program; 0: none.
  double longestAdmittance() const noexcept {
    double longest = 0.0;
    for (int i = 0; i < program.size; ++i) {
      const Segment& s = program.segments[static_cast<std::size_t>(i)];
      if (s.kind == SegmentKind::kAdmittance) longest = std::max(longest, s.duration);
    }
    return longest;
  }
  /// Of admittance control, its compensation in or out.
  Stability stabilityOf(bool compensated) const noexcept {
    return compensated ? stability : stability_uncompensated;
  }
  /// What the robot has in hand can be learnt.
  bool learnsHand() const noexcept { return compensation.learns_masses && hand.link >= -1; }
  double periodSeconds() const noexcept {  // [s]
    return static_cast<double>(period) * kSecondPerNanosecond;
  }
};

}  // namespace ves
