// SPDX-License-Identifier: BSD-3-Clause
//
// Pictures of a run.
#pragma once

#include <filesystem>
#include <vector>

#include "ves/results/series.hpp"

namespace ves {

/// Draws pose.png, error.png, wrench.png and legs.png from folder/series.csv with gnuplot; returns
/// those that exist now.
std::vector<std::filesystem::path> drawPlots(const Series& series,
                                             const std::filesystem::path& folder);

}  // namespace ves
