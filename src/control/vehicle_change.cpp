// SPDX-License-Identifier: BSD-3-Clause
#include "ves/control/vehicle_change.hpp"

#include <algorithm>

#include "ves/control/energy_account.hpp"

namespace ves {

VehicleChange::VehicleChange(double period, double damping) noexcept
    : period_(period), most_damping_(damping), slew_(dampingSlew(damping, period)) {}

VehicleFactors VehicleChange::ordered(const VehicleOrder& order) const noexcept {
  return order.appliedTo(to_);
}

void VehicleChange::begin(const VehicleOrder& order, const AdmittanceModel& model) noexcept {
  constexpr double kLeast = 0.1;  // [s] that a change takes
  from_ = model.factors();
  to_ = ordered(order);
  rate_ = period_ / std::max({order.over, kLeast, period_});
  due_ = gone_ = energy_ = 0.0;
}

void VehicleChange::finish(AdmittanceModel& model) noexcept {
  model.become(to_);
  due_ = gone_ = 1.0;
  energy_ = damping_ = 0.0;
}

void VehicleChange::advance(AdmittanceModel& model) noexcept {
  constexpr double kCatchUp = 3.0;    // [-] times the rate that was ordered, when it has waited
  constexpr double kLeastDue = 0.05;  // [-] of the damping, so that it comes to an end
  due_ = std::min(1.0, due_ + rate_);
  if (gone_ < due_) {
    double next = std::min(due_, gone_ + kCatchUp * rate_);
    if (const double cost = model.costOf(at(next)); energy_ + cost > 0.0)
      next = cost > 0.0 ? gone_ + (next - gone_) * std::max(0.0, -energy_) / cost : gone_;
    gone_ = next;
    energy_ += model.costOf(at(gone_));
    model.become(at(gone_));
  }
  // A debt of d with an energy of motion of E is paid at 2 b E, which is 2 damping d.
  const double owed = gone_ < due_ ? energy_ + model.costOf(at(due_)) : 0.0;
  const double due =
      owed > 0.0 ? most_damping_ * std::clamp(owed / model.kineticEnergy(), kLeastDue, 1.0) : 0.0;
  damping_ += std::clamp(due - damping_, -slew_, slew_);
}

/// Exactly the ends at its ends.
VehicleFactors VehicleChange::at(double share) const noexcept {
  if (share >= 1.0) return to_;
  const auto between = [&](double from, double to) { return from + share * (to - from); };
  return {between(from_.mass, to_.mass), between(from_.damping, to_.damping),
          between(from_.stiffness, to_.stiffness)};
}

}  // namespace ves
