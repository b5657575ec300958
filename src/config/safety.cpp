// SPDX-License-Identifier: BSD-3-Clause
#include "readers.hpp"

#include <fmt/format.h>

namespace ves {
namespace {

/// The platform must be allowed to stand at home.
void requireHome(const Section& s, const SafetyLimits& l, const Geometry& geometry) {
  const Transform home = geometry.fromHome({});
  const Vec6 L = legLengths(geometry, home);
  for (int i = 0; i < kLegs; ++i)
    if (!(L(i) >= l.leg_min && L(i) <= l.leg_max))
      s.fail(L(i) < l.leg_min ? "leg_min_m" : "leg_max_m",
             fmt::format("leg {} is {:.4f} m at home, want [{:.4f}, {:.4f}] around it", i + 1, L(i),
                         l.leg_min, l.leg_max));
  const LegGap gap = nearestLegs(geometry, home);
  if (!(gap.distance >= l.leg_clearance))
    s.fail("leg_clearance_m", fmt::format("legs {} and {} are {:.4f} m apart at home, want at most "
                                          "that",
                                          gap.first + 1, gap.second + 1, gap.distance));
  const LegSlope slope = flattestLeg(geometry, home);
  if (!(slope.angle >= l.plate_angle))
    s.fail("plate_angle_deg", fmt::format("leg {} stands at {:.2f} deg to a plate at home, want at "
                                          "most that",
                                          slope.leg + 1, slope.angle / kDegree));
  const double condition = conditionNumber(geometry, home);
  if (!(condition <= l.condition))
    s.fail("condition_number", fmt::format("it is {:.3g} at home, want more than that", condition));
}

void readLimit(Section& s, const Limit<double>& limit, double derived) {
  if (!std::isnan(limit.before) && !s.has(limit.key)) {
    limit.value = limit.before;
    return;
  }
  const double shown = limit.derives
                           ? s.numberOr(limit.key, limit.least, limit.most, derived / limit.unit)
                           : s.number(limit.key, limit.least, limit.most);
  limit.value = shown * limit.unit;
}

/// A number of something, or of the converter's counts for a voltage.
void readLimit(Section& s, const Limit<int>& limit, int) {
  if (!std::isnan(limit.before) && !s.has(limit.key))
    limit.value = static_cast<int>(limit.before);
  else if (limit.unit == 1.0)
    limit.value =
        static_cast<int>(s.integer(limit.key, std::llround(limit.least), std::llround(limit.most)));
  else
    limit.value =
        static_cast<int>(std::lround(s.number(limit.key, limit.least, limit.most) * limit.unit));
}

}  // namespace

SafetyLimits readSafety(Section s, const Geometry& geometry, const WorkspaceUse& use,
                        const Legs& legs, double volts_per_count) {
  const SafetyLimits derived =
      derivedLimits(use, {legs.actuator.length_min, legs.actuator.length_max},
                    plant::nominalServo(legs.gains, legs.actuator, legs.transducer));
  SafetyLimits l;
  std::apply(
      [&](const auto&... derived_limit) {
        std::apply([&](const auto&... limit) { (readLimit(s, limit, derived_limit.value), ...); },
                   limitTable(l, volts_per_count));
      },
      limitTable(derived, volts_per_count));
  requireHome(s, l, geometry);
  s.finish();
  return l;
}

}  // namespace ves
