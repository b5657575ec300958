// SPDX-License-Identifier: BSD-3-Clause
//
// Where a run lets its vehicle go and what happens to it then, as the run tells it row by row; and
// what the robot on its base in free space does from there.
#pragma once

#include <atomic>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "ves/core/memo.hpp"
#include "ves/evaluation/comparison.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {

/// The first admittance segment of a run.
class LetGo {
 public:
  explicit LetGo(const Experiment& experiment);

  /// The next row, from before admittance control on. True when the base in free space does
  /// something else than was known before it.
  bool add(const Row& row);

  bool begun() const noexcept { return first_.has_value(); }
  /// The state is in that segment.
  bool holds(const state_t& state) const noexcept;
  /// What keeps the run from being compared with its base in free space; empty when nothing does.
  const std::string& whyNotCompared() const noexcept { return why_not_; }
  std::int64_t tick() const noexcept { return first_->header.sequence; }
  /// [m, rad] from home.
  Vec6 start() const { return Vec6::Map(first_->x_desired); }
  /// By their time since then: those that were told.
  const std::vector<TimedAction>& pushes() const noexcept { return pushes_; }
  /// Of the vehicle's thrusters, by orders.
  const std::vector<OrderedFiring>& firings() const noexcept { return firings_; }

 private:
  bool addPush(const truth_t& truth);
  bool addFirings(const state_t& state);

  bool robot_moves_, flies_;
  bool seen_before_ = false;  // a row without admittance control
  std::optional<state_t> first_;
  std::string why_not_;
  int seen_ = 0;  // [-] pushes
  std::vector<TimedAction> pushes_;
  std::vector<OrderedFiring> firings_;
  std::array<std::size_t, kMostThrusters> last_{};  // of each in firings_, from 1
};
LetGo letGoOf(const Series& series);

/// Whether the vehicle is the configuration's, which an order may have changed.
bool ofConfiguredVehicle(const state_t& state) noexcept;

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

/// The robot on its base in free space from there on, a point a tick, with the program's pushes
/// that are still to come. None without admittance control, where the run cannot be compared, and
/// where the motion grows without bound.
std::optional<Motion> baseMotion(const Experiment& experiment, const LetGo& let_go,
                                 ReferenceMotions& references);

/// Beside what the platform did. None of a run without two ticks of it.
std::optional<Emulation> emulation(const Series& series, ReferenceMotions& references);
std::optional<Emulation> emulation(const Series& series);

/// The same beside a run that goes on. A motion takes a while to compute, beside what calls: until
/// it is there the one before stands.
class FollowedBase {
 public:
  explicit FollowedBase(const Experiment& experiment);
  void add(const Row& row);
  /// [m, rad] from home, as it is shown in the laboratory at a state of the segment.
  std::optional<Vec6> at(const state_t& state) const;

 private:
  std::shared_ptr<const Experiment> experiment_;
  LetGo let_go_;
  bool known_ = true;
  std::future<std::optional<Motion>> computing_;
  std::optional<Motion> base_;
};

}  // namespace ves
