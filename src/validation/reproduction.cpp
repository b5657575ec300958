// SPDX-License-Identifier: BSD-3-Clause
#include "reproduction.hpp"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "ves/core/build.hpp"

namespace ves {

namespace fs = std::filesystem;

std::string title(const std::string& configuration, const std::string& robot) {
  std::string c = configuration;
  std::replace(c.begin(), c.end(), '_', ' ');
  return c + (robot == "puma" ? ", PUMA 560" : ", DOSS");
}

Overrides with(Overrides a, const Overrides& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

Reproduction::Reproduction(fs::path config_folder, const fs::path& folder, const Progress& progress)
    : config(std::move(config_folder)),
      scratch(folder),
      shared_(std::make_shared<Shared>(Claims(config / "claims.yaml"), progress)) {}

Reproduction Reproduction::piece() const {
  Reproduction out(*this);
  out.page = {};
  out.numbers = {};
  out.judged = {};
  return out;
}

void Reproduction::append(const Reproduction& piece) {
  page.append(piece.page);
  if (!piece.numbers.is_null()) numbers.merge_patch(piece.numbers);
  judged.insert(piece.judged.begin(), piece.judged.end());
  substitutes = std::max(substitutes, piece.substitutes);
}

void Reproduction::parts(std::size_t n,
                         const std::function<void(Reproduction&, std::size_t)>& write) {
  std::vector<Reproduction> pieces(n, piece());
  const auto count = [&](int& of, std::size_t more) {
    const std::lock_guard<std::mutex> lock(shared_->mutex);
    of += static_cast<int>(more);
  };
  count(shared_->parts, n);
  tbb::parallel_for(std::size_t{0}, n, [&](std::size_t i) {
    write(pieces[i], i);
    count(shared_->parts_done, 1);
  });
  for (const Reproduction& one : pieces) append(one);
}

std::vector<std::string> Reproduction::openClaims() const {
  std::vector<std::string> out;
  for (const std::string& id : shared_->claims.ids())
    if (!judged.count(id)) out.push_back(id);
  return out;
}

Experiment Reproduction::load(const std::string& scenario, const Overrides& set) const {
  Experiment e = loadExperiment(findScenario(scenario, config), set);
  if (wantsAdmittance(e.controller.program)) applyStabilityCheck(e);
  return e;
}

Reproduction::Run Reproduction::record(const std::string& name, const Experiment& e) {
  {
    const std::lock_guard<std::mutex> lock(shared_->mutex);
    shared_->progress(name, ++shared_->runs, shared_->parts_done, shared_->parts);
  }
  return recordLockstep(e);
}

Line lineOf(const std::string& name, const Series& series, SegmentKind kind, int colour,
            const std::function<double(const Row&)>& value, bool dashed) {
  Line out{name, {}, {}, colour, dashed};
  double start = NAN;
  for (const Row& row : series.rows) {
    if (row.state.phase != static_cast<int>(Phase::kRunning) ||
        row.state.kind != static_cast<int>(kind))
      continue;
    if (std::isnan(start)) start = row.t;
    out.x.push_back(row.t - start);
    out.y.push_back(value(row));
  }
  return out;
}

std::vector<Panel> tracking(const Series& series, SegmentKind kind, const std::vector<int>& which) {
  std::vector<Panel> panels;
  for (const int i : which) {
    const Coordinate& c = coordinate(i);
    const auto desired = [&c, i](const Row& r) { return r.state.x_desired[i] * c.shown; };
    const auto is = [&c, i](const Row& r) { return r.truth.x[i] * c.shown; };
    panels.push_back({kSinceSegment,
                      fmt::format("{} [{}]", c.name, c.shown_unit),
                      {lineOf("actual", series, kind, 0, is),
                       lineOf("commanded", series, kind, 1, desired, true)},
                      false});
  }
  return panels;
}

std::string letGo(const CoupledMode& mode) {
  constexpr double kOffset = 0.015;  // [m]
  const Vec6 offset = mode.shape * (kOffset / mode.shape.head<3>().norm());
  std::string to;
  for (int i = 0; i < 6; ++i) {
    const Coordinate& c = coordinate(i);
    to += fmt::format("{}{}_{}: {}", i ? ", " : "", c.name, c.yaml_unit, offset(i) / c.yaml);
  }
  return "program=[{move: {}}, {calibration: {}}, {move: {to: {" + to +
         "}}}, {admittance: {duration_s: 15}}]";
}

Chapter4 reproduceChapter4(const fs::path& config, const fs::path& folder, int workers,
                           const std::function<void(const std::string&, int, int, int)>& progress) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(workers));
  Reproduction r(config, folder, progress);
  constexpr void (*kSections[])(Reproduction&) = {
      sensorSection,    ratesSection,  motionSection,       imperfectSection, shuttleArmSection,
      stabilitySection, massesSection, compensationSection, contactSection};
  r.parts(std::size(kSections), [&](Reproduction& piece, std::size_t i) { kSections[i](piece); });
  if (const std::vector<std::string> open = r.openClaims(); !open.empty())
    throw InputError(fmt::format("{}: claims.{}: nothing measures it",
                                 (config / "claims.yaml").string(), open.front()));

  Chapter4 out;
  out.html = r.page.html(
      "Vehicle Emulation System: chapter 4 once more",
      fmt::format("The simulation results of NASA-CR-195076, rebuilt in lockstep by this replica "
                  "({}). Numbers that the report leaves out are substitutes (up to {} in a run); "
                  "where one decides, nothing is claimed.",
                  describeBuild(), r.substitutes));
  for (const Claim& c : r.page.claims())
    out.summary["claims"].push_back({{"where", c.where},
                                     {"claim", c.says},
                                     {"reached", c.reached},
                                     {"verdict", name(c.verdict)},
                                     {"why", c.why}});
  out.summary["version"] = describeBuild();
  for (const auto& [key, value] : r.numbers.items()) out.summary[key] = value;
  return out;
}

}  // namespace ves
