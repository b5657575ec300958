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

/// Runs the scenarios of `config` on `workers` threads; the result is the same for any number of
/// them. Files in between lie in `folder`. `progress` is told each run's name and number, by one
/// thread at a time. Throws InputError.
Chapter4 reproduceChapter4(const std::filesystem::path& config, const std::filesystem::path& folder,
                           int workers,
                           const std::function<void(const std::string&, int, int, int)>& progress);

}  // namespace ves
