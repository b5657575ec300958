// SPDX-License-Identifier: BSD-3-Clause
//
// One leg that feels its load: servo valve, orifices, oil, piston, seals and play, as they are
// before (2.17) linearises them.
//
//   valve    x'' + 2 zeta w x' + w^2 x = w^2 (i + null - c HP(F/A_1))
//            the spool, counted in amperes; c: pressure feedback, HP a high-pass
//   orifice  Q = c_d w k_j x sqrt(2/rho (p_S - p))          (2.11)
//            `flow` stands for c_d w k_j sqrt(2/rho)
//   oil      p' = beta/V (Q - A y')                         (2.15), and it gives way
//   piston   f = A_1 p_1 - A_2 p_2 - seals - end stops      (2.16), the mass is the platform's
//   seals    z' = v - sigma_0 |v|/g(v) z                    LuGre
//            F = sigma_0 z + sigma_1 z' + sigma_2 v
//            g = F_C + (F_S - F_C) exp(-(v/v_S)^2)
//   play     of the joints: a spring as wide as the play, until the joint is seated
//
// A three-way valve meters the piston's side and leaves the rod's at supply pressure; a four-way
// valve meters both. Either gives the report's two gains, by its ratio of areas. The supply keeps
// its pressure until a fault changes it (become()); the return's is zero. What is below zero is a
// void.
//
// Energy: the supply gives, the oil, the bristles and the stops store, orifices, leak and seals
// dissipate; each is counted for itself. Source of the oil's energy: rho = rho_0 e^{p/beta}, so
// that with N the oil's volume without pressure p = beta ln(N/V), stored beta (N - V - V ln(N/V)),
// and what flows carries beta (1 - e^{-p/beta}) of enthalpy for each m^3 of N.
#pragma once

#include <array>

#include "ves/math/second_order.hpp"
#include "ves/plant/actuator.hpp"

namespace ves::plant {

enum class Circuit { kThreeWay, kFourWay };

struct ValveModel {
  Circuit circuit = Circuit::kThreeWay;
  double frequency = 0.0;  // [rad/s] undamped
  double damping = 0.0;    // [-]
  double opening = 0.0;    // [A] of either edge at null; negative: both are closed so far
  double limit = 0.0;      // [A] at most
  double null = 0.0;       // [A] of the spool without current, as its screw is set
  bool stuck = false;      // where it is
  // Dynamic pressure feedback: what the load's pressure has changed by of late closes it.
  double feedback = 0.0;        // [A/Pa]
  double feedback_time = 0.03;  // [s] of its high-pass
};

struct OilModel {
  double supply = 0.0;        // [Pa] p_S
  double bulk_modulus = 0.0;  // [Pa] beta
  double hoses = 0.0;         // [m^3] that each chamber has where its piston is at its end
  double leak = 0.0;          // [m^3/s/Pa] past the piston
  double outside = 0.0;       // [m^3/s/Pa] from the bore to the floor
};

struct SealModel {
  double coulomb = 0.0;          // [N] F_C
  double breakaway = 0.0;        // [N] F_S
  double stribeck = 1.0;         // [m/s] v_S
  double viscous = 0.0;          // [N s/m] sigma_2
  double bristle = 0.0;          // [N/m] sigma_0
  double bristle_damping = 0.0;  // [N s/m] sigma_1
};

struct CylinderModel {
  double bore = 0.0;          // [m^2] A_1
  double rod_side = 0.0;      // [m^2] A_2
  double length_min = 0.0;    // [m] stroke ends
  double length_max = 0.0;    // [m]
  double stop = 0.0;          // [N/m] stiffness of an end
  double stop_damping = 0.0;  // [N s/m]
  double play = 0.0;          // [m] of both joints together
  double seating = 0.0;       // [N] at which it is taken up
};

struct HydraulicLegModel {
  ValveModel valve;
  OilModel oil;
  SealModel seals;
  CylinderModel cylinder;
  double flow = 0.0;  // [m^3/s/A/sqrt(Pa)]
};

/// [m^3] of oil before and behind a piston whose leg is `length` [m] long.
double boreVolume(const HydraulicLegModel& leg, double length) noexcept;
double rodVolume(const HydraulicLegModel& leg, double length) noexcept;

/// Areas and flow coefficient with which the leg goes as fast as (2.17) says, both ways, at
/// `current` [A] under `load` [N] (pressing on it), and the null of that load; what leaks past the
/// piston is not counted. False where no area does.
bool fit(HydraulicLegModel& leg, const ActuatorModel& gains, double current, double load);

/// [J] since the leg was made, apart from what is stored.
struct HydraulicLosses {
  double supplied = 0.0;  // by the supply
  double valve = 0.0;     // lost in the orifices,
  double leak = 0.0;      // past the piston,
  double seals = 0.0;     // in friction,
  double stops = 0.0;     // and in the damping of an end
};

class HydraulicLeg {
 public:
  /// At rest at `length` [m] under `load` [N], its spool at that load's null.
  HydraulicLeg(const HydraulicLegModel& model, double length, double load) noexcept;

  SecondOrderHold prepare(double dt) const noexcept;

  /// Another leg from now on, with the lengths, pressures and spool of this one: it has a fault.
  /// Its energy is another's.
  void become(const HydraulicLegModel& model) noexcept;

  /// Its joints move to `length` [m] apart at a constant speed while `current` [A] is held;
  /// `spool` prepared for the time dt [s] that this takes.
  void drift(double current, double length, double dt, const SecondOrderHold& spool) noexcept;

  /// f - D v pushes its joints apart at the speed v. [N], [N s/m]
  double force() const noexcept;
  double damping() const noexcept;
  /// They moved at the mean speed v for dt, against this damping.
  void book(double v, double dt) noexcept;

  double length() const noexcept { return y_; }      // [m] of the cylinder: what is measured
  double spool() const noexcept { return eta_(0); }  // [A]
  double pressure(int chamber) const noexcept { return p_[static_cast<std::size_t>(chamber)]; }
  double stored() const noexcept;  // [J] oil, bristles, stops
  const HydraulicLosses& losses() const noexcept { return losses_; }

 private:
  struct Flow {
    double in = 0.0, out = 0.0;            // [m^3/s] from the supply, to the return
    double in_rate = 0.0, out_rate = 0.0;  // [m^3/s/Pa] of both with the chamber's pressure
    double past = 0.0;                     // [m^3/s] in past the piston
  };
  struct Moved {
    double dy = 0.0;                            // [m] of the piston
    std::array<double, 2> dN{}, change{}, p{};  // [m^3, Pa, Pa] of the chambers; implicit change
    double z = 0.0, friction = 0.0;             // [m], [N] steadyFriction() at that speed
  };
  void use(const HydraulicLegModel& model) noexcept;
  double openSpool(double current, double dt, const SecondOrderHold& spool) noexcept;
  double loadPressure() const noexcept;
  Flow through(double towards, double p) const noexcept;
  Moved moved(double dy, double dt, const std::array<Flow, 2>& flow) const noexcept;
  Moved movedThroughPlay(double length, double dt, const std::array<Flow, 2>& flow) const noexcept;
  double jointForce(const std::array<double, 2>& p, double z) const noexcept;
  double stopForce() const noexcept;
  double volume(std::size_t chamber, double y) const noexcept;

  HydraulicLegModel model_;
  double swelling_S_ = 1.0;      // [-] N/V of a chamber at supply pressure,
  double h_S_ = 0.0;             // [Pa] and enthalpy that a m^3 of N carries there
  int metered_;                  // [-] chambers that the valve meters
  double y_;                     // [m] of the cylinder
  Eigen::Vector2d eta_;          // [A, A/s] spool
  std::array<double, 2> oil_{};  // [m^3] N of each chamber, without pressure
  std::array<double, 2> p_{};    // [Pa]
  double pressed_;               // [Pa] loadPressure() behind the feedback's low-pass
  double z_ = 0.0;               // [m] of the seals' bristles
  double v_ = 0.0;               // [m/s] of the piston, last,
  double friction_ = 0.0;        // [N] and what the seals take when that is steady
  HydraulicLosses losses_;
};

}  // namespace ves::plant
