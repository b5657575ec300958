// SPDX-License-Identifier: BSD-3-Clause
//
// Contacts of many machines in lockstep, beside free space and beside what the loop model
// foretells.
//
//   contact_machines map [SET...]          a ball of 50 to 1000 kg on a spring of 10^2 to 10^6 N/m
//       against the PUMA on a base of 500 kg afloat, ten by ten
//   contact_machines limits [SET...]       the stiffness up to which the energy error is at most a
//       tenth, and the peak's a twentieth, as published and compensated
//   contact_machines random N [SEED [SET...]]   worlds, targets and motions by chance: how each run
//       ended, and whether the platform ever left what its limits allow
//
// SET is as for --set of ves run. Noise is off unless SET says otherwise.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "machines.hpp"
#include "support/rig.hpp"
#include "ves/analysis/gate.hpp"
#include "ves/analysis/leaning.hpp"
#include "ves/evaluation/contact_pairs.hpp"
#include "ves/math/dense.hpp"

namespace ves {
namespace {

using test::Dice;
using test::forEach;
using test::Sets;
using test::with;

const Sets kCompensated = {"controller.compensation.feed_forward=true",
                           "controller.compensation.observer=true",
                           "controller.compensation.inertia=true", "sensor.readings_per_tick=4"};

constexpr double kBase = 500.0;  // [kg] afloat in space, the robot on it besides
constexpr double kAnswer = 1.2;  // [s] after the contact

/// A ball that drifts along -x against the tool of the PUMA, 4 mm before it touches.
Experiment meetingAt(double speed, double time, double mass, double stiffness, const Sets& more) {
  return test::experiment(
      "puma_on_table_4_1",
      with(
          {"gravity_m_per_s2=0", "sensor.noise=false", "initial_pose={}",
           "base.damping_diagonal=[0, 0, 0, 0, 0, 0]", "base.stiffness_diagonal=[0, 0, 0, 0, 0, 0]",
           fmt::format("base.mass_diagonal=[{0}, {0}, {0}, 250, 250, 250]", kBase),
           fmt::format("program=[{{move: {{}}}}, {{calibration: {{}}}}, {{admittance: "
                       "{{duration_s: {:.2f}}}}}]",
                       time),
           fmt::format("environment={{tool: [{{radius_m: 0.02}}], contact: {{stiffness: {}}}, "
                       "target: {{mass_kg: {}, from_tool_m: [0.324, 0, 0], velocity_m_per_s: [{}, "
                       "0, 0], ball: {{radius_m: 0.3}}}}}}",
                       stiffness, mass, -speed)},
          more));
}

struct Meeting {
  Experiment e;
  Loop loop;
  double speed, approach;  // [m/s], [J]
};
/// As fast as leaves neither the workspace nor the sensor's range.
Meeting meeting(double mass, double stiffness, const Sets& more) {
  const auto loopOfIt = [](const Experiment& e) {
    const ExpectedContact contact = expectedContacts(e.controller, e.plant.task).at(0);
    return leaning(loopOf(e.controller, contact.q, Direction::kSwinging), contact,
                   contact.leaning.stiffness);
  };
  const double meets = meetingMass(loopOfIt(meetingAt(0.01, 2.0, mass, stiffness, more))),
               lasts = M_PI * std::sqrt(meets / stiffness);
  const double speed =
      std::min({0.08, 0.06 / (lasts + kAnswer), 80.0 / std::sqrt(stiffness * meets)});
  Meeting out;
  out.e = meetingAt(speed, 4e-3 / speed + 1.1 * lasts + kAnswer, mass, stiffness, more);
  out.loop = loopOfIt(out.e);
  out.speed = speed;
  out.approach = 0.5 * meets * speed * speed;
  return out;
}

/// Energy [J] of target, base and robot.
struct Books {
  const Experiment& e;
  Mat6 M_1;
  Eigen::MatrixXd inverse;

  explicit Books(const Experiment& experiment)
      : e(experiment),
        M_1(spatialMass(lockedRobot(e.controller.payload, e.plant.task.initial_joints))),
        inverse(leastSquares(linearised(e.controller.vehicle).Phi, Mat6::Identity())) {}
  double operator()(const Vec6& x, const Vec6& x_dot, const Floating& target) const {
    const ModalModel base = linearised(e.controller.vehicle);
    const Eigen::VectorXd eta = inverse * x, eta_dot = inverse * x_dot;
    const Target& body = *e.plant.task.world->environment.target;
    const Mat3 I = target.X_IB().R * body.I_Bcm_B * target.X_IB().R.transpose();
    return 0.5 * (eta_dot.squaredNorm() + eta.dot(base.stiffness.cwiseProduct(eta)) +
                  x_dot.dot(M_1 * x_dot) + body.mass * target.v.squaredNorm() +
                  target.w.dot(I * target.w));
  }
};

struct Outcome {
  bool measured = false;        // to the end of admittance control,
  Check cause = Check::kCount;  // or what stopped it
  double error = NAN;           // [-] energy beyond free space, by the energy of approach
  double left = NAN;            // [-] of it, were base and robot to stop once the ball has gone
  double account = NAN;         // [-] what the controller's own books say, by the same
  double restitution = NAN, due = NAN;
  double peak = NAN, peak_due = NAN;    // [N]
  double paid = 0.0;                    // [-]
  double foretold = NAN, growth = NAN;  // [-] energy error, [1/s] of the loop
};

Outcome measure(double mass, double stiffness, const Sets& more) {
  const Meeting met = meeting(mass, stiffness, more);
  const Experiment& e = met.e;
  Outcome out;
  out.foretold = impact(met.loop, met.speed).energy_error;
  out.growth = dominantRoot(met.loop).growth;
  const Books books(e);
  // Free space.
  std::int64_t duration = 0;
  const Interaction interaction = interactionOf(e, duration);
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.duration = duration;
  const std::vector<InteractionPoint> points = simulate(interaction, options);
  const Contact due = points.back().contacts.last();
  // In lockstep, to the end of admittance control.
  Lockstep machine(e.controller, e.plant);
  machine.step({Request::kStart, {}, {}});
  double begin = NAN;
  std::pair<double, Vec6> begun{0.0, Vec6::Zero()}, last = begun;  // [s], [m, rad]
  std::size_t at = 0;
  Floating target;
  Contact first;
  while (!test::done(machine.state())) {
    const TickState& s = machine.step();
    const plant::Truth& t = machine.plant().truth();
    if (s.kind != SegmentKind::kAdmittance || s.phase != Phase::kRunning) {
      if (begin >= 0.0) break;  // what it meets on its way home is not looked at
      continue;
    }
    if (t.contacts.count() == 1) first = t.contacts.last();
    const double now = static_cast<double>(t.time) * 1e-9;
    if (!(now >= begin)) begin = now;
    out.account = s.energy_put_in / met.approach;
    out.paid = s.energy_paid / met.approach;
    // By where it goes in the last fifth of a second, free on both sides: within a tick its speed
    // swings, as the command is held.
    const double since = now - begin, end = static_cast<double>(duration) * 1e-9;
    const auto k = static_cast<std::size_t>(std::lround(since / e.controller.periodSeconds()));
    if (since < end - 0.2 || k >= points.size()) continue;
    if (!(last.first > 0.0)) begun = {since, t.x.stacked()};
    last = {since, t.x.stacked()};
    at = k;
    target = t.target;
  }
  const double energy = books(last.second,
                              (last.second - begun.second) / (last.first - begun.first), target),
               due_energy = books(points[at].x, points[at].x_dot, points[at].target);
  out.measured = machine.state().cause == Check::kCount;
  out.cause = machine.state().cause;
  out.error = (energy - due_energy) / met.approach;
  out.left = (books(Vec6::Zero(), Vec6::Zero(), target) - due_energy) / met.approach;
  out.restitution = first.restitution();
  out.due = due.restitution();
  out.peak = first.peak;
  out.peak_due = due.peak;
  return out;
}

double between(double from, double to, int i, int of) {
  return from * std::pow(to / from, static_cast<double>(i) / (of - 1));
}

/// [N/m] up to which the loop model foretells an energy error of at most a tenth; kSoftest: never.
constexpr double kSoftest = 10.0;
double foretoldLimit(double mass, const Sets& more) {
  double low = kSoftest, high = 1e6;
  constexpr int kHalvings = 12;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = std::sqrt(low * high);
    const Meeting met = meeting(mass, middle, more);
    const bool bears = std::abs(impact(met.loop, met.speed).energy_error) <= kMostEnergyError;
    (bears ? low : high) = middle;
  }
  return low;
}

/// The softest on a grid of eight a decade with a peak off by more than 5 %, less one [N/m].
double peakLimit(double mass, const Sets& more) {
  constexpr int kPoints = 33;
  constexpr double kFrom = 30.0, kTo = 3e5, kMostPeakError = 0.05;
  std::vector<Outcome> all(kPoints);
  forEach(kPoints, [&](int i) {
    all[static_cast<std::size_t>(i)] = measure(mass, between(kFrom, kTo, i, kPoints), more);
  });
  double out = 0.0;
  for (int i = 0; i < kPoints; ++i) {
    const Outcome& o = all[static_cast<std::size_t>(i)];
    if (!(o.measured && std::abs(o.peak / o.peak_due - 1.0) <= kMostPeakError)) break;
    out = between(kFrom, kTo, i, kPoints);
  }
  return out;
}

int limits(const Sets& more) {
  fmt::print(
      "energy error within a tenth up to (foretold), the error and the peak measured there; peak "
      "within a twentieth up to\n{:>6} {:>12} {:>8} {:>8} {:>12} {:>12} {:>8} {:>8} {:>12} {:>8}\n",
      "kg", "publ. N/m", "error", "peak", "peak N/m", "comp. N/m", "error", "peak", "peak N/m",
      "ratio");
  for (const double mass : {50.0, 100.0, 200.0, 500.0, 1000.0}) {
    double up_to[2] = {};
    std::string line = fmt::format("{:>6}", mass);
    for (const bool compensated : {false, true}) {
      const Sets set = compensated ? with(kCompensated, more) : more;
      up_to[compensated] = foretoldLimit(mass, set);
      const Outcome o = measure(mass, up_to[compensated], set);
      line += fmt::format(" {:>12.3g} {:>+8.3f} {:>+8.3f} {:>12.3g}", up_to[compensated], o.error,
                          o.peak / o.peak_due - 1.0, peakLimit(mass, set));
    }
    fmt::print("{} {:>8.0f}{}\n", line, up_to[1] / up_to[0],
               up_to[0] > kSoftest ? "" : " or more: as published never");
  }
  return 0;
}

/// Runs by chance: bodies and targets near the tool, on the Shuttle's arm, compensated, the robot
/// led about.
int random(int n, unsigned seed, const Sets& more) {
  struct Ended {
    std::string how;
    int contacts = 0;
    double furthest = 0.0;  // [-] share of the stroke
    double fastest = 0.0;   // [m/s] of a leg
    bool outside = false;
  };
  std::vector<Ended> all(static_cast<std::size_t>(n));
  forEach(n, [&](int i) {
    Dice dice(seed + static_cast<unsigned>(i));
    const auto draw = [&](double a, double b) { return dice.between(a, b); };
    const auto place = [&](double r) {
      Vec3 v(draw(-1, 1), draw(-1, 1), draw(-1, 1));
      return Vec3(v.normalized() * r);
    };
    const Vec3 at = place(draw(0.33, 0.4)), wall = place(draw(0.03, 0.08));
    const Vec3 v = -at.normalized() * draw(0.005, 0.05);
    const Vec3 rpy(draw(-180, 180), draw(-90, 90), draw(-180, 180));
    Sets set = {
        "gravity_m_per_s2=0", fmt::format("seed={}", i),
        fmt::format("environment={{tool: [{{radius_m: 0.02}}], contact: {{stiffness: {}, exponent: "
                    "{}, damping_s_per_m: {}, friction: {}}}",
                    std::pow(10.0, draw(2, 5)), draw(1, 1.5), draw(0, 20), draw(0, 0.5))};
    if (draw(0, 1) < 0.6)
      set.back() += fmt::format(
          ", target: {{mass_kg: {}, from_tool_m: [{}, {}, {}], velocity_m_per_s: [{}, {}, {}], "
          "turning_deg_per_s: [{}, 0, {}], ball: {{radius_m: 0.3}}}}",
          std::pow(10.0, draw(1, 3)), at.x(), at.y(), at.z(), v.x(), v.y(), v.z(), draw(-5, 5),
          draw(-5, 5));
    else
      set.back() += fmt::format(
          ", bodies: [{{from_tool_m: [{}, {}, {}], rpy_deg: [{}, {}, {}], box: {{size_m: [0.02, "
          "0.02, 0.02]}}}}]",
          wall.x(), wall.y(), wall.z(), rpy.x(), rpy.y(), rpy.z());
    set.back() += "}";
    const bool compensated = draw(0, 1) < 0.7;
    if (compensated) set.insert(set.end(), kCompensated.begin(), kCompensated.end());
    const char* const kScenarios[] = {"srms_low_hover_puma", "puma_on_table_4_1"};
    set.push_back(fmt::format("robot.joints_deg_or_m=[0, -45, 180, 0, {}, 0]", draw(30, 60)));
    set.push_back(fmt::format(
        "program=[{{move: {{}}}}, {{calibration: {{}}}}, {{admittance: {{duration_s: 10}}, robot: "
        "[{{at_s: 1, joint: joint_{}, to_deg_or_m: {}, duration_s: {}}}]}}]",
        1, draw(-15, 15), draw(1, 6)));
    set.push_back("initial_pose={}");
    Ended& out = all[static_cast<std::size_t>(i)];
    try {
      const Experiment e = test::experiment(kScenarios[draw(0, 1) < 0.5], with(set, more));
      const SafetyLimits& limits = e.controller.safety;
      Lockstep machine(e.controller, e.plant);
      machine.step({Request::kStart, {}, {}});
      std::int64_t ticks = 0;
      while (!test::done(machine.state()) && ++ticks < 6000) {
        machine.step();
        const plant::Truth& t = machine.plant().truth();
        for (int leg = 0; leg < kLegs; ++leg) {
          const double middle = 0.5 * (limits.leg_max + limits.leg_min),
                       half = 0.5 * (limits.leg_max - limits.leg_min);
          out.furthest = std::max(out.furthest, std::abs(t.legs.L(leg) - middle) / half);
          out.fastest = std::max(out.fastest, std::abs(t.legs.L_dot(leg)));
          // Two millimetres for what a braking cylinder still goes.
          out.outside = out.outside || t.legs.L(leg) > limits.leg_max + 2e-3 ||
                        t.legs.L(leg) < limits.leg_min - 2e-3;
        }
        out.outside = out.outside || !t.legs_agree;
      }
      out.how = machine.state().phase == Phase::kParked ? "parked"
                                                        : std::string(name(machine.state().cause));
      out.contacts = machine.plant().truth().contacts.count();
    } catch (const InputError& error) {
      out.how = "refused by its configuration";
    }
  });
  std::map<std::string, int> how;
  int touched = 0, contacts = 0, outside = 0;
  double furthest = 0.0, fastest = 0.0;
  for (const Ended& one : all) {
    ++how[one.how];
    touched += one.contacts > 0;
    contacts += one.contacts;
    outside += one.outside;
    furthest = std::max(furthest, one.furthest);
    fastest = std::max(fastest, one.fastest);
  }
  fmt::print("{} runs, {} of them touched something, {} contacts\n", n, touched, contacts);
  for (const auto& [name, count] : how) fmt::print("  {:<32} {}\n", name, count);
  fmt::print("legs within {:.3f} of their allowed range, {:.3f} m/s at most; {} outside\n",
             furthest, fastest, outside);
  return outside == 0 ? 0 : 1;
}

int map(const Sets& more) {
  constexpr int kSide = 10;
  std::vector<Outcome> all(kSide * kSide);
  const auto massOf = [](int i) { return between(50.0, 1000.0, i / kSide, kSide); };
  const auto stiffnessOf = [](int i) { return between(1e2, 1e6, i % kSide, kSide); };
  forEach(kSide * kSide, [&](int i) {
    all[static_cast<std::size_t>(i)] = measure(massOf(i), stiffnessOf(i), more);
  });
  fmt::print("{:>8} {:>9} {:>8} {:>10} {:>10} {:>10} {:>10} {:>10} {:>9} {:>9} {:>9} {:>9} {:>9}\n",
             "kg", "N/m", "ended", "error", "in ball", "foretold", "account", "growth/s", "e",
             "e free", "peak N", "free N", "damped");
  // Whole counts of legs and sensor hide what is less: both run with the noise off.
  constexpr double kSeen = 0.02;  // [-]
  int looked = 0, wrong = 0;
  double least = HUGE_VAL, most = -HUGE_VAL, paid = 0.0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const Outcome& o = all[static_cast<std::size_t>(i)];
    fmt::print(
        "{:>8.1f} {:>9.3g} {:>8} {:>+10.4f} {:>+10.4f} {:>+10.4f} {:>+10.4f} {:>+10.4f} {:>9.4f} "
        "{:>9.4f} {:>9.2f} {:>9.2f} {:>9.3f}\n",
        massOf(i), stiffnessOf(i), o.measured ? "well" : name(o.cause), o.error, o.left, o.foretold,
        o.account, o.growth, o.restitution, o.due, o.peak, o.peak_due, o.paid);
    if (!o.measured) continue;
    ++looked;
    least = std::min(least, o.error);
    most = std::max(most, o.error);
    paid = std::max(paid, o.paid);
    wrong += (o.error > kSeen) != (o.foretold > kSeen);
  }
  fmt::print(
      "{} of {} run well; energy error {:+.3f} to {:+.3f}; growth by more than {} foretold wrongly "
      "in {}; "
      "up to {:.3f} damped away\n",
      looked, kSide * kSide, least, most, kSeen, wrong, paid);
  return 0;
}

}  // namespace
}  // namespace ves

int main(int argc, char** argv) {
  const std::vector<std::string> args(argv + 1, argv + argc);
  if (args.empty()) return 2;
  const auto number = [&](std::size_t i, int otherwise) {
    return i < args.size() && args[i].find('=') == std::string::npos ? std::stoi(args[i])
                                                                     : otherwise;
  };
  std::vector<std::string> set;
  for (const std::string& arg : args)
    if (arg.find('=') != std::string::npos) set.push_back(arg);
  if (args[0] == "map") return ves::map(set);
  if (args[0] == "limits") return ves::limits(set);
  if (args[0] == "random")
    return ves::random(number(1, 1000), static_cast<unsigned>(number(2, 1)), set);
  return 2;
}
