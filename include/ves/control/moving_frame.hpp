// SPDX-License-Identifier: BSD-3-Clause
//
// A flight of kilometres in a workspace of decimetres: the laboratory flies along. Beyond the
// report.
//
// The vehicle is emulated in an inertial frame E, and the platform shows how it moves in a
// laboratory that moves through E, so that
//
//   X_EP = X_EH X_HP      H: where P is at home, in the laboratory's axes
//
// What the laboratory does is known. It moves as the vehicle would if nothing acted on it, so that
// the platform rests while the vehicle coasts, tumbling or not; and besides that follows it slowly,
// which brings the platform back home:
//
//   a_HP = (of what acts on the vehicle) - k^2 p_HP - 2 k v_HP,   at most `acceleration`
//
// likewise about its axes, where k^2 = acceleration / (share of the workspace).
#pragma once

#include "ves/control/controller_config.hpp"
#include "ves/math/relative_motion.hpp"

namespace ves {

/// How the platform is emulated to be, as the newest wrench shows it.
struct Emulated {
  Mat3 R_EP = Mat3::Identity();
  bool apart = false;  // from the platform as it stands; without, E is I, and nothing more is said
  Mat3 R_EI = Mat3::Identity();
  // [m/s], [rad/s] of Po and P in E, where it is apart: beside what the vehicle was let go with.
  Vec3 v = Vec3::Zero(), w = Vec3::Zero();
};

class MovingFrame {
 public:
  explicit MovingFrame(const ControllerConfig& config);

  bool enabled() const noexcept { return settings_.enabled; }
  bool steadyInContact() const noexcept { return settings_.steady_in_contact; }
  /// Of H in E, for the instant that was commanded last.
  const BodyMotion& laboratory() const noexcept { return E_H_; }

  /// Begins to fly along with a vehicle that moves so: it rests in the laboratory.
  void begin(const BodyMotion& E_P) noexcept;
  /// dt [s] on. P was shown at `shown`, and coasts as E_P; `share` [-] of the following is done.
  void step(const PathPoint<6>& shown, const BodyMotion& E_P, double share, double dt) noexcept;
  /// Where the platform shows a P that moves so.
  PathPoint<6> shown(const BodyMotion& E_P) const noexcept {
    return coordinates(relative(E_H_, E_P));
  }
  /// The platform shows it elsewhere: that is how the laboratory has moved.
  void yield(const BodyMotion& E_P, const PathPoint<6>& shown) noexcept;
  /// The laboratory rests where it is.
  void rest() noexcept;

  /// Where P, turned by R_IP, is emulated to be while the vehicle does not move by itself.
  Emulated emulated(const Mat3& R_IP) const noexcept;
  /// The same `since` [s] after a vehicle that is emulated was at E_P.
  Emulated emulated(const Mat3& R_IP, const BodyMotion& E_P, double since) const noexcept;
  /// Position and fixed angles in E of a platform shown at x.
  Vec6 emulated(const Vec6& x) const noexcept;
  /// [m/s, rad/s] Of a P at p_EP that goes along, `ago` [s] before laboratory().
  Vec6 along(const Vec3& p_EP, double ago) const noexcept;

 private:
  MovingFrameSettings settings_;
  double home_, upright_;  // [1/s] k of position and attitude
  BodyMotion E_H_;
};

}  // namespace ves
