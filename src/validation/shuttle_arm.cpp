// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "reproduction.hpp"
#include "ves/analysis/loop.hpp"
#include "ves/page/still.hpp"

namespace ves {
namespace {

constexpr const char* kFilters[] = {"none", "outputs"};
constexpr const char* kPlaces[] = {"space", "earth"};
constexpr const char* kNoise[] = {"quiet", "noisy"};
constexpr int kManyModes = 12;  // [-] all below 50 Hz

std::string milliradians(double x) { return fmt::format("{:.3f}", x * kMilli); }

/// What all eight runs leave: rows of tables, and the extremes that the claims are about.
struct EightRuns {
  TableRows distances, attitudes, damping, sizes;
  double worst_puma = 0.0;                            // [-] rms by largest displacement
  double worst_split = 0.0;                           // [-] of the largest displacement
  double largest = 0.0, largest_half = 0.0;           // [m] stiffness as estimated, half of it
  double smallest_doss = HUGE_VAL, largest_doss = 0;  // [m]
  double least_added = HUGE_VAL;                      // [-] damping ratio

  void add(const EightRuns& one) {
    const auto join = [](TableRows& all, const TableRows& more) {
      all.insert(all.end(), more.begin(), more.end());
    };
    join(distances, one.distances);
    join(attitudes, one.attitudes);
    join(damping, one.damping);
    join(sizes, one.sizes);
    worst_puma = std::max(worst_puma, one.worst_puma);
    worst_split = std::max(worst_split, one.worst_split);
    largest = std::max(largest, one.largest);
    largest_half = std::max(largest_half, one.largest_half);
    smallest_doss = std::min(smallest_doss, one.smallest_doss);
    largest_doss = std::max(largest_doss, one.largest_doss);
    least_added = std::min(least_added, one.least_added);
  }
};

Motion simulated(const Experiment& e, InteractionModel model) {
  InteractionOptions options;
  options.model = model;
  return motion(simulate(interactionOf(e, options.duration), options));
}

/// Both motions in one panel: six lines of three coordinates.
Panel bothIn(const Motion& srms, const Motion& ves, const Experiment& e, bool position) {
  Panel panel{kSinceAdmittance,
              position ? "position [mm]" : "orientation [deg]",
              {},
              false,
              robotMarks(e, admittanceSegment(e.controller.program))};
  for (const bool platform : {false, true}) {
    const Motion& m = platform ? ves : srms;
    for (int i = position ? 0 : 3; i < (position ? 3 : 6); ++i) {
      Line l{platform ? "" : std::string(coordinate(i).name), m.t, {}, i % 3, platform};
      for (const Vec6& x : m.x) l.y.push_back(x(i) * coordinate(i).shown);
      panel.lines.push_back(l);
    }
  }
  return panel;
}

/// The robot on the arm without a platform: with the split of the wrench and without, with many
/// modes, and with half the stiffness. Returns SRMS-robot's motion.
Motion onTheArmAlone(Reproduction& r, const std::string& configuration, const std::string& robot,
                     EightRuns& all) {
  const std::string scenario = "srms_" + configuration + "_" + robot;
  const Experiment e = r.load(scenario);
  r.substitutes = std::max(r.substitutes, e.source.substitutes);
  const std::string more = fmt::format("base.keep_modes={}", kManyModes);
  const Motion srms = simulated(e, InteractionModel::kSplit);
  const Distance travelled = travel(srms),
                 split = distance(srms, simulated(e, InteractionModel::kWhole));
  // Nothing of these runs is sampled, so the loop's stability does not matter.
  const auto peak = [&](const Overrides& set) {
    const Experiment changed = loadExperiment(findScenario(scenario, r.config), set);
    return travel(simulated(changed, InteractionModel::kWhole)).peak_position;
  };
  const double full = peak({more}), half = peak({more, "base.arm.stiffness_scale=0.5"});
  const auto modes = linearised(e.controller.vehicle).stiffness.size();
  Numbers& n = r.numbers["srms"][configuration + "_" + robot];
  n["modes_kept"] = modes;
  n["displacement_max_m"] = travelled.peak_position;
  n["rotation_max_rad"] = travelled.peak_attitude;
  n["displacement_max_12_modes_m"] = full;
  n["displacement_max_12_modes_half_stiffness_m"] = half;
  n["split_error_max_m"] = split.peak_position;
  all.largest = std::max(all.largest, full);
  all.largest_half = std::max(all.largest_half, half);
  all.worst_split = std::max(all.worst_split, split.peak_position / travelled.peak_position);
  if (robot == "doss") {
    all.smallest_doss = std::min(all.smallest_doss, full);
    all.largest_doss = std::max(all.largest_doss, half);
  }
  all.sizes.push_back({title(configuration, robot), fmt::format("{}", modes),
                       mm(travelled.peak_position), mm(full), mm(half),
                       percent(split.peak_position / travelled.peak_position)});
  return srms;
}

/// The same robot and arm on the machine: filters, gravity and noise in all combinations.
void onTheMachine(Reproduction& r, const std::string& configuration, const std::string& robot,
                  const Motion& srms, int figure, EightRuns& all) {
  const std::string scenario = "srms_" + configuration + "_" + robot;
  Numbers& n = r.numbers["srms"][configuration + "_" + robot];
  const Distance travelled = travel(srms);
  std::vector<std::string> distances = {title(configuration, robot), mm(travelled.peak_position)},
                           attitudes = {title(configuration, robot),
                                        milliradians(travelled.peak_attitude)};
  std::vector<Panel> panels;
  for (const std::string filters : kFilters)
    for (const std::string place : kPlaces)
      for (const std::string noise : kNoise) {
        const Reproduction::Run run =
            r.run(scenario,
                  {"legs.filters=" + filters, place == "space" ? "gravity_m_per_s2=0" : "seed=1",
                   noise == "quiet" ? "sensor.noise=false" : "seed=1"});
        const Motion ves = commanded(run.series);
        const Distance d = distance(ves, srms), of_platform = distance(actual(run.series), srms);
        Numbers& out = n["ves"][filters + "_" + place + "_" + noise];
        out["ended"] = name(run.result.phase);
        out["position_error_rms_m"] = d.rms_position;
        out["position_error_max_m"] = d.peak_position;
        out["attitude_error_rms_rad"] = d.rms_attitude;
        out["attitude_error_max_rad"] = d.peak_attitude;
        out["platform_position_error_rms_m"] = of_platform.rms_position;
        out["platform_attitude_error_rms_rad"] = of_platform.rms_attitude;
        distances.push_back(mm(d.rms_position) + " / " + mm(d.peak_position));
        attitudes.push_back(milliradians(d.rms_attitude) + " / " + milliradians(d.peak_attitude));
        if (filters != "outputs" || place != "space") continue;
        panels.push_back(bothIn(srms, ves, run.series.experiment, true));
        panels.push_back(bothIn(srms, ves, run.series.experiment, false));
        if (noise == "quiet" && robot == "puma")
          all.worst_puma = std::max(all.worst_puma, d.rms_position / travelled.peak_position);
      }
  all.distances.push_back(distances);
  all.attitudes.push_back(attitudes);
  r.page.figure(
      fmt::format("Figures 4.{} and 4.{}: {}, {} modes, in free space. Solid SRMS-robot, dashed "
                  "what the VES commands with Filters 1 to 3; sensor noise off above, on below.",
                  figure, figure + 1, title(configuration, robot),
                  n["modes_kept"].get<std::int64_t>()),
      panels,
      fmt::format("./ves run {} --lockstep --set legs.filters=outputs --set gravity_m_per_s2=0",
                  scenario));
}

/// Lets go every mode of base and robot from a centimetre and a half, the robot at rest.
void ringDowns(Reproduction& r, const std::string& configuration, const std::string& robot,
               EightRuns& all) {
  const std::string scenario = "srms_" + configuration + "_" + robot;
  Numbers& n = r.numbers["srms"][configuration + "_" + robot];
  std::int64_t duration = 0;
  const std::vector<CoupledMode> modes = coupledModes(interactionOf(r.load(scenario), duration));
  for (std::size_t j = 0; j < modes.size(); ++j) {
    std::vector<std::string> row = {j ? "" : title(configuration, robot),
                                    fmt::format("{:.3f}", modes[j].frequency),
                                    fmt::format("{:.4f}", modes[j].damping_ratio)};
    Numbers mode = {{"frequency_hz", modes[j].frequency},
                    {"damping_ratio", modes[j].damping_ratio}};
    for (const std::string filters : kFilters) {
      const Reproduction::Run run = r.run(
          scenario,
          {"legs.filters=" + filters, "gravity_m_per_s2=0", "sensor.noise=false", letGo(modes[j])});
      const RingDown fit = ringDown(commanded(run.series), modes[j]);
      const double added = fit.damping_ratio - modes[j].damping_ratio;
      all.least_added = std::min(all.least_added, added);
      row.push_back(fmt::format("{:.3f}", fit.frequency));
      row.push_back(fmt::format("{:+.4f}", added));
      mode["ves_" + filters] = {{"frequency_hz", fit.frequency},
                                {"damping_ratio", fit.damping_ratio},
                                {"damping_ratio_added", added}};
    }
    all.damping.push_back(row);
    n["modes"].push_back(mode);
  }
}

void tables(Reproduction& r, const EightRuns& all) {
  r.page.text("Largest displacement of the end effector [mm], without platform:");
  r.page.table(
      {"", "modes kept", "those modes", "12 modes", "12 modes, half stiffness", "split off by [%]"},
      all.sizes);
  r.page.text(
      "VES from SRMS-robot, position, rms / peak [mm]. Displacement beside it is SRMS-robot's "
      "largest. none, outputs: Filters 1 to 3 absent, or on the legs' outputs. Earth: gravity, "
      "compensated.");
  std::vector<std::string> header = {
      "",           "displacement",   "none, space", "with noise",     "none, Earth",
      "with noise", "outputs, space", "with noise",  "outputs, Earth", "with noise"};
  r.page.table(header, all.distances);
  r.page.text("The same for the attitude, rms / peak [mrad]:");
  header[1] = "rotation";
  r.page.table(header, all.attitudes);
  r.page.text(
      "Damping of base and robot together: each mode let go from 15 mm with the robot at rest, in "
      "free space and without noise, fitted until a twentieth is left. What the VES adds comes "
      "from the lag of servo and filters:");
  r.page.table({"", "SRMS-robot [Hz]", "zeta", "VES, none [Hz]", "zeta added", "VES, outputs [Hz]",
                "zeta added"},
               all.damping);
}

/// Chapter 3's own: A inverted every N steps only.
void shortcut(Reproduction& r) {
  const Experiment e = r.load("srms_capture_doss");
  InteractionOptions options;
  const Interaction interaction = interactionOf(e, options.duration);
  const Motion exact = motion(simulate(interaction, options));
  std::string text;
  for (const int steps : {1, 10, 100}) {
    options.hold_mass = steps;
    const double share = distance(motion(simulate(interaction, options)), exact).peak_position /
                         travel(exact).peak_position;
    r.numbers["srms"]["hold_mass_error_share"].push_back({{"steps", steps}, {"share", share}});
    text +=
        fmt::format("{}{:.3f} percent for N = {}", text.empty() ? "" : ", ", 100.0 * share, steps);
  }
  r.page.text(
      "The report's shortcut, A of (3.11) computed every N steps of 10 ms only (capture, DOSS), "
      "errs by " +
      text + " of the largest displacement.");
}

/// More modes than the loop holds: the run must end itself.
void divergence(Reproduction& r) {
  const std::string scenario = "srms_deploy_doss";
  const Overrides set = {"base.keep_modes=6", "legs.filters=outputs",
                         "controller.stability=forced"};
  const Experiment e = r.load(scenario, set);
  const DominantRoot s =
      dominantRoot(loopOf(e.controller, e.plant.task.initial_joints, Direction::kExtending));
  const Reproduction::Run run = r.run(scenario, set);
  const RunResult& result = run.result;
  r.numbers["divergence"] = {
      {"scenario", scenario},
      {"modes_kept", 6},
      {"stable_modes", stableModes(e.controller, e.plant.task.initial_joints)},
      {"growth_per_s", s.growth},
      {"frequency_hz", s.frequency},
      {"stopped_by", name(result.cause)},
      {"ended", name(result.phase)}};
  r.page.text(fmt::format(
      "With six modes kept the deploy configuration with the DOSS diverges, as the model of the "
      "loop says ({:.1f} Hz, e-fold in {:.2f} s): the run {} by itself, cause: {}.",
      s.frequency, 1.0 / s.growth, result.good() ? "did not stop" : "stopped",
      result.cause == Check::kCount ? "none" : std::string(name(result.cause))));
}

}  // namespace

void shuttleArmSection(Reproduction& r) {
  r.page.section("4.3 PUMA 560 and DOSS on the Shuttle's arm");
  r.page.text(
      "SRMS-robot is chapter 3: the robot on the arm in free space, integrated without platform, "
      "sensor or sampling, with the report's split of the wrench. VES is controller and plant: the "
      "wrench measured, the modes stepped at 100 Hz, the platform moved. Both keep the same modes: "
      "as many as the machine's loop holds stable. Distances are of the commanded motion, as in "
      "the report, and Euclidean.");
  const Experiment shown = r.load("srms_low_hover_puma");
  r.page.drawings(
      "The PUMA 560 on the platform, and on the arm whose tip the platform pretends to be "
      "(low hover).",
      {stillAtStart(shown, StillView::kPlatform), stillAtStart(shown, StillView::kArm)});
  EightRuns runs[kRuns], all;
  r.parts(kRuns, [&](Reproduction& piece, std::size_t i) {
    const auto& [configuration, robot] = runOf(i);
    const int figure = 11 + 2 * static_cast<int>(i);
    const Motion srms = onTheArmAlone(piece, configuration, robot, runs[i]);
    onTheMachine(piece, configuration, robot, srms, figure, runs[i]);
    ringDowns(piece, configuration, robot, runs[i]);
  });
  for (const EightRuns& one : runs) all.add(one);
  r.claim("puma_on_srms",
          {{"error_percent", 100.0 * all.worst_puma}, {"least_added", all.least_added}});
  r.claim("doss_on_srms",
          {{"least_cm", 100.0 * all.smallest_doss}, {"most_cm", 100.0 * all.largest_doss}});
  r.claim("two_centimetres",
          {{"most_cm", 100.0 * all.largest}, {"most_half_cm", 100.0 * all.largest_half}});
  r.claim("split", {{"percent", 100.0 * all.worst_split}});
  r.numbers["srms"]["displacement_max_m"] = all.largest;
  r.numbers["srms"]["displacement_max_half_stiffness_m"] = all.largest_half;
  r.numbers["srms"]["split_error_max_share"] = all.worst_split;
  tables(r, all);
  shortcut(r);
  divergence(r);
}

}  // namespace ves
