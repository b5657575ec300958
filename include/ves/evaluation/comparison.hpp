// SPDX-License-Identifier: BSD-3-Clause
//
// The platform's motion in an admittance segment beside SRMS-robot's (section 4.3).
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "ves/series/series.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {

/// Motion of the base's tip, one point a controller period from the segment's start on.
struct Motion {
  std::vector<double> t;       // [s]
  std::vector<Vec6> x, x_dot;  // [m, rad], [m/s, rad/s]
  // Of the base in free space, where there is something to touch:
  std::vector<double> on_tool;  // [N] of what it touches or grips
  std::vector<Floating> target;
  std::vector<Contact> contacts;

  /// x, `after` points after the first one; none outside the motion.
  std::optional<Vec6> point(std::int64_t after) const;
};

/// Admittance control runs in this tick.
bool inAdmittance(const state_t& state) noexcept;

/// Calls take(row, seconds since its first tick) in every tick of the first admittance segment.
void eachTick(const Series& series, const std::function<void(const Row&, double)>& take);

/// What the admittance model commanded, each state at the time it is for.
Motion commanded(const Series& series);

/// Where the platform truly was and when, without rates.
Motion actual(const Series& series);

Motion motion(const std::vector<InteractionPoint>& points);

/// Euclidean, of position and of the fixed angles.
struct Distance {
  double rms_position = 0.0, peak_position = 0.0;  // [m]
  double rms_attitude = 0.0, peak_attitude = 0.0;  // [rad]
};

/// Of two motions, at the times of the first that the second has too.
Distance distance(const Motion& a, const Motion& b);

/// Of a motion from where it began.
Distance travel(const Motion& motion);

/// What an emulation did, and what it is for.
struct Emulation {
  Motion base;      // the robot on its base in free space (SRMS-robot, nothing left out)
  Motion platform;  // in the first admittance segment
};

/// [m], [rad] how far a base goes from where it would rest.
struct Amplitude {
  double position = 0.0, attitude = 0.0;
};
Amplitude amplitude(const Experiment& experiment, const Motion& base);

/// "x_base_m" and the others: the base in free space, in the tick that each of its points is for.
std::vector<Column> columnsOf(const Series& series, const Emulation& emulation);

/// Where the base would be, from home [m, rad], by the tick that it is for.
using BasePoses = std::map<std::int64_t, Vec6>;
BasePoses basePoses(const Series& series, const Motion& base);
/// In the tick of a state.
std::optional<Vec6> at(const BasePoses& poses, const state_t& state);

/// A mode of base and robot together, the robot's joints locked.
struct CoupledMode {
  double frequency = 0.0;      // [Hz]
  double damping_ratio = 0.0;  // [-]
  Vec6 shape = Vec6::Zero();   // [m, rad] at the tip
  Eigen::RowVectorXd of_tip;   // its coordinate is of_tip * x
};

/// From A of (3.11) and the base's stiffness; damping to first order. At most six modes.
std::vector<CoupledMode> coupledModes(const Interaction& interaction);

struct RingDown {
  double frequency = 0.0;      // [Hz] undamped
  double damping_ratio = 0.0;  // [-]
};

/// Fits the decay of one mode that was let go at the start: straight lines through phase and log
/// amplitude, until a twentieth is left.
RingDown ringDown(const Motion& motion, const CoupledMode& mode);

}  // namespace ves
