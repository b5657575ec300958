// SPDX-License-Identifier: BSD-3-Clause
//
// Pictures of a run.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "ves/evaluation/tool_motion.hpp"

namespace ves {

/// Draws with gnuplot pose.png, error.png, wrench.png, legs.png; servos.png and masses.png
/// where these are learnt; tool.png where the robot has a tool and a base to move on; contact.png where there is
/// something to touch. Returns those that exist now.
std::vector<std::filesystem::path> drawPlots(const Series& series,
                                             const std::optional<Emulation>& emulation,
                                             const std::optional<ToolMotion>& tool,
                                             const std::filesystem::path& folder);

}  // namespace ves
