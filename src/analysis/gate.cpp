// SPDX-License-Identifier: BSD-3-Clause
#include "ves/analysis/gate.hpp"
#include "ves/base/coordinates.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace ves {
namespace {

constexpr Direction kBoth[] = {Direction::kExtending, Direction::kRetracting};

std::vector<RigidBody> programRobots(const ControllerConfig& controller,
                                     const plant::PlantConfig& plant) {
  std::vector<RigidBody> out;
  for (const JointVector& q : programPoses(controller.program, plant))
    out.push_back(lockedRobot(controller, q));
  return out;
}

/// True when the `change`d loop decays with every robot and in both directions.
template <class Change>
bool holds(const ControllerConfig& controller, const plant::PlantConfig& plant,
           const std::vector<RigidBody>& robots, const Change& change) {
  return std::all_of(std::begin(kBoth), std::end(kBoth), [&](Direction direction) {
    Loop loop = loopOf(controller, plant, plant.initial_joints, direction);
    change(loop);
    return decaysWithAll(loop, robots);
  });
}

}  // namespace

std::vector<JointVector> programPoses(const Program& program, const plant::PlantConfig& plant) {
  constexpr int kInstants = 12;  // [-] along each motion
  const auto felt = [&](int i) {
    return i < program.size &&
           program.segments[static_cast<std::size_t>(i)].kind == SegmentKind::kAdmittance;
  };
  std::vector<JointVector> out = {plant.initial_joints};
  JointVector at = plant.initial_joints;
  for (int i = 0; i < program.size; ++i) {
    if (felt(i) && at != out.back()) out.push_back(at);
    std::vector<plant::RobotEvent> events;
    std::set<std::int64_t> instants;  // [ns]
    for (const plant::RobotEvent& event : plant.robot_events) {
      if (event.cue.segment != i) continue;
      events.push_back(event);
      for (int k = 0; k <= kInstants; ++k)
        instants.insert(event.cue.after + std::llround(event.move.duration * 1e9 * k / kInstants));
    }
    std::stable_sort(events.begin(), events.end(),
                     [](const auto& a, const auto& b) { return a.cue.after < b.cue.after; });
    JointPaths paths(kMaxJoints, at);
    auto next = events.begin();
    for (const std::int64_t now : instants) {
      for (; next != events.end() && next->cue.after <= now; ++next)
        paths.move(next->move, next->cue.after);
      at = paths.at(now).q;
      if (felt(i) || felt(i + 1)) out.push_back(at);  // a motion may outlast its segment
    }
  }
  return out;
}

bool isStable(const ControllerConfig& controller, const plant::PlantConfig& plant) {
  return holds(controller, plant, programRobots(controller, plant), [](Loop&) {});
}

LoopVerdict assessStability(const ControllerConfig& controller, const plant::PlantConfig& plant) {
  LoopVerdict out;
  out.modes = static_cast<int>(controller.admittance.stiffness.size());
  out.stable_modes = out.modes;
  const std::vector<RigidBody> robots = programRobots(controller, plant);
  const auto cured = [&](const auto& change) { return holds(controller, plant, robots, change); };
  out.stable = cured([](Loop&) {});
  double largest = 0.0;
  for (const Direction direction : kBoth) {
    double most = 0.0;
    Loop& kept = direction == Direction::kExtending ? out.extending : out.retracting;
    const Loop loop = loopOf(controller, plant, plant.initial_joints, direction);
    for (const RigidBody& robot_P : robots) {
      const Loop with = carrying(loop, robot_P);
      const double r = radius(with);
      if (r <= most) continue;
      most = r;
      kept = with;
    }
    if (most <= largest) continue;
    largest = most;
    out.direction = direction;
  }
  out.worst = dominantRoot(out.direction == Direction::kExtending ? out.extending : out.retracting);
  if (out.stable) return out;
  out.stable_modes = 0;
  while (out.stable_modes < out.modes &&
         cured([&](Loop& l) { l.base = softest(l.base, out.stable_modes + 1); }))
    ++out.stable_modes;
  for (double zeta = 0.02; zeta <= 1.0 && out.damping_ratio == 0.0; zeta *= 1.25)
    if (cured([&](Loop& l) {
          const Eigen::VectorXd c = 2.0 * zeta * l.base.stiffness.cwiseSqrt();
          l.base.damping.diagonal() = c.cwiseMax(l.base.damping.diagonal());
        }))
      out.damping_ratio = zeta;
  for (const double share : {0.8, 0.6, 0.4, 0.25, 0.125})
    if (out.K_P == 0.0 && cured([&](Loop& l) { l.velocity_gain *= share; })) out.K_P = share;
  return out;
}

std::string explain(const LoopVerdict& v) {
  Eigen::Index i = 0;
  v.worst.shape.cwiseAbs().maxCoeff(&i);
  std::string cure;
  const auto add = [&](const std::string& one) { cure += (cure.empty() ? "" : "; or ") + one; };
  if (v.stable_modes > 0 && v.stable_modes < v.modes)
    add(fmt::format("keep {} of the {} modes", v.stable_modes, v.modes));
  if (v.damping_ratio > 0.0) add(fmt::format("a damping ratio of {:.2f}", v.damping_ratio));
  if (v.K_P > 0.0) add(fmt::format("{:.0f} percent of K_P", 100.0 * v.K_P));
  if (cure.empty()) cure = "a lighter robot or a heavier base";
  return fmt::format(
      "the loop of base, robot and machine would diverge: {:.2f} Hz, most in {}, doubling every "
      "{:.2g} s (legs {}). What cures it: {}",
      v.worst.frequency, coordinate(static_cast<int>(i)).name, std::log(2.0) / v.worst.growth,
      v.direction == Direction::kExtending ? "extending" : "retracting", cure);
}

std::string applyStabilityCheck(ControllerConfig& controller, const plant::PlantConfig& plant) {
  const auto verdict = [&](const ControllerConfig& c) {
    return isStable(c, plant) ? Stability::kStable : Stability::kUnstable;
  };
  const bool forced = controller.stability == Stability::kForced;
  const Stability as_is = verdict(controller);
  controller.stability_uncompensated = as_is;
  if (controller.compensation.any()) {
    ControllerConfig published = controller;
    published.compensation = {};
    controller.stability_uncompensated = verdict(published);
  }
  controller.stability = as_is;
  if (forced) controller.stability = controller.stability_uncompensated = Stability::kForced;
  return as_is == Stability::kStable ? "" : explain(assessStability(controller, plant));
}

}  // namespace ves
