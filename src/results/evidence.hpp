// SPDX-License-Identifier: BSD-3-Clause
//
// Why a check failed: which leg, coordinate or channel, its value, the limit and its key.
#pragma once

#include <string>

#include "ves/results/series.hpp"

namespace ves {

/// In words, of a tick in which `check` failed; empty where the check's name says it all.
std::string evidence(Check check, const Row& row, const Experiment& experiment);

}  // namespace ves
