// SPDX-License-Identifier: BSD-3-Clause
//
// The platform as a body on six hydraulic legs: their forces move it, its weight, and what it
// carries. Forward dynamics where ideal legs need forward kinematics:
//
//   M a + gyroscopic terms = J^T (f - D J v) + weight + F_Po      M of plate and load, about Po
//
// Each step is a half drift (legs and pose at the speed that they have), a kick (forces change it,
// the dampers implicitly), and a half drift: second order, and no energy of its own but what
// rounding and the turning of M leave. The legs' own masses count into the plate.
#pragma once

#include <vector>

#include "ves/kinematics/stewart.hpp"
#include "ves/plant/hydraulic_leg.hpp"
#include "ves/robot/robot_model.hpp"

namespace ves::plant {

/// What a Temposonics transducer adds to a cylinder's length.
struct ReadingModel {
  double noise = 0.0;       // [m] rms
  double hysteresis = 0.0;  // [m] by which its magnet lags behind
};

struct HydraulicModel {
  HydraulicLegModel leg;  // all alike
  RigidBody plate_P;      // platform with all that moves with it, without the sensor's top plate
  Vec3 gravity = {0.0, 0.0, -9.81};  // [m/s^2] g_I on the plate, wherever the vehicle is
  double fitted_at = 0.0;            // [A] where the gains of (2.17) hold
  ReadingModel reading;
};

/// Areas, flow and null of the legs, from the gains under the plate's weight at home, a mean of the
/// six. False where there are none.
bool fit(HydraulicModel& model, const ActuatorModel& gains, const Geometry& geometry);

/// What stands on the platform, in {P}: one body as long as its joints are locked, and the wrench
/// about Po that it puts on the platform beyond that body's inertia.
struct PlatformLoad {
  RigidBody body_P;
  Wrench F_Po_P;
};

class HydraulicPlatform {
 public:
  static constexpr double kLongestStep = 171e-6;  // [s] half a Temposonics period

  /// At rest at X_IP, its legs carrying plate and load.
  HydraulicPlatform(const Geometry& geometry, const HydraulicModel& model, const Transform& X_IP,
                    const PlatformLoad& load) noexcept;

  /// From now on.
  void carry(const PlatformLoad& load) noexcept;
  /// Its valves take `currents` [A] for dt [s], in equal steps none of which is longer than
  /// kLongestStep.
  void advance(const Vec6& currents, double dt) noexcept;

  const BodyMotion& motion() const noexcept { return P_; }  // accelerations: of the last step
  Vec6 cylinders() const noexcept;                          // [m] lengths, as they are measured
  Vec6 forces() const noexcept;                             // [N] pushing
  /// Leg i from now on; HydraulicLeg::become().
  void change(int i, const HydraulicLegModel& model) noexcept {
    legs_[static_cast<std::size_t>(i)].become(model);
  }
  const HydraulicLeg& leg(int i) const { return legs_[static_cast<std::size_t>(i)]; }

  /// [J] kinetic and potential, of plate and locked load, and stored in the legs.
  double stored() const noexcept;
  /// [J] that the load's own wrench, and its change of shape, have put in.
  double loadWork() const noexcept { return load_work_; }

 private:
  void step(const Vec6& currents, double dt, const SecondOrderHold& spool) noexcept;
  void drift(const Vec6& currents, double dt, const SecondOrderHold& spool) noexcept;
  double kinetic() const noexcept;

  Geometry geometry_;
  HydraulicModel model_;
  std::vector<HydraulicLeg> legs_;
  PlatformLoad load_;
  RigidBody moved_P_;  // plate and load
  BodyMotion P_;
  LegLines lines_;
  double prepared_for_ = 0.0;  // [s]
  SecondOrderHold prepared_;   // of a half step so long
  double load_work_ = 0.0;     // [J]
};

}  // namespace ves::plant
