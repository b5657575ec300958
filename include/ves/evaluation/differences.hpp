// SPDX-License-Identifier: BSD-3-Clause
//
// What two runs or more differ in: their configurations, and what came of them.
#pragma once

#include "ves/series/series.hpp"
#include "ves/evaluation/summary.hpp"

namespace ves {

/// A key of which not all runs have the same value; "-" where a run has none.
struct KeyDifference {
  std::string key;
  std::vector<std::string> values;
};

/// Of the resolved configurations, leaf by leaf: "robot.joints_deg_or_m[3]". Long texts by their
/// fingerprint.
std::vector<KeyDifference> configurationDifferences(const std::vector<const Experiment*>& runs);

/// Of summaries, leaf by leaf, without what is the machine's rather than the run's (wall-clock
/// times, versions).
std::vector<KeyDifference> summaryDifferences(const std::vector<nlohmann::ordered_json>& runs);

/// How the run of a log ended, as its last tick tells.
RunResult resultOf(const Series& series);

}  // namespace ves
