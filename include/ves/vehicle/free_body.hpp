// SPDX-License-Identifier: BSD-3-Clause
//
// A vehicle that nothing holds: a satellite, whose robot floats with it. Beyond the report.
//
//   m v' + (w x S)' = f,   S x v' + (J w)' = n
//
// of vehicle and robot as one body with its joints locked, at Po in I: m its mass, S its first
// moment, J its inertia. f and n are what the sensor shows beyond that body, as for any vehicle:
// what the joints' momentum loses. Its own turn is integrated about the common centre of mass,
// where the angular momentum stays the same to rounding while nothing acts.
#pragma once

#include "ves/kinematics/stewart.hpp"
#include "ves/math/orbit.hpp"
#include "ves/robot/robot_model.hpp"
#include "ves/vehicle/modal_vehicle.hpp"
#include "ves/vehicle/propulsion.hpp"

namespace ves {

/// What floats, and how it moves when it is let go.
struct FreeBodyModel {
  RigidBody body_P;
  Vec3 v_IPo_I = Vec3::Zero();  // [m/s]
  Vec3 w_IP_I = Vec3::Zero();   // [rad/s]
  Propulsion propulsion;
  Orbit orbit;  // that I goes round with, its origin at home

  bool operator==(const FreeBodyModel&) const = default;
};

/// Its six modes about home, which have no stiffness.
ModalModel linearised(const FreeBodyModel& model);

/// Position and velocity of P in I, its position from home.
struct RigidState {
  Mat3 R_IP = Mat3::Identity();
  Vec3 p = Vec3::Zero();  // [m]
  Vec3 v = Vec3::Zero();  // [m/s]
  Vec3 w = Vec3::Zero();  // [rad/s]
};

/// A body of one mass, which may change its shape and has wheels.
struct Gyrostat {
  Mat6 M_P;                 // spatial mass about Po in P
  Vec3 h_P = Vec3::Zero();  // [N m s] of what turns in it
};

/// Over dt [s], which may be negative, under a held wrench, about Po in I: a body that goes evenly
/// from one to the other. By Runge and Kutta's steps of fourth order, the attitude in the rotation
/// vector, of at most 5 mrad each. The momentum that the wrench leaves is kept: to rounding where
/// the shape stays, else as far as a step's change of it is even. In an orbit h_joints_I, the
/// joints' angular momentum about the centre of mass, turns with it.
RigidState advanced(const Gyrostat& body, const Gyrostat& then, const RigidState& from,
                    const Wrench& F_Po_I, double dt, const Orbit& orbit = {},
                    const Vec3& h_joints_I = Vec3::Zero()) noexcept;

/// Steps it. The members are ModalVehicle's.
class FreeBody {
 public:
  FreeBody(const FreeBodyModel& model, double period);  // [s]

  void reset(const Vec6& x, const Mat6& M_1 = Mat6::Zero(), double ahead = 0.0) noexcept;
  void step(const Wrench& F_Po_I, double damping = 0.0) noexcept;
  void step(const Wrench& F_Po_I, const CarriedBody& body, double dt, double ahead,
            double damping = 0.0) noexcept;
  void slow(double share) noexcept;
  void displace(const ModalDynamics::Modes& by) noexcept;

  void become(const VehicleFactors& factors) noexcept { factors_ = factors; }
  const VehicleFactors& factors() const noexcept { return factors_; }
  double costOf(const VehicleFactors& to) const noexcept {
    return (to.mass / factors_.mass - 1.0) * kineticEnergy();
  }
  /// A body has a mass only.
  Refusal refuses(const VehicleFactors& to, bool) const noexcept {
    return to.damping == 1.0 && to.stiffness == 1.0 ? Refusal::kNone : Refusal::kNoSuchPart;
  }
  /// From the next step's beginning on; what another order left of a thruster's time is forgotten.
  Refusal fire(const ThrustOrder& order) noexcept;
  const Thrust& thrust() const noexcept { return thrust_; }

  void countFrom(const Vec6& rate) noexcept { along_ = rate; }
  double kineticEnergy() const noexcept;
  double energy() const noexcept { return kineticEnergy(); }
  double taken(const Wrench& F_Po_I) const noexcept { return F_Po_I.stacked().dot(way()); }
  double dissipated() const noexcept { return 0.0; }
  double takenOfNoise(const Mat6& covariance) const noexcept {
    return 0.5 * dt_ * dt_ * covariance.cwiseProduct(mobility_).sum();
  }
  double damped() const noexcept { return -damping_.dot(way()); }
  double shaken() const noexcept { return pushed_.dot(way()); }  // by its thrusters

  PathPoint<6> motion() const noexcept { return coordinates(now_.motion); }
  const BodyMotion& bodyMotion() const noexcept { return now_.motion; }
  BodyMotion coasting() const noexcept;
  BodyMotion atWrench() const noexcept;

  /// Six coordinates of a motion beside this one, small, in I: without stiffness or damping, the
  /// vehicle's mass less 1 counted to the body on it.
  const ModalDynamics& dynamics() const noexcept { return beside_; }
  ModalDynamics::Body body(const Mat6& M_1) const noexcept;
  int modes() const noexcept { return 6; }
  bool coupled() const noexcept { return false; }

  /// At the last step's end, not ahead of it.
  const RigidState& state() const noexcept { return now_.rigid; }
  const Vec3& letGo() const noexcept { return model_.v_IPo_I; }  // [m/s] how it began
  /// [N s, N m s] of all that floats, the robot's joints and the wheels included, about Po in I.
  Vec6 momentum() const noexcept;
  /// [N, N m] its thrusters in the last step, about Po in I.
  const Vec6& jets() const noexcept { return jets_; }
  /// Spatial mass about Po in I of the vehicle, over factors().mass, and of all that floats.
  Mat6 massOfOne() const noexcept { return rotated(now_.rigid.R_IP, M_P_); }
  Mat6 massOfAll() const noexcept { return rotated(now_.rigid.R_IP, whole_.M_P); }

 private:
  struct State {
    RigidState rigid;
    BodyMotion motion;
    double time = 0.0;  // [s] since it was let go
    Pulses pulses;
    std::array<OrderedFiring, kMostThrusters> ordered{};  // one a thruster
  };

  Vec6 way() const noexcept { return way_ - dt_ * along_; }
  Mat6 massInP() const noexcept { return factors_.mass * M_P_; }
  Vec3 wheels(double t) const noexcept { return wheelMomentum(model_.propulsion, t); }

  FreeBodyModel model_;
  Mat6 M_P_;  // about Po in P
  ModalDynamics beside_;
  double period_;  // [s]
  VehicleFactors factors_;
  double dt_ = 0.0;             // [s] of the last step
  Gyrostat whole_;              // with the robot
  Vec6 joints_ = Vec6::Zero();  // [N s, N m s] momentum of its joints beside that
  State now_, before_;
  Thrust thrust_;                 // of the last step
  Vec6 way_ = Vec6::Zero();       // [m, rad] of the last step, in I
  Vec6 along_ = Vec6::Zero();     // [m/s, rad/s] that energies and damping count from
  Vec6 jets_ = Vec6::Zero();      // [N, N m] by thrusters in it, in I,
  Vec6 pushed_ = Vec6::Zero();    // and by all but the robot
  Vec6 damping_ = Vec6::Zero();   // [N, N m] in it
  Mat6 mobility_ = Mat6::Zero();  // [1/kg] in it: acceleration per wrench
};

}  // namespace ves
