// SPDX-License-Identifier: BSD-3-Clause
#include "reproduction.hpp"

#include <cmath>
#include <fstream>

#include "ves/identification/pose_plan.hpp"
#include "ves/identification/scenario.hpp"
#include "ves/evaluation/static_intervals.hpp"

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
  struct Found {
    double squares = 0.0, within = 0.0, of = 0.0, rank = 0.0, parameters = 0.0;
  } each[std::size(kRobots)];
  r.parts(std::size(kRobots), [&](Reproduction& piece, std::size_t k) {
    const std::string robot = kRobots[k];
    Found& f = each[k];
    const std::string scenario = robot + "_on_table_4_1";
    const fs::path base = fs::absolute(findScenario(scenario, piece.config));
    const Experiment e = loadExperiment(base);
    const StaticSetup setup = staticSetup(e.controller);
    const SeparableCombinations c = separableCombinations(setup.robot);
    const PosePlan plan = planPoses(setup, c, e.controller, e.plant.task.initial_joints, {});
    const fs::path file = piece.scratch / ("identify_" + robot + ".yaml");
    std::ofstream(file) << scenarioOf(plan, e, "identify_" + robot, base.string());
    const Reproduction::Run run = piece.record("identify " + robot, loadExperiment(file));
    fs::remove(file);
    const std::vector<StaticInterval> intervals = staticIntervals(run.series);
    const MassEstimate m = estimateMasses(setup, c, intervals);
    const Eigen::VectorXd truth = c.C * massParameters(carried(e.plant.payload));
    TableRows rows;
    for (Eigen::Index i = 0; i < c.rank(); ++i) {
      const double z = (m.beta(i) - truth(i)) / m.standard_deviation(i);
      f.squares += z * z;
      f.within += std::abs(z) < 3.0;
      f.of += 1.0;
      rows.push_back({c.names[static_cast<std::size_t>(i)], fmt::format("{:.4f}", m.beta(i)),
                      fmt::format("{:.4f}", m.standard_deviation(i)),
                      fmt::format("{:.4f}", truth(i)), fmt::format("{:+.1f}", z)});
    }
    piece.page.table({fmt::format("{}, {} poses [kg, kg m]", robot == "puma" ? "PUMA 560" : "DOSS",
                                  intervals.size()),
                      "identified", "deviation", "truth", "error"},
                     rows);
    f.rank = static_cast<double>(c.rank());
    f.parameters = static_cast<double>(c.C.cols());
    Numbers& n = piece.numbers["appendix_b"][robot];
    n["separable"] = c.rank();
    n["parameters"] = c.C.cols();
    n["poses"] = intervals.size();
    n["condition"] = m.condition;
    n["total_mass_error_kg"] = m.beta(0) - truth(0);
  });
  Quantities found;
  double squares = 0.0, within = 0.0, of = 0.0;
  for (std::size_t k = 0; k < std::size(kRobots); ++k) {
    squares += each[k].squares;
    within += each[k].within;
    of += each[k].of;
    found[kRobots[k]] = each[k].rank;
    found[kRobots[k] + std::string("_of")] = each[k].parameters;
  }
  found["within"] = within;
  found["of"] = of;
  found["within_share"] = within / of;
  found["rms"] = std::sqrt(squares / of);
  r.claim("mass_parameters", found);
}

}  // namespace ves
