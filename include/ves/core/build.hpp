// SPDX-License-Identifier: BSD-3-Clause
//
// What this program was built from and with. Every log carries it: two builds of one arithmetic
// replay each other's logs bit for bit, others may not.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace ves {

struct Build {
  std::string_view version;     // of the project
  std::string_view revision;    // of the source; "+changes" where it was not committed
  std::string_view compiler;    // with its version
  std::string_view flags;       // of the optimiser and the sanitizers
  std::string_view arithmetic;  // processor, vectors and contraction that decide the last bit
};

const Build& build();

/// In one line, as logs carry it: "0.1.0; source 73b68c7; GNU 12.2.0; -O3; x86-64, SSE2, ...".
std::string describeBuild();

/// The arithmetic of a line that describeBuild() made; empty when it is not one.
std::string_view arithmeticOf(std::string_view description);

/// How a person calls this program: "./ves" in the checkout that it was built in, else "ves".
std::string_view frontDoor();
/// Where the configuration and other data lie beside the program where it is installed.
std::filesystem::path installedData();

}  // namespace ves
