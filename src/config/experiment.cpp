// SPDX-License-Identifier: BSD-3-Clause
#include "ves/config/experiment.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "ves/analysis/gate.hpp"
#include "ves/config/base.hpp"
#include "ves/config/masses.hpp"
#include "ves/config/servo.hpp"
#include "ves/config/urdf.hpp"
#include "ves/plant/nominal_servo.hpp"

namespace ves {
namespace {

constexpr double kAny = HUGE_VAL;
constexpr double kTiny = 1e-12;  // least positive value that is taken

constexpr std::string_view kCoordinates[] = {"x", "y", "z", "alpha", "beta", "gamma"};

/// A length in metres, or an angle in degrees, by coordinate.
double readCoordinate(Section& s, const std::string& key, int i) {
  return i < 3 ? s.number(key + "_m", -kAny, kAny) : s.number(key + "_deg", -kAny, kAny) * kDegree;
}

Pose readPose(Section s) {
  Vec6 x = Vec6::Zero();
  for (int i = 0; i < 6; ++i) {
    const std::string key = std::string(kCoordinates[i]) + (i < 3 ? "_m" : "_deg");
    if (s.has(key)) x(i) = readCoordinate(s, std::string(kCoordinates[i]), i);
  }
  s.finish();
  return Pose::from(x);
}

Geometry readGeometry(Section s) {
  Geometry g;
  const auto joints = [&](const char* key) {
    const Eigen::MatrixXd xy = s.matrix(key, kLegs, 2, -10.0, 10.0);
    std::array<Vec3, kLegs> out;
    for (int i = 0; i < kLegs; ++i) out[static_cast<std::size_t>(i)] = {xy(i, 0), xy(i, 1), 0.0};
    return out;
  };
  g.p_IBi_I = joints("base_joints_m");
  g.p_PPi_P = joints("platform_joints_m");
  g.home_height = s.number("home_height_m", 0.01, 10.0);
  s.finish();
  const BodyMotion home{g.fromHome({}), {}, {}, {}, {}};
  BodyMotion solved;
  if (!forwardMotion(g, home.X, {legLengths(g, home.X), Vec6::Zero(), Vec6::Zero()}, solved))
    s.fail("platform_joints_m", "the platform is singular at home: its legs cannot hold it");
  return g;
}

/// A uniform box; its centre is at the frame's origin unless `center_m` says otherwise.
RigidBody readBox(Section s) {
  RigidBody box;
  box.mass = s.number("mass_kg", 0.0, 1e5);
  const Vec3 size = s.vector("size_m", 3, 0.0, 10.0);
  if (s.has("center_m")) box.p_BoBcm_B = s.vector("center_m", 3, -10.0, 10.0);
  const Vec3 q = size.cwiseAbs2();
  box.I_Bcm_B = (box.mass / 12.0 * Vec3(q.y() + q.z(), q.x() + q.z(), q.x() + q.y())).asDiagonal();
  s.finish();
  return box;
}

struct Legs {
  plant::LegSlaveGains gains;
  plant::ActuatorModel actuator;
  plant::Temposonics transducer;
  plant::LegFilters filters = plant::LegFilters::kNone;
  double filter_cutoff = 0.0;
  LegCodec codec;
};

Legs readLegs(Section s) {
  Legs legs;
  legs.gains.K_P = static_cast<int>(s.integer("K_P", 1, 1'000'000));
  legs.gains.K_D = static_cast<int>(s.integer("K_D", 0, 1'000'000));
  constexpr double kPerMilliampere = 1e3;
  legs.actuator.gain_extend =
      s.number("gain_extend_in_per_s_per_ma", kTiny, 1e3) * kMetrePerInch * kPerMilliampere;
  legs.actuator.gain_retract =
      s.number("gain_retract_in_per_s_per_ma", kTiny, 1e3) * kMetrePerInch * kPerMilliampere;
  legs.actuator.tau = s.number("tau_s", 1e-6, 1.0);
  legs.actuator.length_min = s.number("stroke_min_m", 0.0, 10.0);
  legs.actuator.length_max = s.number("stroke_max_m", legs.actuator.length_min, 10.0);
  legs.transducer.offset = s.number("offset_m", 0.0, 10.0);
  legs.transducer.scale = kMetrePerInch / s.number("counts_per_in", 1.0, 1e6);
  const double reach =
      legs.transducer.offset + legs.transducer.scale * plant::Temposonics::kMaxCount;
  if (legs.actuator.length_min < legs.transducer.offset || legs.actuator.length_max > reach)
    s.fail("offset_m",
           fmt::format("the 14-bit transducer sees {:.4f} to {:.4f} m, the stroke is {} "
                       "to {} m; want the stroke inside",
                       legs.transducer.offset, reach, legs.actuator.length_min,
                       legs.actuator.length_max));
  legs.filters = s.choice("filters", {"none", "outputs"}) == "none" ? plant::LegFilters::kNone
                                                                    : plant::LegFilters::kOutputs;
  legs.filter_cutoff = s.number("filter_cutoff_rad_per_s", 1e-3, 1e6);
  s.finish();
  legs.codec.offset.setConstant(legs.transducer.offset);
  legs.codec.scale.setConstant(legs.transducer.scale);
  return legs;
}

Stability readStability(Section& controller, const char* key) {
  if (!controller.has(key)) return Stability::kUnknown;
  const std::string text = controller.choice(
      key, {kStabilityNames[0], kStabilityNames[1], kStabilityNames[2], kStabilityNames[3]});
  return static_cast<Stability>(
      std::find(std::begin(kStabilityNames), std::end(kStabilityNames), text) -
      std::begin(kStabilityNames));
}

/// What goes beyond the report; without the key all of it is off.
Compensation readCompensation(Section& controller) {
  Compensation c;
  if (!controller.has("compensation")) return c;
  Section s = controller.section("compensation");
  c.feed_forward = s.flag("feed_forward");
  c.observer = s.flag("observer");
  c.inertia = s.flag("inertia");
  if (c.inertia && !c.observer) s.fail("inertia", "needs the observer, want 'observer: true'");
  c.mass_update = static_cast<int>(s.integer("mass_update_ticks", 1, 1'000'000));
  c.ramp = s.number("ramp_s", 0.01, 100.0);
  c.jitter = s.number("reading_jitter_s", 0.0, 0.1);
  s.finish();
  return c;
}

struct Sensor {
  plant::ForceTorqueSensorModel model;
  plant::Climate climate;
  Transform X_PS;
  RigidBody top_plate_S;
};

Sensor readSensor(Section s) {
  Sensor out;
  plant::ForceTorqueSensorModel& m = out.model;
  constexpr double kMicro = 1e-6;
  m.S = s.matrix("sensitivity_uv_per_v", 6, 6, -1e6, 1e6) * kMicro;
  m.excitation = s.number("excitation_v", kTiny, 100.0);
  m.gain = s.vector("gain", 6, 1.0, 5000.0);
  m.bias = s.vector("bias_v", 6, -10.0, 10.0);
  m.noise = s.vector("noise_v_per_root_hz", 6, 0.0, 1.0);
  if (!s.flag("noise")) m.noise.setZero();
  m.cutoff = 2.0 * M_PI * s.number("cutoff_hz", 1e-3, 1e5);
  m.volts_per_count = s.number("volts_per_count", kTiny, 1.0);
  m.pressure = s.number("pressure_v", -10.0, 10.0);
  m.drift = s.vector("drift_v_per_c", 6, -1.0, 1.0);
  Section climate = s.section("temperature");
  constexpr double kHour = 3600.0;
  out.climate.mean = climate.number("mean_c", -50.0, 100.0);
  out.climate.swing = climate.number("swing_c", 0.0, 50.0);
  out.climate.period = climate.number("period_h", 1e-3, 1e5) * kHour;
  out.climate.rising = climate.number("rising_h", -1e5, 1e5) * kHour;
  climate.finish();
  if (!(std::abs(m.S_proc().determinant()) > 0.0) || !m.S_proc().inverse().allFinite())
    s.fail("sensitivity_uv_per_v", "is singular, want a matrix that has an inverse");
  out.X_PS = {Vec3(1.0, -1.0, -1.0).asDiagonal().toDenseMatrix(),  // 180 degrees about x
              s.vector("position_m", 3, -10.0, 10.0)};
  out.top_plate_S = readBox(s.section("top_plate"));
  s.finish();
  return out;
}

SafetyLimits readSafety(Section s, double volts_per_count) {
  SafetyLimits l;
  l.leg_velocity = s.number("leg_velocity_m_per_s", kTiny, 10.0);
  l.position_error = s.number("position_error_m", kTiny, 10.0);
  l.position_error_still = s.number("position_error_still_m", kTiny, 10.0);
  l.position_error_lag = s.number("position_error_lag_s", 0.0, 10.0);
  l.reading_jump = s.number("reading_jump_m", kTiny, 10.0);
  l.translation = s.number("translation_m", kTiny, 10.0);
  l.rotation = s.number("rotation_deg", kTiny, 85.0) * kDegree;
  l.leg_min = s.number("leg_min_m", kTiny, 10.0);
  l.leg_max = s.number("leg_max_m", l.leg_min, 10.0);
  l.joint_cone = s.number("joint_cone_deg", kTiny, 180.0) * kDegree;
  l.leg_clearance = s.number("leg_clearance_m", 0.0, 1.0);
  l.plate_angle = s.number("plate_angle_deg", 0.0, 80.0) * kDegree;
  l.condition = s.number("condition_number", 1.0, 1e9);
  constexpr double kSquareCentimetre = 1e-4, kLitre = 1e-3;
  l.bore_area = s.number("bore_area_cm2", kTiny, 1e4) * kSquareCentimetre;
  l.rod_side_area = s.number("rod_side_area_cm2", kTiny, 1e4) * kSquareCentimetre;
  l.flow = s.number("flow_l_per_s", kTiny, 1e3) * kLitre;
  l.stale_ticks = static_cast<int>(s.integer("stale_ticks", 0, 1000));
  l.stall_ticks = static_cast<int>(s.integer("stall_ticks", 0, 1000));
  l.overruns = static_cast<int>(s.integer("overruns_per_second", 0, 1000));
  const auto counts = [&](const char* key) {
    return static_cast<int>(std::lround(s.number(key, -10.0, 10.0) / volts_per_count));
  };
  l.pressure_min = counts("pressure_min_v");
  l.pressure_max = counts("pressure_max_v");
  l.frozen_samples = static_cast<int>(s.integer("frozen_samples", 1, 1000));
  l.frozen_counts = s.number("frozen_counts", 0.0, 65536.0);
  l.growing_windows = static_cast<int>(s.integer("growing_windows", 1, 1000));
  l.growth_floor = s.number("growth_floor_j", 0.0, 1e6);
  l.start_force = s.number("start_force_n", kTiny, 1e6);
  l.start_moment = s.number("start_moment_nm", kTiny, 1e6);
  s.finish();
  return l;
}

struct Robot {
  UrdfRobot urdf;
  Transform X_PR, X_RL0;
  RigidBody adapter_R;
  JointVector q = JointVector::Zero();
};

double jointUnit(const Link& link) { return link.type == JointType::kRevolute ? kDegree : 1.0; }

void requireInLimits(const Section& s, std::string_view key, const UrdfRobot& robot, int joint,
                     double q) {
  const Link& link = robot.model.link(joint);
  if (!(q >= link.lower - 1e-9 && q <= link.upper + 1e-9))
    s.fail(key, fmt::format("joint '{}' at {:.6g}, want [{:.6g}, {:.6g}] {}",
                            robot.joint_names[static_cast<std::size_t>(joint)], q / jointUnit(link),
                            link.lower / jointUnit(link), link.upper / jointUnit(link),
                            link.type == JointType::kRevolute ? "deg" : "m"));
}

Robot readRobot(Section s, const Value& document) {
  Robot robot;
  const Value* text = document.find("robot")->find("urdf_text");
  robot.urdf = loadUrdf(s.text("urdf_text"), *text->file);
  robot.X_PR = {Mat3::Identity(), s.vector("adapter_position_m", 3, -10.0, 10.0)};
  robot.adapter_R = readBox(s.section("adapter"));
  robot.X_RL0 = {rotation(s.vector("mount_rpy_deg", 3, -360.0, 360.0) * kDegree),
                 s.vector("mount_m", 3, -10.0, 10.0)};
  const Eigen::VectorXd q = s.vector("joints_deg_or_m", robot.urdf.model.joints, -1e6, 1e6);
  for (int i = 0; i < robot.urdf.model.joints; ++i) {
    robot.q(i) = q(i) * jointUnit(robot.urdf.model.link(i));
    requireInLimits(s, "joints_deg_or_m", robot.urdf, i, robot.q(i));
  }
  s.finish();
  return robot;
}

/// Nanoseconds from seconds, to the nearest.
std::int64_t readTime(Section& s, std::string_view key) {
  return std::llround(s.number(key, 0.0, 1e6) * 1e9);
}

class ProgramReader {
 public:
  ProgramReader(const UrdfRobot* robot, Experiment& out) : robot_(robot), out_(out) {}

  void read(Section& root) {
    const std::vector<Section> items = root.list("program");
    if (items.empty() || items.size() > kMaxSegments)
      root.fail("program",
                fmt::format("has {} segments, want 1 to {}", items.size(), kMaxSegments));
    for (Section item : items) {
      Segment& segment =
          out_.controller.program.segments[static_cast<std::size_t>(out_.controller.program.size)];
      readSegment(item, segment);
      if (item.has("robot"))
        for (Section event : item.list("robot")) readRobotEvent(event);
      if (item.has("faults"))
        for (Section event : item.list("faults")) readFault(event);
      item.finish();
      ++out_.controller.program.size;
    }
  }

 private:
  void readSegment(Section& item, Segment& segment) {
    const std::string kind = item.onlyKey(
        {"calibration", "move", "trajectory", "admittance", "watch", "path"}, {"robot", "faults"});
    Section s = item.section(kind);
    if (kind == "calibration") {
      segment.kind = SegmentKind::kCalibration;
    } else if (kind == "move") {
      segment.kind = SegmentKind::kMove;
      if (s.has("duration_s")) segment.duration = s.number("duration_s", 0.1, 1e5);
      if (s.has("to")) segment.target = readPose(s.section("to"));
    } else if (kind == "trajectory") {
      segment.kind = SegmentKind::kTrajectory;
      segment.duration = s.number("duration_s", 0.01, 1e6);
      for (int i = 0; i < 6; ++i) {
        const std::string coordinate(kCoordinates[i]);
        if (s.has(coordinate))
          segment.trajectory[static_cast<std::size_t>(i)] = readAxis(s.section(coordinate), i);
      }
    } else if (kind == "watch") {
      segment.kind = SegmentKind::kWatch;
      segment.duration = s.number("duration_s", 0.01, 1e6);
      segment.interval = s.number("interval_s", 1.0, 1e6);
    } else if (kind == "path") {
      segment.kind = SegmentKind::kPath;
      readPath(s, segment);
    } else {
      segment.kind = SegmentKind::kAdmittance;
      segment.duration = s.number("duration_s", 0.01, 1e6);
    }
    s.finish();
  }

  /// A pose a row and period: x y z [m], alpha beta gamma [deg].
  void readPath(Section& s, Segment& segment) {
    ControllerConfig& c = out_.controller;
    if (c.path.cols() > 0) s.fail("rows_m_deg", "is the second path, want one at most");
    c.path = s.matrix("rows_m_deg", -1, 6, -kAny, kAny).transpose();
    c.path.bottomRows<3>() *= kDegree;
    segment.duration = static_cast<double>((c.path.cols() - 1) * c.period) * kSecondPerNanosecond;
  }

  static Axis readAxis(Section s, int i) {
    Axis axis;
    const std::string kind = s.onlyKey({"ramp", "sine"}, {});
    Section motion = s.section(kind);
    if (kind == "ramp") {
      axis.motion = AxisMotion::kRamp;
      axis.final = readCoordinate(motion, "to", i);
    } else {
      axis.motion = AxisMotion::kSine;
      axis.amplitude = readCoordinate(motion, "amplitude", i);
      axis.frequency = motion.number("frequency_hz", 0.0, 1e3);
    }
    motion.finish();
    s.finish();
    return axis;
  }

  void readRobotEvent(Section& s) {
    plant::RobotEvent event;
    event.cue = {out_.controller.program.size, readTime(s, "at_s")};
    event.move.duration = s.number("duration_s", 1e-3, 1e5);
    const std::string joint = s.text("joint");
    if (!robot_) s.fail("joint", fmt::format("'{}', but there is no robot", joint));
    const auto at = std::find(robot_->joint_names.begin(), robot_->joint_names.end(), joint);
    if (at == robot_->joint_names.end())
      s.fail("joint",
             fmt::format("'{}', want one of {}", joint, fmt::join(robot_->joint_names, ", ")));
    event.move.joint = static_cast<int>(at - robot_->joint_names.begin());
    event.move.target =
        s.number("to_deg_or_m", -1e6, 1e6) * jointUnit(robot_->model.link(event.move.joint));
    requireInLimits(s, "to_deg_or_m", *robot_, event.move.joint, event.move.target);
    s.finish();
    out_.plant.robot_events.push_back(event);
  }

  void readFault(Section& s) {
    using plant::Fault;
    plant::FaultEvent event;
    event.cue = {out_.controller.program.size, readTime(s, "at_s")};
    event.duration = readTime(s, "duration_s");
    std::vector<std::string_view> names;
    for (int i = 0; i < static_cast<int>(Fault::kCount); ++i)
      names.push_back(plant::name(static_cast<Fault>(i)));
    const std::string fault = s.text("fault");
    const auto at = std::find(names.begin(), names.end(), fault);
    if (at == names.end())
      s.fail("fault", fmt::format("'{}', want one of {}", fault, fmt::join(names, ", ")));
    event.fault = static_cast<Fault>(at - names.begin());
    switch (event.fault) {
      case Fault::kWrenchStep:
      case Fault::kLegJump: event.amount = s.number("counts", -65536.0, 65536.0); [[fallthrough]];
      case Fault::kWrenchRail:
      case Fault::kLegFrozen:
      case Fault::kLegOutOfRange:
      case Fault::kValveStuck:
      case Fault::kRunaway:  // from 1, as the legs and channels are called
        event.index = static_cast<int>(s.integer("which", 1, 6)) - 1;
        break;
      case Fault::kPressure: event.amount = s.number("volts", -10.0, 10.0); break;
      case Fault::kLate: event.amount = static_cast<double>(s.integer("samples", 1, 15)); break;
      default: break;
    }
    s.finish();
    out_.plant.faults.push_back(event);
  }

  const UrdfRobot* robot_;
  Experiment& out_;
};

/// What the machine is, beside what everybody believes: factors on the robot's masses, on its
/// links' centres of mass, and on the servos.
void readReality(Section s, plant::PlantConfig& p) {
  const auto factor = [&](const char* key, double& value) {
    if (s.has(key)) value *= s.number(key, 0.01, 100.0);
  };
  factor("gain_extend", p.actuator.gain_extend);
  factor("gain_retract", p.actuator.gain_retract);
  factor("tau", p.actuator.tau);
  const double mass = s.has("mass") ? s.number("mass", 0.01, 100.0) : 1.0;
  const double center = s.has("center") ? s.number("center", 0.0, 10.0) : 1.0;
  const auto change = [&](RigidBody& body) {
    body = heavier(mass, body);
    body.p_BoBcm_B *= center;
  };
  change(p.payload.robot.base);
  for (int i = 0; i < p.payload.robot.joints; ++i)
    change(p.payload.robot.links[static_cast<std::size_t>(i)].body);
  s.finish();
}

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

Experiment build(const Value& document) {
  Experiment out;
  Section root(document, "");
  root.integer("schema", 1, 1);
  out.name = root.text("name");
  if (out.name.empty() ||
      out.name.find_first_not_of(
          "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") != std::string::npos)
    root.fail("name", "want letters, digits, _ and -; folders are named after it");
  out.description = root.text("description");
  out.plant.seed = static_cast<std::uint32_t>(root.integer("seed", 0, UINT32_MAX));

  ControllerConfig& c = out.controller;
  plant::PlantConfig& p = out.plant;
  c.gravity = Vec3(0.0, 0.0, -root.number("gravity_m_per_s2", 0.0, 100.0));

  Section controller = root.section("controller");
  c.period = controller.integer("period_ns", 1'000'000, 1'000'000'000);
  c.gentle.speed = controller.number("gentle_speed_m_per_s", 1e-3, 1.0);
  c.gentle.rotation = controller.number("gentle_rotation_deg_per_s", 1e-1, 100.0) * kDegree;
  const auto braking = [&](const std::string& kind) -> Braking {
    return {controller.number(kind + "_braking_m_per_s2", 1e-3, 100.0),
            controller.number(kind + "_rotation_braking_deg_per_s2", 1e-1, 1e4) * kDegree};
  };
  c.gentle.braking = braking("gentle");
  c.stop_braking = braking("stop");
  c.arming_samples = static_cast<int>(controller.integer("arming_samples", 1, 10'000));
  c.stability = readStability(controller, "stability");
  c.stability_uncompensated = readStability(controller, "stability_uncompensated");
  c.tare_ramp = controller.number("tare_ramp_s", 0.01, 100.0);
  c.compensation = readCompensation(controller);
  Section still = controller.section("still");
  c.stillness.leg_counts = static_cast<int>(still.integer("leg_counts", 0, 1000));
  c.stillness.joint = still.number("joint_rad_or_m", 0.0, 1.0);
  c.stillness.deviation = still.number("deviation_counts", kTiny, 1e4);
  const double bias = still.number("bias_v", kTiny, 10.0);
  still.finish();
  controller.finish();

  c.geometry = readGeometry(root.section("platform"));
  Section leg_section = root.section("legs");
  Section watchdog = leg_section.section("watchdog");
  p.watchdog.park_after = readTime(watchdog, "park_after_s");
  p.watchdog.park_time = std::max<std::int64_t>(1, readTime(watchdog, "park_time_s"));
  watchdog.finish();
  const Legs legs = readLegs(leg_section);
  c.legs = legs.codec;
  const Sensor sensor = readSensor(root.section("sensor"));
  c.sensor = {sensor.model.S_proc().inverse(), sensor.X_PS};
  c.stillness.bias = bias / sensor.model.volts_per_count;
  c.servo = plant::nominalServo(legs.gains, legs.actuator, legs.transducer);
  c.servo.sensor_cutoff = sensor.model.cutoff;
  c.servo.jitter = c.compensation.jitter;
  if (root.has("servo")) c.servo = withRecord(c.servo, readServo(root.section("servo")));
  c.safety = readSafety(root.section("safety"), sensor.model.volts_per_count);
  c.admittance = readBase(root.section("base")).modes;

  c.payload.X_PS = sensor.X_PS;
  c.payload.top_plate_S = sensor.top_plate_S;
  c.payload.X_PR.p = sensor.X_PS.p;
  UrdfRobot urdf;
  const bool has_robot = root.has("robot");
  if (has_robot) {
    const Robot robot = readRobot(root.section("robot"), document);
    urdf = robot.urdf;
    c.payload.X_PR = robot.X_PR;
    c.payload.adapter_R = robot.adapter_R;
    c.payload.X_RL0 = robot.X_RL0;
    c.payload.robot = urdf.model;
    p.initial_joints = robot.q;
    out.joint_names = urdf.joint_names;
    out.warnings = urdf.warnings;
  }

  p.geometry = c.geometry;
  p.initial_pose = readPose(root.section("initial_pose"));
  p.leg_slave = legs.gains;
  p.actuator = legs.actuator;
  p.transducer = legs.transducer;
  p.filters = legs.filters;
  p.filter_cutoff = legs.filter_cutoff;
  p.sensor = sensor.model;
  p.climate = sensor.climate;
  p.payload = c.payload;
  p.gravity = c.gravity;
  if (root.has("reality")) readReality(root.section("reality"), p);
  const Vec6 L = legLengths(p.geometry, p.geometry.fromHome(p.initial_pose));
  if (L.minCoeff() < p.actuator.length_min || L.maxCoeff() > p.actuator.length_max)
    root.fail(
        "initial_pose",
        fmt::format("takes legs of {:.4f} to {:.4f} m, want the stroke of {} to {} m", L.minCoeff(),
                    L.maxCoeff(), p.actuator.length_min, p.actuator.length_max));

  out.setup = setupOf(document);
  if (root.has("calibration")) {
    Section section = root.section("calibration");
    out.calibration = readCalibration(section);
    if (out.calibration->setup != out.setup)
      section.fail("setup", fmt::format("{} is of another sensor, robot or gravity, want {}; "
                                        "calibrate again",
                                        out.calibration->setup, out.setup));
    c.bias = out.calibration->bias;
  }

  if (root.has("masses")) {
    Section section = root.section("masses");
    const MassRecord masses = readMasses(section);
    if (masses.kinematics != kinematicsOf(c.payload))
      section.fail("kinematics", fmt::format("{} is of another robot, mount or sensor, want {}; "
                                             "identify again",
                                             masses.kinematics, kinematicsOf(c.payload)));
    if (std::ssize(masses.bodies) != c.payload.robot.joints + 1)
      section.fail("bodies", fmt::format("are {}, want {}: link 0 and a link for each joint",
                                         masses.bodies.size(), c.payload.robot.joints + 1));
    c.payload = withMasses(c.payload, masses);
  }

  ProgramReader(has_robot ? &urdf : nullptr, out).read(root);
  root.finish();
  out.substitutes = countSubstitutes(document, false);
  out.resolved = emit(document);
  out.hash = fingerprint(out.resolved);
  return out;
}

}  // namespace

Experiment loadExperiment(const std::filesystem::path& file,
                          const std::vector<std::string>& overrides,
                          const std::filesystem::path& calibration,
                          const std::filesystem::path& masses, const std::filesystem::path& servo) {
  Value document = loadDocument(file);
  if (!calibration.empty()) document.put("calibration", loadDocument(calibration));
  if (!masses.empty()) document.put("masses", loadDocument(masses));
  if (!servo.empty()) document.put("servo", loadDocument(servo));
  for (const std::string& assignment : overrides) override(document, assignment);
  return build(document);
}

Experiment parseExperiment(const std::string& resolved, const std::string& name) {
  return build(parseDocument(resolved, name));
}

std::string applyStabilityCheck(Experiment& e) {
  const std::string why = applyStabilityCheck(e.controller, e.plant);
  Value document = parseDocument(e.resolved, e.name);
  Value& controller = *document.find("controller");
  const auto put = [&](const char* key, Stability verdict) {
    Value value;
    value.kind = Value::Kind::kScalar;
    value.text = kStabilityNames[static_cast<std::size_t>(verdict)];
    controller.put(key, value);
  };
  put("stability", e.controller.stability);
  put("stability_uncompensated", e.controller.stability_uncompensated);
  e.resolved = emit(document);
  e.hash = fingerprint(e.resolved);
  return why;
}

Interaction interactionOf(const Experiment& experiment, std::int64_t& duration) {
  const Program& program = experiment.controller.program;
  int segment = 0;
  while (segment < program.size &&
         program.segments[static_cast<std::size_t>(segment)].kind != SegmentKind::kAdmittance)
    ++segment;
  if (segment == program.size)
    throw InputError(
        fmt::format("{}: no admittance segment, want one in its program", experiment.name));
  duration = std::llround(program.segments[static_cast<std::size_t>(segment)].duration * 1e9);
  Interaction out;
  out.base = experiment.controller.admittance;
  out.payload = experiment.plant.payload;
  out.q0 = experiment.plant.initial_joints;
  for (const plant::RobotEvent& event : experiment.plant.robot_events) {
    if (event.cue.segment < segment) out.q0(event.move.joint) = event.move.target;
    if (event.cue.segment == segment) out.moves.push_back({event.cue.after, event.move});
  }
  std::stable_sort(out.moves.begin(), out.moves.end(),
                   [](const TimedMove& a, const TimedMove& b) { return a.start < b.start; });
  return out;
}

std::filesystem::path findScenario(const std::string& scenario,
                                   const std::filesystem::path& config) {
  return findFile("scenario", scenario, config / "scenarios");
}

}  // namespace ves
