// SPDX-License-Identifier: BSD-3-Clause
//
// The page that shows runs, as one file.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace ves {

/// Little-endian floats, as RFC 4648 writes bytes.
std::string base64(const std::vector<float>& numbers);

/// The page with everything inside: three.js and dygraphs of this machine, and the recordings (see
/// recording()). Throws InputError when those libraries are not installed.
std::string page(const std::vector<nlohmann::ordered_json>& recordings);

/// The same, for what a WebServer sends.
std::string livePage();

}  // namespace ves
