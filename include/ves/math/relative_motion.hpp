// SPDX-License-Identifier: BSD-3-Clause
//
// Motions of rigid frames as seen from each other, in the letters of math/frames.hpp: of B in A,
// everything in A's axes.
#pragma once

#include "ves/math/frames.hpp"

namespace ves {

/// R, orthogonal to rounding again, by a step of Newton's.
inline Mat3 orthogonal(const Mat3& R) {
  return 0.5 * R * (3.0 * Mat3::Identity() - R.transpose() * R);
}

/// dt [s] later, which may be before, its accelerations held.
inline BodyMotion later(const BodyMotion& AB, double dt) {
  BodyMotion out = AB;
  out.X.p += dt * (AB.v + 0.5 * dt * AB.a);
  out.X.R = orthogonal(rotationOf(dt * (AB.w + 0.5 * dt * AB.alpha)) * AB.X.R);
  out.v += dt * AB.a;
  out.w += dt * AB.alpha;
  return out;
}

/// Of C in A, where C moves in B and B in A.
inline BodyMotion composed(const BodyMotion& AB, const BodyMotion& BC) {
  const Vec3 p = AB.X.R * BC.X.p, v = AB.X.R * BC.v, w = AB.X.R * BC.w;
  BodyMotion out;
  out.X = AB.X * BC.X;
  out.v = AB.v + AB.w.cross(p) + v;
  out.w = AB.w + w;
  out.a =
      AB.a + AB.alpha.cross(p) + AB.w.cross(AB.w.cross(p)) + 2.0 * AB.w.cross(v) + AB.X.R * BC.a;
  out.alpha = AB.alpha + AB.w.cross(w) + AB.X.R * BC.alpha;
  return out;
}

/// Of C in B, where both move in A.
inline BodyMotion relative(const BodyMotion& AB, const BodyMotion& AC) {
  const Mat3 R_BA = AB.X.R.transpose();
  const Vec3 p = AC.X.p - AB.X.p, v = AC.v - AB.v - AB.w.cross(p), w = AC.w - AB.w;
  BodyMotion out;
  out.X = {R_BA * AC.X.R, R_BA * p};
  out.v = R_BA * v;
  out.w = R_BA * w;
  out.a =
      R_BA * (AC.a - AB.a - AB.alpha.cross(p) - AB.w.cross(AB.w.cross(p)) - 2.0 * AB.w.cross(v));
  out.alpha = R_BA * (AC.alpha - AB.alpha - AB.w.cross(w));
  return out;
}

/// Of A in B, where B moves in A.
inline BodyMotion inverse(const BodyMotion& AB) { return relative(AB, BodyMotion{}); }

}  // namespace ves
