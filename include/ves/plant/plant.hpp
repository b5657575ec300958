// SPDX-License-Identifier: BSD-3-Clause
//
// Everything that was metal, on one event schedule:
//
//   every 341 us   six Temposonics readings into six LegSlaves
//   every 1023 us  new valve currents (a LegSlave's second reading)
//                  half a period later, in the middle of the constant current, one step of the
//                  mechanics: forward kinematics, Newton-Euler on the moving base, sensor
//                  (on hydraulic legs with something to touch: every 171 us)
//   when asked     a sample of that moment
//                  where the A/D converter averages, of its readings over the last controller
//                  period, in the middles of equal parts
//
// The periods are no multiples of each other. Between events ideal actuators are integrated
// exactly; hydraulic legs move the platform under the load as it was at the last step of the
// mechanics.
#pragma once

#include <optional>
#include <vector>

#include "ves/contact/contact_watch.hpp"
#include "ves/contract/leg_watchdog.hpp"
#include "ves/contract/sample.hpp"
#include "ves/control/program.hpp"
#include "ves/planning/robot_task.hpp"
#include "ves/plant/actuator.hpp"
#include "ves/plant/faults.hpp"
#include "ves/plant/force_torque_sensor.hpp"
#include "ves/plant/hydraulic_platform.hpp"
#include "ves/plant/joint_encoders.hpp"
#include "ves/plant/leg_slave.hpp"
#include "ves/robot/newton_euler.hpp"
#include "ves/robot/payload.hpp"

namespace ves::plant {

/// Where the report's Filters 1 to 3 sit (figure 2.15).
enum class LegFilters {
  kNone,
  kOutputs  // one each on the position, velocity and acceleration that forward kinematics reads
};

/// Between two looks at what touches; half of it changes no figure of a contact by 1 %.
inline constexpr double kContactStep = 50e-6;  // [s]

/// Temperature of the laboratory: mean + swing/2 sin(2 pi (t - rising)/period).
struct Climate {
  double mean = 20.0;                  // [C]
  double swing = 0.0;                  // [C] from coldest to warmest
  double period = 86400.0;             // [s]
  double rising = 0.0;                 // [s] when it passes the mean, rising
  double at(double t) const noexcept;  // [C]
};

struct PlantConfig {
  Geometry geometry;
  Pose initial_pose;  // about home
  LegSlaveGains leg_slave;
  ActuatorModel actuator;                   // of ideal legs,
  std::optional<HydraulicModel> hydraulic;  // or legs that feel their load
  Temposonics transducer;
  LegFilters filters = LegFilters::kNone;
  double filter_cutoff = 30.0;  // [rad/s] of Filters 1 to 3
  ForceTorqueSensorModel sensor;
  int sensor_readings = 1;         // [-] that a sample's wrench is the mean of,
  std::int64_t sensor_window = 0;  // [ns] and over which; 1: read when asked
  Climate climate;
  JointEncoderModel joints;
  bool gripper_switch = false;       // closed while the robot holds something
  Payload payload;                   // as it is
  Vec3 gravity = {0.0, 0.0, -9.81};  // [m/s^2] g_I
  RobotTask task;
  std::vector<FaultEvent> faults;
  Watchdog watchdog;
  std::uint32_t seed = 1;
};

/// What nobody but a simulation can know; the controller never reads it.
struct Truth {
  std::int64_t time = 0;  // [ns]
  BodyMotion P;           // platform; its accelerations are means since the last step
  Pose x;                 // about home
  Wrench F_Po_I;          // on the platform from all the sensor carries
  Wrench F_So_S;          // what the sensor reads, before it is rounded to counts
  JointState joints;
  Wrench contact_To_I;          // on the tool from what it touches, mean over the last step
  double clearance = HUGE_VAL;  // [m] of the tool from the nearest surface, least in it
  Floating target;              // the body that floats, in E
  ContactWatch contacts;
  std::optional<BegunPush> push;  // the last one
  int pushes = 0;                 // [-] so far
  LegMotion legs;                 // of the actuators, unfiltered
  Vec6 current = Vec6::Zero();    // [A] valves
  bool legs_agree = true;         // forward kinematics found a pose
  bool parking = false;           // the LegSlaves go home by themselves
};

class Plant {
 public:
  static constexpr std::int64_t kNever = INT64_MAX;
  static constexpr std::int64_t kSkipped = 10'000'000'000;  // [ns]

  explicit Plant(const PlantConfig& config);

  /// References of the LegSlaves, from now on. The cues of a segment count from the first command
  /// that names it.
  void command(const LegCommand& command) noexcept;

  /// Begins now; false where MovingRobot::begin() refuses, and where no target is within reach.
  bool moveRobot(const RobotAction& action) noexcept;

  /// Legs, or joints, that are elsewhere: the platform, or the robot, is where they say from the
  /// next step on, and no longer where the simulated ones are.
  void follow(const LegMotion& legs) noexcept { real_legs_ = legs; }
  void follow(const JointState& joints) noexcept { real_joints_ = joints; }

  /// Time passes, up to and including the events at `until` [ns]. Where nothing moves, more than
  /// kSkipped of it are passed over at once: the noise goes on from where it was.
  void advance(std::int64_t until) noexcept;

  /// What the controller gets to see, taken now.
  Sample sample() noexcept;

  /// As of the last step of the mechanics; now, right after sample().
  const Truth& truth() const noexcept { return truth_; }
  std::int64_t time() const noexcept { return now_; }  // [ns]
  /// The platform on legs that feel their load; null on ideal ones.
  const HydraulicPlatform* hydraulics() const noexcept {
    return hydraulic_ ? &*hydraulic_ : nullptr;
  }
  /// [-] events that the robot could not begin, as it was elsewhere or its hand not free.
  int refusedEvents() const noexcept { return refused_events_; }

 private:
  void runEvents(std::int64_t until) noexcept;
  bool still() const noexcept;
  void skip(std::int64_t until) noexcept;
  void moveActuators(std::int64_t to) noexcept;
  bool now(const Cue& cue, std::int64_t duration) const noexcept;
  double current(std::size_t leg) const noexcept;
  void wear() noexcept;
  void readTransducers() noexcept;
  void stepMechanics() noexcept;
  void readSensor() noexcept;
  void averageSensor(Sample& sample) const noexcept;
  void readJoints() noexcept;
  void fly(const Laboratory& laboratory) noexcept;
  void planRobotEvent() noexcept;
  void startRobotEvents() noexcept;
  Wrench sensorLoad() noexcept;
  BodyMotion emulated() const noexcept;
  FrameMotion toolMotion() const noexcept;
  bool push(const Push& push) noexcept;
  Wrench pushed(std::int64_t from) const noexcept;
  Mat3 laboratoryTurn() const noexcept;
  Wrench meetWorld(double dt) noexcept;
  PlatformLoad platformLoad(const Wrench& further_So_S) noexcept;
  double reading(std::size_t leg) noexcept;
  void movePlatform(double dt) noexcept;
  Wrench wrenchOnRobot(const ProperMotion& L0) noexcept;
  LegMotion legOutputs(double dt) noexcept;

  PlantConfig config_;
  Transform X_SL0_;
  std::vector<LegSlave> slaves_;
  std::vector<Actuator> actuators_;             // ideal legs
  double passed_ = 0.0, decay_ = 1.0;           // [s] last, [-] e^{-dt/tau} of it
  std::optional<HydraulicPlatform> hydraulic_;  // or the platform on those that feel it
  Vec6 magnets_;                                // [m] of their transducers
  LegWatchdog watchdog_;
  Laboratory laboratory_;  // the world is in E
  ForceTorqueSensor sensor_;
  Butterworth2<kLegs> filter_position_;
  Butterworth3<kLegs> filter_velocity_, filter_acceleration_;
  Noise transducer_noise_;
  ForceTorqueSensor::Step sensor_step_;  // for steps one update period apart
  Butterworth2<kLegs>::Step position_step_;
  Butterworth3<kLegs>::Step rate_step_;

  std::int64_t now_ = 0;                           // [ns] actuators are here
  std::int64_t last_step_ = 0;                     // [ns] mechanics and sensor are here
  std::int64_t next_reading_ = kTransducerPeriod;  // [ns]
  bool fine_;                                      // steps of half a Temposonics period
  std::int64_t next_step_ = 0;                     // [ns]
  std::int64_t sensor_interval_ = 0;               // [ns] between two readings that are averaged
  std::int64_t next_sensor_ = kNever;              // [ns]
  std::vector<AdcCounts> sensor_readings_;         // a ring, a reading longer than the window
  std::size_t read_ = 0;                           // [-] readings so far
  JointEncoders encoders_;
  std::int64_t next_joints_ = kNever;  // [ns]
  std::int64_t joints_time_ = 0;       // [ns] when joints_read_ was
  JointVector joints_read_;
  std::int64_t sequence_ = -1;
  std::int64_t segment_ = -1;                           // of the program, as last commanded
  bool outside_ = true;                                 // of it, by the last command
  std::int64_t segment_start_ = 0;                      // [ns]
  std::array<std::int64_t, kMaxSegments + 1> began_{};  // [ns] each segment; kNever: not yet
  std::int64_t next_robot_event_ = kNever;              // [ns]
  std::vector<Injector> injectors_;                     // one a fault
  std::vector<FaultEvent> valve_faults_;                // those that are not of samples,
  std::vector<FaultEvent> leg_faults_;                  // and of hydraulic legs,
  std::vector<bool> worn_;                              // of which these are there
  std::vector<bool> robot_event_done_;
  int refused_events_ = 0;
  MovingRobot robot_;  // all rigid plates counted into its base
  struct Standing {
    JointVector q;
    RigidBody body_L0;
  };
  std::optional<Standing> standing_;  // the robot while its joints stand
  JacobianFactors jacobian_;          // at the last step
  FrameMotion tool_;                  // at the last step, where there is a world
  std::optional<LegMotion> real_legs_;
  std::optional<JointState> real_joints_;
  Truth truth_;
};

}  // namespace ves::plant
