// SPDX-License-Identifier: BSD-3-Clause
//
// The names of the channels on the bus.
#pragma once

#include <string>
#include <vector>

namespace ves::channel {

// At most 15 characters: such a string needs no heap.
inline const std::string kSample = "VES_SAMPLE";
inline const std::string kLegs = "VES_LEGS";  // of drivers of one piece: sample_t, their part of it
inline const std::string kWrench = "VES_WRENCH";
inline const std::string kJoints = "VES_JOINTS";
inline const std::string kSwitches = "VES_SWITCHES";
inline const std::string kLegCommand = "VES_LEG_COMMAND";
inline const std::string kState = "VES_STATE";
inline const std::string kTruth = "VES_TRUTH";
inline const std::string kTiming = "VES_TIMING";
inline const std::string kRobot = "VES_ROBOT";
inline const std::string kOperator = "VES_OPERATOR";
inline const std::string kQuery = "VES_QUERY";
inline const std::string kPace = "VES_PACE";
inline const std::string kSetup = "VES_SETUP";
inline const std::string kExperiment = "VES_EXPERIMENT";

/// What a recording of a run has, besides VES_EXPERIMENT at its beginning.
inline const std::vector<std::string> kRecorded = {kSample, kLegCommand, kState,   kTruth,
                                                   kTiming, kRobot,      kOperator};

}  // namespace ves::channel
