// SPDX-License-Identifier: BSD-3-Clause
#include "ves/contract/order.hpp"

namespace ves {

std::string_view name(SegmentKind kind) noexcept {
  switch (kind) {
    case SegmentKind::kCalibration: return "calibration";
    case SegmentKind::kMove: return "move";
    case SegmentKind::kTrajectory: return "trajectory";
    case SegmentKind::kAdmittance: return "admittance";
    case SegmentKind::kMonitor: return "monitor";
    case SegmentKind::kPath: return "path";
    case SegmentKind::kCount: break;
  }
  return "none";
}

std::string_view name(Request request) noexcept {
  switch (request) {
    case Request::kNone: return "none";
    case Request::kStart: return "start";
    case Request::kStop: return "stop";
    case Request::kArm: return "arm";
    case Request::kRun: return "run";
    case Request::kHold: return "hold";
    case Request::kTare: return "tare";
    case Request::kReset: return "reset";
    case Request::kCompensate: return "compensate";
    case Request::kUncompensate: return "uncompensate";
    case Request::kOvertaken: return "overtaken";
    case Request::kVehicle: return "vehicle";
    case Request::kGripper: return "gripper";
    case Request::kThrust: return "thrust";
    case Request::kCount: break;
  }
  return "unknown";
}

std::string_view name(Refusal refusal) noexcept {
  switch (refusal) {
    case Refusal::kNone: return "not refused";
    case Refusal::kNotArmed: return "the legs are not armed";
    case Refusal::kBusy: return "something else is running";
    case Refusal::kArmed: return "already armed";
    case Refusal::kNotStopped: return "there is no stop to leave";
    case Refusal::kCauseRemains: return "a safety check still fails";
    case Refusal::kOutside: return "its path fails a safety check";
    case Refusal::kUnstable: return "with this base and robot the loop would diverge";
    case Refusal::kNoCompensation: return "the configuration has no compensation";
    case Refusal::kUnassessed: return "the stability of this loop has not been checked";
    case Refusal::kLoaded: return "the measured wrench is too large: calibrate, or remove the load";
    case Refusal::kChecking: return "its path is being checked";
    case Refusal::kOvertaken: return "a hold, a stop or a failing check came before it";
    case Refusal::kTooLong: return "the loop grows slowly, and would grow too much in that time";
    case Refusal::kTooFast: return "a mode of that vehicle would be too fast for the period";
    case Refusal::kNoSuchPart: return "the vehicle has no such springs, dampers or thrusters";
    case Refusal::kTooShort: return "shorter than the thruster can be on";
    case Refusal::kNotEmulated: return "no vehicle is emulated now";
    case Refusal::kNotLearning: return "masses are not learnt, or the robot has no tool";
    case Refusal::kCount: break;
  }
  return "unknown";
}

}  // namespace ves
