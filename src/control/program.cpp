// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/program.hpp"

#include <algorithm>

namespace ves {

int admittanceSegment(const Program& program) noexcept {
  const auto begin = program.segments.begin(), end = begin + program.size;
  return static_cast<int>(std::find_if(begin, end,
                                       [](const Segment& segment) {
                                         return segment.kind == SegmentKind::kAdmittance;
                                       }) -
                          begin);
}

bool wantsAdmittance(const Program& program) noexcept {
  return admittanceSegment(program) < program.size;
}

}  // namespace ves
