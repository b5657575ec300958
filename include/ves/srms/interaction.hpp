// SPDX-License-Identifier: BSD-3-Clause
//
// SRMS-robot (report, chapter 3): a robot that moves on a flexible base, in free space, integrated
// without platform, sensor or sampling. What the VES should do, and what it is compared with.
//
// Two models of the same thing:
//   split   (3.11), the report's: the wrench of the moving robot on a fixed base, and the locked
//           robot's mass on the moving one. Small angles; of the base's rates only the centripetal
//           term is kept.
//   whole   Newton-Euler of the moving robot on the moving base, nothing left out. As in the
//           emulation, x = rest + Phi eta are position and fixed angles (2.19) however far the base
//           turns; the wrench does its work on the modes through the Jacobian of these angles, so
//           that energy is conserved. For small angles that is Phi^T F (C.4).
// A vehicle that floats freely has the second alone, by the momentum of it and the robot.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "ves/contact/contact_watch.hpp"
#include "ves/planning/moving_robot.hpp"
#include "ves/robot/payload.hpp"
#include "ves/vehicle/admittance_model.hpp"

namespace ves {

struct TimedAction {
  std::int64_t start = 0;  // [ns]
  RobotAction action;

  bool operator==(const TimedAction&) const = default;
};

/// The two that meet.
struct Interaction {
  VehicleModel vehicle;                  // at Po
  Payload payload;                       // what stands on it
  JointVector q0 = JointVector::Zero();  // [rad | m]
  std::vector<TimedAction> actions;      // of the robot, by time
  std::vector<OrderedFiring> firings;    // of a vehicle that floats, beside its schedule
  std::optional<World> world;            // what its tool touches
  Vec3 p_IH = Vec3::Zero();              // [m] where P is in I when the base is at x = 0
  Vec6 start =
      Vec6::Zero();  // [m, rad] x where it is let go; what modes do not express of it stays

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
  Eigen::VectorXd eta, eta_dot;  // of modes at the start, beside Interaction::start; empty: none
};

/// The base at one time.
struct InteractionPoint {
  double t = 0.0;                // [s]
  Vec6 x = Vec6::Zero();         // [m, rad] of modes rest + Phi eta (3.13a)
  Vec6 x_dot = Vec6::Zero();     // [m/s, rad/s] of modes Phi eta'
  Eigen::VectorXd eta, eta_dot;  // of modes
  Touch touch;                   // where there is a world
  Floating target;
  ContactWatch contacts;  // up to now
};

/// By Boost: Bulirsch and Stoer's extrapolation, interpolated at the points. Cash and Karp's
/// Runge-Kutta 5(4) takes its place where something is held from step to step, or the tool may
/// touch; where it begins or ceases to, a step ends to 1e-12 s. Throws std::domain_error when the
/// tolerance cannot be kept.
std::vector<InteractionPoint> simulate(const Interaction& interaction,
                                       const InteractionOptions& options);

/// A of (3.11): modal mass of the base with a robot on it that does not move its joints.
Eigen::MatrixXd augmentedModalMass(const ModalModel& base, const RigidBody& robot_P);

}  // namespace ves
