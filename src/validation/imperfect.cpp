// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>

#include "reproduction.hpp"

namespace ves {
namespace {

constexpr std::size_t kMachines = 24;

/// [-] in [0, 1): digits of n in a base, mirrored at the point. Spreads evenly (van der Corput).
double spread(std::size_t n, std::size_t base) {
  double out = 0.0, share = 1.0;
  for (; n > 0; n /= base) {
    share /= static_cast<double>(base);
    out += share * static_cast<double>(n % base);
  }
  return out;
}

/// A machine as it might have been: each number of legs.hydraulic that the report does not give,
/// anywhere in the range in which such machines are built.
Overrides machine(std::size_t i) {
  const auto between = [&](double a, double b, std::size_t base) {
    return a + (b - a) * spread(i + 1, base);
  };
  const double seals = between(100.0, 500.0, 2);
  const auto number = [](const char* key, double value) {
    return fmt::format("legs.hydraulic.{}={:.6g}", key, value);
  };
  return {"legs.model=hydraulic",
          std::string("legs.hydraulic.circuit=") + (i % 2 == 0 ? "three_way" : "four_way"),
          number("coulomb_n", seals),
          number("breakaway_n", 1.5 * seals),
          number("viscous_n_s_per_m", between(300.0, 3000.0, 3)),
          number("supply_mpa", between(7.0, 14.0, 5)),
          number("bulk_modulus_mpa", between(690.0, 1400.0, 7)),
          number("valve_opening_ma", between(-0.2, 0.2, 11)),
          number("hose_volume_cm3", between(10.0, 60.0, 13)),
          number("play_m", between(0.0, 2e-4, 17)),
          number("reading_hysteresis_m", between(0.0, 2e-4, 19))};
}

/// The largest errors of 4.2 that figures show, as they are shown.
struct Errors {
  double extending = 0.0, retracting = 0.0;  // [mm] z_sine
  double alpha = 0.0;                        // [deg] alpha_sine
  std::array<double, 6> decay{};             // [mm, deg] free_decay

  std::vector<double> all() const {
    std::vector<double> out = {extending, retracting, alpha};
    out.insert(out.end(), decay.begin(), decay.end());
    return out;
  }
};

struct Three {
  Reproduction::Run z, alpha, decay;
};

Three runsOf(Reproduction& r, const Overrides& set) {
  return {r.run("z_sine", set), r.run("alpha_sine", set), r.run("free_decay", set)};
}

Errors errorsOf(const Three& runs) {
  Errors out;
  Numbers z = summarise(runs.z.series, runs.z.result);
  out.extending = z["z_error_max_extending_m"].get<double>() * kMilli;
  out.retracting = z["z_error_max_retracting_m"].get<double>() * kMilli;
  out.alpha = summarise(runs.alpha.series, runs.alpha.result)["alpha_error_max_rad"].get<double>() /
              kDegree;
  Numbers decay = summarise(runs.decay.series, runs.decay.result);
  for (std::size_t i = 0; i < 6; ++i) {
    const Coordinate& c = coordinate(static_cast<int>(i));
    out.decay[i] = decay[fmt::format("{}_error_max_{}", c.name, c.unit)].get<double>() * c.shown;
  }
  return out;
}

/// Commanded minus actual of some coordinates, on ideal legs and others.
std::vector<Panel> errorPanels(const Reproduction::Run& ideal, const Reproduction::Run& other,
                               SegmentKind kind, const std::vector<int>& which) {
  std::vector<Panel> out;
  for (const int i : which) {
    const Coordinate& c = coordinate(i);
    const auto error = [&c, i](const Row& row) {
      return (row.state.x_desired[i] - row.truth.x[i]) * c.shown;
    };
    out.push_back({kSinceSegment,
                   fmt::format("{} error [{}]", c.name, c.shown_unit),
                   {lineOf("ideal", ideal.series, kind, 0, error),
                    lineOf("hydraulic", other.series, kind, 1, error, true)},
                   false});
  }
  return out;
}

}  // namespace

void imperfectSection(Reproduction& r) {
  r.page.section("4.2 once more, on legs that feel their load");
  r.page.text(fmt::format(
      "The report explains its hardware's larger errors by friction or hysteresis that it does not "
      "model. Here {} machines have both: oil, seals, valves, play and transducers by substitutes, "
      "spread evenly over ranges in which such machines are built, every one with the report's two "
      "gains at 10 mA (docs/hydraulics.md). Their range takes the hardware's place; it is no "
      "measurement of it.",
      kMachines));
  const Three ideal = runsOf(r, {}), hydraulic = runsOf(r, {"legs.model=hydraulic"});
  const Errors as_modelled = errorsOf(ideal);
  std::array<Errors, kMachines> machines;
  r.parts(kMachines, [&](Reproduction& piece, std::size_t i) {
    machines[i] = errorsOf(runsOf(piece, machine(i)));
  });

  TableRows rows = {{"ideal legs"}, {"config/ves.yaml"}, {"least"}, {"median"}, {"most"}};
  const std::vector<double> first = as_modelled.all(), second = errorsOf(hydraulic).all();
  std::vector<std::array<double, 3>> ranges;  // least, median, most
  for (std::size_t i = 0; i < first.size(); ++i) {
    std::vector<double> all;
    for (const Errors& one : machines) all.push_back(one.all()[i]);
    std::sort(all.begin(), all.end());
    ranges.push_back({all.front(), all[kMachines / 2], all.back()});
    rows[0].push_back(fmt::format("{:.2f}", first[i]));
    rows[1].push_back(fmt::format("{:.2f}", second[i]));
    for (std::size_t k = 0; k < 3; ++k) rows[2 + k].push_back(fmt::format("{:.2f}", ranges[i][k]));
  }
  r.page.table({"largest error", "z ext. [mm]", "z retr. [mm]", "alpha [deg]", "decay x [mm]",
                "y [mm]", "z [mm]", "alpha [deg]", "beta [deg]", "gamma [deg]"},
               rows);
  const auto larger = [&](const auto& than) {
    return static_cast<double>(std::count_if(machines.begin(), machines.end(), than));
  };
  r.numbers["imperfect"]["z_extending_mm"] = ranges[0];
  r.numbers["imperfect"]["z_retracting_mm"] = ranges[1];
  r.numbers["imperfect"]["alpha_deg"] = ranges[2];
  r.claim("z_hardware", {{"extending_mm", as_modelled.extending},
                         {"retracting_mm", as_modelled.retracting},
                         {"machines", kMachines},
                         {"larger", larger([&](const Errors& e) {
                            return e.extending > as_modelled.extending &&
                                   e.retracting > as_modelled.retracting;
                          })},
                         {"least_extending_mm", ranges[0][0]},
                         {"most_extending_mm", ranges[0][2]},
                         {"least_retracting_mm", ranges[1][0]},
                         {"most_retracting_mm", ranges[1][2]}});
  r.claim("alpha_hardware",
          {{"error_deg", as_modelled.alpha},
           {"machines", kMachines},
           {"smaller", larger([&](const Errors& e) { return e.alpha < as_modelled.alpha; })},
           {"least_deg", ranges[2][0]},
           {"most_deg", ranges[2][2]}});
  Quantities decay = {{"machines", kMachines}};
  double least = HUGE_VAL, most = 0.0;  // [-] error of the model's over a machine's
  for (std::size_t i = 0; i < 6; ++i) {
    const Coordinate& c = coordinate(static_cast<int>(i));
    decay[fmt::format("{}_{}", c.name, c.shown_unit)] = as_modelled.decay[i];
    least = std::min(least, as_modelled.decay[i] / ranges[3 + i][2]);
    most = std::max(most, as_modelled.decay[i] / ranges[3 + i][0]);
  }
  decay["least_ratio"] = least;
  decay["most_ratio"] = most;
  r.claim("free_decay", decay);

  const char* const set = " --lockstep --set legs.model=hydraulic";
  r.page.figure("Figure 4.5 once more: commanded minus actual z.",
                errorPanels(ideal.z, hydraulic.z, SegmentKind::kTrajectory, {2}),
                std::string("./ves run z_sine") + set);
  r.page.figure("Figure 4.7 once more: commanded minus actual alpha.",
                errorPanels(ideal.alpha, hydraulic.alpha, SegmentKind::kTrajectory, {3}),
                std::string("./ves run alpha_sine") + set);
  r.page.figure("Figures 4.9 and 4.10 once more: commanded minus actual position and attitude.",
                errorPanels(ideal.decay, hydraulic.decay, SegmentKind::kAdmittance, {0, 2, 3, 4}),
                std::string("./ves run free_decay") + set);
}

}  // namespace ves
