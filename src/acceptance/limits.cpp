// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "ves/acceptance/acceptance.hpp"
#include "ves/config/document.hpp"
#include "ves/core/coordinates.hpp"

namespace ves {
namespace {

const QuantityMeaning& meaningOf(Quantity quantity) {
  return kQuantities[static_cast<std::size_t>(quantity)];
}

/// What a limit may be of.
std::vector<std::string_view> subjects() {
  std::vector<std::string_view> out;
  for (const Coordinate& c : kCoordinates) out.push_back(c.name);
  for (const char* leg : {"leg_1", "leg_2", "leg_3", "leg_4", "leg_5", "leg_6"})
    out.emplace_back(leg);
  return out;
}

AcceptanceLimit readLimit(Section& s) {
  AcceptanceLimit out;
  std::vector<std::string_view> names;
  for (const QuantityMeaning& q : kQuantities) names.emplace_back(q.name);
  const std::string quantity = s.choice("quantity", names);
  out.quantity =
      static_cast<Quantity>(std::find(names.begin(), names.end(), quantity) - names.begin());
  const QuantityMeaning& meaning = meaningOf(out.quantity);
  const bool differs = meaning.unit == Per::kWay || meaning.unit == Per::kAcceleration;
  if (s.has("of")) {
    const std::vector<std::string_view> all = subjects();
    for (const std::string& one : s.texts("of")) {
      if (std::find(all.begin(), all.end(), one) == all.end())
        s.fail("of", fmt::format("'{}', want some of {}", one, fmt::join(all, ", ")));
      const bool of_legs = out.quantity == Quantity::kHysteresis ||
                           out.quantity == Quantity::kOffset || out.quantity == Quantity::kLag;
      if (one.starts_with("leg_") && !of_legs)
        s.fail("of",
               fmt::format("{} has no {}, want hysteresis, offset or lag of it", one, quantity));
      out.of.push_back(one);
    }
  }
  if (differs) {
    if (out.of.empty())
      s.fail("of", fmt::format("is missing, want it: {} is a length of some and an angle of "
                               "others",
                               quantity));
    for (const std::string& one : out.of)
      if (turns(one) != turns(out.of.front()))
        s.fail("of", "has lengths and angles, want an entry for each");
  }
  const Unit unit = unitOf(out.quantity, !out.of.empty() && turns(out.of.front()));
  const std::string least = std::string("least") + unit.key, most = std::string("most") + unit.key;
  if (s.has(least)) out.least = s.number(least, -1e9, 1e9) * unit.key_si;
  if (s.has(most)) out.most = s.number(most, -1e9, 1e9) * unit.key_si;
  if (!s.has(least) && !s.has(most))
    s.fail(most, fmt::format("is missing, want {}, {}, or both", least, most));
  if (!(out.least <= out.most)) s.fail(most, fmt::format("is below {}, want it above", least));
  if (meaning.of_sine) {
    if (s.has("from_hz")) out.from = s.number("from_hz", 0.0, 1e3);
    if (s.has("up_to_hz")) out.up_to = s.number("up_to_hz", out.from, 1e3);
  }
  s.finish();

  out.text = quantity;
  if (!out.of.empty()) out.text += fmt::format(" of {}", fmt::join(out.of, ", "));
  const std::string shown_unit = meaning.unit == Per::kOne ? "" : " " + std::string(unit.key + 1);
  if (std::isfinite(out.least))
    out.text += fmt::format(", at least {:g}{}", out.least / unit.key_si, shown_unit);
  if (std::isfinite(out.most))
    out.text += fmt::format(", at most {:g}{}", out.most / unit.key_si, shown_unit);
  if (out.from > 0.0) out.text += fmt::format(", from {:g} Hz", out.from);
  if (std::isfinite(out.up_to)) out.text += fmt::format(", up to {:g} Hz", out.up_to);
  return out;
}

using Is = AcceptanceVerdict::Is;

/// [any] By how much an estimate is past the limit: its nearest and its farthest end.
struct Past {
  double nearest, farthest;
};
Past past(const AcceptanceLimit& limit, const Estimate& e) {
  const double low = e.value - e.within, high = e.value + e.within;
  return {std::max(limit.least - high, low - limit.most),
          std::max(limit.least - low, high - limit.most)};
}

}  // namespace

std::vector<AcceptanceLimit> readLimits(const std::filesystem::path& file) {
  const Value document = loadDocument(file);
  Section root(document, "");
  std::vector<AcceptanceLimit> out;
  for (Section one : root.list("limits")) out.push_back(readLimit(one));
  root.finish();
  return out;
}

const char* partOf(Quantity quantity) noexcept {
  switch (quantity) {
    case Quantity::kHysteresis:
    case Quantity::kOffset:
    case Quantity::kLag: return "passes";
    case Quantity::kThreshold: return "steps";
    case Quantity::kRestPosition:
    case Quantity::kRestAcceleration:
    case Quantity::kCount: return "";
    default: return "sines";
  }
}

const char* name(Is is) {
  switch (is) {
    case Is::kKept: return "kept";
    case Is::kBroken: return "BROKEN";
    case Is::kOpen: return "open";
    case Is::kNotMeasured: return "not measured";
  }
  return "";
}

std::vector<AcceptanceVerdict> judge(const std::vector<AcceptanceLimit>& limits,
                                     const std::vector<CoordinateResult>& found) {
  std::vector<AcceptanceVerdict> out;
  for (const AcceptanceLimit& limit : limits) {
    AcceptanceVerdict verdict{limit, {}};
    double worst = -HUGE_VAL;
    std::vector<std::string> seen;
    for (const CoordinateResult& coordinate : found)
      for (const Measurement& f : coordinate.all) {
        if (f.quantity != limit.quantity) continue;
        const bool asked =
            limit.of.empty() ? !f.of.starts_with("leg_")
                             : std::find(limit.of.begin(), limit.of.end(), f.of) != limit.of.end();
        if (!asked || f.frequency < limit.from || f.frequency > limit.up_to) continue;
        seen.push_back(f.of);
        const Past by = past(limit, f.estimate);
        const Is is = by.nearest > 0.0     ? Is::kBroken
                      : by.farthest <= 0.0 ? Is::kKept
                                           : Is::kOpen;  // NaN too
        if (verdict.worst && (is < verdict.is || (is == verdict.is && !(by.farthest > worst))))
          continue;
        verdict.worst = f;
        verdict.is = is;
        worst = by.farthest;
      }
    for (const std::string& one : limit.of)
      if (std::find(seen.begin(), seen.end(), one) == seen.end() && verdict.is == Is::kKept)
        verdict = {limit, {}};
    if (limit.of.empty() && verdict.is == Is::kKept)
      for (const CoordinateResult& coordinate : found)
        if (std::find(seen.begin(), seen.end(), ves::coordinate(coordinate.coordinate).name) ==
            seen.end())
          verdict = {limit, {}};
    out.push_back(std::move(verdict));
  }
  return out;
}

}  // namespace ves
