// SPDX-License-Identifier: BSD-3-Clause
//
// Robots: any text is a serial arm with finite numbers, or one line.
#include <cmath>
#include <string>

#include "bytes.hpp"
#include "ves/config/urdf.hpp"
#include "ves/core/errors.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const ves::UrdfRobot robot =
        ves::loadUrdf(std::string(reinterpret_cast<const char*>(data), size), "fuzz.urdf");
    ves::fuzz::require(robot.model.joints <= ves::kMaxJoints);
    for (int i = 0; i < robot.model.joints; ++i) {
      const ves::Link& link = robot.model.link(i);
      ves::fuzz::require(std::isfinite(link.body.mass) && link.body.I_Bcm_B.allFinite() &&
                         link.X_parent.p.allFinite() && std::abs(link.axis.norm() - 1.0) < 1e-6);
    }
  } catch (const ves::InputError&) {
  }
  return 0;
}
