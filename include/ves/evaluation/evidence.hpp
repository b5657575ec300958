// SPDX-License-Identifier: BSD-3-Clause
//
// Why a check failed, with its value, its limit and its key; why a calibration or a program was cut
// short.
#pragma once

#include <string>

#include "ves/series/series.hpp"

namespace ves {

/// In words, of a tick in which `check` failed; empty where the check's name says it all.
std::string evidence(Check check, const Row& row, const Experiment& experiment);

/// What moved, or was out of range, while a calibration took its samples.
std::string stillnessViolation(const state_t& state, const Experiment& experiment);

/// Why a program went home early; empty when it did not.
std::string whyEarly(const Series& series);
std::string refusedSegment(Refusal why);

}  // namespace ves
