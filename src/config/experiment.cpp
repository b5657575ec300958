// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/experiment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "readers.hpp"
#include "ves/analysis/gate.hpp"
#include "ves/config/base.hpp"
#include "ves/config/masses.hpp"
#include "ves/config/servo.hpp"
#include "ves/control/gravity_compensation.hpp"
#include "ves/core/coordinates.hpp"
#include "ves/math/dense.hpp"
#include "ves/plant/nominal_servo.hpp"

namespace ves {
namespace {

int countSubstitutes(const Value& value, bool inherited) {
  const bool substitute = value.tag.empty() ? inherited : value.tag == "substitute";
  if (value.kind == Value::Kind::kScalar) return substitute ? 1 : 0;
  int count = 0;
  for (const Value& child : value.children) count += countSubstitutes(child, substitute);
  return count;
}

/// What a calibration depends on.
std::string setupOf(const Value& document) {
  std::string text;
  for (const char* key : {"sensor", "robot", "gravity_m_per_s2", "masses"})
    if (const Value* value = document.find(key)) text += emit(*value);
  return fingerprint(text);
}

/// With the areas that these gains ask for.
plant::HydraulicModel fitted(Section& root, plant::HydraulicModel model,
                             const plant::ActuatorModel& gains, const Geometry& geometry) {
  if (!fit(model, gains, geometry))
    root.section("legs").fail("hydraulic",
                              "no areas give the leg's two gains under the plate's weight, want "
                              "more supply_mpa or bore_area_cm2, or gains farther apart");
  return model;
}

/// [ns] at which an action that begins `now` is over.
std::int64_t endOf(MovingRobot& robot, const RobotAction& action, std::int64_t now) {
  robot.begin(action, now);
  return now + std::llround(durationOf(action) * 1e9);
}

/// Warns of channels that the weight alone nearly fills, in the robot's poses and level.
void warnOfFullChannels(Experiment& e) {
  constexpr double kMostShare = 0.9, kFullScale = 32767.0;  // [-], [count]
  const Mat6 S_proc = e.plant.sensor.S_proc();
  Vec6 most = Vec6::Zero();
  const Mat3 R = e.plant.geometry.fromHome(e.plant.initial_pose).R;
  const auto look = [&](const RobotModel& robot, const JointVector& q) {
    Payload payload = e.plant.payload;
    payload.robot = robot;
    for (const Mat3& attitude : {Mat3(Mat3::Identity()), R})
      most = most.cwiseMax(
          (S_proc * staticWrench(payload, q, attitude, e.plant.gravity).stacked()).cwiseAbs());
  };
  MovingRobot robot(e.plant.payload.robot, e.plant.task.initial_joints);
  std::int64_t now = 0;
  look(robot.model(), robot.at(now).q);
  for (const RobotEvent& event : e.plant.task.robot_events) {
    now = endOf(robot, event.action, now);
    look(robot.model(), robot.at(now).q);
  }
  for (int i = 0; i < 6; ++i)
    if (most(i) > kMostShare * kFullScale)
      e.source.warnings.push_back(fmt::format(
          "the weight alone takes {:.0f} % of the range of channel {}; a smaller sensor.gain[{}] "
          "would leave room",
          100.0 * most(i) / kFullScale, wrenchComponent(i).name, i));
}

/// Where masses are to be learnt from a wide belief, and nothing tells of them before admittance.
std::string proposeExcitation(Section& root, const ControllerConfig& c) {
  constexpr double kWide = 0.02;  // [-]
  if (!c.compensation.learns_masses || c.compensation.mass_error < kWide) return {};
  for (Section& item : root.list("program"))
    if (item.has("excite")) return {};
  return fmt::format(
      "masses are learnt from a belief of +-{:.0f} % while the vehicle is emulated; `excite: "
      "{{tilt_deg: 4, duration_s: 9}}` after the calibration tells most of them before it",
      100.0 * c.compensation.mass_error);
}

Experiment build(const Value& document, AskedKey* asked = nullptr) {
  Experiment out;
  Section root(document, "", asked);
  root.integer("schema", 1, 1);
  out.name = root.text("name");
  if (out.name.empty() ||
      out.name.find_first_not_of(
          "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") != std::string::npos)
    root.fail("name", "want letters, digits, _ and -; folders are named after it");
  constexpr std::size_t kLongest = 100;  // [B] with a time behind it, of a folder's name
  if (out.name.size() > kLongest)
    root.fail("name", fmt::format("has {} letters, want at most {}: folders are named after it",
                                  out.name.size(), kLongest));
  out.description = root.text("description");
  out.plant.seed = static_cast<std::uint32_t>(root.integer("seed", 0, UINT32_MAX));

  ControllerConfig& c = out.controller;
  plant::PlantConfig& p = out.plant;
  constexpr const char* kGravity = "gravity_m_per_s2";  // downwards, or a vector in {I}
  c.gravity = root.isList(kGravity) ? Vec3(root.vector(kGravity, 3, -100.0, 100.0))
                                    : Vec3(0.0, 0.0, -root.number(kGravity, 0.0, 100.0));
  if (c.gravity.z() > 0.0)
    root.fail(
        kGravity,
        fmt::format("[{}] points up, and would have the platform hang from its base; Z is up, "
                    "so that 9.81 is [0, 0, -9.81]",
                    fmt::join(c.gravity, ", ")));

  readController(root.section("controller"), c);
  c.geometry = readGeometry(root.section("platform"));
  Section leg_section = root.section("legs");
  Section watchdog = leg_section.section("watchdog");
  p.watchdog.hold_after = c.period * watchdog.integer("hold_after_ticks", 1, 1000);
  p.watchdog.park_after = readTime(watchdog, "park_after_s");
  p.watchdog.park_time = std::max<std::int64_t>(1, readTime(watchdog, "park_time_s"));
  watchdog.finish();
  const WorkspaceUse use = readWorkspace(root.section("safety"), c.geometry);
  const Legs legs = readLegs(leg_section, use);
  c.legs = legs.codec;
  if (root.has("bus")) {
    Section bus = root.section("bus");
    out.key_file = bus.text("key_file");
    bus.finish();
  }
  const Sensor sensor = readSensor(root.section("sensor"));
  c.sensor = {inverse(sensor.model.S_proc()), sensor.X_PS};
  c.stillness.bias /= sensor.model.volts_per_count;
  c.servo = plant::nominalServo(legs.gains, legs.actuator, legs.transducer);
  c.servo.sensor_cutoff = sensor.model.cutoff;
  if (sensor.readings > 1) {
    // To whole ns, so that each part has a middle.
    p.sensor_readings = sensor.readings;
    p.sensor_window = c.period / (2 * sensor.readings) * 2 * sensor.readings;
    c.servo.sensor_readings = sensor.readings;
    c.servo.sensor_window = static_cast<double>(p.sensor_window) * kSecondPerNanosecond;
  }
  if (legs.filters == plant::LegFilters::kOutputs) c.servo.filter_cutoff = legs.filter_cutoff;
  c.servo.jitter = c.compensation.jitter;
  const double mass_error = c.compensation.mass_error;
  if (root.has("servo")) {
    const ServoRecord record = readServo(root.section("servo"));
    c.servo = withRecord(c.servo, record);
    if (const double most = ModelledServos::kMostDelay * c.periodSeconds();
        !(c.servo.delay.maxCoeff() <= most))
      root.fail("servo",
                fmt::format("delay_s of {:.4g} s, want at most {:.4g} s: {} periods of the "
                            "controller",
                            c.servo.delay.maxCoeff(), most, ModelledServos::kMostDelay));
    c.compensation = withRecord(c.compensation, record);
  }
  c.safety =
      readSafety(root.section("safety"), c.geometry, use, legs, sensor.model.volts_per_count);
  c.safety.alone = static_cast<double>(p.watchdog.park_after) * kSecondPerNanosecond;
  const Base base = readBase(root.section("base"));
  c.vehicle = base.vehicle;
  if (base.feels_weight) {
    const auto refuse = [&](const char* why) { root.section("base").fail("weight", why); };
    if (c.gravity.isZero(0.0)) refuse("felt, and gravity_m_per_s2 is 0");
    if (!c.compensation.inertia)
      refuse("felt: the robot's is known with its inertia, want controller.compensation.inertia");
    if (c.compensation.learns_masses)
      refuse("felt: masses that are learnt move it, want learns_masses: false");
    if (root.has("environment") && root.section("environment").has("target"))
      refuse("felt, and the environment's target floats, want one of the two");
    c.vehicle.gravity = c.gravity;
  }
  if (const ModalModel modes = linearised(c.vehicle);
      c.compensation.inertia && modes.stiffness.size() > 0) {
    const double fastest = std::sqrt(modes.stiffness.maxCoeff()), damping = modes.damping.norm();
    if (!((fastest + damping) * c.periodSeconds() <= kMostModalAngle))
      root.fail(
          "base",
          fmt::format("with the inertia compensated its fastest mode, {:.4g} rad/s and damped "
                      "by {:.4g}/s, takes a tick too long, want together at most {:.4g}/s; "
                      "keep_modes leaves the softest",
                      fastest, damping, kMostModalAngle / c.periodSeconds()));
  }
  out.arm = base.shape;

  c.payload.X_PS = sensor.X_PS;
  c.payload.top_plate_S = sensor.top_plate_S;
  c.payload.X_PR.p = sensor.X_PS.p;
  if (root.has("robot")) {
    const Robot robot = readRobot(root.section("robot"), document);
    out.robot = robot.urdf;
    c.payload.X_PR = robot.X_PR;
    c.payload.adapter_R = robot.adapter_R;
    c.payload.X_RL0 = robot.X_RL0;
    c.payload.robot = out.robot.model;
    p.task.initial_joints = robot.q;
    p.joints = robot.encoders;
    p.gripper_switch = c.hand.switched = robot.gripper_switch;
    c.joints.deviation =
        ((robot.encoders.count.cwiseAbs2() + robot.encoders.play.cwiseAbs2()) / 12.0 +
         robot.encoders.noise.cwiseAbs2())
            .cwiseSqrt();
    // Of joints at rest readings differ by a count, where their noise takes them across.
    constexpr double kMostNoise = 8.0;  // [-] times its deviation, from reading to reading
    c.stillness.joint = std::max(
        c.stillness.joint, (robot.encoders.count + kMostNoise * robot.encoders.noise).maxCoeff());
    c.joints.interval = static_cast<double>(robot.encoders.interval) * kSecondPerNanosecond;
    out.source.notes = out.robot.warnings;
    if (!out.robot.choice.empty()) out.source.warnings.push_back(out.robot.choice);
  }

  if (const NamedFrame* tool = out.robot.tool()) {
    c.hand.link = tool->link;
    c.hand.p_LT_L = tool->X_link.p;
  } else if (c.hand.switched) {
    root.section("robot").fail("gripper_switch",
                               "the robot has no tool, want one: a frame at its end");
  }
  if (legs.hydraulic) {
    const plant::HydraulicModel nominal = fitted(root, *legs.hydraulic, legs.actuator, c.geometry);
    c.resonance = plant::nominalResonance(nominal, legs.actuator, c.geometry,
                                          lockedRobot(c.payload, p.task.initial_joints));
  }
  out.machine = readMachine(root.section("machine"), c.period, c.resonance);
  p.geometry = c.geometry;
  p.initial_pose = readPose(root.section("initial_pose"));
  p.leg_slave = legs.gains;
  p.actuator = legs.actuator;
  p.transducer = legs.transducer;
  p.filters = legs.filters;
  p.filter_cutoff = legs.filter_cutoff;
  p.hydraulic = legs.hydraulic;
  p.sensor = sensor.model;
  p.climate = sensor.climate;
  p.payload = c.payload;
  p.gravity = c.gravity;
  if (root.has("reality") && root.has("plant_mismatch"))
    root.fail("reality", "is the old name of plant_mismatch, which is there too; want one of them");
  for (const char* key : {"plant_mismatch", "reality"})
    if (root.has(key)) readPlantMismatch(root.section(key), p);
  if (root.has("reality"))
    out.source.warnings.push_back("'reality' is called 'plant_mismatch' now; the old name will go");
  if (p.hydraulic) {
    if (out.machine.external_legs)
      root.section("legs").fail("model", "is hydraulic, want ideal: the legs are external");
    p.hydraulic = fitted(root, *p.hydraulic, p.actuator, p.geometry);
  }
  const Vec6 L = legLengths(p.geometry, p.geometry.fromHome(p.initial_pose));
  for (int i = 0; i < kLegs; ++i)
    if (!(L(i) >= p.actuator.length_min && L(i) <= p.actuator.length_max))
      root.fail("initial_pose",
                fmt::format("takes leg {} to {:.4f} m, want the stroke of {:.4f} to {:.4f} m",
                            i + 1, L(i), p.actuator.length_min, p.actuator.length_max));

  if (root.has("environment")) p.task.world = readEnvironment(root.section("environment"), out);

  if (root.has("calibration")) {
    Section section = root.section("calibration");
    out.source.calibration = readCalibration(section);
    if (const std::string setup = setupOf(document); out.source.calibration->setup != setup)
      section.fail("setup",
                   fmt::format("{} is of another sensor, robot, masses or gravity, want {}; "
                               "calibrate again",
                               out.source.calibration->setup, setup));
    c.bias = out.source.calibration->bias;
  }

  if (root.has("masses")) {
    Section section = root.section("masses");
    const MassRecord masses = readMasses(section);
    if (masses.kinematics != kinematicsOf(c.payload))
      section.fail("kinematics", fmt::format("{} is of another robot, mount or sensor, want {}; "
                                             "identify again",
                                             masses.kinematics, kinematicsOf(c.payload)));
    if (std::ssize(masses.bodies) != c.payload.robot.size + 1)
      section.fail("bodies", fmt::format("are {}, want {}: link 0 and every link that moves",
                                         masses.bodies.size(), c.payload.robot.size + 1));
    c.payload = withMasses(c.payload, masses);
    if (masses.deviation > 0.0) {
      const double found = massErrorOf(masses, c.payload.robot, p.task.initial_joints, mass_error);
      double& used = c.compensation.mass_error;  // the servo's record may have said one too
      used = used == mass_error ? found : std::max(used, found);
    }
  }

  readProgram(root, out);
  requirePathFits(root, c);
  requireGroundFits(root, c);
  requireFiringsFit(root, c);
  requireFrameFits(root, c, p.task);
  if (const std::string proposal = proposeExcitation(root, c); !proposal.empty())
    out.source.notes.push_back(proposal);
  ToldLoads& told = c.told_loads;
  std::stable_sort(
      told.loads.begin(), told.loads.begin() + told.size, [](const ToldLoad& a, const ToldLoad& b) {
        return std::pair(a.cue.segment, a.cue.after) < std::pair(b.cue.segment, b.cue.after);
      });
  if (p.task.world) {
    const int segment = admittanceSegment(c.program);
    p.task.world->release = segment < c.program.size ? segment : -1;
  }
  root.finish();
  warnOfFullChannels(out);
  out.source.substitutes = countSubstitutes(document, false);
  if (const Value* said = document.find("legs"); said && !p.hydraulic)
    if (const Value* unused = said->find("hydraulic"))
      out.source.substitutes -= countSubstitutes(*unused, false);
  return out;
}

}  // namespace

std::string Provenance::resolved() const { return emit(document); }

std::string Provenance::hash() const { return fingerprint(resolved()); }

std::string Provenance::calibrated() const { return setupOf(document); }

Experiment loadExperiment(const std::filesystem::path& file,
                          const std::vector<std::string>& overrides, const BeliefFiles& files) {
  Value document = loadDocument(file);
  // A title is of the scenario that has the name, and not of one that was built upon.
  const Value *name = document.find("name"), *title = document.find("description");
  if (name && title && name->file && title->file && *name->file != *title->file) {
    Value own = *title;
    own.text = name->text;
    document.put("description", own);
  }
  if (!files.belief.empty()) {
    const Value belief = loadDocument(files.belief);
    Section root(belief, "");
    for (const char* key : kBeliefKeys)
      if (root.has(key)) {
        root.section(key);
        document.put(key, *belief.find(key));
      }
    root.finish();
  }
  if (!files.calibration.empty()) document.put("calibration", loadDocument(files.calibration));
  if (!files.masses.empty()) document.put("masses", loadDocument(files.masses));
  if (!files.servo.empty()) document.put("servo", loadDocument(files.servo));
  return buildExperiment(std::move(document), overrides);
}

Experiment buildExperiment(Value document, const std::vector<std::string>& overrides) {
  for (const std::string& assignment : overrides) applyOverride(document, assignment);
  Experiment out = build(document);
  out.source.document = std::move(document);
  return out;
}

void askKeys(const Value& document, AskedKey& asked) { build(document, &asked); }

Experiment parseExperiment(const std::string& resolved, const std::string& name) {
  return buildExperiment(parseDocument(resolved, name));
}

std::string applyStabilityCheck(Experiment& e) {
  const std::string why = applyStabilityCheck(e.controller, e.plant.task);
  Value& controller = *e.source.document.find("controller");
  const auto put = [&](const char* key, std::string text) {
    Value value;
    value.kind = Value::Kind::kScalar;
    value.text = std::move(text);
    controller.put(key, value);
  };
  const auto verdict = [](Stability s) {
    return std::string(kStabilityNames[static_cast<std::size_t>(s)]);
  };
  const ControllerConfig& c = e.controller;
  put("stability", verdict(c.stability));
  put("stability_uncompensated", verdict(c.stability_uncompensated));
  const auto putSeconds = [&](const char* key, double seconds) {
    if (std::isfinite(seconds))
      put(key, fmt::format("{}", seconds));
    else
      controller.erase(key);  // an earlier verdict's
  };
  putSeconds("stable_for_s", c.stable_for);
  putSeconds("stable_for_uncompensated_s", c.stable_for_uncompensated);
  return why;
}

std::string requireStability(Experiment& e) {
  const std::string why = applyStabilityCheck(e);
  if (!why.empty() && wantsAdmittance(e.controller.program) &&
      e.controller.stability != Stability::kForced)
    throw InputError(fmt::format(
        "{}: {}; --force (controller.stability=forced) runs it all the same", e.name, why));
  return why;
}

std::string whyNotPushed(const Experiment& experiment, const PushOrder& order) {
  if (!experiment.machine.simulated())
    return "a push is for a machine that is all simulated; pieces of this one are real";
  if (!(order.force_I.norm() <= kMostPush))
    return fmt::format("a push of {:.4g} N, want at most {} N", order.force_I.norm(), kMostPush);
  if (order.on == PushOrder::On::kTool && !experiment.robot.tool())
    return "there is no robot with one tip to push";
  const std::optional<World>& world = experiment.plant.task.world;
  if (order.on == PushOrder::On::kTarget && !(world && world->environment.target))
    return "there is no target to push in this scenario's environment";
  return "";
}

Interaction interactionOf(const Experiment& experiment, std::int64_t& duration) {
  const Program& program = experiment.controller.program;
  const int segment = admittanceSegment(program);
  if (segment == program.size)
    throw InputError(
        fmt::format("{}: no admittance segment, want one in its program", experiment.name));
  duration = std::llround(program.segments[static_cast<std::size_t>(segment)].duration * 1e9);
  Interaction out;
  out.vehicle = experiment.controller.vehicle;
  out.payload = experiment.plant.payload;
  out.world = experiment.plant.task.world;
  out.p_IH = experiment.plant.geometry.home();
  MovingRobot before(out.payload.robot, experiment.plant.task.initial_joints);
  std::int64_t now = 0;
  RobotAction in_hand = Release{};
  for (const RobotEvent& event : experiment.plant.task.robot_events) {
    if (event.cue.segment > segment) break;
    if (event.cue.segment == segment) {
      out.actions.push_back({event.cue.after, event.action});
      continue;
    }
    now = endOf(before, event.action, now);
    if (std::holds_alternative<Grasp>(event.action)) in_hand = event.action;
  }
  if (before.holds()) out.actions.insert(out.actions.begin(), {0, in_hand});
  out.q0 = before.at(now).q;
  return out;
}

std::filesystem::path findScenario(const std::string& scenario,
                                   const std::filesystem::path& config) {
  return findFile("scenario", scenario, config / "scenarios");
}

}  // namespace ves
