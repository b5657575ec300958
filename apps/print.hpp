// SPDX-License-Identifier: BSD-3-Clause
//
// What several commands say.
#pragma once

#include <string>
#include <vector>

#include "ves/config/experiment.hpp"
#include "ves/run/run.hpp"

namespace ves::app {

/// What reading its files has found; `verbose`: also what is known to be odd in the robot's.
void printWarnings(const Experiment& experiment, bool verbose = false);

/// Says that admittance control would diverge, and refuses a program that has it. Says which
/// contacts of the program are too stiff to be emulated well.
void warnOfInstability(Experiment& experiment);

/// Why a run of the controller is no success, empty where it is; its log knows more of it.
std::string whyNot(const RunResult& result, const std::string& log = "");

/// A title and columns beneath each other.
void printTable(const std::string& title, const std::vector<std::string>& header,
                const std::vector<std::vector<std::string>>& rows);

/// As a shell takes it for one word.
std::string asTyped(const std::string& word);

}  // namespace ves::app
