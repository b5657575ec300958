// SPDX-License-Identifier: BSD-3-Clause
//
// ves srms: the flexible base and the robot on it, without platform (report, chapter 3).
#include <fmt/ranges.h>

#include <fstream>

#include "commands.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "print.hpp"
#include "ves/config/base.hpp"
#include "ves/core/coordinates.hpp"

namespace ves::app {
namespace {

int showModes(const std::string& name, const std::vector<std::string>& overrides) {
  const Base base = loadBase(findBase(name, configFolder()), overrides);
  const ModalModel m = linearised(base.vehicle);
  if (m.stiffness.size() == 0)
    throw InputError(fmt::format("{}: gives way to no force, and has no modes", name));
  fmt::print("{:>4} {:>10} {:>8} {:>12}  {}\n", "mode", "[Hz]", "zeta", "mass [kg]",
             "shape at the robot's foot, in P: x y z [m], alpha beta gamma [rad]");
  for (Eigen::Index i = 0; i < m.stiffness.size(); ++i) {
    const double omega = std::sqrt(m.stiffness(i));
    const Vec6 shape = m.Phi.col(i);
    fmt::print("{:>4} {:>10.4f} {:>8.4f} {:>12.1f}  ", i + 1, omega / (2.0 * M_PI),
               omega > 0.0 ? m.damping(i, i) / (2.0 * omega) : 0.0,
               1.0 / shape.head<3>().squaredNorm());
    for (double s : shape) fmt::print("{:>9.5f}", std::abs(s) < 5e-6 ? 0.0 : s);
    fmt::print("\n");
  }
  fmt::print("mass: of a point at the foot with the same momentum; shapes are mass-normalised\n");
  if (!base.arm) return kDone;
  const Mat6 C = tipCompliance(*base.arm);
  fmt::print("\n{} degrees of freedom; stiffness at the foot, other directions free:\n ",
             base.arm->frame.dofs());
  for (int i = 0; i < 6; ++i)
    fmt::print(" {} {:.0f} {}{}", coordinate(i).name, 1.0 / C(i, i), i < 3 ? "N/m" : "N m/rad",
               i < 5 ? "," : "\n");
  return kDone;
}

/// The straight arm beside what has been published of it.
int showPublished() {
  const PublishedArm published = loadPublished(configFolder() / "arms" / "straight_arm.yaml");
  fmt::print("straight arm without mass, natural frequencies with a payload [Hz]\n");
  for (const PublishedFrequencies& row : published.rows) {
    const Vec6 ours = masslessFrequencies(published.arm, row.payload_P);
    fmt::print("{}\n", row.name);
    const auto line = [](const char* name, const char* format, const Vec6& values) {
      fmt::print("  {:<12}", name);
      for (double v : values) fmt::print(fmt::runtime(format), v);
      fmt::print("\n");
    };
    line("published", "{:>9.4f}", row.frequency);
    line("this model", "{:>9.4f}", ours);
    line("difference", "{:>+8.1f}%", 100.0 * (ours.cwiseQuotient(row.frequency) - Vec6::Ones()));
  }
  return kDone;
}

struct Range {
  Vec6 low = Vec6::Constant(HUGE_VAL), high = Vec6::Constant(-HUGE_VAL);
  void add(const Vec6& x) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  Vec6 size() const { return high - low; }
};

/// Both models of chapter 3, and how far the report's split is from the whole.
int simulateBoth(const std::string& scenario, const std::vector<std::string>& overrides,
                 InteractionOptions options, const std::string& file) {
  const Experiment e = loadExperiment(findScenario(scenario, configFolder()), overrides);
  printWarnings(e);
  const Interaction interaction = interactionOf(e, options.duration);
  // The integrator is explicit: it follows every vibration, kept or not by damping.
  constexpr double kFastest = 1000.0;  // [Hz]
  const ModalModel base = linearised(interaction.vehicle);
  const double fastest = std::sqrt(base.stiffness.maxCoeff()) / (2.0 * M_PI);
  if (!(fastest <= kFastest))
    throw InputError(
        fmt::format("{}: base.keep_modes: the stiffest of the {} modes has {:.0f} Hz; "
                    "keep those up to {:.0f} Hz",
                    e.name, base.stiffness.size(), fastest, kFastest));
  std::ofstream to;
  if (!file.empty()) {
    requireReplaceable("--out", file, "t_s");
    to.open(file);
    if (!to) throw InputError(fmt::format("--out {}: cannot be written", file));
  }
  options.model = InteractionModel::kSplit;
  const std::vector<InteractionPoint> split = simulate(interaction, options);
  options.model = InteractionModel::kWhole;
  const std::vector<InteractionPoint> whole = simulate(interaction, options);

  std::string csv = "t_s";
  for (const char* model : {"split", "whole"})
    for (int i = 0; i < 6; ++i)
      csv += fmt::format(",{}_{}_{}", coordinate(i).name, model, coordinate(i).unit);
  csv += "\n";
  Range of_split, of_whole, apart;
  for (std::size_t i = 0; i < split.size(); ++i) {
    of_split.add(split[i].x);
    of_whole.add(whole[i].x);
    apart.add((split[i].x - whole[i].x).cwiseAbs());
    csv += fmt::format("{:.6f},{},{}\n", split[i].t, fmt::join(split[i].x, ","),
                       fmt::join(whole[i].x, ","));
  }
  fmt::print("{}: {} modes, {:g} s in free space\n", e.name, base.stiffness.size(),
             static_cast<double>(options.duration) * kSecondPerNanosecond);
  fmt::print("  {:<8}{:>20}{:>20}{:>20}\n", "", "split, peak to peak", "whole, peak to peak",
             "largest difference");
  for (int i = 0; i < 6; ++i) {
    const double scale = coordinate(i).shown;
    const std::string_view unit = coordinate(i).shown_unit;
    const auto cell = [&](double x) { return fmt::format("{:.5f} {:<3}", x * scale, unit); };
    fmt::print("  {:<8}{:>20}{:>20}{:>20}\n", coordinate(i).name, cell(of_split.size()(i)),
               cell(of_whole.size()(i)), cell(apart.high(i)));
  }
  if (!file.empty()) {
    to << csv;
    to.flush();
    if (!to) throw InputError(fmt::format("--out {}: cannot be written", file));
  }
  return kDone;
}

}  // namespace

int srmsCommand(int argc, char** argv) {
  CLI::App cli("The flexible base and the robot on it, without platform.", "ves srms");
  cli.require_subcommand(1);
  std::string name;
  std::vector<std::string> overrides;
  CLI::App* modes =
      cli.add_subcommand("modes", "frequencies and shapes of a base, and its stiffness");
  modes->add_option("base", name, "name in config/bases, or a .yaml file")->required();
  modes->add_option("--set", overrides, "KEY.PATH=VALUE as if it stood in the file")
      ->allow_extra_args(false);
  CLI::App* simulation =
      cli.add_subcommand("simulate",
                         "SRMS-robot: a scenario's robot on its base in free space, with the "
                         "report's split of the wrench and without");
  std::string out;
  InteractionOptions options;
  simulation->add_option("scenario", name, "name in config/scenarios, or a .yaml file")->required();
  simulation->add_option("--set", overrides, "KEY.PATH=VALUE as if it stood in the file")
      ->allow_extra_args(false);
  simulation->add_option("--tolerance", options.tolerance, "of the integrator, relative")
      ->check(inRange(1e-13, 1e-2))
      ->capture_default_str();
  simulation
      ->add_option("--hold-mass", options.hold_mass,
                   "steps of 10 ms that the robot's mass matrix is kept for; 0: follows the robot")
      ->check(CLI::Range(0, 1'000'000));
  simulation->add_option("--out", out, "file for the motion, CSV");
  CLI::App* published =
      cli.add_subcommand("published", "the straight arm beside published frequencies");
  return run(cli, argc, argv, [&] {
    if (simulation->parsed()) return simulateBoth(name, overrides, options, out);
    if (published->parsed()) return showPublished();
    return showModes(name, overrides);
  });
}

}  // namespace ves::app
