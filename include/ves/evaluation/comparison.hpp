// SPDX-License-Identifier: BSD-3-Clause
//
// The platform's motion in an admittance segment beside SRMS-robot's (section 4.3).
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "ves/core/memo.hpp"
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

/// Where a platform that is emulated to be at x in E at the state's tick is shown; without a
/// laboratory that flies at x.
Vec6 shownAt(const state_t& state, const Vec6& x) noexcept;

/// The base's motions that were needed last, for several threads. Runs that differ in noise, gains
/// or filters share one: it depends on nothing but what is compared here.
class ReferenceMotions {
 public:
  /// SRMS-robot with nothing left out. None where the motion grows without bound.
  std::shared_ptr<const std::optional<Motion>> of(const Interaction& interaction, std::int64_t step,
                                                  std::int64_t duration);
  int computed() const { return computed_; }  // [-]

 private:
  static constexpr std::size_t kKept = 32;
  struct Asked {
    Interaction interaction;
    std::int64_t step, duration;  // [ns]

    bool operator==(const Asked&) const = default;
  };
  Memo<Asked, std::optional<Motion>, kKept> known_;
  std::atomic<int> computed_ = 0;
};

/// The robot on its base in free space, in the first admittance segment of the program, let go at
/// `start` from home: a point a tick. None without admittance control, and where the motion grows
/// without bound. `pushes` that there were take the place of the program's; `firings` are those by
/// orders.
std::optional<Motion> baseMotion(const Experiment& experiment, const Vec6& start,
                                 ReferenceMotions& references,
                                 const std::vector<TimedAction>* pushes = nullptr,
                                 const std::vector<OrderedFiring>& firings = {});

/// Pushes on the machine in the first admittance segment, the program's and others, since it began.
class ToldPushes {
 public:
  /// The next row; true when it tells of another push.
  bool add(const Row& row);
  const std::vector<TimedAction>& list() const { return list_; }

 private:
  std::optional<std::int64_t> start_;  // [ns] by the machine's clock
  int seen_ = 0;
  std::vector<TimedAction> list_;
};
std::vector<TimedAction> pushesOf(const Series& series);

/// What the vehicle's thrusters were ordered to fire in the first admittance segment, since it was
/// let go.
std::vector<OrderedFiring> firingsOf(const Series& series);
/// Whether an order has a thruster on.
bool firesByOrder(const state_t& state) noexcept;

/// Whether the vehicle is the configuration's, which an order may have changed.
bool ofConfiguredVehicle(const state_t& state) noexcept;

/// What keeps a run with admittance control from being compared with its base in free space; empty
/// when nothing does, or there was none.
std::string whyNotCompared(const Series& series);

/// The same from where the platform was let go, beside what it did. None of a run without two ticks
/// of it, or with another vehicle for a while.
std::optional<Emulation> emulation(const Series& series, ReferenceMotions& references);
std::optional<Emulation> emulation(const Series& series);

/// [m], [rad] how far a base goes from where it would rest.
struct Amplitude {
  double position = 0.0, attitude = 0.0;
};
Amplitude amplitude(const Experiment& experiment, const Motion& base);

/// "x_base_m" and the others: the base in free space, in the tick that each of its points is for.
std::vector<Column> columnsOf(const Series& series, const Emulation& emulation);

/// Where the base would be, from home [m, rad], by the tick that it is for.
std::map<std::int64_t, Vec6> basePoses(const Series& series, const Motion& base);

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
