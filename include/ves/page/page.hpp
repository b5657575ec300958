// SPDX-License-Identifier: BSD-3-Clause
//
// The page that shows runs, as one file.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace ves {

/// Little-endian numbers, as RFC 4648 writes bytes.
std::string base64(const std::vector<float>& numbers);
std::string base64OfCounts(const std::vector<std::uint16_t>& numbers);

/// The page with everything inside: three.js and dygraphs of this machine, and the recordings (see
/// recording()). Throws InputError when those libraries are not installed.
std::string page(const std::vector<nlohmann::ordered_json>& recordings);

/// The same, for what a WebServer sends.
std::string livePage();

}  // namespace ves
