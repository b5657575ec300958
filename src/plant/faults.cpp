// SPDX-License-Identifier: BSD-3-Clause
#include "ves/plant/faults.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ves::plant {

std::string_view name(Fault fault) noexcept {
  switch (fault) {
    case Fault::kWrenchFrozen: return "wrench_frozen";
    case Fault::kWrenchRail: return "wrench_rail";
    case Fault::kWrenchStep: return "wrench_step";
    case Fault::kPressure: return "pressure";
    case Fault::kLegFrozen: return "leg_frozen";
    case Fault::kLegJump: return "leg_jump";
    case Fault::kLegOutOfRange: return "leg_out_of_range";
    case Fault::kValveStuck: return "valve_stuck";
    case Fault::kRunaway: return "runaway";
    case Fault::kSupplyFalls: return "supply_falls";
    case Fault::kLegLeaks: return "leg_leaks";
    case Fault::kAirInOil: return "air_in_oil";
    case Fault::kLegSticks: return "leg_sticks";
    case Fault::kSealWorn: return "seal_worn";
    case Fault::kJointsLost: return "joints_lost";
    case Fault::kLost: return "samples_lost";
    case Fault::kLate: return "samples_late";
    case Fault::kShuffled: return "samples_shuffled";
    case Fault::kPanicButton: return "panic_button";
    case Fault::kFloorMat: return "floor_mat";
    case Fault::kCount: break;
  }
  return "none";
}

void Injector::apply(const FaultEvent& event, bool active, double volts_per_count,
                     Sample& sample) noexcept {
  kept_[calls_ % kKept] = sample;
  const auto earlier = [&](std::size_t calls) {
    return kept_[(calls_ - std::min({calls, calls_, kKept - 1})) % kKept];
  };
  const Sample before = earlier(1);
  const Sample late = earlier(static_cast<std::size_t>(std::max(0.0, event.amount)));
  const Sample old = earlier(3);
  ++calls_;
  if (!active) {
    first_.reset();
    return;
  }
  if (!first_) first_ = before;
  constexpr std::int32_t kRail = 32767;  // [count]
  const auto i = static_cast<std::size_t>(event.index);
  switch (event.fault) {
    case Fault::kWrenchFrozen:
      std::copy_n(first_->adc.begin(), kWrenchChannels, sample.adc.begin());
      break;
    case Fault::kWrenchRail: sample.adc[i] = kRail; break;
    case Fault::kWrenchStep:
      sample.adc[i] =
          std::clamp(sample.adc[i] + static_cast<std::int32_t>(event.amount), -kRail, kRail);
      break;
    case Fault::kPressure:
      sample.adc[kWrenchChannels] =
          static_cast<std::int32_t>(std::lround(event.amount / volts_per_count));
      break;
    case Fault::kSupplyFalls:
      sample.adc[kWrenchChannels] =
          static_cast<std::int32_t>(std::lround(event.amount * sample.adc[kWrenchChannels]));
      break;
    case Fault::kLegFrozen: sample.legs[i] = first_->legs[i]; break;
    case Fault::kLegJump: sample.legs[i] += static_cast<std::int32_t>(event.amount); break;
    case Fault::kLegOutOfRange: sample.legs[i] = 1 << 14; break;
    case Fault::kJointsLost: sample.q.setConstant(std::numeric_limits<double>::quiet_NaN()); break;
    case Fault::kLost: sample = *first_; break;
    case Fault::kLate: sample = late; break;
    case Fault::kShuffled:
      if (calls_ % 2 == 0) sample = old;
      break;
    case Fault::kPanicButton: sample.switches &= ~kPanicButtonClosed; break;
    case Fault::kFloorMat: sample.switches &= ~kFloorMatClosed; break;
    case Fault::kValveStuck:
    case Fault::kRunaway:  // valves and cylinders are the plant's
    case Fault::kLegLeaks:
    case Fault::kAirInOil:
    case Fault::kLegSticks:
    case Fault::kSealWorn:
    case Fault::kCount: break;
  }
}

}  // namespace ves::plant
