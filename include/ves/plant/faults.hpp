// SPDX-License-Identifier: BSD-3-Clause
//
// Faults to inject: what, when, for how long. Sensor, legs, switches and messages go wrong here, so
// that what the controller does about it can be measured.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "ves/contract/sample.hpp"
#include "ves/control/program.hpp"

namespace ves::plant {

enum class Fault {
  kWrenchFrozen,   // all channels keep their reading
  kWrenchRail,     // channel `index` at the end of the converter
  kWrenchStep,     // channel `index` off by `amount` [count]
  kPressure,       // reads `amount` [V]
  kLegFrozen,      // leg `index` keeps its reading
  kLegJump,        // leg `index` reads `amount` [count] more
  kLegOutOfRange,  // leg `index` reads what no 14-bit counter can
  kValveStuck,     // the valve of leg `index` stays shut; a hydraulic one where it is
  kRunaway,        // the valve of leg `index` stays open
  kSupplyFalls,    // to the share `amount`; hydraulic legs, as all down to kSealWorn
  kLegLeaks,       // leg `index` from its bore to the outside, `amount` [m^3/s/Pa]
  kAirInOil,       // of leg `index`: its bulk modulus is the share `amount`
  kLegSticks,      // the seals of leg `index` rub with `amount` [N]
  kSealWorn,       // of the piston of leg `index`: oil gets past it, `amount` [m^3/s/Pa]
  kJointsLost,     // the robot's joint angles are NaN
  kLost,           // samples do not arrive
  kLate,           // samples arrive `amount` calls later
  kShuffled,       // every other sample is an old one
  kPanicButton,    // loop open
  kFloorMat,       // loop open
  kCount
};

std::string_view name(Fault fault) noexcept;

/// Of the cylinders, and of those that feel their load.
constexpr bool isHydraulic(Fault fault) noexcept {
  return fault >= Fault::kSupplyFalls && fault <= Fault::kSealWorn;
}

struct FaultEvent {
  Cue cue;
  std::int64_t duration = 0;  // [ns]
  Fault fault = Fault::kCount;
  int index = 0;        // [-] channel or leg, from 0
  double amount = 0.0;  // as the fault says
};

/// Applies one fault to what leaves the machine. Remembers what it needs to: an earlier reading.
class Injector {
 public:
  /// `active`: now. Called for every sample, so that there is an earlier one.
  void apply(const FaultEvent& event, bool active, double volts_per_count, Sample& sample) noexcept;

 private:
  static constexpr std::size_t kKept = 16;  // [-] samples
  std::array<Sample, kKept> kept_{};        // a ring, by call
  std::size_t calls_ = 0;
  std::optional<Sample> first_;  // when it became active
};

}  // namespace ves::plant
