// SPDX-License-Identifier: BSD-3-Clause
//
// How a vehicle's motion would have been, had the masses of the robot on it been a little other:
// linear, a column a parameter, from where it was let go.
#pragma once

#include "ves/robot/mass_regressor.hpp"
#include "ves/vehicle/free_body.hpp"
#include "ves/vehicle/modal_vehicle.hpp"

namespace ves {

/// In the modes of dynamics(). Of a body that floats these are displacement and small turn of Po
/// and P in I, and their rates.
struct Sensitivity {
  using Columns =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxModes, kMaxMassParameters>;

  Columns eta, eta_dot;
  Columns momentum;  // of vehicle and robot, which springs alone change: modal, over the vehicle's
                     // mass; of a body that floats about `origin`, and beside its letGo()
  Vec3 origin = Vec3::Zero();  // [m] which goes on with letGo()
  double mass = 1.0;           // [-] of the vehicle, as factors().mass, when that was kept
};

/// `count` parameters from `first` on count from now. The robot has this momentum [N s, N m s] per
/// parameter, about Po in I; on a body that floats beside its letGo(), for a kilometre's lever
/// would leave nothing of a small turn.
void begin(Sensitivity& s, const ModalVehicle& vehicle, const MassColumns& momentum,
           Eigen::Index first, Eigen::Index count) noexcept;
void begin(Sensitivity& s, const FreeBody& vehicle, const MassColumns& momentum, Eigen::Index first,
           Eigen::Index count) noexcept;

/// After a step of dt [s] of the vehicle; `body`: of the robot on it.
void advance(Sensitivity& s, const ModalVehicle& vehicle, const MassColumns& momentum,
             const ModalDynamics::Body& body, double dt) noexcept;
void advance(Sensitivity& s, const FreeBody& vehicle, const MassColumns& momentum,
             const ModalDynamics::Body& body, double dt) noexcept;

}  // namespace ves
