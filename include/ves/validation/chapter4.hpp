// SPDX-License-Identifier: BSD-3-Clause
//
// Chapter 4 of the report once more: every claim that a replica can be held to, run in lockstep.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>

namespace ves {

struct Chapter4 {
  std::string html;                // the page
  nlohmann::ordered_json summary;  // the claims, and named numbers with the unit in the name
};

/// Runs the scenarios of `config`, its logs passing through `folder`. `progress` is told each run's
/// name and number. Throws InputError.
Chapter4 reproduceChapter4(const std::filesystem::path& config, const std::filesystem::path& folder,
                           const std::function<void(const std::string&, int)>& progress);

}  // namespace ves
