// SPDX-License-Identifier: BSD-3-Clause
#include "ves/contract/tick_state.hpp"

namespace ves {

std::string_view name(Phase phase) noexcept {
  switch (phase) {
    case Phase::kDisarmed: return "disarmed";
    case Phase::kArmed: return "armed";
    case Phase::kRunning: return "running";
    case Phase::kReturning: return "returning";
    case Phase::kParked: return "parked";
    case Phase::kStopped: return "stopped";
    case Phase::kStopping: return "stopping";
    case Phase::kCount: break;
  }
  return "unknown";
}

std::string_view name(CalibrationStatus status) noexcept {
  switch (status) {
    case CalibrationStatus::kNone: return "none";
    case CalibrationStatus::kTaking: return "being taken";
    case CalibrationStatus::kDone: return "done";
    case CalibrationStatus::kRefused: return "refused";
    case CalibrationStatus::kCount: break;
  }
  return "unknown";
}

std::string_view name(StillnessViolation violation) noexcept {
  switch (violation) {
    case StillnessViolation::kNone: return "nothing";
    case StillnessViolation::kLeg: return "leg";
    case StillnessViolation::kJoint: return "joint";
    case StillnessViolation::kChannel: return "wrench channel";
    case StillnessViolation::kBias: return "bias";
    case StillnessViolation::kCount: break;
  }
  return "unknown";
}

}  // namespace ves
