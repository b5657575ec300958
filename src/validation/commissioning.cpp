// SPDX-License-Identifier: BSD-3-Clause
#include "ves/validation/commissioning.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "ves/core/coordinates.hpp"
#include "ves/core/errors.hpp"
#include "ves/evaluation/summary.hpp"
#include "ves/identification/scenario.hpp"

namespace ves {
namespace {

/// Sines of all legs together, about home.
struct Shake {
  double share;      // [-] of the legs' range
  double frequency;  // [Hz]
};
constexpr Shake kShakes[] = {{0.024, 1.5}, {0.008, 4.0}, {0.004, 8.0}};
constexpr double kShaking = 2.0;  // [s] each
constexpr int kFirstShake = 2;    // [-] of the program's segments; home and calibration go before
constexpr int kShakeCount = static_cast<int>(std::size(kShakes));

/// [m]
double amplitudeOf(const Shake& shake, const SafetyLimits& limits, double acceleration) {
  constexpr double kSpeed = 0.5;  // [-] of the legs' limit
  const double w = 2.0 * M_PI * shake.frequency;
  return std::min({shake.share * (limits.leg_max - limits.leg_min),
                   kSpeed * limits.leg_velocity / w, sineRoom(acceleration, w)});
}

/// [s] of a move of all joints at once, and of the platform home.
double moveTime(const Experiment& e, const JointVector& from, const JointVector& to, double speed) {
  constexpr double kHome = 2.0;
  double time = kHome;
  for (int i = 0; i < e.controller.payload.robot.joints; ++i) {
    const double unit = jointUnit(e.controller.payload.robot.jointLink(i).type);
    time = std::max(time, std::abs(to(i) - from(i)) / (unit * speed));
  }
  return time;
}

Value without(Value document, std::initializer_list<const char*> keys) {
  for (const char* key : keys) document.erase(key);
  return document;
}

/// The shakes and the first slow moves after them.
Series movesIn(const Series& series) {
  constexpr double kLongest = 20.0;  // [s]
  Series out;
  out.experiment = series.experiment;
  for (const Row& row : series.rows)
    if (row.state.segment >= kFirstShake &&
        (out.rows.empty() || row.t - out.rows.front().t < kLongest))
      out.rows.push_back(row);
  return out;
}

/// The shakes alone, with the masses and the bias that have been found.
Series shakesIn(const Series& series, const Commissioned& found) {
  Series out;
  out.experiment = series.experiment;
  if (found.masses)
    out.experiment.controller.payload =
        withMasses(out.experiment.controller.payload, found.masses->record);
  for (const Row& row : series.rows) {
    if (row.state.segment < kFirstShake || row.state.segment >= kFirstShake + kShakeCount) continue;
    out.rows.push_back(row);
    if (found.calibration) Vec6::Map(out.rows.back().state.bias) = found.calibration->bias;
  }
  return out;
}

bool hasJoints(const Experiment& e) { return !e.robot.joint_names.empty(); }

}  // namespace

Commissioning commissioningOf(const Experiment& scenario, const CommissioningOptions& options) {
  Commissioning out;
  // What is there to be found is not believed; what stands about in the workspace is taken away.
  Value document =
      without(scenario.source.document, {"calibration", "masses", "servo", "environment"});
  document.put("program", parseDocument("program:\n  - move: {}\n", "commission").children.front());
  const Experiment bare = buildExperiment(document);
  const ControllerConfig& c = bare.controller;
  const JointVector start = bare.plant.task.initial_joints;
  const double speed = options.poses.speed;
  JointVector stand = start;  // where the sensor bears most beside the robot's weight
  double bears = accelerationRoom(c, start, 2);
  const auto beside = [&] {  // [s] arming, home, calibration, shakes, home, and moves between
    constexpr double kEnds = 5.0;
    double time = kEnds + kShaking * kShakeCount + moveTime(bare, start, stand, speed);
    if (out.plan)
      time += moveTime(bare, stand, start, speed) +
              moveTime(bare, out.plan->attitudes.back().q.back(), start, speed);
    return time;
  };
  if (!hasJoints(bare)) {
    out.no_plan = "the robot has no joints";
  } else if (!(c.gravity.norm() > 0.0)) {
    out.no_plan = "there is no weight to feel (gravity_m_per_s2: 0)";
  } else {
    try {
      const StaticSetup setup = staticSetup(c);
      const SeparableCombinations combinations = separableCombinations(setup.robot);
      PosePlanOptions poses = options.poses;
      poses.most_seconds = options.seconds - beside();
      constexpr int kPasses = 3;  // the moves between are known with the plan
      for (int pass = 0; pass < kPasses; ++pass) {
        poses.most_seconds = std::max(1.0, poses.most_seconds);
        out.plan = planFewestPoses(setup, combinations, c, start, poses, options.accuracy);
        stand = start;
        bears = accelerationRoom(c, start, 2);
        for (const PosePlan::Attitude& a : out.plan->attitudes)
          for (const JointVector& q : a.q)
            if (const double one = accelerationRoom(c, q, 2); one > bears) {
              bears = one;
              stand = q;
            }
        const double over = out.plan->seconds + beside() - options.seconds;
        if (over <= 0.0) break;
        poses.most_seconds = out.plan->seconds - over;
      }
    } catch (const std::domain_error& why) {
      out.no_plan = why.what();
    }
  }
  if (!(bears > 0.0))
    throw InputError(fmt::format(
        "{}: the weight alone takes too much of the sensor's range, want a smaller sensor.gain",
        scenario.name));
  out.seconds = beside() + (out.plan ? out.plan->seconds : 0.0);

  const auto move = [&](const JointVector& from, const JointVector& to) {
    const double time = moveTime(bare, from, to, speed);
    return fmt::format("  - move: {{duration_s: {:.2f}}}\n", time) +
           robotMoves(bare, {{0.0, time, to}});
  };
  std::string program = "program:\n" + move(start, stand) + "  - calibration: {}\n";
  for (const Shake& shake : kShakes)
    program += fmt::format(
        "  - trajectory: {{duration_s: {}, z: {{sine: {{amplitude_m: {:.6f}, frequency_hz: "
        "{}}}}}}}\n",
        kShaking, amplitudeOf(shake, c.safety, bears), shake.frequency);
  if (out.plan) {
    program += move(stand, start) + programOf(*out.plan, bare);
    program += move(out.plan->attitudes.back().q.back(), start);
  }
  document.put("program", parseDocument(program, "commission").children.front());
  Value name = *document.find("name"), about = name;
  name.text = ("commission_" + scenario.name).substr(0, 100);  // no longer name is taken
  about.text = "Finds out what the machine of " + scenario.name + " is.";
  document.put("name", name);
  document.put("description", about);
  out.experiment = buildExperiment(std::move(document));
  return out;
}

Commissioned commissioned(const Series& series, const Commissioning& commissioning) {
  constexpr double kFullScale = 32768.0;  // [count]
  Commissioned out;
  const ControllerConfig& c = series.experiment.controller;
  Vec6 most = Vec6::Zero(), shortest = Vec6::Constant(HUGE_VAL), longest = -shortest;
  for (const Row& row : series.rows) {
    if (!row.has_sample) continue;
    const auto sample = fromMessage(row.sample);
    if (!sample) continue;
    const Vec6 L = legLengths(c.legs, sample->legs);
    shortest = shortest.cwiseMin(L);
    longest = longest.cwiseMax(L);
    for (int i = 0; i < kWrenchChannels; ++i)
      most(i) = std::max(most(i), std::abs(static_cast<double>(row.sample.adc[i])));
    if (row.state.calibration == static_cast<int>(CalibrationStatus::kDone) && !out.calibration)
      out.calibration = calibrationOf(row.state, commissioning.experiment.source.calibrated(),
                                      row.sample.temperature);
  }
  for (int i = 0; i < 6; ++i)
    out.ranges.push_back(
        {fmt::format("channel {}", wrenchComponent(i).name), most(i) / kFullScale});
  const double middle = 0.5 * (c.safety.leg_max + c.safety.leg_min),
               half = 0.5 * (c.safety.leg_max - c.safety.leg_min);
  for (int i = 0; i < kLegs; ++i)
    out.ranges.push_back(
        {fmt::format("leg {}", i + 1), std::max(longest(i) - middle, middle - shortest(i)) / half});
  if (commissioning.plan) {
    try {
      out.masses = identifiedMasses(series);
      // Apart from the weight, which a calibration takes as told.
      const MassEstimate& m = out.masses->estimate;
      if (out.calibration) {
        out.calibration->bias = m.bias;
        out.calibration->standard_error =
            m.residual / std::sqrt(static_cast<double>(out.masses->rests.size()));
      }
    } catch (const std::domain_error& why) {
      out.no_masses = why.what();
    }
  } else {
    out.no_masses = commissioning.no_plan;
  }
  try {
    // Slow moves tell how far valves are open at null, and how seals rub; else fast ones the gains.
    const ServoEstimate legs = identifiedLegs(movesIn(series));
    out.servo = identifiedServo(shakesIn(series, out),
                                legs.plain() ? std::optional<ServoEstimate>() : legs);
  } catch (const std::domain_error& why) {
    out.no_servo = why.what();
  }
  return out;
}

std::string beliefOf(const Commissioned& found, const Experiment& scenario,
                     const std::string& comment) {
  std::string text;
  const auto lines = [&](const std::string& begin, const std::string& of) {
    std::istringstream in(of);
    for (std::string line; std::getline(in, line);) text += begin + line + "\n";
  };
  lines("# ", comment);
  const auto section = [&](const char* name, const std::string& yaml) {
    text += fmt::format("{}:\n", name);
    lines("  ", yaml);
  };
  Value document = without(scenario.source.document, {"calibration", "masses", "servo"});
  if (found.masses) section("masses", write(found.masses->record, ""));
  if (found.servo) section("servo", write(found.servo->record));
  if (!found.calibration) return text;
  if (found.masses) document.put("masses", *parseDocument(text, "belief").find("masses"));
  CalibrationRecord calibration = *found.calibration;
  calibration.setup = buildExperiment(std::move(document)).source.calibrated();
  section("calibration", write(calibration));
  return text;
}

std::optional<ErrorForecast> forecastError(const Experiment& scenario, const Experiment& believing,
                                           const Commissioned& found) {
  // The machine as it was found, but for the links' own inertia.
  struct Machine {
    Payload payload;
    double extend, retract, tau;  // [-] times those of the data sheet
  };
  const ServoModel &told = scenario.controller.servo, &believed_servo = believing.controller.servo;
  const auto ratio = [&](Vec6 ServoModel::*value) {
    return (believed_servo.*value).mean() / (told.*value).mean();
  };
  const Machine machine{believing.controller.payload, ratio(&ServoModel::extend),
                        ratio(&ServoModel::retract), ratio(&ServoModel::tau)};
  const auto errorOn = [](const Machine& m,
                          const Experiment& with) -> std::optional<EmulationError> {
    Experiment e = buildExperiment(
        without(with.source.document, {"plant_mismatch", "reality"}),
        {fmt::format("plant_mismatch={{gain_extend: {}, gain_retract: {}, tau: {}}}", m.extend,
                     m.retract, m.tau),
         "machine.legs=simulated", "machine.force_sensor=simulated", "machine.robot=simulated",
         "machine.switches=simulated",
         "controller.stability=forced"});  // whether it may is said beside it
    e.plant.payload = m.payload;
    if (!e.plant.hydraulic) {  // ideal valves just close, and nothing rubs
      e.controller.servo.opening.setZero();
      e.controller.servo.friction.setZero();
    }
    const RecordedRun run = recordLockstep(e);
    const auto summary = summarise(run.series, run.result);
    if (!summary.contains("emulation_error_position_share")) return {};
    return EmulationError{summary["emulation_error_position_share"],
                          summary.value("emulation_error_attitude_share", 0.0),
                          run.result.good() ? "" : std::string(name(run.result.cause))};
  };
  const auto as_told = errorOn(machine, scenario), believed = errorOn(machine, believing);
  if (!as_told || !believed) return {};
  ErrorForecast out{*as_told, *believed, *believed, {}};
  const Compensation& allows = believing.controller.compensation;
  // Weight tells masses and centres, and nothing of the links' own inertia.
  constexpr double kDeviations = 3.0;  // [-] as massErrorOf()
  const double told_error = scenario.controller.compensation.mass_error,
               mass = found.masses ? kDeviations * found.masses->record.deviation : told_error;
  Machine heavy = machine, longer = machine, wider = machine, quick = machine, late = machine;
  const auto change = [](Machine& m, const auto& one) {
    one(m.payload.robot.base);
    for (int i = 0; i < m.payload.robot.size; ++i)
      one(m.payload.robot.links[static_cast<std::size_t>(i)].body);
  };
  change(heavy, [&](RigidBody& body) { body = scaledDensity(1.0 + mass, body); });
  change(longer, [&](RigidBody& body) { body.p_BoBcm_B *= 1.0 + mass; });
  change(wider, [&](RigidBody& body) { body.I_Bcm_B *= 1.0 + told_error; });
  quick.extend *= 1.0 + allows.gain_error;
  quick.retract *= 1.0 + allows.gain_error;
  late.tau *= 1.0 + allows.timing_error / believed_servo.tau.mean();
  double position = 0.0, attitude = 0.0;
  const auto beyond = [](double off, double without) {
    return std::max(0.0, off * off - without * without);
  };
  for (const Machine* one : {&heavy, &longer, &wider, &quick, &late}) {
    const EmulationError off = *errorOn(*one, believing);
    position += beyond(off.position, believed->position);
    attitude += beyond(off.attitude, believed->attitude);
    if (out.off.stopped.empty()) out.off.stopped = off.stopped;
  }
  out.off.position = std::hypot(believed->position, std::sqrt(position));
  out.off.attitude = std::hypot(believed->attitude, std::sqrt(attitude));
  Experiment judged = believing;
  try {
    out.refused = requireStability(judged);
  } catch (const InputError& why) {
    out.refused = why.what();
  }
  return out;
}

}  // namespace ves
