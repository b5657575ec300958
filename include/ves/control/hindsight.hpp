// SPDX-License-Identifier: BSD-3-Clause
//
// Where the base would be, had what is known now been known from the beginning. The base is linear:
// what it has done for a wrong mass, or without a force that was taken for noise, runs beside it,
// and is given to it by and by.
#pragma once

#include "ves/robot/mass_regressor.hpp"
#include "ves/vehicle/admittance_model.hpp"

namespace ves {

/// What a tick has found out.
struct Lesson {
  static constexpr int kGroup = 5;            // [-] samples that are looked at together
  static constexpr std::size_t kGroups = 40;  // [-] of the longest time that is looked at

  MassColumns momentum;  // [N s, N m s] of the robot per parameter, about Po in I
  MassVector learnt;     // by how much parameters are other than was believed; empty: nothing
  Wrench withheld;       // F_Po_I taken for noise in this tick
  bool group_ends = false;
  int replay = 0;        // [-] samples for which that was wrong, this one included
  Wrench passed;         // F_Po_I beyond the robot's model that the base was given,
  bool passing = false;  // now or of late
  int hand = -1;         // [-] the first parameter of a body that may be in the hand from now on,
  bool was_weight = false;  // and what passed of late was its weight
};

class Hindsight {
 public:
  explicit Hindsight(double period);  // [s]

  /// The base begins: with the momentum of the next step's lesson, of as many parameters as this.
  void reset(const AdmittanceModel& base, const Lesson& lesson) noexcept;
  /// After a step of dt [s] of the base with M_1 on it.
  void step(const AdmittanceModel& base, const Mat6& M_1, double dt, const Lesson& lesson) noexcept;
  /// What the base's modes are to change by now.
  const ModalDynamics::Modes& due() const noexcept { return due_; }
  bool any() const noexcept { return any_; }

 private:
  static constexpr std::size_t kKept = Lesson::kGroups + 1;  // [-] ends of groups

  using Modes = ModalDynamics::Modes;
  void owe(const Modes& more, double sign) noexcept;

  double period_;                    // [s]
  int slide_;                        // [-] steps over which a correction is given
  Sensitivity learns_;               // of the modes per parameter,
  bool begun_ = false;               // which counts
  Modes withheld_;                   // what the base has not done,
  Modes passed_;                     // and what it has, of what it was given of late
  std::array<Modes, kKept> past_{};  // a ring, the newest at kept_ - 1
  std::size_t kept_ = 0;
  Modes owed_, due_;
  int remaining_ = 0;  // [-] steps
  bool any_ = false;
};

}  // namespace ves
