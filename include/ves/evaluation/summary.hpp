// SPDX-License-Identifier: BSD-3-Clause
//
// A run in named numbers.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "ves/evaluation/let_go.hpp"
#include "ves/run/run.hpp"

namespace ves {

/// Named numbers, the unit at the end of each name. Errors are where the platform should be at a
/// tick minus where it is, over the trajectory and admittance segments of the program.
nlohmann::ordered_json summarise(const Series& series, const RunResult& result,
                                 ReferenceMotions& references);
nlohmann::ordered_json summarise(const Series& series, const RunResult& result);

/// The summary as a person reads it.
std::string table(const nlohmann::ordered_json& summary);

/// Throws InputError when the file cannot be written.
void writeSummary(const nlohmann::ordered_json& summary, const std::string& file);

}  // namespace ves
