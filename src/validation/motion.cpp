// SPDX-License-Identifier: BSD-3-Clause
#include "reproduction.hpp"

#include <cmath>

namespace ves {
namespace {

/// Commanded minus actual, as it is shown.
auto error(int i) {
  return [i](const Row& row) {
    return (row.state.x_desired[i] - row.truth.x[i]) * coordinate(i).shown;
  };
}

void trajectories(Reproduction& r) {
  r.page.section("4.2.1 Trajectory control");
  const Reproduction::Run z = r.run("z_sine");
  Numbers of_z = summarise(z.series, z.result);
  const double extending = of_z["z_error_max_extending_m"].get<double>();
  const double retracting = of_z["z_error_max_retracting_m"].get<double>();
  r.numbers["z_sine"]["z_error_max_extending_m"] = extending;
  r.numbers["z_sine"]["z_error_max_retracting_m"] = retracting;
  // A linear servo lags by its speed over its velocity gain.
  const ServoModel& servo = z.series.experiment.controller.servo;
  const auto linear = [](double gain) { return 0.2 * 2.0 * M_PI * 0.5 / gain; };  // [m]
  r.claim("z_lag", {{"extending_mm", extending * kMilli},
                    {"retracting_mm", retracting * kMilli},
                    {"linear_extending_mm", linear(servo.extend(0)) * kMilli},
                    {"linear_retracting_mm", linear(servo.retract(0)) * kMilli},
                    {"extending_share", extending / linear(servo.extend(0))},
                    {"retracting_share", retracting / linear(servo.retract(0))}});
  auto panels = tracking(z.series, SegmentKind::kTrajectory, {2});
  panels.push_back({kSinceSegment,
                    "z error [mm]",
                    {lineOf("", z.series, SegmentKind::kTrajectory, 0, error(2))},
                    false});
  r.page.figure("Figures 4.4 and 4.5: z, and commanded minus actual.", panels,
                "./ves run z_sine --lockstep");

  const Reproduction::Run alpha = r.run("alpha_sine");
  const double most = summarise(alpha.series, alpha.result)["alpha_error_max_rad"].get<double>();
  r.numbers["alpha_sine"]["alpha_error_max_rad"] = most;
  panels = tracking(alpha.series, SegmentKind::kTrajectory, {3});
  panels.push_back({kSinceSegment,
                    "alpha error [deg]",
                    {lineOf("", alpha.series, SegmentKind::kTrajectory, 0, error(3))},
                    false});
  r.page.figure("Figures 4.6 and 4.7: alpha, and commanded minus actual.", panels,
                "./ves run alpha_sine --lockstep");
}

void freeDecay(Reproduction& r) {
  r.page.section("4.2.2 Free decay of Table 4.1");
  const Reproduction::Run run = r.run("free_decay");
  Numbers summary = summarise(run.series, run.result);
  for (const Coordinate& c : kCoordinates) {
    const std::string key = fmt::format("{}_error_max_{}", c.name, c.unit);
    r.numbers["free_decay"][key] = summary[key].get<double>();
  }
  const char* const command = "./ves run free_decay --lockstep";
  r.page.figure("Figure 4.8: commanded and actual pose.",
                tracking(run.series, SegmentKind::kAdmittance, {0, 1, 2, 3, 4, 5}), command);
  std::vector<Panel> errors;
  for (const int first : {0, 3}) {
    Panel panel{kSinceSegment, first == 0 ? "error [mm]" : "error [deg]", {}, false};
    for (int k = 0; k < 3; ++k)
      panel.lines.push_back(lineOf(std::string(coordinate(first + k).name), run.series,
                                   SegmentKind::kAdmittance, k, error(first + k)));
    errors.push_back(panel);
  }
  r.page.figure("Figures 4.9 and 4.10: commanded minus actual position and attitude.", errors,
                command);
}

}  // namespace

void motionSection(Reproduction& r) {
  trajectories(r);
  freeDecay(r);
}

}  // namespace ves
