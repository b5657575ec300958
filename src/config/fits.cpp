// SPDX-License-Identifier: BSD-3-Clause
//
// Vehicles that this platform cannot show, refused before it moves.
#include <fmt/format.h>

#include <algorithm>

#include "readers.hpp"
#include "ves/control/path_checks.hpp"

namespace ves {

/// As long as the program asks for it, and within what the platform may do.
void requireGroundFits(Section& root, const ControllerConfig& c) {
  constexpr double kStep = 0.02;  // [s]
  const GroundMotion& ground = c.vehicle.ground;
  const double longest = c.longestAdmittance();
  if (!ground.moves() || longest == 0.0) return;
  if (!(ground.lasts() >= longest))
    root.section("base").fail(
        "ground", fmt::format("its recording lasts {:.4g} s, and admittance control {:.4g} s; want "
                              "a longer one, or less of the program",
                              ground.lasts(), longest));
  const PathChecks checks(c.safety, c.geometry);
  Vec6 last = Vec6::Zero();
  for (int i = 0; i * kStep <= longest; ++i) {
    const Pose x = Pose::from(ground.at(i * kStep).x);
    const Transform X_IP = c.geometry.fromHome(x);
    const Vec6 L = legLengths(c.geometry, X_IP);
    Tripped t = checks.pose(X_IP, x, L);
    if (!t.any() && i > 0) t = checks.step(L, last, kStep);
    last = L;
    if (t.any())
      root.section("base").fail(
          "ground", fmt::format("after {:.2f} s it is at {:.3f} {:.3f} {:.3f} m, {:.1f} {:.1f} "
                                "{:.1f} deg, and the {} check would stop the run; want less of it",
                                i * kStep, x.p.x(), x.p.y(), x.p.z(), x.rpy.x() / kDegree,
                                x.rpy.y() / kDegree, x.rpy.z() / kDegree, name(t.first())));
  }
}

/// A laboratory flies along with what floats, and nobody in it pushes; without one, the platform
/// itself has to go where the vehicle goes.
void requireFrameFits(Section& root, const ControllerConfig& c, const RobotTask& task) {
  constexpr double kMostSpeed = 1.0;  // [m/s] of a platform
  const auto* free = std::get_if<FreeBodyModel>(&c.vehicle.kind);
  if (!c.moving_frame.enabled) {
    if (free && !(free->v_IPo_I.cwiseAbs().maxCoeff() <= kMostSpeed))
      root.section("base").fail(
          "free",
          fmt::format("velocity_m_per_s: faster than {:.4g} m/s, which no platform follows; "
                      "want less, or 'enabled: true' in controller.moving_frame",
                      kMostSpeed));
    return;
  }
  const auto refuse = [&](const char* why) {
    root.section("controller").section("moving_frame").fail("enabled", why);
  };
  if (!free)
    refuse(
        "this base stays where it is, and the laboratory need not move; want a base that is "
        "'free', or false");
  const auto* end = c.program.segments.begin() + c.program.size;
  const bool calibrated = std::any_of(c.program.segments.begin(), end, [](const Segment& s) {
    return s.kind == SegmentKind::kCalibration;
  });
  if (c.moving_frame.steady_in_contact && !calibrated)
    root.section("controller")
        .section("moving_frame")
        .fail("steady_in_contact",
              "what is felt is known after a calibration, want one in the program, or false");
  for (const RobotEvent& event : task.robot_events)
    if (std::holds_alternative<Push>(event.action))
      refuse("a push is in the laboratory's axes, and would turn with it; want no push, or false");
}

}  // namespace ves
