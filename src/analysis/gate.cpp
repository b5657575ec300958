// SPDX-License-Identifier: BSD-3-Clause
#include "ves/analysis/gate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>

#include "ves/analysis/leaning.hpp"
#include "ves/core/coordinates.hpp"

namespace ves {
namespace {

std::vector<CarriedRobot> bodies(const std::vector<ProgramRobot>& robots) {
  std::vector<CarriedRobot> out;
  for (const ProgramRobot& one : robots) out.push_back(one.body);
  return out;
}

/// [-] of the wrench for which a loop is judged: behind a dead band anything from all to nothing.
std::vector<double> feltShares(const ControllerConfig& controller) {
  if (controller.wrench_filter.dead_band.isZero(0.0)) return {1.0};
  return {1.0, 0.8, 0.6, 0.4, 0.2};
}

/// [rad/s] of what gives way, for which a loop is judged: the lowest mode is known about, the
/// others are somewhere above it.
std::vector<double> resonances(const ControllerConfig& controller) {
  const double lowest = controller.resonance.frequency;
  if (lowest == 0.0) return {0.0};
  return {0.9 * lowest, 1.25 * lowest, 1.7 * lowest, 2.4 * lowest};
}

/// [s] that legs which turn stay quicker, for which a loop is judged: the smaller the swing, the
/// longer.
std::vector<double> turningTimes(const Loop& loop) {
  if (loop.resonance.turning == 1.0) return {loop.resonance.turning_time};
  return {0.01, 0.03, 0.1, 0.3, 1.0};
}

/// A controller's loops of one direction at `q`: every share of the wrench that a dead band leaves,
/// every resonance, every time that legs stay quicker.
std::vector<Loop> loopsOf(const ControllerConfig& controller, const JointVector& q,
                          Direction direction) {
  std::vector<Loop> out;
  Loop loop = loopOf(controller, q, direction);
  for (const double share : feltShares(controller))
    for (const double frequency : resonances(controller))
      for (const double time : turningTimes(loop)) {
        loop.felt = share;
        loop.resonance.frequency = frequency;
        loop.resonance.turning_time = time;
        out.push_back(loop);
      }
  return out;
}

/// True when the `change`d loops decay with every robot and in all directions.
template <class Change>
bool holds(const ControllerConfig& controller, const RobotTask& task, double growth,
           const std::vector<CarriedRobot>& robots, const Change& change) {
  const std::vector<Direction> directions = directionsOf(controller);
  return std::all_of(directions.begin(), directions.end(), [&](Direction direction) {
    const std::vector<Loop> loops = loopsOf(controller, task.initial_joints, direction);
    return std::all_of(loops.begin(), loops.end(), [&](Loop loop) {
      loop.allowed_growth = growth;
      change(loop);
      return decaysWithAll(loop, robots);
    });
  });
}

Uncertainty uncertaintyOf(const Compensation& c) {
  // What was learnt may be as far on the other side of the belief as it is allowed to go.
  const double servos = c.adaptation ? 1.0 + c.adaptation_limit : 1.0;
  const double learnt = std::min(c.mostLearnt(), 1.0 - Compensation::kLeastLearnt);
  return {servos * c.timing_error, servos * c.gain_error,
          (1.0 + c.mass_error) / (1.0 - learnt) - 1.0,
          1.0 - (1.0 - c.mass_error) / (1.0 + c.mostLearnt())};
}

/// Robots that are heavier (1) or lighter (-1) than is believed: all of their bodies, or by what is
/// in the hand, whose mass is beside it.
std::vector<ProgramRobot> mistaken(const std::vector<ProgramRobot>& robots, const Uncertainty& by,
                                   int mass) {
  const double times = mass > 0 ? 1.0 + by.heavier : 1.0 - by.lighter;
  std::vector<ProgramRobot> out;
  for (const ProgramRobot& one : robots) {
    out.push_back(one);
    out.back().in_hand = RigidBody();
    out.back().body.robot_P = scaledDensity(times, one.body.robot_P);
    if (!(one.in_hand.mass > 0.0)) continue;
    out.push_back(one);
    RigidBody& holds = mass > 0 ? out.back().body.robot_P : out.back().body.known_P;
    holds = combine(holds, {}, one.in_hand);
  }
  return out;
}

/// Of the eight corners of what the belief may be off by, one where the loop grows.
std::optional<std::array<int, 3>> cornerThatGrows(const ControllerConfig& controller,
                                                  const RobotTask& task, double growth,
                                                  const std::vector<ProgramRobot>& robots) {
  const Compensation& c = controller.compensation;
  if (!c.inertia) return {};
  const Uncertainty by = uncertaintyOf(c);
  const std::vector<CarriedRobot> heavy = bodies(mistaken(robots, by, 1));
  std::vector<CarriedRobot> both = bodies(mistaken(robots, by, -1));
  both.insert(both.end(), heavy.begin(), heavy.end());
  for (const int gain : {1, -1})
    for (const int timing : {1, -1}) {
      const auto change = [&](Loop& l) { l = off(l, by, timing, gain); };
      if (!holds(controller, task, growth, both, change))
        return std::array<int, 3>{timing, gain,
                                  holds(controller, task, growth, heavy, change) ? -1 : 1};
    }
  return {};
}

}  // namespace

double allowedGrowth(const ControllerConfig& controller) {
  const double longest = controller.longestAdmittance();
  return longest > 0.0 ? std::log(controller.most_growth) / longest : 0.0;
}

bool isStable(const ControllerConfig& controller, const RobotTask& task, double growth) {
  const std::vector<ProgramRobot> robots = programRobots(controller, task);
  return holds(controller, task, growth, bodies(robots), [](Loop&) {}) &&
         !cornerThatGrows(controller, task, growth, robots);
}

bool contactsDecay(const ControllerConfig& controller, const RobotTask& task) {
  if (controller.passivity.enabled) return true;
  const std::vector<ExpectedContact> contacts = expectedContacts(controller, task);
  const std::vector<Direction> directions = directionsOf(controller);
  return std::all_of(contacts.begin(), contacts.end(), [&](const ExpectedContact& contact) {
    return std::all_of(directions.begin(), directions.end(), [&](Direction direction) {
      return !growsLeaning(
          leaning(loopOf(controller, contact.q, direction), contact, contact.leaning.stiffness));
    });
  });
}

LoopVerdict assessStability(const ControllerConfig& controller, const RobotTask& task) {
  LoopVerdict out;
  out.modes = static_cast<int>(linearised(controller.vehicle).stiffness.size());
  out.stable_modes = out.modes;
  const std::vector<ProgramRobot> program = programRobots(controller, task);
  const std::vector<CarriedRobot> robots = bodies(program);
  const double growth = allowedGrowth(controller);
  const auto cured = [&](const auto& change) {
    return holds(controller, task, growth, robots, change);
  };
  out.longest = controller.longestAdmittance();
  out.as_believed = cured([](Loop&) {});
  out.stable = out.as_believed;
  if (out.as_believed)
    if (const auto corner = cornerThatGrows(controller, task, growth, program)) {
      out.stable = false;
      out.off = *corner;
      out.uncertainty = uncertaintyOf(controller.compensation);
      const auto& [timing, gain, mass] = out.off;
      for (const Direction direction : directionsOf(controller))
        for (const Loop& loop : loopsOf(controller, task.initial_joints, direction))
          for (const ProgramRobot& robot : mistaken(program, out.uncertainty, mass)) {
            const DominantRoot root =
                dominantRoot(off(carrying(loop, robot.body), out.uncertainty, timing, gain));
            if (root.radius <= out.at_off.radius) continue;
            out.at_off = root;
            out.hand = robot.in_hand.mass;
          }
    }
  double largest = 0.0;
  for (const Direction direction : directionsOf(controller)) {
    double most = 0.0;
    Loop& kept = out.loops[static_cast<std::size_t>(direction)];
    for (const Loop& loop : loopsOf(controller, task.initial_joints, direction)) {
      for (const CarriedRobot& robot : robots) {
        const Loop with = carrying(loop, robot);
        const double r = radius(with);
        if (r <= most) continue;
        most = r;
        kept = with;
      }
    }
    if (most <= largest) continue;
    largest = most;
    out.direction = direction;
  }
  out.worst = dominantRoot(out.at(out.direction));
  if (out.stable && growth > 0.0 && !isStable(controller, task)) out.stable_for = out.longest;
  if (out.as_believed) return out;
  out.plain_servos = cured([](Loop& l) { l.model.turning = l.model.lapped = 0.0; });
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
  if (controller.resonance.frequency > 0.0)
    for (const double cutoff : {1.0, 0.5, 0.25, 0.15})  // the gentlest cure
      for (const double feedback : {0.0, 50.0, 100.0, 200.0}) {
        if (out.sensor_cutoff > 0.0 || feedback + 1.0 < controller.resonance.feedback) continue;
        const double w = cutoff * controller.servo.sensor_cutoff;
        if (!cured([&](Loop& l) {
              l.sensor_cutoff = l.model.servo.sensor_cutoff = w;
              l.resonance.feedback = std::max(l.resonance.feedback, feedback);
            }))
          continue;
        out.sensor_cutoff = w;
        out.feedback = feedback;
      }
  return out;
}

/// "0.52 Hz, doubling every 3.1 s, 12 times as much after the 11 s of its segment".
std::string explain(const DominantRoot& root, double longest) {
  const std::string until =
      longest > 0.0 ? fmt::format(", {:.3g} times as much after the {:.4g} s of its segment",
                                  std::exp(root.growth * longest), longest)
                    : "";
  return fmt::format("{:.2f} Hz, doubling every {:.2g} s{}", root.frequency,
                     std::log(2.0) / root.growth, until);
}

std::string explain(const LoopVerdict& v) {
  if (v.as_believed) {
    const bool heavy = v.off[2] > 0, hand = v.hand > 0.0;
    const std::string robot =
        hand ? fmt::format("{:.3g} kg in the robot's hand that {}", v.hand,
                           heavy ? "nobody knows of" : "are believed and not there")
             : fmt::format("a robot {:.3g} % {}",
                           100.0 * (heavy ? v.uncertainty.heavier : v.uncertainty.lighter),
                           heavy ? "heavier" : "lighter");
    return fmt::format(
        "the loop of base, robot and machine would decay as believed, but diverge with a wrench "
        "{:.3g} ms {}, servos {:.3g} % {} and {}: {}. What cures it: better beliefs "
        "(timing_error_s, gain_error and {} of controller.compensation), a lighter robot or a "
        "heavier base",
        1e3 * v.uncertainty.timing, v.off[0] > 0 ? "later" : "earlier", 100.0 * v.uncertainty.gain,
        v.off[1] > 0 ? "quicker" : "slower", robot, explain(v.at_off, v.longest),
        hand ? "hand_mass_kg" : "mass_error");
  }
  Eigen::Index i = 0;
  v.worst.shape.cwiseAbs().maxCoeff(&i);
  std::string cure;
  const auto add = [&](const std::string& one) { cure += (cure.empty() ? "" : "; or ") + one; };
  if (v.stable_modes > 0 && v.stable_modes < v.modes)
    add(fmt::format("keep {} of the {} modes", v.stable_modes, v.modes));
  if (v.damping_ratio > 0.0) add(fmt::format("a damping ratio of {:.2f}", v.damping_ratio));
  if (v.plain_servos) add("no friction_m, and no opening_m below zero, in the servos' belief");
  if (v.K_P > 0.0) add(fmt::format("{:.0f} percent of K_P", 100.0 * v.K_P));
  if (v.sensor_cutoff > 0.0) {
    std::string one;
    if (v.sensor_cutoff < v.at(Direction::kExtending).sensor_cutoff)
      one = fmt::format("a sensor cutoff of {:.3g} Hz", v.sensor_cutoff / (2.0 * M_PI));
    if (v.feedback > 0.0)
      one +=
          fmt::format("{}pressure feedback of {:.0f}/s", one.empty() ? "" : " with ", v.feedback);
    add(one);
  }
  if (cure.empty())
    cure = v.worst.frequency > 0.0 ? "a lighter robot or a heavier base"
                                   : "a lighter or lower robot, or a stiffer base";
  const double gives = v.at(Direction::kExtending).resonance.frequency / (2.0 * M_PI);
  return fmt::format(
      "the loop of base, robot and machine{} would diverge: {}, most in {} (legs {}). What cures "
      "it: {}",
      gives > 0.0 ? fmt::format(", which gives way at {:.3g} Hz,", gives) : "",
      explain(v.worst, v.longest), coordinate(static_cast<int>(i)).name, name(v.direction), cure);
}

std::string applyStabilityCheck(ControllerConfig& controller, const RobotTask& task) {
  const auto assess = [&](const ControllerConfig& c, Stability& verdict, double& stable_for) {
    const bool decays = isStable(c, task);
    const double growth = allowedGrowth(c);
    const bool passes = decays || (growth > 0.0 && isStable(c, task, growth));
    verdict = passes && contactsDecay(c, task) ? Stability::kStable : Stability::kUnstable;
    stable_for = decays ? HUGE_VAL : c.longestAdmittance();
  };
  const bool forced = controller.stability == Stability::kForced;
  Stability as_is = Stability::kUnknown;
  assess(controller, as_is, controller.stable_for);
  controller.stability_uncompensated = as_is;
  controller.stable_for_uncompensated = controller.stable_for;
  if (controller.compensation.any()) {
    ControllerConfig published = controller;
    published.compensation = {};
    assess(published, controller.stability_uncompensated, controller.stable_for_uncompensated);
  }
  controller.stability = as_is;
  if (forced) controller.stability = controller.stability_uncompensated = Stability::kForced;
  if (as_is == Stability::kStable) return "";
  if (const LoopVerdict verdict = assessStability(controller, task); !verdict.stable)
    return explain(verdict);
  std::string why;
  for (const ContactVerdict& one : assessContacts(controller, task))
    if (one.grows) why += (why.empty() ? "" : "; ") + explain(one);
  return why;
}

namespace {

/// Shares of the straight way between two vehicles, the last one 1, so close together that no
/// factor changes by more than a fifth from one to the next.
std::set<double> placesBetween(const VehicleFactors& from, const VehicleFactors& to) {
  std::set<double> out = {1.0};
  const auto along = [&](double a, double b) {
    const int n = static_cast<int>(std::ceil(std::abs(std::log(b / a)) / std::log(1.2)));
    for (int i = 1; i < n; ++i)
      out.insert((a * std::pow(b / a, static_cast<double>(i) / n) - a) / (b - a));
  };
  along(from.mass, to.mass);
  along(from.damping, to.damping);
  along(from.stiffness, to.stiffness);
  return out;
}

}  // namespace

VehicleVerdict assessChange(const ControllerConfig& controller, const RobotTask& task,
                            const VehicleFactors& from, const VehicleFactors& to) {
  if (controller.stability == Stability::kForced) return {Stability::kForced, Stability::kForced};
  const std::set<double> places = placesBetween(from, to);
  const auto assess = [&](const Compensation& compensation) {
    const auto grows = [&](double share) {
      const auto between = [&](double a, double b) { return a + share * (b - a); };
      ControllerConfig changed = controller;
      changed.compensation = compensation;
      changed.vehicle.kind = scaled(linearised(controller.vehicle),
                                    {between(from.mass, to.mass), between(from.damping, to.damping),
                                     between(from.stiffness, to.stiffness)});
      return !isStable(changed, task) || !contactsDecay(changed, task);
    };
    // The end first: it is what is refused most often.
    return std::any_of(places.rbegin(), places.rend(), grows) ? Stability::kUnstable
                                                              : Stability::kStable;
  };
  const Stability published = assess({});
  return {controller.compensation.any() ? assess(controller.compensation) : published, published};
}

}  // namespace ves
