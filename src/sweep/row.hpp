// SPDX-License-Identifier: BSD-3-Clause
//
// A run of a sweep, as a row of its table.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "ves/core/memo.hpp"
#include "ves/evaluation/let_go.hpp"
#include "ves/sweep/sweep.hpp"

namespace ves {

/// What the stability check said, and what it makes of a controller.
struct Judged {
  std::string diverges;
  Stability stability, uncompensated;
  double stable_for, stable_for_uncompensated;
};

/// What runs share that differ in what neither belief nor base know of.
struct SharedByRuns {
  ReferenceMotions references;
  Memo<std::string, Judged, 64> verdicts;
};

inline constexpr std::string_view kWords[] = {"ended", "first_cause"};  // columns of words

std::string headerOf(const SweepPlan& plan);

/// What could not run says so in its row.
std::string rowOf(const SweepPlan& plan, const Value& scenario, std::int64_t run,
                  SharedByRuns& shared);

}  // namespace ves
