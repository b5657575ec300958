// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/ranges.h>

#include <algorithm>
#include <regex>

#include "rows.hpp"
#include "ves/run/run.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;
using Sets = std::vector<std::string>;

/// The segment in which faults come, and when in it.
constexpr int kSegment = 2;
constexpr double kInjection = 2.0;  // [s]

/// What a lockstep run should come to.
struct Expectation {
  Phase phase = Phase::kParked;
  std::vector<Check> causes;  // any of them; none: no stop
  std::vector<Check> with;    // also latched
  int within = 0;             // [-] ticks from injection to detection; 0: not asked
  bool aborted = false;
};

/// The enumerator of that name, up to kCount.
template <typename Enum>
Enum named(const Section& s, const char* key, const std::string& text, Enum count) {
  std::vector<std::string_view> names;
  for (int i = 0; i < static_cast<int>(count); ++i) names.push_back(name(static_cast<Enum>(i)));
  const auto at = std::find(names.begin(), names.end(), text);
  if (at == names.end())
    s.fail(key, fmt::format("'{}', want one of {}", text, fmt::join(names, ", ")));
  return static_cast<Enum>(at - names.begin());
}

Expectation readExpectation(Section s) {
  Expectation out;
  const std::string phase = s.choice("phase", {name(Phase::kParked), name(Phase::kStopped)});
  out.phase = phase == name(Phase::kParked) ? Phase::kParked : Phase::kStopped;
  if (s.has("cause")) out.causes.push_back(named(s, "cause", s.text("cause"), Check::kCount));
  for (const auto& [key, list] : {std::pair("or", &out.causes), std::pair("with", &out.with)})
    if (s.has(key))
      for (const std::string& text : s.texts(key))
        list->push_back(named(s, key, text, Check::kCount));
  if (s.has("within_ticks")) out.within = static_cast<int>(s.integer("within_ticks", 1, 10'000));
  if (s.has("aborted")) out.aborted = s.flag("aborted");
  s.finish();
  return out;
}

/// "0.2*m" and "15*a" in the unit's size of this platform.
std::string scaled(const std::string& text, const WorkspaceScale& scale) {
  static const std::regex kNumber("(-?[0-9.]+)\\*([ma])");
  std::string out;
  auto rest = text.cbegin();
  for (std::sregex_iterator at(text.begin(), text.end(), kNumber), end; at != end; ++at) {
    out.append(rest, (*at)[0].first);
    out +=
        fmt::format("{}", std::stod((*at)[1]) * ((*at)[2] == "m" ? scale.lengths : scale.angles));
    rest = (*at)[0].second;
  }
  return out.append(rest, text.cend());
}

FaultOutcome run(const Experiment& e, const Expectation& expected) {
  FaultOutcome out;
  out.period = e.controller.periodSeconds();
  std::int64_t injected = -1, detected = -1;
  bool braked = false;
  double farthest = 0.0;  // [m] from home
  TickState last;
  const RunResult result = runLockstep(e, nullptr, [&](const TickState& s) {
    if (injected < 0 && s.segment == kSegment && s.phase == Phase::kRunning)
      injected = s.tick + static_cast<std::int64_t>(kInjection / out.period);
    if (detected < 0 && s.latched.any()) detected = s.tick;
    braked = braked || s.phase == Phase::kStopping;
    if (injected >= 0 && s.tick >= injected)
      out.peak_deviation =
          std::max(out.peak_deviation, (s.desired.head<3>() - s.measured.p).norm());
    farthest = std::max(farthest, s.measured.p.norm());
    last = s;
    return Order();
  });
  bool as_expected = result.phase == expected.phase && result.aborted == expected.aborted;
  if (result.phase == Phase::kStopped) {
    if (injected >= 0) out.ticks = detected - injected;
    out.what = fmt::format("{}: {}", braked ? "controlled stop" : "freeze", names(last.latched));
    as_expected =
        as_expected && std::count(expected.causes.begin(), expected.causes.end(), result.cause) > 0;
  } else {
    out.what = fmt::format("{}{} after {} ticks, at most {:.0f} mm from home", name(result.phase),
                           result.aborted ? fmt::format(" early ({})", name(last.aborted_by)) : "",
                           result.ticks, farthest * 1e3);
  }
  for (const Check check : expected.with) as_expected = as_expected && last.latched.has(check);
  if (expected.within > 0)
    as_expected = as_expected && out.ticks >= 0 && out.ticks <= expected.within;
  out.as_expected = as_expected;
  return out;
}

}  // namespace

Experiment faultScenario(const FaultBench& bench, const Sets& sets) {
  Sets all = bench.sets;
  all.insert(all.end(), sets.begin(), sets.end());
  Experiment e = loadExperiment(findScenario(bench.scenario, bench.config), all);
  if (wantsAdmittance(e.controller.program)) applyStabilityCheck(e);
  return e;
}

std::vector<FaultRow> scenarioRows(const FaultBench& bench) {
  const Value document = loadDocument(bench.config / "faults.yaml");
  Section root(document, "");
  const WorkspaceScale scale(
      loadExperiment(findScenario(bench.scenario, bench.config), bench.sets).controller.safety,
      bench);
  Section segments = root.section("segments");
  std::vector<FaultRow> rows;
  for (Section s : root.list("rows")) {
    FaultRow row;
    row.id = s.text("id");
    row.fault = s.text("fault");
    row.expected = s.text("expected");
    Sets sets;
    if (s.has("in"))
      sets.push_back(fmt::format(
          "program=[{{calibration: {{}}}}, {{move: {{to: {{x_m: {}}}, duration_s: 1}}}}, {{{}, "
          "faults: [{}]}}]",
          0.02 * scale.lengths, scaled(segments.text(s.text("in")), scale),
          fmt::join(s.texts("inject"), ", ")));
    row.any_machine = !s.has("set") && !(s.has("own") && s.flag("own"));
    if (s.has("set"))
      for (const std::string& set : s.texts("set")) sets.push_back(set);
    const Expectation expected = readExpectation(s.section("expect"));
    s.finish();
    row.run = [=] { return run(faultScenario(bench, sets), expected); };
    rows.push_back(row);
  }
  root.finish();
  return rows;
}

}  // namespace ves
