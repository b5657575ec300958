// SPDX-License-Identifier: BSD-3-Clause
//
// What a person reads of a commissioning.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "ves/core/coordinates.hpp"
#include "ves/identification/scenario.hpp"
#include "ves/validation/commissioning.hpp"

namespace ves {

std::vector<Table> tablesOf(const Series& series, const Commissioning& commissioning,
                            const Commissioned& f, const std::optional<ErrorForecast>& forecast) {
  std::vector<Table> out;
  if (forecast) {
    Table t{"Expected error of the emulation, rms over the base's travel",
            {"", "position", "rotation"},
            {}};
    const auto row = [&](const char* when, const EmulationError& e) {
      t.rows.push_back({when, fmt::format("{:.2f} %", 100.0 * e.position),
                        fmt::format("{:.2f} %", 100.0 * e.attitude)});
      if (!e.stopped.empty()) t.rows.back().front() += ", stopped by the " + e.stopped + " check";
    };
    row("as told, on the machine that was found", forecast->told);
    row("with this belief", forecast->believed);
    row("with this belief, off by what it allows", forecast->off);
    t.note =
        "Simulated. What the belief allows: masses, centres, the links' own inertia, servo gains "
        "and "
        "timing one after the other, root of the sum of squares.";
    if (!forecast->refused.empty()) t.note += " " + forecast->refused;
    out.push_back(std::move(t));
  }

  Table room{"Ranges used, from their middle", {"", "most", "want at most"}, {}};
  for (const RangeUse& one : f.ranges)
    room.rows.push_back({one.name, fmt::format("{:.0f} %", 100.0 * one.used),
                         fmt::format("{:.0f} %{}", 100.0 * RangeUse::kRoom,
                                     one.used <= RangeUse::kRoom ? "" : "  too little room")});
  room.note =
      "A channel that uses little of its range may have a larger sensor.gain: the most for it is "
      "the gain times what is wanted over what is used.";
  out.push_back(std::move(room));

  if (f.calibration) {
    Table t{"Calibration of the force-torque sensor",
            {"channel", "bias [count]", "of a sample", "of the bias"},
            {}};
    for (int i = 0; i < 6; ++i)
      t.rows.push_back({std::string(wrenchComponent(i).name),
                        fmt::format("{:.2f}", f.calibration->bias(i)),
                        fmt::format("{:.2f}", f.calibration->deviation(i)),
                        fmt::format("{:.3f}", f.calibration->standard_error(i))});
    out.push_back(std::move(t));
  }

  Table masses{"Masses of the robot", {"combination", "found", "deviation", "told"}, {}};
  if (f.masses) {
    const SeparableCombinations& c = f.masses->combinations;
    const Eigen::VectorXd told =
        c.C * massParameters(staticSetup(commissioning.experiment.controller).robot);
    for (Eigen::Index i = 0; i < c.rank(); ++i)
      masses.rows.push_back({c.names[static_cast<std::size_t>(i)],
                             fmt::format("{:.4f}", f.masses->estimate.beta(i)),
                             fmt::format("{:.4f}", f.masses->estimate.standard_deviation(i)),
                             fmt::format("{:.4f}", told(i))});
    masses.note = fmt::format(
        "kg and kg m. The robot is {:+.1f} % heavier than told. From {} looks in {} attitudes, "
        "which tell the weight's wrench to {:.3f} %.",
        100.0 * (f.masses->estimate.beta(0) / told(0) - 1.0), f.masses->rests.size(),
        commissioning.plan->attitudes.size(), 100.0 * f.masses->estimate.deviation);
  } else {
    masses.note = "Not found: " + f.no_masses + ".";
  }
  out.push_back(std::move(masses));

  Table servo{
      "Servos", {"leg", "extending [1/s]", "retracting [1/s]", "tau [ms]", "delay [ms]"}, {}};
  if (f.servo) {
    const auto cell = [&](Vec6 ServoModel::*value, int i, double scale) {
      return fmt::format("{:.3f} +- {:.3f}", scale * (f.servo->legs.servo.*value)(i),
                         scale * (f.servo->legs.deviation.*value)(i));
    };
    for (int i = 0; i < kLegs; ++i)
      servo.rows.push_back({fmt::format("{}", i + 1), cell(&ServoModel::extend, i, 1.0),
                            cell(&ServoModel::retract, i, 1.0), cell(&ServoModel::tau, i, 1e3),
                            cell(&ServoModel::delay, i, 1e3)});
    const auto found = [&](Vec6 ServoModel::*value, const char* name) {
      if ((f.servo->legs.servo.*value).isZero(0.0)) return;
      servo.header.push_back(name);
      for (int i = 0; i < kLegs; ++i)
        servo.rows[static_cast<std::size_t>(i)].push_back(cell(value, i, 1e6));
    };
    found(&ServoModel::opening, "open at null [um]");
    found(&ServoModel::friction, "seals take [um]");
    const auto& sensor = f.servo->sensor;
    servo.note = sensor ? fmt::format(
                              "The wrench comes {:.0f} +- {:.0f} us later than the servos "
                              "and its filter say, and shows {:.4f} +- {:.4f} of the "
                              "robot's inertia.",
                              1e6 * sensor->delay, 1e6 * sensor->delay_deviation, sensor->scale,
                              sensor->scale_deviation)
                        : "The wrench's time is not told: " + f.servo->why + ".";
  } else {
    servo.note = "Not found: " + f.no_servo + ".";
  }
  out.push_back(std::move(servo));

  std::vector<double> late, computing;
  for (const Row& row : series.rows) {
    if (!row.has_timing) continue;
    late.push_back(1e-6 * static_cast<double>(row.timing.late_ns));
    computing.push_back(1e-6 * static_cast<double>(row.timing.compute_ns));
  }
  if (!late.empty()) {
    Table t{"Timing of the loop", {"[ms]", "median", "worst"}, {}};
    const auto row = [&](const char* what, std::vector<double>& values) {
      std::sort(values.begin(), values.end());
      t.rows.push_back({what, fmt::format("{:.3f}", values[values.size() / 2]),
                        fmt::format("{:.3f}", values.back())});
    };
    row("wakes late by", late);
    row("computes for", computing);
    out.push_back(std::move(t));
  }
  return out;
}

}  // namespace ves
