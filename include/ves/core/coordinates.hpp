// SPDX-License-Identifier: BSD-3-Clause
//
// The six coordinates of a pose about home and the six components of a wrench: names and units, in
// the order of every list of six.
#pragma once

#include <array>
#include <string_view>

namespace ves {

struct Coordinate {
  std::string_view name;
  std::string_view unit;        // [SI] as names of columns and numbers end
  std::string_view yaml_unit;   // as keys of a configuration end
  double yaml = 1.0;            // [SI per yaml_unit]
  std::string_view shown_unit;  // on a screen
  double shown = 1.0;           // [shown_unit per SI]
};

inline constexpr double kRadianPerDegree = 0.017453292519943295;
inline constexpr double kShownAngle = 1.0 / kRadianPerDegree;

inline constexpr std::array<Coordinate, 6> kCoordinates = {{
    {"x", "m", "m", 1.0, "mm", 1e3},
    {"y", "m", "m", 1.0, "mm", 1e3},
    {"z", "m", "m", 1.0, "mm", 1e3},
    {"alpha", "rad", "deg", kRadianPerDegree, "deg", kShownAngle},
    {"beta", "rad", "deg", kRadianPerDegree, "deg", kShownAngle},
    {"gamma", "rad", "deg", kRadianPerDegree, "deg", kShownAngle},
}};

struct WrenchComponent {
  std::string_view name;
  std::string_view unit;        // [SI] as names of columns and numbers end
  std::string_view shown_unit;  // on a screen
};

inline constexpr std::array<WrenchComponent, 6> kWrenchComponents = {{
    {"fx", "n", "N"},
    {"fy", "n", "N"},
    {"fz", "n", "N"},
    {"mx", "nm", "N m"},
    {"my", "nm", "N m"},
    {"mz", "nm", "N m"},
}};

/// The i-th of six.
constexpr const Coordinate& coordinate(int i) { return kCoordinates[static_cast<std::size_t>(i)]; }
constexpr const WrenchComponent& wrenchComponent(int i) {
  return kWrenchComponents[static_cast<std::size_t>(i)];
}

}  // namespace ves
