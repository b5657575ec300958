// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "ves/acceptance/acceptance.hpp"
#include "ves/core/coordinates.hpp"

namespace ves {
namespace {

/// "12.3 +- 0.4", to the digits that the interval leaves.
std::string shown(const Estimate& e, double per_si) {
  const double value = e.value * per_si, within = e.within * per_si;
  if (!std::isfinite(value)) return "-";
  if (std::abs(value) < 1e-9) return "0";  // no count has changed
  if (!std::isfinite(within) || within <= 0.0) return fmt::format("{:.3g}", value);
  const int digits = std::clamp(1 - static_cast<int>(std::floor(std::log10(within))), 0, 6);
  return fmt::format("{:.{}f} ± {:.{}f}", value, digits, within, digits);
}

std::string shown(const Measurement& f) { return shown(f.estimate, unitOf(f).per_si); }

const Measurement* find(const CoordinateResult& found, const std::string& of, Quantity quantity) {
  for (const Measurement& f : found.all)
    if (f.of == of && f.quantity == quantity) return &f;
  return nullptr;
}

/// A quantity over frequency at one level of the amplitude.
Line curveOf(const CoordinateResult& found, Quantity quantity, double level, int colour) {
  Line out;
  out.colour = colour;
  out.name = fmt::format("{:g} % of the largest", 100.0 * level);
  double turns = 0.0;
  for (const Measurement& f : found.all) {
    if (f.quantity != quantity || f.level != level) continue;
    double y = f.estimate.value * unitOf(f).per_si;
    if (quantity == Quantity::kPhase) {  // goes on falling
      while (!out.y.empty() && y + turns - out.y.back() > 180.0) turns -= 360.0;
      y += turns;
    }
    out.x.push_back(f.frequency);
    out.y.push_back(y);
  }
  return out;
}

std::vector<double> levelsOf(const AcceptanceTest& test) {
  std::vector<double> out;
  for (const AcceptanceTest::Sine& s : test.sines)
    if (std::find(out.begin(), out.end(), s.level) == out.end()) out.push_back(s.level);
  return out;
}

Line scaled(const std::string& name, const Track& track, double x, double y, int colour,
            bool dashed = false) {
  Line out{name, track.t, track.y, colour, dashed};
  for (double& one : out.x) one *= x;
  for (double& one : out.y) one *= y;
  return out;
}

void coordinateSection(Page& page, const AcceptanceTest& test, const CoordinateResult& found,
                       const std::string& command) {
  constexpr int kColours = 3;
  const Coordinate& c = coordinate(test.coordinate);
  page.section(std::string(c.name));
  const auto span = [&](const Travel& t, double sign) {
    return fmt::format(
        "{:+.4g} {} ({})", sign * t.distance * c.shown, c.shown_unit,
        t.ends == Check::kMotionLimits ? "nothing else ends it nearer" : name(t.ends));
  };
  std::string limits = fmt::format(
      "By geometry, from home and alone: {} to {}; the legs' commanded speed allows "
      "{:.3g} {}/s",
      span(test.down, -1.0), span(test.up, 1.0), test.fastest * c.shown, c.shown_unit);
  if (test.hardest > 0.0)
    limits += fmt::format(", the force sensor's range {:.3g} {}",
                          test.hardest * (test.coordinate < 3 ? 1.0 : c.shown),
                          test.coordinate < 3 ? "m/s^2" : "deg/s^2");
  page.text(limits + ".");
  for (const std::string& one : found.missing) page.text("Not measured: " + one + ".");

  Panel gain{"frequency [Hz]", "gain [-]", {}, true},
      phase{"frequency [Hz]", "phase [deg]", {}, true};
  int colour = 0;
  for (const double level : levelsOf(test)) {
    gain.lines.push_back(curveOf(found, Quantity::kGain, level, colour % kColours));
    phase.lines.push_back(curveOf(found, Quantity::kPhase, level, colour++ % kColours));
  }
  const auto empty = [](const Panel& p) {
    return std::all_of(p.lines.begin(), p.lines.end(),
                       [](const Line& l) { return l.x.size() < 2; });
  };
  if (!empty(gain))
    page.figure(
        fmt::format("Describing function of {}: done over told, by the transducers.", c.name),
        {gain, phase}, command);
  std::vector<Panel> panels;
  if (!found.loop_up.t.empty())
    panels.push_back({fmt::format("told [{}]", c.shown_unit),
                      fmt::format("done less told [{}]", c.shown_unit),
                      {scaled("up", found.loop_up, c.shown, c.shown, 0),
                       scaled("down", found.loop_down, c.shown, c.shown, 1)},
                      false});
  if (!found.step_felt.t.empty()) {
    const double per = test.coordinate < 3 ? 1.0 : c.shown;
    panels.push_back({"since the step [ms]",
                      test.coordinate < 3 ? "acceleration [m/s^2]" : "acceleration [deg/s^2]",
                      {scaled("told", found.step_told, 1e3, per, 1, true),
                       scaled("felt", found.step_felt, 1e3, per, 0)},
                      false});
  }
  if (!panels.empty())
    page.figure(
        fmt::format("{}: a slow pass up and one down at {:.3g} {}/s; a step of acceleration, "
                    "mean of the repetitions, by the force sensor.",
                    c.name, test.slow * c.shown, c.shown_unit),
        panels, command);

  std::vector<std::vector<std::string>> rows;
  for (const AcceptanceTest::Sine& s : test.sines) {
    std::vector<std::string> row = {fmt::format("{:g}", s.frequency),
                                    fmt::format("{:.3g}", s.amplitude * c.shown)};
    bool any = false;
    for (const Quantity q :
         {Quantity::kGain, Quantity::kPhase, Quantity::kCrosstalk, Quantity::kHarmonics,
          Quantity::kRoughness, Quantity::kPeak, Quantity::kTurnAround}) {
      std::string cell = "-";
      for (const Measurement& f : found.all)
        if (f.quantity == q && f.frequency == s.frequency && f.level == s.level) {
          cell = shown(f) + (f.note.empty() ? "" : " " + f.note);
          any = true;
        }
      row.push_back(cell);
    }
    if (any) rows.push_back(row);
  }
  page.table({"Hz", fmt::format("amplitude [{}]", c.shown_unit), "gain", "phase [deg]", "crosstalk",
              "harmonics", "roughness", "peak noise",
              test.coordinate < 3 ? "turn-around [m/s^2]" : "turn-around [deg/s^2]"},
             rows);
}

}  // namespace

Table acceptanceSummary(const std::vector<CoordinateResult>& found) {
  Table out{"Of each coordinate alone, 95 % intervals",
            {"", "-90 deg at [Hz]", "hysteresis", "offset", "lag [ms]", "threshold [ms]",
             "noise at rest", "of acceleration"},
            {}};
  for (const CoordinateResult& one : found) {
    std::vector<std::string> subjects = {std::string(coordinate(one.coordinate).name)};
    for (const Measurement& f : one.all)
      if (f.of != subjects.back() && f.of.starts_with("leg_") &&
          std::find(subjects.begin(), subjects.end(), f.of) == subjects.end())
        subjects.push_back(f.of);
    for (const std::string& of : subjects) {
      std::vector<std::string> row = {of};
      for (const Quantity q :
           {Quantity::kCorner, Quantity::kHysteresis, Quantity::kOffset, Quantity::kLag,
            Quantity::kThreshold, Quantity::kRestPosition, Quantity::kRestAcceleration}) {
        const Measurement* f = find(one, of, q);
        const bool named =
            q == Quantity::kCorner || q == Quantity::kLag || q == Quantity::kThreshold;
        row.push_back(!f ? "-" : named ? shown(*f) : shown(*f) + " " + unitOf(*f).name);
      }
      out.rows.push_back(row);
    }
  }
  return out;
}

Table verdictTable(const std::vector<AcceptanceVerdict>& verdicts) {
  Table out{"What was asked", {"limit", "worst", "where", "verdict"}, {}};
  for (const AcceptanceVerdict& v : verdicts) {
    std::string worst = "-", where = "-";
    if (v.worst) {
      const Measurement& f = *v.worst;
      worst = shown(f) + (*unitOf(f).name ? std::string(" ") + unitOf(f).name : "");
      where = f.of;
      if (std::isfinite(f.frequency))
        where +=
            fmt::format(", {:g} Hz, {:g} % of the largest amplitude", f.frequency, 100.0 * f.level);
    }
    out.rows.push_back({v.limit.text, worst, where, name(v.is)});
  }
  return out;
}

std::string acceptanceCsv(const std::vector<CoordinateResult>& found) {
  std::string out = "of,quantity,unit,value,within_95,frequency_hz,amplitude_m_or_rad,note\r\n";
  const auto number = [](double x) { return std::isfinite(x) ? fmt::format("{:.9g}", x) : ""; };
  for (const CoordinateResult& one : found)
    for (const Measurement& f : one.all) {
      out += fmt::format("{},{},{},{},{},{},{},{}\r\n", f.of,
                         kQuantities[static_cast<std::size_t>(f.quantity)].name, unitOf(f).si,
                         number(f.estimate.value), number(f.estimate.within), number(f.frequency),
                         number(f.amplitude), csvField(f.note));
    }
  return out;
}

Page acceptancePage(const std::vector<AcceptanceTest>& tests,
                    const std::vector<CoordinateResult>& found,
                    const std::vector<AcceptanceVerdict>& verdicts,
                    const std::vector<std::string>& conditions, const std::string& command) {
  Page page;
  for (const std::string& one : conditions) page.text(one);
  const auto add = [&](const Table& table) {
    page.section(table.title);
    page.table(table.header, table.rows);
  };
  if (!verdicts.empty()) add(verdictTable(verdicts));
  add(acceptanceSummary(found));
  for (std::size_t i = 0; i < found.size(); ++i)
    coordinateSection(page, tests[i], found[i], command);
  std::vector<std::vector<std::string>> meanings;
  for (const QuantityMeaning& q : kQuantities) meanings.push_back({q.name, q.meaning});
  page.section("What the numbers mean");
  page.table({"quantity", "meaning"}, meanings);
  return page;
}

}  // namespace ves
