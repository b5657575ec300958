// SPDX-License-Identifier: BSD-3-Clause
//
// A scene as a drawing that needs no program to turn it: one instant, or a while that repeats.
#pragma once

#include <string>
#include <vector>

#include "ves/page/scene.hpp"

namespace ves {

enum class StillView { kPlatform, kArm };

/// SVG, seen from above and aside without perspective: the platform and what stands on it, or the
/// whole arm. The experiment's scene at home, the robot as it stands at the start.
std::string stillAtStart(const Experiment& experiment, StillView view);

struct MovingOptions {
  double from = 0.0, to = 0.0;  // [s] of the run
  double rate = 0.0;            // [1/s] drawings; between them a browser interpolates
};

/// SVG of a run as it moves, over and over. Throws InputError when nothing was recorded then.
std::string moving(const Series& series, const MovingOptions& options);

}  // namespace ves
