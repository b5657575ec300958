// SPDX-License-Identifier: BSD-3-Clause
#include "readers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "ves/math/dense.hpp"

namespace ves {

/// A guess where legs are longer than any that are built.
static std::string unitOf(const WorkspaceUse& use) {
  constexpr double kLongest = 5.0;  // [m]
  const double most = use.leg_most.maxCoeff();
  return most > kLongest ? fmt::format(
                               "; legs of {:.3g} m: are the platform's lengths in inches or "
                               "mm, and not in m?",
                               most)
                         : "";
}

Legs readLegs(Section s, const WorkspaceUse& use) {
  Legs legs;
  legs.gains.K_P = static_cast<int>(s.integer("K_P", 1, 1'000'000));
  legs.gains.K_D = static_cast<int>(s.integer("K_D", 0, 1'000'000));
  constexpr double kPerMilliampere = 1e3;
  legs.actuator.gain_extend =
      s.number("gain_extend_in_per_s_per_ma", kTiny, 1e3) * kMetrePerInch * kPerMilliampere;
  legs.actuator.gain_retract =
      s.number("gain_retract_in_per_s_per_ma", kTiny, 1e3) * kMetrePerInch * kPerMilliampere;
  legs.actuator.tau = s.number("tau_s", 1e-6, 1.0);
  const Stroke stroke = derivedStroke(use);
  legs.actuator.length_min = s.numberOr("stroke_min_m", 0.0, 20.0, stroke.min);
  legs.actuator.length_max = s.numberOr("stroke_max_m", legs.actuator.length_min, 20.0, stroke.max);
  legs.transducer.scale = kMetrePerInch / s.number("counts_per_in", 1.0, 1e6);
  legs.transducer.offset = s.numberOr(
      "offset_m", 0.0, 20.0,
      derivedOffset({legs.actuator.length_min, legs.actuator.length_max}, legs.transducer.scale));
  const double range = legs.transducer.scale * kMaxLegCount,
               length = legs.actuator.length_max - legs.actuator.length_min;
  if (length > range)
    s.fail("counts_per_in",
           fmt::format("the stroke of {:.4f} m takes more than 14 bits, want at most {:.4g}{}",
                       length, kMetrePerInch * kMaxLegCount / length, unitOf(use)));
  if (legs.actuator.length_min < legs.transducer.offset ||
      legs.actuator.length_max > legs.transducer.offset + range)
    s.fail("offset_m",
           fmt::format("the 14-bit transducer sees {:.4f} to {:.4f} m, the stroke is {:.4f} "
                       "to {:.4f} m; want the stroke inside",
                       legs.transducer.offset, legs.transducer.offset + range,
                       legs.actuator.length_min, legs.actuator.length_max));
  legs.filters = s.choice("filters", {"none", "outputs"}) == "none" ? plant::LegFilters::kNone
                                                                    : plant::LegFilters::kOutputs;
  legs.filter_cutoff = s.number("filter_cutoff_rad_per_s", 1e-3, 1e6);
  if (s.has("hydraulic")) legs.hydraulic = readHydraulics(s.section("hydraulic"), legs.actuator);
  if (!s.has("model") || s.choice("model", {"ideal", "hydraulic"}) == "ideal")
    legs.hydraulic.reset();
  else if (!legs.hydraulic)
    s.fail("model", "is hydraulic, want a section `hydraulic` that says of what kind");
  if (legs.hydraulic && legs.filters != plant::LegFilters::kNone)
    s.fail("filters", "are of ideal legs, want none: hydraulic ones move the platform themselves");
  s.finish();
  legs.codec.offset.setConstant(legs.transducer.offset);
  legs.codec.scale.setConstant(legs.transducer.scale);
  return legs;
}

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
  out.readings = static_cast<int>(s.integer("readings_per_tick", 1, 100));
  m.pressure = s.number("pressure_v", -10.0, 10.0);
  m.drift = s.vector("drift_v_per_c", 6, -1.0, 1.0);
  Section climate = s.section("temperature");
  constexpr double kHour = 3600.0;
  out.climate.mean = climate.number("mean_c", -50.0, 100.0);
  out.climate.swing = climate.number("swing_c", 0.0, 50.0);
  out.climate.period = climate.number("period_h", 1e-3, 1e5) * kHour;
  out.climate.rising = climate.number("rising_h", -1e5, 1e5) * kHour;
  climate.finish();
  if (!inverse(m.S_proc()).allFinite())
    s.fail("sensitivity_uv_per_v", "is singular, want a matrix that has an inverse");
  const Vec3 upside_down(180.0, 0.0, 0.0);  // the report's, and of configurations without the key
  const Vec3 rpy = s.has("rpy_deg") ? Vec3(s.vector("rpy_deg", 3, -360.0, 360.0)) : upside_down;
  out.X_PS = {rotationOfDegrees(rpy), s.vector("position_m", 3, -10.0, 10.0)};
  out.top_plate_S = readBox(s.section("top_plate"));
  s.finish();
  return out;
}

namespace {

ForceSensorSource readNetFt(Section& machine) {
  Section s = machine.section("net_ft");
  NetFtAddress out;
  out.host = s.text("host");
  out.port = static_cast<int>(s.integer("port", 1, 65535));
  out.http_port = static_cast<int>(s.integer("http_port", 1, 65535));
  s.finish();
  return out;
}

/// "serial:/dev/ttyUSB0", "udp:5000" or "pipe:FILE".
void readFrom(Section& s, StreamSource& out) {
  const std::string from = s.text("source");
  const std::size_t colon = from.find(':');
  const std::string how = from.substr(0, colon),
                    what = colon == std::string::npos ? "" : from.substr(colon + 1);
  using From = StreamSource::From;
  for (const auto& [name, kind] :
       {std::pair{"serial", From::kSerial}, {"udp", From::kUdp}, {"pipe", From::kPipe}})
    if (how == name && !what.empty()) {
      out.from = kind;
      out.path = what;
      if (kind != From::kUdp) return;
      const auto [end, error] = std::from_chars(what.data(), what.data() + what.size(), out.port);
      if (error == std::errc() && end == what.data() + what.size() && out.port > 0 &&
          out.port < 65536)
        return;
    }
  s.fail("source", fmt::format("'{}', want serial:DEVICE, udp:PORT or pipe:FILE", from));
}

ForceSensorSource readStream(Section& machine) {
  constexpr int kLongest = 256;  // [B] of a frame
  Section s = machine.section("stream");
  StreamSource out;
  readFrom(s, out);
  out.baud = static_cast<int>(s.integer("baud", 50, 4'000'000));
  using Value = StreamSource::Value;
  const std::string value = s.choice("values", {"text", "int16", "int32", "float32"});
  out.value = value == "text"    ? Value::kText
              : value == "int16" ? Value::kInt16
              : value == "int32" ? Value::kInt32
                                 : Value::kFloat32;
  out.separators = s.text("separators");
  out.first = static_cast<int>(s.integer("first", 0, kLongest));
  out.big_endian = s.choice("byte_order", {"little", "big"}) == "big";
  for (const double byte : s.vector("sync", -1, 0.0, 255.0))
    out.sync.push_back(static_cast<std::uint8_t>(byte));
  out.length = static_cast<int>(s.integer("length", 1, kLongest));
  using Checksum = StreamSource::Checksum;
  const std::string kind =
      s.choice("checksum", {"none", "sum8", "xor8", "crc16_modbus", "crc16_x25", "crc32"});
  for (const auto& [name, one] : {std::pair{"none", Checksum::kNone},
                                  {"sum8", Checksum::kSum8},
                                  {"xor8", Checksum::kXor8},
                                  {"crc16_modbus", Checksum::kCrc16Modbus},
                                  {"crc16_x25", Checksum::kCrc16X25},
                                  {"crc32", Checksum::kCrc32}})
    if (kind == name) out.checksum = one;
  const Eigen::VectorXd over = s.vector("checksum_over", 2, 0.0, kLongest);
  out.checksum_from = static_cast<int>(over(0));
  out.checksum_to = static_cast<int>(over(1));
  out.checksum_at = static_cast<int>(s.integer("checksum_at", 0, kLongest));
  const std::vector<std::string> channels = s.texts("channels");
  if (channels.size() != 6) s.fail("channels", "want six of fx, fy, fz, mx, my, mz, each once");
  for (std::size_t i = 0; i < 6; ++i) {
    int at = -1;
    for (int k = 0; k < 6; ++k)
      if (wrenchComponent(k).name == channels[i]) at = k;
    if (at < 0 || std::count(channels.begin(), channels.end(), channels[i]) > 1)
      s.fail("channels",
             fmt::format("'{}', want each of fx, fy, fz, mx, my, mz once", channels[i]));
    out.channels[i] = at;
  }
  out.scale = s.vector("scale", 6, -1e6, 1e6);
  if ((out.scale.array() == 0.0).any()) s.fail("scale", "has a 0");
  const int size = value == "int16" ? 2 : 4;
  if (out.value != Value::kText &&
      (out.first + 6 * size > out.length || static_cast<int>(out.sync.size()) > out.length))
    s.fail("length", fmt::format("{} bytes, want {} at least for six values from byte {} on",
                                 out.length, out.first + 6 * size, out.first));
  if (out.checksum != Checksum::kNone &&
      (out.checksum_from >= out.checksum_to || out.checksum_to > out.length ||
       out.checksum_at >= out.length))
    s.fail("checksum_over", "want the first byte and the one behind the last, inside the frame");
  s.finish();
  return out;
}

/// What `force_sensor` may say, and who reads the section that goes with it.
struct ForceSensorKind {
  std::string_view name;
  bool section;
  ForceSensorSource (*read)(Section& machine);
};
constexpr ForceSensorKind kForceSensors[] = {
    {"simulated", false, [](Section&) -> ForceSensorSource { return Simulated{}; }},
    {"external", false, [](Section&) -> ForceSensorSource { return External{}; }},
    {"net_ft", true, readNetFt},
    {"stream", true, readStream},
};
static_assert(std::size(kForceSensors) == std::variant_size_v<ForceSensorSource>,
              "each kind of force sensor has a line in kForceSensors");

/// The sections of those that are not chosen are looked at too, where they are given.
ForceSensorSource readForceSensor(Section& machine) {
  std::vector<std::string_view> names;
  for (const ForceSensorKind& kind : kForceSensors) names.push_back(kind.name);
  const std::string chosen = machine.choice("force_sensor", names);
  ForceSensorSource out;
  for (const ForceSensorKind& kind : kForceSensors) {
    if (kind.name != chosen && !(kind.section && machine.has(kind.name))) continue;
    const ForceSensorSource one = kind.read(machine);
    if (kind.name == chosen) out = one;
  }
  return out;
}

}  // namespace

MachinePieces readMachine(Section s, std::int64_t controller_period, Resonance& resonance) {
  MachinePieces m;
  const auto external = [&](const char* key) {
    return s.choice(key, {"simulated", "external"}) == "external";
  };
  m.external_legs = external("legs");
  m.external_robot = external("robot");
  m.external_switches = external("switches");
  m.force_sensor = readForceSensor(s);
  // A quick controller finds a new sample in every tick, whenever in it it wakes.
  m.period = std::min(s.integer("sample_period_ns", 200'000, 100'000'000), controller_period / 2);
  m.follow = s.number("follow_per_s", 1.0, 1e4);
  if (s.has("resonance")) {
    constexpr double kTurn = 2.0 * M_PI;
    Section told = s.section("resonance");
    // Only of simulated legs anything follows; what swings faster no controller notices.
    constexpr double kFastest = 200.0;  // [Hz]
    if (m.external_legs || resonance.frequency > kFastest * kTurn) resonance = {};
    const bool derived = resonance.frequency > 0.0;
    resonance.frequency =
        kTurn * told.numberOr("lowest_hz", 0.0, kFastest, resonance.frequency / kTurn);
    if (!derived) resonance.damping = resonance.frequency > 0.0 ? NAN : 1.0;
    resonance.damping = told.numberOr("damping_ratio", 0.0, 10.0, resonance.damping);
    resonance.feedback = told.numberOr("pressure_feedback_per_s", 0.0, 1e5, resonance.feedback);
    resonance.feedback_time =
        told.numberOr("pressure_feedback_s", 1e-3, 10.0, resonance.feedback_time);
    if (!derived && resonance.frequency == 0.0 &&
        (resonance.damping != 1.0 || resonance.feedback != 0.0))
      told.fail("lowest_hz",
                "nothing gives way here, want it above 0 beside damping_ratio or "
                "pressure_feedback_per_s");
    if (told.has("turning_gain"))  // older logs have none
      resonance.turning = told.numberOr("turning_gain", 0.5, 2.0, resonance.turning);
    told.finish();
  }
  s.finish();
  return m;
}

/// What the machine is, beside what everybody believes: factors on the robot's masses, on its
/// links' centres of mass, and on the servos.
void readPlantMismatch(Section s, plant::PlantConfig& p) {
  const auto factor = [&](const char* key, double& value) {
    if (s.has(key)) value *= s.number(key, 0.01, 100.0);
  };
  factor("gain_extend", p.actuator.gain_extend);
  factor("gain_retract", p.actuator.gain_retract);
  factor("tau", p.actuator.tau);
  if (p.hydraulic && s.has("tau")) p.hydraulic->leg.valve.frequency /= s.number("tau", 0.01, 100.0);
  const auto ofCylinders = [&](const char* key, std::initializer_list<double*> values) {
    if (!s.has(key)) return;
    const double by = s.number(key, 0.01, 100.0);
    if (!p.hydraulic) s.fail(key, "is of cylinders, want legs.model: hydraulic");
    for (double* value : values) *value *= by;
  };
  plant::HydraulicLegModel none;
  plant::HydraulicLegModel& leg = p.hydraulic ? p.hydraulic->leg : none;
  ofCylinders("bulk_modulus", {&leg.oil.bulk_modulus});
  ofCylinders("friction", {&leg.seals.coulomb, &leg.seals.breakaway, &leg.seals.bristle});
  ofCylinders("opening", {&leg.valve.opening});
  factor("sensor_cutoff", p.sensor.cutoff);
  const double mass = s.has("mass") ? s.number("mass", 0.01, 100.0) : 1.0;
  const double center = s.has("center") ? s.number("center", 0.0, 10.0) : 1.0;
  const auto change = [&](RigidBody& body) {
    body = scaledDensity(mass, body);
    body.p_BoBcm_B *= center;
  };
  change(p.payload.robot.base);
  for (int i = 0; i < p.payload.robot.size; ++i)
    change(p.payload.robot.links[static_cast<std::size_t>(i)].body);
  s.finish();
}

}  // namespace ves
