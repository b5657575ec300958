// SPDX-License-Identifier: BSD-3-Clause
//
// Vehicles and recorded paths that this platform cannot show, refused before it moves.
#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "readers.hpp"
#include "ves/control/motion_plan.hpp"
#include "ves/control/path_checks.hpp"

namespace ves {
namespace {

/// A platform that goes from one pose about home to the next.
class Walk {
 public:
  /// A pose takes `period` [s].
  Walk(const ControllerConfig& c, double period) : checks_(c.safety, c.geometry), period_(period) {}

  void beginAt(const Vec6& x) { last_ = legLengths(geometry(), pose(x)); }
  /// What would stop it at x, or on the way there.
  Tripped go(const Vec6& x) {
    const Transform X_IP = pose(x);
    const Vec6 L = legLengths(geometry(), X_IP);
    Tripped t = checks_.pose(X_IP, Pose::from(x), L);
    if (!t.any() && last_) t = checks_.step(L, *last_, period_);
    last_ = L;
    return t;
  }

 private:
  const Geometry& geometry() const { return checks_.geometry(); }
  Transform pose(const Vec6& x) const { return geometry().fromHome(Pose::from(x)); }

  PathChecks checks_;
  double period_;             // [s]
  std::optional<Vec6> last_;  // [m] legs
};

}  // namespace

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
  Walk walk(c, kStep);
  for (int i = 0; i * kStep <= longest; ++i) {
    const Pose x = Pose::from(ground.at(i * kStep).x);
    const Tripped t = walk.go(x.stacked());
    if (t.any())
      root.section("base").failOfMotion(
          "ground", fmt::format("after {:.2f} s it is at {:.3f} {:.3f} {:.3f} m, {:.1f} {:.1f} "
                                "{:.1f} deg, and the {} check would stop the run; want less of it",
                                i * kStep, x.p.x(), x.p.y(), x.p.z(), x.rpy.x() / kDegree,
                                x.rpy.y() / kDegree, x.rpy.z() / kDegree, name(t.first())));
  }
}

/// What fires after admittance control has ended never fires.
void requireFiringsFit(Section& root, const ControllerConfig& c) {
  const auto* free = std::get_if<FreeBodyModel>(&c.vehicle.kind);
  const double longest = c.longestAdmittance();
  if (!free || longest == 0.0) return;
  const auto check = [&](const char* list, int n, const char* key, const Firing& one) {
    if (one.from < longest) return;
    root.section("base").section("free").fail(
        list,
        fmt::format("number {}, {}: begins at {:.4g} s, when admittance control has ended after "
                    "{:.4g} s; want an earlier one, or a longer program",
                    n, key, one.from, longest));
  };
  const Propulsion& p = free->propulsion;
  for (int i = 0; i < p.size; ++i) {
    const Thruster& thruster = p.thrusters[static_cast<std::size_t>(i)];
    for (int k = 0; k < thruster.size; ++k)
      check("thrusters", i, "firings_s", thruster.firings[static_cast<std::size_t>(k)]);
  }
  for (int i = 0; i < p.wheel_count; ++i) {
    const ReactionWheel& wheel = p.wheels[static_cast<std::size_t>(i)];
    for (int k = 0; k < wheel.size; ++k)
      check("wheels", i, "torques_s_nm", wheel.torques[static_cast<std::size_t>(k)].on);
  }
}

std::string ProgramRehearsal::next(const Segment& s) {
  const std::optional<Vec6> from = at_;
  const bool moves = s.kind == SegmentKind::kMove;
  if (s.kind == SegmentKind::kAdmittance || s.kind == SegmentKind::kPath) at_.reset();
  if (!moves && s.kind != SegmentKind::kTrajectory) return {};
  if (moves) at_ = s.target.stacked();
  if (!from && !moves) return {};
  Check failure = Check::kCount;
  if (from) {
    const MotionPlan plan = MotionPlan::of({c_.periodSeconds(), c_.gentle}, s, atRest(*from));
    if (!moves) at_ = plan.swings() ? std::nullopt : std::optional(plan.at(plan.steps(), {}).x);
    const PathChecks checks(c_.safety, c_.geometry);
    Rehearsal rehearsal;
    rehearsal.begin(plan, legLengths(c_.geometry, c_.geometry.fromHome(Pose::from(*from))));
    while (rehearsal.underWay()) rehearsal.advance(checks, c_.periodSeconds(), {});
    failure = rehearsal.failure();
  } else {
    failure = Walk(c_, c_.periodSeconds()).go(*at_).first();
  }
  if (failure == Check::kCount) return {};
  return fmt::format("the {} check would stop the run; want {}", name(failure),
                     moves ? "a target nearer home, or more time" : "less of it, or slower");
}

/// Row by row, and from where the segment before it ends, where that is known.
void requirePathFits(Section& root, const ControllerConfig& c) {
  if (c.path.cols() == 0) return;
  const auto refuse = [&](const std::string& why) {
    for (Section& item : root.list("program"))
      if (item.has("path")) item.section("path").failOfMotion("rows_m_deg", why);
  };
  std::optional<Vec6> before;
  for (int i = 0; i < c.program.size; ++i) {
    const Segment& s = c.program.segments[static_cast<std::size_t>(i)];
    if (s.kind == SegmentKind::kPath) break;
    if (s.kind == SegmentKind::kMove)
      before = s.target.stacked();
    else if (s.kind == SegmentKind::kTrajectory || s.kind == SegmentKind::kAdmittance)
      before.reset();
  }
  Walk walk(c, c.periodSeconds());
  if (before) walk.beginAt(*before);
  for (Eigen::Index k = 0; k < c.path.cols(); ++k) {
    const Tripped t = walk.go(c.path.col(k));
    if (!t.any()) continue;
    const std::string_view check = name(t.first());
    if (k == 0 && (t.has(Check::kVelocity) || t.has(Check::kFlow)))
      refuse(
          fmt::format("begins elsewhere than the segment before it ends: the {} check would "
                      "stop the run; want a move to its first row before it",
                      check));
    refuse(
        fmt::format("row {}: the {} check would stop the run; want less of it, or more rows "
                    "for the same way",
                    k + 1, check));
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
