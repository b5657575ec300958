// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/moving_frame.hpp"

#include <algorithm>
#include <cmath>

namespace ves {
namespace {

BodyMotion motionOf(const PathPoint<6>& shown) noexcept {
  return bodyMotion(Vec3::Zero(), Pose::from(shown.x), shown.x_dot, shown.x_ddot);
}

/// k^2 x + 2 k x', at most so long.
Vec3 following(double k, const Vec3& x, const Vec3& x_dot, double most) noexcept {
  const Vec3 a = k * (k * x + 2.0 * x_dot);
  return a * std::min(1.0, most / std::max(a.norm(), 1e-300));
}

}  // namespace

MovingFrame::MovingFrame(const ControllerConfig& config)
    : settings_(config.moving_frame),
      home_(std::sqrt(settings_.acceleration / (settings_.share * config.safety.translation))),
      upright_(
          std::sqrt(settings_.angular_acceleration / (settings_.share * config.safety.rotation))) {}

void MovingFrame::begin(const BodyMotion& E_P) noexcept {
  const Vec3 p = E_P.X.p - E_H_.X.p;
  E_H_.w = E_P.w;
  E_H_.v = E_P.v - E_P.w.cross(p);
}

void MovingFrame::step(const PathPoint<6>& shown, const BodyMotion& E_P, double share,
                       double dt) noexcept {
  BodyMotion P = motionOf(shown);
  P.a = -share * following(home_, P.X.p, P.v, settings_.acceleration);
  P.alpha =
      -share * following(upright_, rotationVector(P.X.R), P.w, settings_.angular_acceleration);
  // What E_H has to do so that P, which coasts, is so accelerated in the laboratory.
  const BodyMotion moves = composed(E_H_, P);
  E_H_.alpha += E_P.alpha - moves.alpha;
  E_H_.a += E_P.a - composed(E_H_, P).a;
  E_H_ = later(E_H_, dt);
}

void MovingFrame::yield(const BodyMotion& E_P, const PathPoint<6>& shown) noexcept {
  const BodyMotion moved = composed(E_P, inverse(motionOf(shown)));
  E_H_.X = {orthogonal(moved.X.R), moved.X.p};
  E_H_.v = moved.v;
  E_H_.w = moved.w;
}

void MovingFrame::rest() noexcept { E_H_.v = E_H_.w = E_H_.a = E_H_.alpha = Vec3::Zero(); }

Emulated MovingFrame::emulated(const Mat3& R_IP) const noexcept {
  Emulated out;
  out.R_EP = R_IP;
  if (!settings_.enabled) return out;
  out.apart = true;
  out.R_EI = E_H_.X.R;
  out.R_EP = out.R_EI * R_IP;
  return out;
}

Emulated MovingFrame::emulated(const Mat3& R_IP, const BodyMotion& E_P,
                               double since) const noexcept {
  Emulated out;
  out.apart = true;
  out.R_EP = rotationOf(since * E_P.w) * E_P.X.R;
  out.R_EI = out.R_EP * R_IP.transpose();
  out.v = E_P.v;
  out.w = E_P.w;
  return out;
}

Vec6 MovingFrame::emulated(const Vec6& x) const noexcept {
  const Transform X_EP = E_H_.X * Transform{rotation(Vec3(x.tail<3>())), x.head<3>()};
  return (Vec6() << X_EP.p, fixedAngles(X_EP.R)).finished();
}

Vec6 MovingFrame::along(const Vec3& p_EP, double ago) const noexcept {
  const BodyMotion H = later(E_H_, -ago);
  return (Vec6() << H.v + H.w.cross(p_EP - H.X.p), H.w).finished();
}

}  // namespace ves
