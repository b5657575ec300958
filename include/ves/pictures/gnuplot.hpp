// SPDX-License-Identifier: BSD-3-Clause
//
// Runs gnuplot.
#pragma once

#include <filesystem>
#include <string>

namespace ves {

/// Distinct to most eyes.
inline constexpr const char* kColour[] = {"#0072b2", "#d55e00", "#009e73"};

/// For gnuplot, between single quotes.
std::string quoted(const std::string& text);

/// Runs a script in a folder; what it draws is there or is not.
void gnuplot(const std::string& script, const std::filesystem::path& folder);

}  // namespace ves
