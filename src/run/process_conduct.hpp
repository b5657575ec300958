// SPDX-License-Identifier: BSD-3-Clause
//
// What the controller's and the machine's process say when they begin.
#pragma once

#include <fmt/format.h>

#include <cstdio>

#include "ves/core/build.hpp"
#include "ves/realtime/realtime.hpp"
#include "ves/run/run.hpp"

namespace ves {

inline void enableRealtime(const char* who, int priority, bool required) {
  if (const std::string refused = claimRealtime(priority, required); !refused.empty())
    fmt::print(stderr, "{}: runs at best effort: {}; {} doctor says more\n", who, refused,
               frontDoor());
}

inline void warnOfOpenBus(const char* who, const std::string& url) {
  if (const std::string warning = openBusWarning(url); !warning.empty())
    fmt::print(stderr, "{}: {}\n", who, warning);
}

/// Throws InputError.
inline void refuseKeyedLockstep(const ProcessOptions& options) {
  if (options.lockstep && !BusAddress(options.url).key_file.empty())
    throw InputError(fmt::format(
        "--url {}: lockstep stays on one machine; want no key, or no --lockstep", options.url));
}

}  // namespace ves
