// SPDX-License-Identifier: BSD-3-Clause
//
// SRMS-robot (report, chapter 3): a robot that moves on a flexible base, in free space, integrated
// without platform, sensor or sampling. What the VES should do, and what it is compared with.
//
// Two models of the same thing:
//   split   (3.11), the report's: the wrench of the moving robot on a fixed base, and the locked
//           robot's mass on the moving one. Small angles; of the base's rates only the centripetal
//           term is kept.
//   whole   Newton-Euler of the moving robot on the moving base, nothing left out. Phi_l eta' is
//           the base's angular velocity, and its attitude is integrated beside the modes.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "ves/contact/contact_watch.hpp"
#include "ves/control/admittance_model.hpp"
#include "ves/planning/moving_robot.hpp"
#include "ves/robot/payload.hpp"

namespace ves {

struct TimedAction {
  std::int64_t start = 0;  // [ns]
  RobotAction action;

  bool operator==(const TimedAction&) const = default;
};

/// The two that meet.
struct Interaction {
  ModalModel base;                       // at Po
  Payload payload;                       // what stands on it
  JointVector q0 = JointVector::Zero();  // [rad | m]
  std::vector<TimedAction> actions;      // of the robot, by time
  std::optional<World> world;            // what its tool touches
  Transform X_IH;                        // where P is in I when the base is at x = 0

  bool operator==(const Interaction&) const = default;
};

enum class InteractionModel { kSplit, kWhole };

struct InteractionOptions {
  InteractionModel model = InteractionModel::kSplit;
  double tolerance = 1e-9;         // [-] of a step, relative; and absolute, of 1 mm and 1 mrad
  std::int64_t step = 10'000'000;  // [ns] between points
  std::int64_t duration = 20'000'000'000;  // [ns]
  // Steps that A of (3.11) is kept for, the report's shortcut; 0: it follows the robot
  // continuously.
  int hold_mass = 0;
  Eigen::VectorXd eta, eta_dot;  // at the start; empty: rest
};

/// The base at one time.
struct InteractionPoint {
  double t = 0.0;             // [s]
  Vec6 x = Vec6::Zero();      // [m, rad] Phi eta (3.13a); of the whole model the attitude's angles
  Vec6 x_dot = Vec6::Zero();  // [m/s, rad/s] Phi eta'
  Eigen::VectorXd eta, eta_dot;
  Mat3 R_IP = Mat3::Identity();  // whole model only
  Touch touch;                   // where there is a world
  Floating target;
  ContactWatch contacts;  // up to now
};

/// GSL's Runge-Kutta Prince-Dormand (8, 9) with adaptive steps; where the tool begins or ceases to
/// touch something, a step ends to 1e-12 s. Throws std::domain_error when the
/// tolerance cannot be kept.
std::vector<InteractionPoint> simulate(const Interaction& interaction,
                                       const InteractionOptions& options);

/// A of (3.11): modal mass of the base with a robot on it that does not move its joints.
Eigen::MatrixXd augmentedModalMass(const ModalModel& base, const RigidBody& robot_P);

}  // namespace ves
