// SPDX-License-Identifier: BSD-3-Clause
#include "reproduction.hpp"

#include <cmath>
#include <fstream>

#include "ves/identification/pose_plan.hpp"
#include "ves/identification/scenario.hpp"
#include "ves/results/static_intervals.hpp"

namespace ves {

namespace fs = std::filesystem;

/// The robot's masses once more, from what the sensor feels while nothing moves.
void massesSection(Reproduction& r) {
  r.page.section("Appendix B: mass parameters");
  r.page.text(
      "Robot and platform go through a plan of poses; where both stand still, the sensor's mean "
      "readings, forces and all three moments, give every combination of masses and first "
      "moments that can be told apart, beside the sensor's biases. m: mass, m x, m y, m z: first "
      "moment in the link's own frame, link 0 with all plates. The last column is the error in "
      "standard deviations.");
  Quantities found;
  double squares = 0.0, within = 0.0, of = 0.0;
  for (const std::string robot : kRobots) {
    const std::string scenario = robot + "_on_table_4_1";
    const fs::path base = fs::absolute(findScenario(scenario, r.config));
    const Experiment e = loadExperiment(base);
    const StaticSetup setup = staticSetup(e.controller);
    const SeparableCombinations c = separableCombinations(setup.robot);
    const PosePlan plan = planPoses(setup, c, e.controller, e.plant.initial_joints, {});
    const fs::path file = r.scratch / "identify.yaml";
    constexpr double kSpeed = 30.0;  // [deg/s]
    std::ofstream(file) << scenarioOf(plan, e, "identify_" + robot, base.string(), kSpeed);
    const Reproduction::Run run = r.record("identify " + robot, loadExperiment(file));
    fs::remove(file);
    const std::vector<StaticInterval> intervals = staticIntervals(run.series);
    const MassEstimate m = estimateMasses(setup, c, intervals);
    const Eigen::VectorXd truth = c.C * massParameters(carried(e.plant.payload));
    TableRows rows;
    for (Eigen::Index i = 0; i < c.rank(); ++i) {
      const double z = (m.beta(i) - truth(i)) / m.standard_deviation(i);
      squares += z * z;
      within += std::abs(z) < 3.0;
      of += 1.0;
      rows.push_back({c.names[static_cast<std::size_t>(i)], fmt::format("{:.4f}", m.beta(i)),
                      fmt::format("{:.4f}", m.standard_deviation(i)),
                      fmt::format("{:.4f}", truth(i)), fmt::format("{:+.1f}", z)});
    }
    r.page.table({fmt::format("{}, {} poses [kg, kg m]", robot == "puma" ? "PUMA 560" : "DOSS",
                              intervals.size()),
                  "identified", "deviation", "truth", "error"},
                 rows);
    found[robot] = static_cast<double>(c.rank());
    found[robot + "_of"] = static_cast<double>(c.C.cols());
    Numbers& n = r.numbers["appendix_b"][robot];
    n["separable"] = c.rank();
    n["parameters"] = c.C.cols();
    n["poses"] = intervals.size();
    n["condition"] = m.condition;
    n["total_mass_error_kg"] = m.beta(0) - truth(0);
  }
  found["within"] = within;
  found["of"] = of;
  found["within_share"] = within / of;
  found["rms"] = std::sqrt(squares / of);
  r.claim("mass_parameters", found);
}

}  // namespace ves
