// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "ves/acceptance/acceptance.hpp"
#include "ves/core/coordinates.hpp"
#include "ves/core/errors.hpp"
#include "ves/identification/scenario.hpp"

namespace ves {
namespace {

constexpr double kRest = 4.0;        // [s] stood still, for its noise
constexpr double kTriangle = 0.005;  // [m] of a triangle, either way
constexpr int kPasses = 4;           // [-] each way and speed
constexpr int kSteps = 12;           // [-] of acceleration
constexpr double kPush = 0.4;        // [s] of a step
constexpr double kBetween = 1.0;     // [s] at rest between them
constexpr double kSettles = 1.0;     // [s] at least, before a sine is looked at

/// Writes a program, segment by segment.
class ProgramText {
 public:
  /// The segment's number.
  int add(const std::string& segment, double seconds) {
    text_ += "  - " + segment + "\n";
    seconds_ += seconds;
    return size_++;
  }
  Value document() const {
    return parseDocument("program:\n" + text_, "acceptance").children.front();
  }
  double seconds() const { return seconds_; }

 private:
  std::string text_;
  double seconds_ = 0.0;
  int size_ = 0;
};

/// [s] of whole cycles, at least so many and so long.
double wholeCycles(double frequency, double cycles, double seconds) {
  return std::max(cycles, std::ceil(seconds * frequency - 1e-9)) / frequency;
}

/// Of a coordinate, from rest to rest at home: pushed, braked twice as long, pushed again.
std::vector<double> stepPath(double acceleration, double period) {
  const auto ticks = [&](double seconds) { return std::lround(seconds / period); };
  const double push = static_cast<double>(ticks(kPush)) * period, v = acceleration * push,
               x = 0.5 * v * push;
  std::vector<double> out(static_cast<std::size_t>(ticks(kBetween)), 0.0);
  for (int k = 0; k < kSteps; ++k) {
    const double way = k % 2 == 0 ? 1.0 : -1.0;
    for (long i = 1; i < ticks(4.0 * push); ++i) {
      const double t = static_cast<double>(i) * period, u = t - push, w = t - 3.0 * push;
      const double at = u <= 0.0   ? 0.5 * acceleration * t * t
                        : w <= 0.0 ? x + v * u - 0.5 * acceleration * u * u
                                   : x - v * w + 0.5 * acceleration * w * w;
      out.push_back(way * at);
    }
    out.insert(out.end(), static_cast<std::size_t>(ticks(kBetween)), 0.0);
  }
  return out;
}

}  // namespace

AcceptanceTest acceptanceTest(const Experiment& scenario, int coordinate,
                              const AcceptanceOptions& options) {
  constexpr double kFarther = 3.0, kMostAngle = 85.0 * kDegree;
  constexpr double kLeastLoad = 1.0;  // [kg] below which no acceleration is felt
  const ControllerConfig& c = scenario.controller;
  const Coordinate& names = ves::coordinate(coordinate);
  const bool turns = coordinate >= 3;
  AcceptanceTest out;
  out.coordinate = coordinate;
  out.radius = jointRadius(c.geometry);
  const double per_way = turns ? 1.0 / out.radius : 1.0;  // [rad/m | -]

  const double allowed = turns ? c.safety.rotation : c.safety.translation,
               farthest = turns ? std::min(kMostAngle, kFarther * allowed) : kFarther * allowed;
  out.down = travel(c.geometry, c.safety, coordinate, -1.0, farthest);
  out.up = travel(c.geometry, c.safety, coordinate, 1.0, farthest);
  const double way = std::min({out.down.distance, out.up.distance, allowed});
  const Vec6 rates = legLines(c.geometry, c.geometry.fromHome({})).J.col(coordinate).cwiseAbs();
  out.fastest = c.safety.leg_velocity / rates.maxCoeff();
  const JointVector& q = scenario.plant.task.initial_joints;
  const double room = accelerationRoom(c, q, coordinate);
  if (!(room > 0.0))
    throw InputError(fmt::format(
        "{}: the weight alone takes too much of the sensor's range, want a smaller sensor.gain",
        scenario.name));
  const bool loaded = compositeBody(carried(c.payload), q).mass >= kLeastLoad;
  out.hardest = loaded ? room : 0.0;
  out.slow = options.slow * per_way;
  out.step = options.step * per_way;

  ProgramText program;
  const std::string unit(names.yaml_unit), key(names.name);
  const auto shown = [&](double x) { return fmt::format("{:.9g}", x / names.yaml); };
  program.add("move: {}", 3.0);
  program.add("calibration: {}", 1.5);
  out.rest_segment = program.add(fmt::format("trajectory: {{duration_s: {}}}", kRest), kRest);

  constexpr double kCounts = 5.0;  // [-] of a leg, below which an amplitude is not measured
  const double least =
      kCounts * c.legs.scale.cwiseAbs().maxCoeff() / rates.maxCoeff();  // [m | rad]
  for (const double level : options.amplitudes)
    for (const double f : options.sines ? options.frequencies : std::vector<double>()) {
      const double w = 2.0 * M_PI * f;
      double most = std::min(way, out.fastest / w);
      if (loaded) most = std::min(most, sineRoom(room, w));
      const double settles = wholeCycles(f, 1.0, kSettles),
                   looks = wholeCycles(f, f < 0.5 ? 3.0 : 4.0, 2.0),
                   amplitude = level * options.share * most,
                   turn = 0.25 / f;  // where it ends at rest
      if (amplitude < least) {       // and farther on too
        out.skipped.push_back(
            fmt::format("at {:g} % from {:g} Hz on: amplitudes below {:g} counts of a leg",
                        100.0 * level, f, kCounts));
        break;
      }
      const std::string sine = fmt::format(
          "trajectory: {{duration_s: {:.6f}, {}: {{sine: {{amplitude_{}: {}, "
          "frequency_hz: {}}}}}}}",
          settles + looks + turn, key, unit, shown(amplitude), f);
      out.sines.push_back({program.add(sine, settles + looks + turn), f, amplitude, level, settles,
                           settles + looks});
      program.add("move: {}", 1.5);
    }

  const double half = std::min(kTriangle * per_way, options.share * way);
  for (const bool fast : {false, true}) {
    if (!options.passes) break;
    const double speed = (fast ? 2.0 : 1.0) * out.slow;
    double at = 0.0;
    const auto ramp = [&](double to) {
      const double time = std::abs(to - at) / speed;
      at = to;
      return program.add(
          fmt::format("trajectory: {{duration_s: {:.6f}, {}: {{ramp: {{to_{}: {}}}}}}}", time, key,
                      unit, shown(to)),
          time);
    };
    ramp(half);
    for (int k = 0; k < kPasses; ++k) {
      out.ramps.push_back({ramp(-half), false, fast});
      out.ramps.push_back({ramp(half), true, fast});
    }
    ramp(0.0);
  }

  if (options.steps) {
    std::string rows;
    const std::vector<double> path = stepPath(out.step, c.periodSeconds());
    const double top = *std::max_element(path.begin(), path.end());
    if (top > options.share * way)
      throw InputError(
          fmt::format("{}: {}: the step of acceleration needs more room than there is, "
                      "want a --step of at most {:.2g}",
                      scenario.name, key, 0.9 * options.step * options.share * way / top));
    for (const double x : path) {
      rows += rows.empty() ? "[" : ", [";
      for (int i = 0; i < 6; ++i)
        rows += fmt::format("{}{}", i ? ", " : "", i == coordinate ? shown(x) : "0");
      rows += "]";
    }
    out.step_segment = program.add("path: {rows_m_deg: [" + rows + "]}",
                                   static_cast<double>(path.size()) * c.periodSeconds());
  }
  out.seconds = program.seconds() + 3.0;

  Value document = scenario.source.document;
  document.erase("environment");
  document.put("program", program.document());
  Value name = *document.find("name"), about = name;
  name.text = fmt::format("accept_{}_{}", key, scenario.name).substr(0, 100);
  about.text = fmt::format("{} of {} alone, as ves accept moves it.", key, scenario.name);
  document.put("name", name);
  document.put("description", about);
  out.experiment = buildExperiment(std::move(document));
  return out;
}

}  // namespace ves
