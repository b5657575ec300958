// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/hydraulic_platform.hpp"

#include <Eigen/Cholesky>
#include <cmath>

#include "ves/robot/newton_euler.hpp"

namespace ves::plant {
namespace {

/// [N, N m] about Po in {I} of the plate's weight.
Vec6 weight(const HydraulicModel& model, const Mat3& R_IP) noexcept {
  const Vec3 f = model.plate_P.mass * model.gravity;
  return (Vec6() << f, (R_IP * model.plate_P.p_BoBcm_B).cross(f)).finished();
}

/// [N] of each leg that holds a wrench on the platform about Po in {I}.
Vec6 holding(const LegLines& lines, const Vec6& wrench) noexcept {
  return lines.J.transpose().partialPivLu().solve(-wrench);
}

}  // namespace

bool fit(HydraulicModel& model, const ActuatorModel& gains, const Geometry& geometry) {
  const Transform home = geometry.fromHome({});
  const double load = holding(legLines(geometry, home), weight(model, home.R)).mean();
  return fit(model.leg, gains, model.fitted_at, load);
}

HydraulicPlatform::HydraulicPlatform(const Geometry& geometry, const HydraulicModel& model,
                                     const Transform& X_IP, const PlatformLoad& load) noexcept
    : geometry_(geometry), model_(model), lines_(legLines(geometry, X_IP)) {
  P_.X = X_IP;
  carry(load);
  const Vec6 carried = weight(model_, X_IP.R) + rotate(X_IP.R, load.F_Po_P).stacked();
  const Vec6 f = holding(lines_, carried);
  for (int i = 0; i < kLegs; ++i) legs_.emplace_back(model_.leg, lines_.L(i), f(i));
}

void HydraulicPlatform::carry(const PlatformLoad& load) noexcept {
  const double before = kinetic();
  load_ = load;
  moved_P_ = combine(model_.plate_P, {}, load.body_P);
  load_work_ += kinetic() - before;
}

void HydraulicPlatform::advance(const Vec6& currents, double dt) noexcept {
  if (!(dt > 0.0)) return;
  const double n = std::ceil(dt / kLongestStep);
  const double h = dt / n;
  if (h != prepared_for_) {
    prepared_for_ = h;
    prepared_ = legs_.front().prepare(0.5 * h);
  }
  for (int k = 0; k < static_cast<int>(n); ++k) step(currents, h, prepared_);
}

void HydraulicPlatform::drift(const Vec6& currents, double dt,
                              const SecondOrderHold& spool) noexcept {
  P_.X.p += dt * P_.v;
  P_.X.R = rotationOf(dt * P_.w) * P_.X.R;
  lines_ = legLines(geometry_, P_.X);
  for (int i = 0; i < kLegs; ++i)
    legs_[static_cast<std::size_t>(i)].drift(currents(i), lines_.L(i), dt, spool);
}

void HydraulicPlatform::step(const Vec6& currents, double dt,
                             const SecondOrderHold& spool) noexcept {
  drift(currents, 0.5 * dt, spool);

  Vec6 f, D;
  for (int i = 0; i < kLegs; ++i) {
    f(i) = legs_[static_cast<std::size_t>(i)].force();
    D(i) = legs_[static_cast<std::size_t>(i)].damping();
  }
  const Mat6& J = lines_.J;
  const RigidBody moved_I = rotated(P_.X.R, moved_P_);
  const Vec3 w = P_.w + 0.5 * dt * P_.alpha;  // in the middle
  const Wrench gyroscopic = inertialWrench(moved_I, {w, Vec3::Zero(), Vec3::Zero()});
  const Wrench load = rotate(P_.X.R, load_.F_Po_P);
  const Mat6 damping = J.transpose() * D.asDiagonal() * J;
  const Vec6 v = (Vec6() << P_.v, P_.w).finished();
  const Vec6 rhs = J.transpose() * f - damping * v + weight(model_, P_.X.R) + load.stacked() -
                   gyroscopic.stacked();
  const Mat6 M = spatialMass(moved_I) + 0.5 * dt * damping;
  const Vec6 a = M.llt().solve(rhs);
  P_.a = a.head<3>();
  P_.alpha = a.tail<3>();
  P_.v += dt * P_.a;
  P_.w += dt * P_.alpha;

  const Vec6 mean = v + 0.5 * dt * a, rates = J * mean;
  for (int i = 0; i < kLegs; ++i) legs_[static_cast<std::size_t>(i)].book(rates(i), dt);
  load_work_ += dt * load.stacked().dot(mean);

  drift(currents, 0.5 * dt, spool);
}

Vec6 HydraulicPlatform::cylinders() const noexcept {
  Vec6 L;
  for (int i = 0; i < kLegs; ++i) L(i) = leg(i).length();
  return L;
}

Vec6 HydraulicPlatform::forces() const noexcept {
  Vec6 f;
  for (int i = 0; i < kLegs; ++i)
    f(i) =
        leg(i).force() - leg(i).damping() * lines_.J.row(i).dot((Vec6() << P_.v, P_.w).finished());
  return f;
}

double HydraulicPlatform::kinetic() const noexcept {
  const Vec6 v = (Vec6() << P_.v, P_.w).finished();
  return 0.5 * v.dot(spatialMass(rotated(P_.X.R, moved_P_)) * v);
}

double HydraulicPlatform::stored() const noexcept {
  double E = kinetic() - model_.plate_P.mass * model_.gravity.dot(P_.X * model_.plate_P.p_BoBcm_B);
  for (const HydraulicLeg& leg : legs_) E += leg.stored();
  return E;
}

}  // namespace ves::plant
