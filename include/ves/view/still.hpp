// SPDX-License-Identifier: BSD-3-Clause
//
// One instant of a scene as a drawing that needs no browser to turn it.
#pragma once

#include <string>
#include <vector>

#include "ves/view/scene.hpp"

namespace ves {

enum class StillView { kPlatform, kArm };

/// SVG, seen from above and aside without perspective: the platform and what stands on it, or the
/// whole arm.
std::string still(const Scene& scene, const std::vector<float>& picture, StillView view);

/// The experiment's scene at home, the robot as it stands at the start.
std::string stillAtStart(const Experiment& experiment, StillView view);

}  // namespace ves
