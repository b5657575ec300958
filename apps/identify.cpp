// SPDX-License-Identifier: BSD-3-Clause
//
// ves identify: what the machine can find out about itself.
#include <fmt/format.h>

#include "commands.hpp"
#include "logs.hpp"
#include "outputs.hpp"
#include "print.hpp"
#include "runner.hpp"
#include "ves/evaluation/identified.hpp"
#include "ves/identification/scenario.hpp"
#include "ves/validation/iterative_compensation.hpp"

namespace ves::app {
namespace {

constexpr const char* kChannel[] = {"Fx", "Fy", "Fz", "Mx", "My", "Mz"};

/// Turns what a computation cannot do into a line for a person.
template <class F>
auto orRefuse(const std::string& about, const F& f) {
  try {
    return f();
  } catch (const std::domain_error& error) {
    throw InputError(fmt::format("{}: {}", about, error.what()));
  }
}

/// Writes YAML that `read` takes; what it would refuse is not written.
int keep(const std::string& file, const std::string& yaml, const auto& read) {
  const Value written = parseDocument(yaml, file);
  read(Section(written, ""));
  writeGiven("--out", file, yaml);
  fmt::print("{}\n", file);
  return kDone;
}

int plan(const std::string& scenario, const std::vector<std::string>& overrides,
         const PosePlanOptions& options, std::string file) {
  const std::filesystem::path base = findScenario(scenario, configFolder());
  const Experiment e = loadExperiment(base, overrides);
  printWarnings(e);
  if (e.robot.joint_names.empty())
    throw InputError(fmt::format("{}: has no robot with joints to identify", base.string()));
  if (!(e.controller.gravity.norm() > 0.0))
    throw InputError(fmt::format("{}: gravity_m_per_s2: 0, want weight to feel", base.string()));
  const std::string name = "identify_" + e.name;
  if (file.empty()) file = (makeFolder("ves-runs") / (name + ".yaml")).string();
  const SeparableCombinations combinations =
      orRefuse(base.string(), [&] { return separableCombinations(e.controller.payload.robot); });
  const PosePlan plan = orRefuse(base.string(), [&] {
    return planPoses(staticSetup(e.controller), combinations, e.controller,
                     e.plant.task.initial_joints, options);
  });
  if (!std::isfinite(plan.condition))
    throw InputError(
        fmt::format("--attitudes {} --poses {}: too few to tell {} combinations and the "
                    "sensor's biases",
                    options.attitudes, options.poses, combinations.rank()));
  const std::filesystem::path folder = std::filesystem::absolute(file).parent_path();
  std::filesystem::path from = std::filesystem::proximate(std::filesystem::absolute(base), folder);
  if (!overrides.empty()) {  // what it builds on is no file yet
    from = std::filesystem::path(file).stem().string() + "_base.yaml";
    writeGiven("--out", (folder / from).string(), e.source.resolved());
  }
  writeGiven("--out", file, scenarioOf(plan, e, name, from.string()));
  loadExperiment(file);  // what is refused is refused now
  fmt::print(
      "{} of {} parameters can be told apart; condition number {:.1f}, of random poses "
      "{:.1f}\n{}\n",
      combinations.rank(), combinations.C.cols(), plan.condition, plan.condition_random, file);
  return kDone;
}

int masses(const std::string& log, const std::string& scenario, const std::string& file) {
  const Series series = seriesOf(log, scenario);
  const Experiment& e = series.experiment;
  const IdentifiedMasses found = orRefuse(log, [&] { return identifiedMasses(series); });
  const SeparableCombinations& combinations = found.combinations;
  const MassEstimate& m = found.estimate;

  std::string text = fmt::format(
      "Mass parameters of the robot of '{}' from {} poses at rest, by ves identify.\n"
      "{} of {} can be told apart (lengths in m, each link in its own frame, all plates counted\n"
      "into link 0):\n\n",
      e.name, found.rests.size(), combinations.rank(), combinations.C.cols());
  int mixed = 0;
  for (Eigen::Index i = 0; i < combinations.rank(); ++i) {
    const bool poor = m.inflation(i) > MassEstimate::kMixed;
    mixed += poor;
    text += fmt::format("{:>11.4f} +- {:<8.4f} {:<5} {}{}\n", m.beta(i), m.standard_deviation(i),
                        combinations.leads[static_cast<std::size_t>(i)] % 4 ? "kg m" : "kg",
                        combinations.names[static_cast<std::size_t>(i)],
                        poor ? "  (poorly observed)" : "");
  }
  text += fmt::format("\nchannel    bias [count]  drift [count/h]  residual [count]\n");
  for (int c = 0; c < 6; ++c)
    text += fmt::format("{:<8}{:>15.2f}{:>17.2f}{:>18.2f}\n", kChannel[c], m.bias(c),
                        m.bias_drift(c) * 3600.0, m.residual(c));
  text += fmt::format("condition number {:.1f}\n", m.condition);
  fmt::print("{}", text);
  if (mixed > 0)
    fmt::print(
        "{} poorly observed: these poses mix it with others, more than {:.0f} times the "
        "deviation it could have\n",
        mixed, MassEstimate::kMixed);
  if (file.empty()) return kDone;

  const std::string yaml =
      write(found.record,
            text + "\nBelow: one set of masses that has all of these. Single values mean little.");
  return keep(file, yaml, readMasses);
}

/// The servos from any log in which every leg moves both ways.
int servo(const std::string& log, const std::string& scenario, const std::string& file) {
  const Series series = seriesOf(log, scenario);
  const IdentifiedServo all = orRefuse(log, [&] { return identifiedServo(series); });
  const ServoEstimate& found = all.legs;
  const auto more = [&](Vec6 ServoModel::*value, const auto& text) {
    return (found.servo.*value).isZero(0.0) ? "" : fmt::format("{:>18}", text());
  };
  fmt::print("{:>3}{:>22}{:>22}{:>20}{:>20}{}{}{:>12}\n", "leg", "extending [1/s]",
             "retracting [1/s]", "tau [ms]", "delay [ms]",
             more(&ServoModel::opening, [] { return "open [um]"; }),
             more(&ServoModel::friction, [] { return "seals [um]"; }), "rest [um]");
  for (int i = 0; i < kLegs; ++i) {
    const auto cell = [&](Vec6 ServoModel::*value, double scale) {
      return fmt::format("{:.3f} +- {:.3f}", scale * (found.servo.*value)(i),
                         scale * (found.deviation.*value)(i));
    };
    const auto um = [&](Vec6 ServoModel::*value) {
      return more(value, [&] {
        return fmt::format("{:.0f} +- {:.0f}", (found.servo.*value)(i)*1e6,
                           (found.deviation.*value)(i)*1e6);
      });
    };
    fmt::print("{:>3}{:>22}{:>22}{:>20}{:>20}{}{}{:>12.1f}\n", i + 1,
               cell(&ServoModel::extend, 1.0), cell(&ServoModel::retract, 1.0),
               cell(&ServoModel::tau, 1e3), cell(&ServoModel::delay, 1e3), um(&ServoModel::opening),
               um(&ServoModel::friction), found.residual(i) * 1e6);
  }
  // Slow motions leave tau to the rounding of counts, which no deviation knows of.
  const double tau = found.servo.tau.mean(), told = series.experiment.controller.servo.tau.mean();
  if (!(tau < 1.5 * told && tau > told / 1.5))
    fmt::print(
        stderr,
        "warning: tau of {:.3g} ms, where the configuration says {:.3g}: slow motions do not "
        "tell it; want a log of quick ones, as of servo_identification\n",
        tau * 1e3, told * 1e3);
  if (all.sensor)
    fmt::print(
        "wrench: {:.0f} +- {:.0f} us later than the servos and its filter say; shows {:.4f} +- "
        "{:.4f} of the robot's inertia\n",
        1e6 * all.sensor->delay, 1e6 * all.sensor->delay_deviation, all.sensor->scale,
        all.sensor->scale_deviation);
  else
    fmt::print("wrench: its time is not told, {}\n", all.why);
  if (file.empty()) return kDone;
  return keep(file, write(all.record), readServo);
}

int iterate(Options& load, const IterativeOptions& options, const std::string& file) {
  const Experiment e = load.load();
  printWarnings(e, load.verbose);
  fmt::print("{:>9} {:>22} {:>22}\n", "iteration", "answer - path [mm]", "[deg]");
  int n = 0;
  const IterativeResult r = compensateIteratively(e, options, [&](const IterativeChange& change) {
    fmt::print("{:>9} {:>22.3f} {:>22.4f}\n", ++n, change.translation * 1e3,
               change.rotation / kDegree);
    std::fflush(stdout);
  });
  fmt::print("{}, {:.0f} s of the machine's time\n",
             r.converged ? fmt::format("converged after {} iterations", r.changes.size())
             : r.stopped_by != Check::kCount
                 ? fmt::format("stopped by the {} check", ves::name(r.stopped_by))
                 : "not converged",
             r.machine_time);
  if (!file.empty()) {
    std::string text = "rows_m_deg:  # x y z alpha beta gamma from home, a row a period\n";
    for (const auto& x : r.path.colwise())
      text += fmt::format("  - [{:.7g}, {:.7g}, {:.7g}, {:.7g}, {:.7g}, {:.7g}]\n", x(0), x(1),
                          x(2), x(3) / kDegree, x(4) / kDegree, x(5) / kDegree);
    writeGiven("--out", file, text);
    fmt::print("{}\n", file);
  }
  return r.converged ? kDone : kTripped;
}

}  // namespace

int identifyCommand(int argc, char** argv) {
  CLI::App cli("What the machine finds out about itself.", "ves identify");
  cli.require_subcommand(1);
  std::string name, file, scenario;
  PosePlanOptions options;
  std::vector<std::string> overrides;
  double tilt = options.tilt / kDegree;
  CLI::App* of_plan = cli.add_subcommand(
      "plan", "poses from which a scenario's robot is well identified, as a scenario to run");
  of_plan->add_option("scenario", name, "name in config/scenarios, or a .yaml file")->required();
  of_plan->add_option("--set", overrides, "KEY.PATH=VALUE as if it stood in the scenario")
      ->allow_extra_args(false);
  of_plan->add_option("--attitudes", options.attitudes, "of the platform")
      ->check(CLI::Range(1, kMaxSegments / 3))
      ->capture_default_str();
  of_plan->add_option("--poses", options.poses, "of the robot in each attitude")
      ->check(CLI::Range(1, 20))
      ->capture_default_str();
  of_plan->add_option("--tilt", tilt, "most about x and about y [deg]")
      ->check(inRange(0.1, 85.0))
      ->capture_default_str();
  of_plan->add_option("--joint-speed", options.speed, "mean, of the robot's joints [deg/s | cm/s]")
      ->check(inRange(0.1, 1000.0))
      ->capture_default_str();
  of_plan->add_option("--seed", options.seed, "of the search")
      ->check(CLI::Range(std::int64_t{0}, std::int64_t{UINT32_MAX}));
  of_plan->add_option("--out", file, "scenario file; ves-runs/identify_SCENARIO.yaml by default");
  CLI::App* of_masses = cli.add_subcommand(
      "masses", "mass parameters from a log in which platform and robot stand still in many poses");
  asLog(of_masses->add_option("log", name, "a run's folder, or its LCM event log"))->required();
  addScenarioOfLog(*of_masses, scenario);
  of_masses->add_option("--out", file, "file for --masses of run and controller");
  CLI::App* of_servo = cli.add_subcommand(
      "servo",
      "gains, lag and delay of every leg from a log, of servo_identification for instance");
  asLog(of_servo->add_option("log", name, "a run's folder, or its LCM event log"))->required();
  addScenarioOfLog(*of_servo, scenario);
  of_servo->add_option("--out", file, "file for --servo of run and controller");
  CLI::App* of_path = cli.add_subcommand(
      "iterate",
      "Kuklinski's compensation without a mass model: slow and fast passes of a scenario's robot "
      "motion until the platform's path is the model's answer; the same motion every time");
  Options load;
  IterativeOptions iterative;
  double millimetres = iterative.translation * 1e3, degrees = iterative.rotation / kDegree;
  load.addExperiment(*of_path);
  of_path->add_option("--slower", iterative.slower, "times, of a slow pass")
      ->check(CLI::Range(2, 1000))
      ->capture_default_str();
  of_path->add_option("--weight", iterative.weight, "of the model's answer in the next path")
      ->check(inRange(0.01, 1.0))
      ->capture_default_str();
  of_path->add_option("--most", iterative.most, "iterations")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  of_path->add_option("--tolerance-mm", millimetres, "answer less path")
      ->check(inRange(1e-6, 1e3))
      ->capture_default_str();
  of_path->add_option("--tolerance-deg", degrees, "the same")
      ->check(inRange(1e-6, 90.0))
      ->capture_default_str();
  of_path->add_option("--out", file, "file for the path, as a path segment takes it");
  return run(cli, argc, argv, [&] {
    if (of_path->parsed()) {
      iterative.translation = millimetres * 1e-3;
      iterative.rotation = degrees * kDegree;
      return iterate(load, iterative, file);
    }
    if (of_masses->parsed()) return masses(name, scenario, file);
    if (of_servo->parsed()) return servo(name, scenario, file);
    options.tilt = tilt * kDegree;
    return plan(name, overrides, options, file);
  });
}

}  // namespace ves::app
