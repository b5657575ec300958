// SPDX-License-Identifier: BSD-3-Clause
//
// The admittance model: the vehicle that the platform pretends to be, of one kind or another. It
// takes the wrench of the robot on it and says how it moves. Nobody else asks which kind it is, but
// who reads one from a file.
#pragma once

#include <variant>

#include "ves/vehicle/free_body.hpp"
#include "ves/vehicle/modal_vehicle.hpp"
#include "ves/vehicle/sensitivity.hpp"

namespace ves {

/// What is emulated.
struct VehicleModel {
  VehicleModel() = default;
  VehicleModel(const ModalModel& model) : kind(model) {}
  VehicleModel(const FreeBodyModel& model) : kind(model) {}

  std::variant<ModalModel, FreeBodyModel> kind;
  GroundMotion ground;          // that it stands on; a body that floats stands on none
  Vec3 gravity = Vec3::Zero();  // [m/s^2] in I, of which it feels what is on it; 0: taken out

  bool operator==(const VehicleModel&) const = default;
};

/// Its modes about home: what can be said of it before it moves far.
ModalModel linearised(const VehicleModel& model);

/// What it pushes itself with; nothing for one that stands.
Propulsion propulsionOf(const VehicleModel& model) noexcept;

/// Any of them, in its inertial frame I; where the laboratory moves, that is E (control/
/// moving_frame.hpp).
class AdmittanceModel {
  using Kinds = std::variant<ModalVehicle, FreeBody>;

  template <typename F>
  decltype(auto) each(F&& f) noexcept {
    return std::visit(f, kind_);
  }
  template <typename F>
  decltype(auto) each(F&& f) const noexcept {
    return std::visit(f, kind_);
  }

  Kinds kind_;

 public:
  /// For the period [s].
  AdmittanceModel(const VehicleModel& model, double period);

  /// motion() is at x: at rest, or as the model says that it is let go. Where motion() is predicted
  /// `ahead` [s], it begins with that prediction, M_1 on it.
  void reset(const Vec6& x, const Mat6& M_1 = Mat6::Zero(), double ahead = 0.0) noexcept {
    return each([&](auto& v) { v.reset(x, M_1, ahead); });
  }
  /// One period after F_Po_I began to act. `damping` [1/s] acts on all of its motion besides, held
  /// with F_Po_I; not in a step in which the vehicle turns round, and it would push.
  void step(const Wrench& F_Po_I, double damping = 0.0) noexcept {
    return each([&](auto& v) { v.step(F_Po_I, damping); });
  }
  /// The same `dt` [s] after, with a rigid body on the vehicle: the left-hand side of (3.11), where
  /// the body changes as that of momenta: what it turns with is passed on. motion() is `ahead` [s]
  /// of that, F_Po_I held. dt of 0: F_Po_I has acted already.
  void step(const Wrench& F_Po_I, const CarriedBody& body, double dt, double ahead,
            double damping = 0.0) noexcept {
    return each([&](auto& v) { v.step(F_Po_I, body, dt, ahead, damping); });
  }
  /// Takes back all but `share` of the last step, and of the rate it led to: the path stays and
  /// only the motion along it is slowed.
  void slow(double share) noexcept {
    return each([&](auto& v) { v.slow(share); });
  }
  /// Is elsewhere by so much, and as much faster, from the last step's end on; of dynamics().
  void displace(const ModalDynamics::Modes& by) noexcept {
    return each([&](auto& v) { v.displace(by); });
  }

  /// The next step's vehicle, where and as fast as this one is.
  void become(const VehicleFactors& factors) noexcept {
    return each([&](auto& v) { v.become(factors); });
  }
  const VehicleFactors& factors() const noexcept {
    return each([](const auto& v) -> const VehicleFactors& { return v.factors(); });
  }
  /// [J] that becoming so puts in.
  double costOf(const VehicleFactors& factors) const noexcept {
    return each([&](const auto& v) { return v.costOf(factors); });
  }
  /// Why it cannot become so, with a body on it or without.
  Refusal refuses(const VehicleFactors& factors, bool with_body) const noexcept {
    return each([&](const auto& v) { return v.refuses(factors, with_body); });
  }

  /// Its thrusters are on from the next step's beginning on, unless that is refused.
  Refusal fire(const ThrustOrder& order) noexcept {
    return each([&](auto& v) { return v.fire(order); });
  }
  /// What it pushed itself with in the last step.
  Thrust thrust() const noexcept {
    return each([](const auto& v) -> Thrust { return v.thrust(); });
  }

  /// Energies, work and damping are of its motion beside this [m/s, rad/s] of Po in I, in which a
  /// laboratory flies along with what floats.
  void countFrom(const Vec6& rate) noexcept {
    return each([&](auto& v) { v.countFrom(rate); });
  }
  /// [J] of the vehicle alone.
  double kineticEnergy() const noexcept {
    return each([](const auto& v) { return v.kineticEnergy(); });
  }
  double energy() const noexcept {
    return each([](const auto& v) { return v.energy(); });
  }
  /// [J] that the last step took of F_Po_I, and that `damping` took in it.
  double taken(const Wrench& F_Po_I) const noexcept {
    return each([&](const auto& v) { return v.taken(F_Po_I); });
  }
  double damped() const noexcept {
    return each([](const auto& v) { return v.damped(); });
  }
  /// [J] that the vehicle's own damping took in it.
  double dissipated() const noexcept {
    return each([](const auto& v) { return v.dissipated(); });
  }
  /// [J] that ground and weight put into energy() in it.
  double shaken() const noexcept {
    return each([](const auto& v) { return v.shaken(); });
  }
  /// [J] that a step takes on average of noise in F_Po_I, of this covariance: of the speed that a
  /// wrench leads to in a step, the next steps have all, this one half.
  double takenOfNoise(const Mat6& covariance) const noexcept {
    return each([&](const auto& v) { return v.takenOfNoise(covariance); });
  }

  /// (C.7): position, velocity, acceleration at the last step's end, or ahead of it.
  PathPoint<6> motion() const noexcept {
    return each([](const auto& v) { return v.motion(); });
  }
  /// The same however far it has turned; and with the accelerations it would have if nothing acted
  /// on it, its springs, dampers and thrusters included.
  BodyMotion bodyMotion() const noexcept {
    return each([](const auto& v) { return v.bodyMotion(); });
  }
  BodyMotion coasting() const noexcept {
    return each([](const auto& v) { return v.coasting(); });
  }
  /// At the last step's end, not ahead of it, without accelerations.
  BodyMotion atWrench() const noexcept {
    return each([](const auto& v) { return v.atWrench(); });
  }

  /// Motions beside this one, small: their coordinates, and the vehicle where it is with the body
  /// M_1 on it, for wrenches over factors().mass.
  const ModalDynamics& dynamics() const noexcept {
    return each([](const auto& v) -> const ModalDynamics& { return v.dynamics(); });
  }
  ModalDynamics::Body body(const Mat6& M_1) const noexcept {
    return each([&](const auto& v) { return v.body(M_1); });
  }
  /// Its attitude is one of its own, and no small angles.
  bool floats() const noexcept { return std::holds_alternative<FreeBody>(kind_); }
  /// [m/s] Of Po, that it begins with.
  Vec3 letGo() const noexcept {
    return each([](const auto& v) -> Vec3 { return v.letGo(); });
  }
  /// Sensitivities (sensitivity.hpp) count from now, and one step of dt [s] on.
  void begin(Sensitivity& s, const MassColumns& momentum, Eigen::Index first,
             Eigen::Index count) const noexcept {
    each([&](const auto& v) { ves::begin(s, v, momentum, first, count); });
  }
  void advance(Sensitivity& s, const MassColumns& momentum, const ModalDynamics::Body& body,
               double dt) const noexcept {
    each([&](const auto& v) { ves::advance(s, v, momentum, body, dt); });
  }
  int modes() const noexcept {
    return each([](const auto& v) { return v.modes(); });
  }
  bool coupled() const noexcept {
    return each([](const auto& v) { return v.coupled(); });
  }
};

}  // namespace ves
