// SPDX-License-Identifier: BSD-3-Clause
//
// What testPlatform can be told to do: the items of its menu, a program of them, orders.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "ves/control/trajectory_generation.hpp"

namespace ves {

struct Program {
  int size = 0;
  std::array<Segment, kMaxSegments> segments{};
};

/// The first of its segments that is admittance control; its size when none is.
int admittanceSegment(const Program& program) noexcept;

/// One of its segments is admittance control.
bool wantsAdmittance(const Program& program) noexcept;

/// A calibration takes so many samples, and so does each sample of a monitor segment.
inline constexpr int kCalibrationSamples = 100;  // [-] per channel

}  // namespace ves
