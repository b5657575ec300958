// SPDX-License-Identifier: BSD-3-Clause
#include "ves/analysis/gate.hpp"

#include <fmt/format.h>

#include <vector>

namespace ves {
namespace {

constexpr Direction kBoth[] = {Direction::kExtending, Direction::kRetracting};

/// Joint poses that the program passes through.
std::vector<JointVector> poses(const plant::PlantConfig& plant) {
  std::vector<JointVector> out = {plant.initial_joints};
  for (const plant::RobotEvent& event : plant.robot_events) {
    JointVector q = out.back();
    q(event.move.joint) = event.move.target;
    out.push_back(q);
  }
  return out;
}

/// True when `change`d loops of all poses and directions decay.
template <class Change>
bool holds(const ControllerConfig& controller, const plant::PlantConfig& plant,
           const Change& change) {
  for (const JointVector& q : poses(plant))
    for (const Direction direction : kBoth) {
      Loop loop = loopOf(controller, plant, q, direction);
      change(loop);
      if (!(radius(loop) < 1.0)) return false;
    }
  return true;
}

}  // namespace

Verdict judge(const ControllerConfig& controller, const plant::PlantConfig& plant, bool cures) {
  Verdict out;
  out.modes = static_cast<int>(controller.admittance.stiffness.size());
  Loop worst;
  double largest = 0.0;
  for (const JointVector& q : poses(plant))
    for (const Direction direction : kBoth) {
      const Loop loop = loopOf(controller, plant, q, direction);
      const double r = radius(loop);
      if (r <= largest) continue;
      largest = r;
      worst = loop;
      out.direction = direction;
    }
  // A base that is free in a direction has a root at one, and drifts as it should.
  constexpr double kOne = 1.0 + 1e-7;
  out.stable = largest <= kOne;
  out.stable_modes = out.modes;
  if (!cures) return out;
  out.worst = slowest(worst);
  if (out.stable) return out;

  out.stable_modes = 0;
  while (out.stable_modes < out.modes &&
         holds(controller, plant, [&](Loop& l) { l.base = softest(l.base, out.stable_modes + 1); }))
    ++out.stable_modes;
  for (double zeta = 0.02; zeta <= 1.0 && out.damping_ratio == 0.0; zeta *= 1.25)
    if (holds(controller, plant, [&](Loop& l) {
          const Eigen::VectorXd c =
              (2.0 * zeta * l.base.stiffness.cwiseSqrt()).cwiseMax(l.base.damping.diagonal());
          l.base.damping = c.asDiagonal();
        }))
      out.damping_ratio = zeta;
  for (const double share : {0.8, 0.6, 0.4, 0.25, 0.125})
    if (out.K_P == 0.0 && holds(controller, plant, [&](Loop& l) { l.velocity_gain *= share; }))
      out.K_P = share;
  return out;
}

std::string explain(const Verdict& v) {
  static constexpr const char* kCoordinate[] = {"x", "y", "z", "alpha", "beta", "gamma"};
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
      "the loop of base, robot and machine would diverge: {:.2f} Hz, most in {}, {:.2g}-fold a "
      "second "
      "(legs {}). What cures it: {}",
      v.worst.frequency, kCoordinate[i], std::exp(v.worst.growth),
      v.direction == Direction::kExtending ? "extending" : "retracting", cure);
}

std::string admit(ControllerConfig& controller, const plant::PlantConfig& plant) {
  if (judge(controller, plant, false).stable) return {};
  controller.admissible = controller.forced;
  return explain(judge(controller, plant));
}

}  // namespace ves
