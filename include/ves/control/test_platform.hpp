// SPDX-License-Identifier: BSD-3-Clause
//
// testPlatform: the routines of Appendix C in their order, once every controller period.
//
//              start, arm          program, order
//   disarmed -------------> armed ---------------> running --------.
//       ^                   |   ^ <------ over ------'  |          |
//       | reset             |   `------- held ----------|          | a check fails
//       |              stop |                           | stop     |
//       |                   `-------> returning <-------'          |-- freezes -----------.
//       |                                 |                        |                      v
//       |                                 `--> parked              `--> stopping ----> stopped
//       `---------------------------------------------------------------------------------'
//
// Armed is holding still, ready for an order. A program that was started without an operator ends
// by returning to home and parking. A check that freezes holds the last checked lengths at once;
// the others brake along the motion first (stopping), and freeze should a freezing check fail
// meanwhile. A stop lasts until a reset, which is refused while its cause remains; what follows
// begins at the measured pose again.
//
// The invariant: every command that leaves is either the checked new lengths or the last checked
// ones, with the instant for which they are meant. docs/safety.md has all laws.
#pragma once

#include "ves/control/aided_wrench.hpp"
#include "ves/control/safety_monitor.hpp"
#include "ves/control/supervisor.hpp"

namespace ves {

class TestPlatform {
 public:
  explicit TestPlatform(const ControllerConfig& config);

  /// One period. Bounded, and free of heap, locks, clocks, logs and exceptions.
  const TickState& tick(const TickInput& in) noexcept;

 private:
  /// F_Po_I of one tick.
  struct Wrenches {
    Wrench total;          // measured
    Wrench static_wrench;  // of gravity
    Wrench inertial;       // of the robot's composite body, when that is compensated
    Emulated emulated;     // how the platform is, as they show it
    Wrench felt;           // total - static_wrench + inertial, less what is withheld as noise; as
                           // emulated: F_Po_E
    Wrench dynamic;        // that, behind dead band and low-pass
  };
  Wrench inE(const Emulated& emulated, const Wrench& F_Po_I) const noexcept;
  Waypoint<6> nextMotion(const Wrenches& W) noexcept;
  Checked safetyChecks(const Proposal& next, const Wrench& dynamic, bool conflict) const noexcept;
  void legCommunication(const Checked& next) noexcept;
  const TickState& report(const TickInput& in, const Wrenches& W) noexcept;

  ControllerConfig config_;
  double period_;          // [s]
  std::int64_t time_ = 0;  // [ns] of this tick, by the machine's clock
  TickClock clock_;
  SampleStream samples_;
  CompensationShare share_;
  LegEstimator legs_;
  KnownPayload known_;
  StaticLoad load_;
  SensorBias bias_;
  JointMomentum joints_;
  RobotInertia robot_;
  AidedWrench aided_;
  WrenchFilter filter_;
  MotionGenerator motion_;
  SafetyMonitor safety_;
  Supervisor supervisor_;
  LegCommander commander_;
  TickState state_;
};

}  // namespace ves
