// SPDX-License-Identifier: BSD-3-Clause
#include "reproduction.hpp"

#include <algorithm>
#include <cmath>

#include "ves/analysis/appendix_e.hpp"
#include "ves/analysis/loop.hpp"

namespace ves {
namespace {

/// The roots of (E.11), and where the third leaves the unit circle.
void sampledFeedback(Reproduction& r) {
  std::vector<Panel> panels = {
      {"mass ratio m1/m [-]", "magnitude of the pair [-]", {}, false},
      {"mass ratio m1/m [-]", "magnitude of the third root [-]", {}, false}};
  TableRows rows;
  double first = 0.0, last = HUGE_VAL;
  int rising = 0;  // [-] steps in which the limit does not fall
  for (int f = 10; f <= 100; f += 10) {
    const bool named = f == 10 || f == 100;
    Line pair{named ? fmt::format("f/F = {}", f) : "",
              {},
              {},
              f == 10    ? 1
              : f == 100 ? 2
                         : 0,
              false};
    Line third = pair;
    for (int i = 0; i <= 200; ++i) {
      const double ratio = i / 100.0;
      const auto z = roots({ratio, static_cast<double>(f), 0.5});
      pair.x.push_back(ratio);
      pair.y.push_back(std::abs(z[0]));
      third.x.push_back(ratio);
      third.y.push_back(std::abs(z[2]));
    }
    double lo = 0.0, hi = 5.0;  // the third root grows with the ratio
    for (int i = 0; i < 60; ++i) {
      const double mid = 0.5 * (lo + hi);
      (std::abs(roots({mid, static_cast<double>(f), 0.5})[2]) < 1.0 ? lo : hi) = mid;
    }
    const double limit = lo;
    rising += !(limit < last);
    last = limit;
    if (f == 10) first = limit;
    panels[0].lines.push_back(pair);
    panels[1].lines.push_back(third);
    rows.push_back({std::to_string(f),
                    fmt::format("{:.4f}", std::abs(roots({0.5, double(f), 0.5})[0])),
                    fmt::format("{:.4f}", std::abs(roots({0.5, double(f), 0.5})[2])),
                    fmt::format("{:.4f}", std::abs(roots({1.0, double(f), 0.5})[0])),
                    fmt::format("{:.4f}", std::abs(roots({1.0, double(f), 0.5})[2])),
                    fmt::format("{:.4f}", limit)});
    r.numbers["appendix_e"]["mass_ratio_limit_zeta_0.5"].push_back(
        {{"samples_per_period", f}, {"mass_ratio", limit}});
  }
  const double undamped = std::abs(roots({1.0, 1e5, 0.0})[2]);
  r.claim("third_root",
          {{"at_10", first}, {"at_100", last}, {"undamped", undamped}, {"rising_steps", rising}});
  r.page.figure(
      "Figure E.4: (a) the pair, (b) the third root, zeta = 0.5, f/F from 10 (orange) to 100 "
      "(green) in steps of 10.",
      panels, "./ves stability map");
  r.page.table(
      {"f/F", "pair at 0.5", "third at 0.5", "pair at 1", "third at 1", "largest stable m1/m"},
      rows);
}

/// Mass ratios of the eight runs, and how many modes the machine's loop holds.
void massRatiosOfTheRuns(Reproduction& r) {
  r.page.text(
      "Eigenvalues of M^-1 M1 (E.20) with the modes that are kept and with six, and how many "
      "modes this machine's loop holds (servo, sensor filter and hold included):");
  TableRows table;
  double kept_below = 0, six_below = 0, of = 0;  // [-] runs
  for (const std::string robot : kRobots)
    for (const std::string configuration : kConfigurations) {
      const std::string scenario = "srms_" + configuration + "_" + robot;
      const Experiment e = r.load(scenario), six = r.load(scenario, {"base.keep_modes=6"});
      const Experiment filtered = r.load(scenario, {"base.keep_modes=6", "legs.filters=outputs"});
      const JointVector& q = e.plant.task.initial_joints;
      const Loop loop = loopOf(six.controller, q, Direction::kExtending);
      const double ratio = massRatios(linearised(e.controller.vehicle), loop.robot_P)(0);
      const double ratio_six = massRatios(loop.base, loop.robot_P)(0);
      const int none = stableModes(six.controller, q);
      const int outputs = stableModes(filtered.controller, q);
      kept_below += ratio <= 1.0;
      six_below += ratio_six <= 1.0;
      ++of;
      table.push_back({title(configuration, robot),
                       fmt::format("{}", linearised(e.controller.vehicle).stiffness.size()),
                       fmt::format("{:.2f}", ratio), fmt::format("{:.2f}", ratio_six),
                       fmt::format("{}{}", none, none == 6 ? " (of 6)" : ""),
                       fmt::format("{}", outputs)});
      Numbers& n = r.numbers["appendix_e"]["mass_ratios"][configuration + "_" + robot];
      n["kept"] = ratio;
      n["six_modes"] = ratio_six;
      n["stable_modes_filters_none"] = none;
      n["stable_modes_filters_outputs"] = outputs;
    }
  r.claim("mass_ratio", {{"kept", kept_below}, {"six", six_below}, {"runs", of}});
  r.page.table({"", "modes kept", "largest ratio", "with six modes", "stable modes, none",
                "stable modes, outputs"},
               table);
}

}  // namespace

void stabilitySection(Reproduction& r) {
  r.page.section("Appendix E: stability of the sampled force feedback");
  sampledFeedback(r);
  massRatiosOfTheRuns(r);
}

}  // namespace ves
