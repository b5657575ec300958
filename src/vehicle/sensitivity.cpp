// SPDX-License-Identifier: BSD-3-Clause
#include "ves/vehicle/sensitivity.hpp"

#include "ves/math/lu6.hpp"

namespace ves {

void begin(Sensitivity& s, const ModalVehicle& vehicle, const MassColumns& momentum,
           Eigen::Index first, Eigen::Index count) noexcept {
  if (first == 0) s.mass = vehicle.factors().mass;
  s.eta.middleCols(first, count).setZero();
  s.eta_dot.middleCols(first, count).setZero();
  s.momentum.middleCols(first, count).noalias() =
      vehicle.dynamics().Phi().transpose() * momentum.middleCols(first, count) / s.mass;
}

/// (1 + Phi^T M_1 Phi) eta' + Phi^T p, per parameter, changes by what springs and dampers take.
void advance(Sensitivity& s, const ModalVehicle& vehicle, const MassColumns& momentum,
             const ModalDynamics::Body& body, double dt) noexcept {
  const ModalDynamics& base = vehicle.dynamics();
  const double mass = vehicle.factors().mass;
  if (mass != s.mass) {  // its velocity stays
    s.momentum = (s.mass * s.momentum + (mass - s.mass) * s.eta_dot) / mass;
    s.mass = mass;
  }
  s.eta_dot = s.momentum;
  s.eta_dot.noalias() -= base.Phi().transpose() * momentum / mass;
  const MassColumns pull = body.pull * s.eta_dot;
  s.eta_dot.noalias() -= base.Phi().transpose() * pull;
  // A mode that turns by more than this in a step follows at once, and hardly moves.
  constexpr double kMostAngle = 1.5;  // [rad]
  for (Eigen::Index i = 0; i < base.size(); ++i)
    if (base.stiffness()(i) * dt * dt > kMostAngle * kMostAngle) s.eta_dot.row(i).setZero();
  s.eta += dt * s.eta_dot;
  const ModalDynamics::Forces none = ModalDynamics::Forces::Zero(base.size());
  for (Eigen::Index j = 0; j < s.eta.cols(); ++j)
    s.momentum.col(j) += dt * base.acceleration({s.eta.col(j), s.eta_dot.col(j)}, none);
}

namespace {

/// p x f beside the moment: of a momentum about Po the one about a point that Po is p from.
Vec6 about(const Vec3& p, const Vec6& about_Po) noexcept {
  Vec6 out = about_Po;
  out.tail<3>() += p.cross(about_Po.head<3>());
  return out;
}

/// Both halves turned by a small th.
Vec6 turned(const Vec3& th, const Vec6& y) noexcept {
  return (Vec6() << th.cross(y.head<3>()), th.cross(y.tail<3>())).finished();
}

}  // namespace

void begin(Sensitivity& s, const FreeBody& vehicle, const MassColumns& momentum, Eigen::Index first,
           Eigen::Index count) noexcept {
  s.eta.middleCols(first, count).setZero();
  s.eta_dot.middleCols(first, count).setZero();
  const Vec3& p = vehicle.state().p;
  if (first == 0) {
    s.mass = vehicle.factors().mass;
    s.origin = p;
  }
  for (Eigen::Index j = first; j < first + count; ++j)
    s.momentum.col(j) = about(p - s.origin, momentum.col(j));
}

/// Momentum and angular momentum about a fixed point stay as they were at first, but for the
/// thrusters, which turn with it. Displaced by d, turned by th and as much faster as it is turned
/// besides (V*), vehicle and robot of momentum P have, about Po, P + th x P + M V* + p per
/// parameter.
void advance(Sensitivity& s, const FreeBody& vehicle, const MassColumns& momentum,
             const ModalDynamics::Body&, double dt) noexcept {
  const RigidState& at = vehicle.state();
  const Mat6 M_all = vehicle.massOfAll();
  const Vec3& along = vehicle.letGo();
  const Vec6 V = (Vec6() << at.v - along, at.w).finished(),
             P = vehicle.momentum() - M_all.leftCols<3>() * along;
  s.origin += dt * along;
  const Vec3 p = at.p - s.origin;
  const double more = vehicle.factors().mass - s.mass;  // its velocity stays
  const Mat6 M_vehicle = vehicle.massOfOne();
  const Vec6 P_vehicle = M_vehicle * V;
  s.mass = vehicle.factors().mass;
  const Lu6 M(M_all);
  for (Eigen::Index j = 0; j < s.eta.cols(); ++j) {
    const Vec3 d = s.eta.col(j).head<3>(), th = s.eta.col(j).tail<3>();
    if (more != 0.0) {
      const Vec6 change = M_vehicle * (s.eta_dot.col(j) - turned(th, V)) + turned(th, P_vehicle);
      s.momentum.col(j) += more * about(p, change);
      s.momentum.col(j).tail<3>() += more * d.cross(P_vehicle.head<3>());
    }
    s.momentum.col(j) += dt * about(p, turned(th, vehicle.jets()));
    s.momentum.col(j).tail<3>() += dt * d.cross(vehicle.jets().head<3>());
    Vec6 left = about(-p, s.momentum.col(j)) - momentum.col(j) - turned(th, P);
    left.tail<3>() -= d.cross(P.head<3>());
    const Vec6 faster = M.solve(left);
    s.eta_dot.col(j) = faster + turned(th, V);
    s.eta.col(j).head<3>() += dt * s.eta_dot.col(j).head<3>();
    s.eta.col(j).tail<3>() += dt * faster.tail<3>();
  }
}

}  // namespace ves
