// SPDX-License-Identifier: BSD-3-Clause
#include "ves/validation/claims.hpp"

#include <fmt/args.h>
#include <fmt/format.h>

#include <cmath>

#include "ves/config/document.hpp"

namespace ves {

std::string name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAgrees: return "agrees";
    case Verdict::kDiffers: return "differs";
    case Verdict::kRange: return "a range";
    case Verdict::kCannotTell: return "cannot be judged";
  }
  return "";
}

Claims::Claims(const std::filesystem::path& file) : file_(file.string()) {
  const Value document = loadDocument(file);
  Section root(document, "");
  Section claims = root.section("claims");
  for (const std::string& id : claims.keys()) {
    Section s = claims.section(id);
    Entry& entry = entries_[id];
    entry.claim.where = s.text("where");
    entry.claim.says = s.text("says");
    entry.claim.reached = s.text("reached");
    entry.claim.why = s.text("why");
    if (s.has("agrees")) {
      Section ranges = s.section("agrees");
      for (const std::string& quantity : ranges.keys()) {
        const Eigen::VectorXd range = ranges.vector(quantity, 2, -HUGE_VAL, HUGE_VAL);
        if (!(range(0) <= range(1))) ranges.fail(quantity, "want the lower end first");
        entry.agrees[quantity] = {range(0), range(1)};
      }
      ranges.finish();
    }
    if (s.has("range") && s.flag("range")) entry.claim.verdict = Verdict::kRange;
    s.finish();
  }
  root.finish();
}

Claim Claims::judge(const std::string& id, const Quantities& measured) const {
  const auto at = entries_.find(id);
  if (at == entries_.end()) throw InputError(fmt::format("{}: no claim '{}'", file_, id));
  const Entry& entry = at->second;
  Claim out = entry.claim;
  fmt::dynamic_format_arg_store<fmt::format_context> arguments;
  for (const auto& [quantity, value] : measured)
    arguments.push_back(fmt::arg(quantity.c_str(), value));
  try {
    out.reached = fmt::vformat(out.reached, arguments);
  } catch (const fmt::format_error& error) {
    throw InputError(fmt::format("{}: claims.{}.reached: {}", file_, id, error.what()));
  }
  if (entry.agrees.empty()) return out;
  out.verdict = Verdict::kAgrees;
  for (const auto& [quantity, range] : entry.agrees) {
    const auto value = measured.find(quantity);
    if (value == measured.end())
      throw InputError(
          fmt::format("{}: claims.{}.agrees: {}: is not measured", file_, id, quantity));
    if (!(value->second >= range.first && value->second <= range.second))
      out.verdict = Verdict::kDiffers;
  }
  return out;
}

std::vector<std::string> Claims::ids() const {
  std::vector<std::string> out;
  for (const auto& [id, entry] : entries_) out.push_back(id);
  return out;
}

}  // namespace ves
