// SPDX-License-Identifier: BSD-3-Clause
//
// ves stability: Appendix E as published, and the loop of this machine.
#include <fmt/format.h>
#include <unistd.h>

#include "commands.hpp"
#include "outputs.hpp"
#include "print.hpp"
#include "runner.hpp"
#include "ves/analysis/appendix_e.hpp"
#include "ves/analysis/gate.hpp"
#include "ves/analysis/leaning.hpp"
#include "ves/math/dense.hpp"
#include "ves/pictures/gnuplot.hpp"

namespace ves::app {
namespace {

/// The loop with the softest 1, 2, .. modes kept, the verdict on all of them, and its margins.
int showLoop(const Experiment& e) {
  const JointVector& q = e.plant.task.initial_joints;
  const Loop loop = loopOf(e.controller, q, Direction::kExtending);
  fmt::print("{:>5} {:>10} {:>16}   {:>28}   {:>28}   {:>28}\n", "modes", "[Hz]",
             "mass ratio (E.20)", "legs extending: growth [1/s]", "retracting: growth [1/s]",
             "swinging: growth [1/s]");
  for (int k = 1; k <= loop.base.stiffness.size(); ++k) {
    fmt::print("{:>5} {:>10.4f} {:>17.3f}", k, std::sqrt(loop.base.stiffness(k - 1)) / (2.0 * M_PI),
               massRatios(softest(loop.base, k), loop.robot_P)(0));
    for (const Direction direction :
         {Direction::kExtending, Direction::kRetracting, Direction::kSwinging}) {
      Loop some = loopOf(e.controller, q, direction);
      some.base = softest(some.base, k);
      const DominantRoot s = dominantRoot(some);
      fmt::print("   {:>+10.3f} at {:>7.3f} Hz {:<6}", s.growth, s.frequency,
                 decays(some) ? "" : "grows");
    }
    fmt::print("\n");
  }
  const std::vector<ContactVerdict> contacts = assessContacts(e.controller, e.plant.task);
  for (const ContactVerdict& contact : contacts) fmt::print("{}\n", explain(contact));
  const LoopVerdict v = assessStability(e.controller, e.plant.task);
  if (!v.stable) {
    fmt::print("{}\n", explain(v));
    return kTripped;
  }
  if (std::isfinite(v.stable_for))
    fmt::print(
        "grows, slowly: {:.4g} times as much after {:.4g} s, which is let pass up to {:.4g} "
        "(controller.most_growth); a longer segment is refused\n",
        std::exp(std::max(0.0, v.worst.growth) * v.longest), v.longest, e.controller.most_growth);
  for (const Direction direction : directionsOf(e.controller)) {
    const Margins m = margins(v.at(direction));
    const auto least = [](bool most) { return most ? "at least " : ""; };
    fmt::print(
        "stable, legs {}: where it is worst, bears {}{:.0f} % of the robot's inertia, {}{:.0f} % "
        "of the servos' gain, a wrench {}{:.2f} ms earlier or {}{:.2f} ms later than believed, and "
        "{}{} ticks of further delay\n",
        name(direction), least(m.gain >= Margins::kMostGain), 100.0 * m.gain,
        least(m.servo_gain >= Margins::kMostGain), 100.0 * m.servo_gain,
        least(m.early >= Margins::kMostTime), 1e3 * m.early, least(m.late >= Margins::kMostTime),
        1e3 * m.late, least(m.delay == Margins::kMostDelay), m.delay);
  }
  const bool grows = !contactsDecay(e.controller, e.plant.task);
  if (grows) fmt::print("a contact would grow: admittance control is refused\n");
  return grows ? kTripped : kDone;
}

/// A parameter of the loop that a map can run over.
struct Parameter {
  const char* name;
  const char* label;
  double least, most;
  void (*set)(Loop& loop, double value);
  bool logarithmic = false;
};
const Parameter kParameters[] = {
    {"mass", "robot's inertia, times its own", 0.0, 10000.0,
     [](Loop& l, double v) {
       l.robot_P = scaledDensity(v, l.robot_P);
       l.model.robot_P = scaledDensity(v, l.model.robot_P);
     }},
    {"mass_error", "robot's inertia, times the controller's model", 0.0, 100.0,
     [](Loop& l, double v) { l.robot_P = scaledDensity(v, l.robot_P); }},
    {"contact_stiffness", "stiffness of the contact [N/m]", 1e-3, 1e12,
     [](Loop& l, double v) {
       l.contact->damping *= std::sqrt(v / l.contact->stiffness);
       l.contact->stiffness = v;
     },
     true},
    {"rate", "controller rate [Hz]", 1.0, 1000.0, [](Loop& l, double v) { l.period = 1.0 / v; }},
    {"K_P", "K_P, times its own", 0.0, 100.0,
     [](Loop& l, double v) {
       l.velocity_gain *= v;
       l.model.setGain(v * l.model.gain());
     }},
    {"gain_error", "servo gain, times the controller's model", 0.01, 100.0,
     [](Loop& l, double v) { l.velocity_gain *= v; }},
    {"late", "wrench later than believed [ms]", -20.0, 20.0,
     [](Loop& l, double v) { l.late += 1e-3 * v; }},
    {"delay", "further delay [ticks]", 0.0, 50.0,
     [](Loop& l, double v) { l.delay += static_cast<int>(v); }},
    {"filter", "cut-off of Filter 3 [rad/s]", 0.0, 10000.0,
     [](Loop& l, double v) { l.filter_cutoff = v; }},
    {"sensor", "cut-off of the sensor's filter [Hz]", 0.1, 10000.0,
     [](Loop& l, double v) { l.sensor_cutoff = l.model.servo.sensor_cutoff = 2.0 * M_PI * v; }},
    {"frequency", "frequencies of the base, times their own", 0.0, 1000.0,
     [](Loop& l, double v) {
       l.base.stiffness *= v * v;
       l.base.damping *= v;
     }},
    {"modes", "modes kept", 1.0, 132.0,
     [](Loop& l, double v) {
       const auto all = static_cast<int>(l.base.stiffness.size());
       l.base = softest(l.base, std::clamp(static_cast<int>(v), 1, all));
     }},
};

/// NAME=FROM:TO
struct MapAxis {
  const Parameter* parameter = nullptr;
  double from = 0.0, to = 0.0;
  double at(int i, int of) const {
    const double share = static_cast<double>(i) / (of - 1);
    return parameter->logarithmic ? from * std::pow(to / from, share) : from + share * (to - from);
  }
};
MapAxis axisOf(const std::string& option, const std::string& text) {
  const std::size_t equals = text.find('='), colon = text.find(':');
  MapAxis axis;
  std::string names;
  for (const Parameter& p : kParameters) {
    names += (names.empty() ? "" : ", ") + std::string(p.name);
    if (text.substr(0, equals) == p.name) axis.parameter = &p;
  }
  const bool numbers =
      equals != std::string::npos && colon != std::string::npos && colon > equals &&
      CLI::detail::lexical_cast(text.substr(equals + 1, colon - equals - 1), axis.from) &&
      CLI::detail::lexical_cast(text.substr(colon + 1), axis.to);
  if (!axis.parameter || !numbers || !(axis.to > axis.from))
    throw InputError(fmt::format("{} '{}': want NAME=FROM:TO, FROM below TO, NAME one of {}",
                                 option, text, names));
  if (!(axis.from >= axis.parameter->least && axis.to <= axis.parameter->most))
    throw InputError(fmt::format("{} '{}': want {} within [{}, {}]", option, text,
                                 axis.parameter->name, axis.parameter->least,
                                 axis.parameter->most));
  return axis;
}

void draw(const std::string& script, const std::filesystem::path& folder,
          const std::filesystem::path& picture) {
  gnuplot(script, folder);
  fmt::print("{}\n", (folder / picture).string());
}

constexpr const char* kLook =
    "set terminal pngcairo noenhanced size 1100,640 font 'DejaVu Sans,12' background '#ffffff'\n"
    "set border 3 lc rgb '#555555'\nset tics nomirror out\n";

bool usesContact(const MapAxis& axis) {
  return std::string_view(axis.parameter->name) == "contact_stiffness";
}

/// The contact of a scenario that gives the most energy.
std::optional<ExpectedContact> hardestContact(const Experiment& e) {
  std::optional<ExpectedContact> out;
  double most = -HUGE_VAL;
  for (const ExpectedContact& contact : expectedContacts(e.controller, e.plant.task)) {
    const Loop loop = loopOf(e.controller, contact.q, Direction::kExtending);
    const double error = std::abs(
        impact(leaning(loop, contact, contact.leaning.stiffness), contact.speed).energy_error);
    if (out && !(error > most)) continue;
    most = error;
    out = contact;
  }
  return out;
}

/// Growth of the loop over two of its parameters, the limit drawn in.
int drawMap(const Experiment& e, const MapAxis& x, const MapAxis& y,
            const std::filesystem::path& folder) {
  constexpr int kPoints = 41;
  Loop original = loopOf(e.controller, e.plant.task.initial_joints, Direction::kExtending);
  std::string pose = "robot as it stands", of_contact;
  double speed = 0.0;
  if (const auto contact = hardestContact(e)) {
    original = leaning(loopOf(e.controller, contact->q, Direction::kExtending), *contact,
                       contact->leaning.stiffness);
    pose = "contact with " + contact->name;
    of_contact = ",energy_error";
    speed = contact->speed;
  } else if (usesContact(x) || usesContact(y)) {
    throw InputError(
        fmt::format("{}: contact_stiffness of a scenario that touches nothing in "
                    "admittance control",
                    e.name));
  }
  std::string csv = fmt::format("{},{},growth_per_s,frequency_hz{}\n", x.parameter->name,
                                y.parameter->name, of_contact);
  std::string data;
  const bool shown = isatty(STDERR_FILENO) != 0;
  for (int j = 0; j < kPoints; ++j) {
    for (int i = 0; i < kPoints; ++i) {
      Loop loop = original;
      x.parameter->set(loop, x.at(i, kPoints));
      y.parameter->set(loop, y.at(j, kPoints));
      const DominantRoot s = dominantRoot(loop);
      csv += fmt::format("{},{},{},{}", x.at(i, kPoints), y.at(j, kPoints), s.growth, s.frequency);
      if (loop.contact) csv += fmt::format(",{}", impact(loop, speed).energy_error);
      csv += "\n";
      data += fmt::format("{} {} {}\n", x.at(i, kPoints), y.at(j, kPoints), s.growth);
    }
    data += "\n";
    if (shown) fmt::print(stderr, "\r{:3.0f} %", 100.0 * (j + 1) / kPoints);
  }
  if (shown) fmt::print(stderr, "\r     \r");
  writeGiven("--out", (folder / "map.csv").string(), csv);
  draw(fmt::format(
           "$map << EOD\n{}EOD\n{}set output 'map.png'\nset title {}\nset xlabel {}\n"
           "set ylabel {}\nset cblabel 'growth [1/s]'\n"
           "set palette defined (-1 '#2166ac', 0 '#f7f7f7', 1 '#b2182b')\n"
           "set cbrange [-3:3]\nset view map\nset contour base\n"
           "set cntrparam levels discrete 0\nset pm3d map interpolate 4,4\nunset key\n"
           "set xrange [{}:{}]\nset yrange [{}:{}]\n{}{}"
           "splot $map with pm3d, $map with lines lw 2.5 lc rgb 'black' nosurface\n",
           data, kLook,
           quoted(e.name + ": blue decays, red diverges, line: the limit. Legs extending, " + pose),
           quoted(x.parameter->label), quoted(y.parameter->label), x.from, x.to, y.from, y.to,
           x.parameter->logarithmic ? "set logscale x\n" : "",
           y.parameter->logarithmic ? "set logscale y\n" : ""),
       folder, "map.png");
  return kDone;
}

/// Figure E.4, its polynomial beside the exact transition, and the limit line.
int drawPublished(const std::filesystem::path& folder) {
  std::string csv = "samples_per_period,mass_ratio,pair,third,eigenvalue_difference\n", data;
  double apart = 0.0;
  for (int f = 10; f <= 100; f += 5) {
    for (int i = 0; i <= 80; ++i) {
      const SampledOscillator o{i / 40.0, static_cast<double>(f), 0.5};
      const auto z = roots(o);
      const Eigen::Vector3cd exact = eigenvalues(transition(o));
      double off = 0.0;
      for (const std::complex<double>& root : z)
        off = std::max(off, (exact.array() - root).abs().minCoeff());
      apart = std::max(apart, off);
      csv += fmt::format("{},{},{},{},{}\n", f, o.mass_ratio, std::abs(z[0]), std::abs(z[2]), off);
      data += fmt::format("{} {} {} {}\n", f, o.mass_ratio, std::abs(z[0]), std::abs(z[2]));
    }
    data += "\n";
  }
  writeGiven("--out", (folder / "figure_e4.csv").string(), csv);
  std::string script =
      "$e4 << EOD\n" + data + "EOD\n" + kLook +
      "set output 'figure_e4.png'\nset multiplot layout 1,2 margins 0.07,0.92,0.13,0.92 "
      "spacing 0.16,0.1\n"
      "set xlabel 'f/F, samples a period'\nset ylabel 'mass ratio m1/m'\nset view map\n"
      "set pm3d map interpolate 4,4\nunset key\nset xrange [10:100]\nset yrange [0:2]\n"
      "set contour base\nset cntrparam levels discrete 1\n";
  for (const auto& [title, column] :
       {std::pair{"(a) magnitude of the pair", 3}, {"(b) magnitude of the third root; line: 1", 4}})
    script += fmt::format(
        "set title {}\nset palette defined (0 '#2166ac', 1 '#f7f7f7', 2 '#b2182b')\n"
        "set cbrange [{}]\nsplot $e4 using 1:2:{} with pm3d, $e4 using 1:2:{} with "
        "lines lw 2.5 lc rgb 'black' nosurface\n",
        quoted(title), column == 3 ? "0.7:1.3" : "0:2", column, column);
  draw(script + "unset multiplot\n", folder, "figure_e4.png");
  fmt::print("the roots of (E.11) are the eigenvalues of the exact transition to {:.0e}\n", apart);
  return kDone;
}

}  // namespace

int stabilityCommand(int argc, char** argv) {
  CLI::App cli("Stability of the force feedback: Appendix E, and the loop of this machine.",
               "ves stability");
  cli.require_subcommand(1);
  Options options;
  CLI::App* loop = cli.add_subcommand(
      "loop", "a scenario's roots, verdict and margins; status 1 when it would diverge");
  options.addExperiment(*loop);
  CLI::App* map = cli.add_subcommand(
      "map",
      "growth over two parameters of a scenario's loop, as map.png and map.csv; without a "
      "scenario figure E.4");
  std::string scenario, x = "mass=0.1:4", y = "frequency=0.2:3", out = "ves-runs/stability";
  map->add_option("scenario", scenario, "name in config/scenarios, or a .yaml file");
  map->add_option("--x", x,
                  "NAME=FROM:TO: mass, mass_error, contact_stiffness, rate, K_P, gain_error, late, "
                  "delay, filter, sensor, frequency, modes")
      ->capture_default_str();
  map->add_option("--y", y, "the same")->capture_default_str();
  map->add_option("--set", options.overrides, "KEY.PATH=VALUE as if it stood in the scenario")
      ->allow_extra_args(false);
  map->add_option("--out", out, "folder for the results")->capture_default_str();
  return run(cli, argc, argv, [&] {
    if (loop->parsed()) {
      const Experiment e = options.load();
      printWarnings(e, options.verbose);
      return showLoop(e);
    }
    if (scenario.empty()) {
      for (const char* option : {"--x", "--y", "--set"})
        if (map->count(option))
          throw InputError(
              fmt::format("{}: of a scenario's map, and no scenario is given", option));
      return drawPublished(makeFolder(out));
    }
    const MapAxis of_x = axisOf("--x", x), of_y = axisOf("--y", y);
    if (of_x.parameter == of_y.parameter)
      throw InputError(fmt::format("--y {}: is that of --x too, want another", y));
    options.scenario = scenario;
    return drawMap(options.load(), of_x, of_y, makeFolder(out));
  });
}

}  // namespace ves::app
