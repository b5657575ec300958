// SPDX-License-Identifier: BSD-3-Clause
//
// Stability of this machine's force feedback: the base, its sampling, and everything between a
// command and the reading that answers it.
//
//   eta --Phi--> command, held --LegSlave, valve, cylinder--> platform --M_1--> wrench
//    ^                                                                            |
//    +--- admittance model <--- delay, in ticks <--- sample, or mean <--- sensor filter <--+
//
// What the controller adds beyond the report (control/servo.hpp) is in it: the servo model and the
// robot as it believes them, which need not be what they are.
//
// Linear about home, one controller period a step: all modes, all six directions coupled through
// the robot's inertia at its pose, the LegSlaves' readings, average, update and derivative gain,
// the actuators K/(s(tau s + 1)), Filter 3 (the one on accelerations), the sensor's filter. Lifted
// exactly over a period that holds a whole number of LegSlave updates, which the real ones miss by
// up to half an update (100 Hz: ten for 9.775). All legs have one gain here, so the six directions
// of the platform pass through six equal channels; which gain is looked at is Direction's.
//
// A machine may give way: oil under the platform's mass. In coordinates of its modes, platform with
// robot on six springs that are the legs, each channel has its own frequency; here all six have
// one, which may be that of any mode.
//
// Left out: quantisation, limits, what a contact's force does to legs that give way, and gravity on
// a tilting robot, which the controller compensates.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "ves/control/test_platform.hpp"

namespace ves {

/// The robot leans on something along one direction: a spring and a damper that cannot part.
struct Leaning {
  // d: the wrench on the platform, about Po in I, is d times the force, and d^T x' how fast the
  // spring is relieved. A force through p along n has d = {n, p x n}, a moment about n {0, n}.
  Vec6 direction = Vec6::Zero();
  double stiffness = 0.0;     // [N/m], [N m/rad]
  double damping = 0.0;       // [N s/m], [N m s/rad]
  double inverse_mass = 0.0;  // [1/kg], [1/(kg m^2)] of what it leans on, along d; 0: fixed
};

struct Loop {
  ModalModel base;
  Vec3 gravity = Vec3::Zero();   // [m/s^2] that the base feels of the robot, in I
  RigidBody robot_P;             // what the sensor carries, joints locked
  double period = 0.0;           // [s] of the controller
  double velocity_gain = 0.0;    // [1/s] of the servo, speed per error of length
  double derivative_gain = 0.0;  // [1/s] the same for X(k) - X(k-4)
  double tau = 0.0;              // [s] of the actuator
  Resonance resonance;           // of what gives way behind it
  double filter_cutoff = 0.0;    // [rad/s] of Filter 3; 0: none
  double sensor_cutoff = 0.0;    // [rad/s]
  int readings = 1;              // [-] of the A/D converter, averaged over a period
  double late = 0.0;             // [s] by which a wrench is later than anybody knows
  Vec6 passes = Vec6::Ones();    // [-] of a new wrench that the low-pass lets through in a period
  double felt = 1.0;             // [-] of the wrench, that a dead band leaves
  int delay = 0;                 // [ticks] that a sample is older than it need be, and says so
  double allowed_growth = 0.0;   // [1/s] that decays() lets pass
  std::optional<Leaning> contact;
  /// Of the compensation, when it is on.
  struct Model {
    bool feed_forward = false, inertia = false;
    RigidBody robot_P;
    ServoModel servo;  // all legs alike, one gain for both directions, no rail
    // Of feed-forward for legs that turn round, by friction and overlap that are not there.
    double turning = 0.0;       // [-] of a way within which a leg turns,
    double turning_time = 1.0;  // [s] while it is new
    double lapped = 0.0;        // [s] of its speed

    Mat6 M_1() const { return servo.sensor_scale * spatialMass(robot_P); }
    double gain() const { return servo.extend(0); }  // [1/s]
    void setGain(double gain) {
      servo.extend.setConstant(gain);
      servo.retract.setConstant(gain);
    }
  } model;
};

/// What a belief may be wrong by, either way.
struct Uncertainty {
  double timing = 0.0;                  // [s] of the wrench
  double gain = 0.0;                    // [-] of the servos
  double heavier = 0.0, lighter = 0.0;  // [-] of the robot
};

/// The loop of a machine that is off in timing and gain, in directions of -1, 0 or 1.
Loop off(Loop loop, const Uncertainty& by, int timing, int gain);

/// The gain of a leg depends on which way it moves. A leg that swings has the harmonic mean, as
/// long as its speed is nearly a sine. Near null both edges of valves that are open there pass. A
/// leg that turns round is told more than goes that way, where friction or overlap is believed in:
/// the loop is judged as if neither were there. Legs that swing are a loop of their own where they
/// are quicker after a turn (Resonance::turning).
enum class Direction { kExtending, kRetracting, kSwinging, kNearNull, kTurning };
inline constexpr std::size_t kDirections = 5;
const char* name(Direction direction);

/// Those for which a loop is judged: both ways, and hardly moving where that is another loop.
std::vector<Direction> directionsOf(const ControllerConfig& controller);

/// The loop as the controller believes it: servos and sensor by its servo model, the robot by its
/// payload, the joints at q.
Loop loopOf(const ControllerConfig& controller, const JointVector& q, Direction direction);

/// A robot in P with its joints locked, and what the controller takes it for.
struct CarriedRobot {
  RigidBody robot_P, known_P;

  bool operator==(const CarriedRobot&) const = default;
};

/// The same loop with another robot.
Loop carrying(Loop loop, const CarriedRobot& robot);

/// The root of largest magnitude.
struct DominantRoot {
  double radius = 0.0;        // [-] a period; above 1 the emulation diverges
  double growth = 0.0;        // [1/s]
  double frequency = 0.0;     // [Hz]
  Vec6 shape = Vec6::Zero();  // [m, rad] of the commanded motion, largest entry 1
};
DominantRoot dominantRoot(const Loop& loop);

/// Without the shape, which costs more than the root.
double radius(const Loop& loop);

/// All of them, in no order.
Eigen::VectorXcd roots(const Loop& loop);

/// No root outside the unit circle, but for the growth that is allowed. A base that is free in a
/// direction drifts, and a robot on it may turn drift (below 0.01 Hz) into a growth that takes
/// minutes: that is let pass, up to 0.02/s.
bool decays(const Loop& loop);

/// The same, carrying each of these robots in turn; most of the work is done once for all of them.
bool decaysWithAll(const Loop& loop, const std::vector<CarriedRobot>& robots);

/// What a stable loop bears, the controller's belief unchanged: a factor on the robot's inertia,
/// one on the servos' gain, a wrench that is earlier or later than believed, and ticks of further
/// delay.
struct Margins {
  double gain = 0.0;               // [-] kMostGain: at least
  double servo_gain = 0.0;         // [-] the same
  double early = 0.0, late = 0.0;  // [s] kMostTime: at least
  int delay = 0;                   // [ticks] kMostDelay: at least
  static constexpr double kMostGain = 64.0;
  static constexpr double kMostTime = 0.005;
  static constexpr int kMostDelay = 50;
};
Margins margins(const Loop& loop);

/// How many of the base's modes can be kept: the largest k for which the loop with 1, 2, .. k modes
/// decays with the gain of either direction, the robot at q. 0 when even one diverges.
int stableModes(const ControllerConfig& controller, const JointVector& q);

/// The loop without its contact, under a force along contact->direction whose reading [N] a tick
/// takes: what an impact is integrated with, period by period.
struct PushedLoop {
  static constexpr int kSubsteps = 100;  // [-] of a period
  Eigen::MatrixXd step;                  // the next state, from {state, reading}
  Eigen::MatrixXd
      places;  // kSubsteps + 1 rows: [m] of the platform along the direction, from it too
  Eigen::MatrixXd energy;  // [J] of base and robot is state^T energy state
};
PushedLoop pushedLoop(const Loop& loop);

/// The base with a rigid body M_1 on it, which is a modal model again: the left-hand side of
/// (3.11).
ModalModel withBody(const ModalModel& base, const Mat6& M_1, const Mat6& K_1 = Mat6::Zero());

/// The softest k modes of a base.
ModalModel softest(const ModalModel& base, int k);

}  // namespace ves
