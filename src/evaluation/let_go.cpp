// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/let_go.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

namespace ves {

LetGo::LetGo(const Experiment& experiment)
    : robot_moves_(!experiment.plant.task.robot_events.empty()),
      flies_(experiment.controller.moving_frame.enabled) {}

bool LetGo::holds(const state_t& state) const noexcept {
  return first_ && inAdmittance(state) && state.segment == first_->segment;
}

bool LetGo::add(const Row& row) {
  const state_t& s = row.state;
  if (!inAdmittance(s)) {
    seen_before_ = true;
    return false;
  }
  bool another = !begun();
  if (!begun()) {
    first_ = s;
    if (!seen_before_)
      why_not_ = "where it was let go is not in the log";
    else if (s.segment < 0 && robot_moves_)
      why_not_ = "it was ordered by hand, without the motions of the robot that its program has";
  }
  if (!holds(s)) return false;
  if (why_not_.empty() && !ofConfiguredVehicle(s)) why_not_ = "the vehicle was changed on the way";
  if (row.has_truth && addPush(row.truth)) {
    another = true;
    if (why_not_.empty() && flies_) why_not_ = "it was pushed in a laboratory that flies along";
  }
  return addFirings(s) || another;
}

bool LetGo::addPush(const truth_t& m) {
  if (m.pushes <= seen_) return false;
  seen_ = m.pushes;
  // One may last from before.
  const std::int64_t begun = m.push_began_ns - first_->machine_time_ns;
  const double before = static_cast<double>(std::max<std::int64_t>(0, -begun));
  const double rest = m.push_duration - before * kSecondPerNanosecond;
  if (!(rest > 0.0)) return false;
  pushes_.push_back({std::max<std::int64_t>(0, begun),
                     Push{static_cast<Push::On>(m.push_on), m.push_link, Vec3::Map(m.push_point),
                          Vec3::Map(m.push_force), rest}});
  return true;
}

bool LetGo::addFirings(const state_t& s) {
  constexpr double kSame = 1e-9;  // [s]
  bool another = false;
  for (std::size_t i = 0; i < last_.size(); ++i) {
    if (!(s.thrust_left[i] > 0.0)) continue;
    const double until = s.vehicle_time + s.thrust_left[i];
    if (last_[i] > 0 && firings_[last_[i] - 1].on.until > s.vehicle_time - kSame) {
      double& known = firings_[last_[i] - 1].on.until;  // it goes on, or another order came
      another = another || std::abs(until - known) > kSame;
      known = until;
    } else {
      firings_.push_back({static_cast<int>(i), {std::max(0.0, s.vehicle_time), until}});
      last_[i] = firings_.size();
      another = true;
    }
  }
  return another;
}

LetGo letGoOf(const Series& series) {
  LetGo out(series.experiment);
  for (const Row& row : series.rows) out.add(row);
  return out;
}

bool ofConfiguredVehicle(const state_t& s) noexcept {
  return s.vehicle_mass == 1.0 && s.vehicle_damping == 1.0 && s.vehicle_stiffness == 1.0;
}

std::shared_ptr<const std::optional<Motion>> ReferenceMotions::of(const Interaction& interaction,
                                                                  std::int64_t step,
                                                                  std::int64_t duration) {
  return known_.of({interaction, step, duration}, [&]() -> std::optional<Motion> {
    ++computed_;
    InteractionOptions options;
    options.model = InteractionModel::kWhole;
    options.step = step;
    options.duration = duration;
    try {
      return motion(simulate(interaction, options));
    } catch (const std::domain_error&) {
      return {};
    }
  });
}

namespace {

/// Pushes that were told take the place of the program's, but for those that are still to come.
void putPushes(const LetGo& let_go, std::int64_t period, std::vector<TimedAction>& actions) {
  const std::vector<TimedAction>& told = let_go.pushes();
  const std::int64_t last = told.empty() ? -1 : told.back().start + 2 * period;
  std::erase_if(actions, [&](const TimedAction& one) {
    return std::holds_alternative<Push>(one.action) && one.start <= last;
  });
  actions.insert(actions.end(), told.begin(), told.end());
  std::stable_sort(actions.begin(), actions.end(),
                   [](const TimedAction& a, const TimedAction& b) { return a.start < b.start; });
}

/// In the laboratory at a time [ns].
PathPoint<6> shownIn(const Laboratory& lab, std::int64_t time, const Vec6& x, const Vec6& x_dot) {
  const BodyMotion E_P = bodyMotion(Vec3::Zero(), Pose::from(x), x_dot, Vec6::Zero());
  return coordinates(relative(lab.at(time), E_P));
}

/// As far as the run went: a stop may have come before the segment's end.
Motion asFarAs(const Series& series, Motion motion) {
  std::int64_t first = -1, last = -1;
  eachTick(series, [&](const Row& row, double) {
    last = row.state.header.sequence;
    if (first < 0) first = last;
  });
  const auto gone = static_cast<std::size_t>(last - first) + 2;
  for (auto* list : {&motion.x, &motion.x_dot}) list->resize(std::min(list->size(), gone));
  motion.t.resize(std::min(motion.t.size(), gone));
  return motion;
}

/// A motion in E from the first tick on, as the laboratory that flew in the run would have shown
/// it.
Motion shown(const Series& series, Motion motion) {
  const std::int64_t period = series.experiment.controller.period;
  std::vector<const Row*> rows;
  eachTick(series, [&](const Row& row, double) { rows.push_back(&row); });
  if (rows.empty()) return motion;
  const std::int64_t first = rows.front()->state.header.sequence;
  std::size_t row = 0;
  for (std::size_t k = 0; k < motion.x.size(); ++k) {
    const std::int64_t tick = first + static_cast<std::int64_t>(k);
    while (row + 1 < rows.size() && rows[row + 1]->state.header.sequence <= tick) ++row;
    const state_t& s = rows[row]->state;
    const std::int64_t time = s.machine_time_ns + (tick - s.header.sequence) * period;
    const Vec6 x_dot = motion.x_dot.empty() ? Vec6(Vec6::Zero()) : motion.x_dot[k];
    const PathPoint<6> there = shownIn(laboratoryOf(s), time, motion.x[k], x_dot);
    motion.x[k] = there.x;
    if (!motion.x_dot.empty()) motion.x_dot[k] = there.x_dot;
  }
  return motion;
}

}  // namespace

std::optional<Motion> baseMotion(const Experiment& e, const LetGo& let_go,
                                 ReferenceMotions& references) {
  if (!wantsAdmittance(e.controller.program) || !let_go.begun() || !let_go.whyNotCompared().empty())
    return {};
  std::int64_t duration = 0;
  Interaction interaction = interactionOf(e, duration);
  interaction.start = let_go.start();
  interaction.firings = let_go.firings();
  putPushes(let_go, e.controller.period, interaction.actions);
  return *references.of(interaction, e.controller.period, duration);
}

std::optional<Emulation> emulation(const Series& series) {
  ReferenceMotions references;
  return emulation(series, references);
}

std::optional<Emulation> emulation(const Series& series, ReferenceMotions& references) {
  const LetGo let_go = letGoOf(series);
  Emulation out;
  out.platform = actual(series);
  if (out.platform.x.size() < 2) return {};
  auto base = baseMotion(series.experiment, let_go, references);
  if (!base) return {};
  base = asFarAs(series, *base);
  out.base = series.experiment.controller.moving_frame.enabled ? shown(series, *base) : *base;
  return out;
}

FollowedBase::FollowedBase(const Experiment& experiment)
    : experiment_(std::make_shared<const Experiment>(experiment)), let_go_(experiment) {}

void FollowedBase::add(const Row& row) {
  if (let_go_.add(row)) known_ = false;
  if (computing_.valid() &&
      computing_.wait_for(std::chrono::seconds(0)) == std::future_status::ready)
    base_ = computing_.get();
  if (!let_go_.whyNotCompared().empty()) {
    base_.reset();
  } else if (!known_ && !computing_.valid()) {
    known_ = true;
    computing_ = std::async(std::launch::async, [e = experiment_, told = let_go_] {
      ReferenceMotions references;
      return baseMotion(*e, told, references);
    });
  }
}

std::optional<Vec6> FollowedBase::at(const state_t& s) const {
  if (!base_ || !let_go_.holds(s)) return {};
  const auto x = base_->point(s.header.sequence - let_go_.tick());
  const Laboratory lab = laboratoryOf(s);
  if (!x || !lab.flies()) return x;
  return shownIn(lab, s.machine_time_ns, *x, Vec6::Zero()).x;
}

}  // namespace ves
