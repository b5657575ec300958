// SPDX-License-Identifier: BSD-3-Clause
#include "reproduction.hpp"

#include <cmath>

#include "ves/evaluation/contact_pairs.hpp"

namespace ves {
namespace {

struct Case {
  const char* title;
  const char* scenario;  // without the robot's name
  Overrides set;
};
const Case kCases[] = {
    {"board, 2 and 5 cm/s", "contact_board", {}},
    {"board, slow, friction 0.3", "contact_friction", {}},
    {"ball of 100 kg, rebound", "contact_rebound", {}},
    {"ball of 500 kg, rebound", "contact_rebound", {"environment.target.mass_kg=500"}},
    {"ball of 100 kg, capture", "contact_capture", {}},
    {"ball of 500 kg, capture", "contact_capture", {"environment.target.mass_kg=500"}},
    {"peg into a socket", "contact_peg", {}}};

const Overrides kPublished = {
    "controller.compensation.feed_forward=false", "controller.compensation.observer=false",
    "controller.compensation.inertia=false", "sensor.readings_per_tick=1"};

/// One case, published or compensated: cells of the table, and what the tool felt.
void oneContact(Reproduction& r, const Case& which, const std::string& robot, bool published,
                TableRow& row, Numbers& numbers, Panel& forces) {
  const std::string scenario = std::string(which.scenario) + "_" + robot;
  // Whatever the stability check says, and without asking it: that takes as long as a run.
  Overrides set = with(which.set, {"sensor.noise=false", "controller.stability=forced",
                                   "controller.stability_uncompensated=forced"});
  if (published) set = with(set, kPublished);
  const Reproduction::Run run =
      r.record(scenario, loadExperiment(findScenario(scenario, r.config), set));
  const std::optional<Emulation> e = r.emulation(run.series);
  Numbers of_run;
  addContacts(run.series, e, of_run);
  addEnergy(run.series, of_run);
  const auto number = [&](const char* key) {
    return of_run.contains(key) ? of_run[key].get<double>() : NAN;
  };
  const auto cell = [](double x, int digits) {
    return std::isfinite(x) ? fmt::format("{:.{}f}", x, digits) : std::string("-");
  };
  if (published)
    row.insert(row.end(), {cell(number("contacts_free_space"), 0),
                           cell(number("contact_peak_free_space_n"), 1),
                           cell(number("contact_restitution_free_space"), 3)});
  const bool good = run.result.good();
  row.insert(row.end(), {good ? cell(number("contacts"), 0) : std::string(name(run.result.cause)),
                         cell(number("contact_peak_n"), 1), cell(number("contact_restitution"), 3),
                         cell(kMilli * number("energy_put_in_max_j"), 1)});
  Numbers& own = numbers[scenario + (which.set.empty() ? "" : "_500_kg")]
                        [published ? "as_published" : "compensated"];
  own = of_run;
  own.erase("contact_list");
  own["ended"] = name(run.result.phase);
  if (which.scenario != std::string("contact_rebound") || !which.set.empty() || robot != "puma")
    return;
  const auto line = [&](const char* title, int colour, bool dashed, const auto& value) {
    Line out{title, {}, {}, colour, dashed};
    eachTick(run.series, [&](const Row& one, double t) {
      if (t > 4.0) return;
      out.x.push_back(t);
      out.y.push_back(value(one, out.x.size() - 1));
    });
    forces.lines.push_back(out);
  };
  line(published ? "as published" : "compensated", published ? 1 : 0, false,
       [](const Row& one, std::size_t) { return Vec3::Map(one.truth.contact).norm(); });
  if (published && e)
    line("in free space", 2, true, [&](const Row&, std::size_t k) {
      return k < e->base.on_tool.size() ? e->base.on_tool[k] : NAN;
    });
}

}  // namespace

void contactSection(Reproduction& r) {
  r.page.section("Beyond the report: contact");
  constexpr std::size_t kAll = std::size(kCases) * std::size(kRobots);
  TableRows rows(kAll);
  Panel forces{kSinceAdmittance, "force on the tool [N]", {}, false};
  r.parts(kAll, [&](Reproduction& piece, std::size_t i) {
    const Case& which = kCases[i / std::size(kRobots)];
    const std::string robot = kRobots[i % std::size(kRobots)];
    rows[i] = {fmt::format("{}, {}", which.title, robot == "puma" ? "PUMA" : "DOSS")};
    Panel own{"", "", {}, false};
    for (const bool published : {true, false})
      oneContact(piece, which, robot, published, rows[i], piece.numbers["contact"], own);
    if (!own.lines.empty()) forces.lines = own.lines;
  });
  r.page.text(
      "The tool touches something, on the SRMS in low hover, in space, the sensor's noise off: "
      "boards, a ball that drifts against it at 2 cm/s and leaves or is taken hold of, a socket. "
      "Each run beside the same robot on its base in free space with the same contact: how often "
      "it touched, the largest force, Newton's restitution of the first contact, and the energy "
      "that the emulation put in at most, by the controller's own books. As published the runs are "
      "forced: the stability check refuses them. A run that a safety check ended is named.");
  r.page.table({"", "free space: contacts", "peak [N]", "e", "published: contacts", "peak [N]", "e",
                "put in [mJ]", "compensated: contacts", "peak [N]", "e", "put in [mJ]"},
               rows);
  r.page.figure("A ball of 100 kg meets the tool of the PUMA.", {forces},
                "./ves run contact_rebound_puma --lockstep --force");
}

}  // namespace ves
