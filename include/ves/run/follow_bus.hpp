// SPDX-License-Identifier: BSD-3-Clause
//
// A run that others have started, message by message.
#pragma once

#include <functional>
#include <string>

#include "ves/bus/event_log.hpp"

namespace ves {

/// Waits for a controller on the bus, asks for its configuration, and hands out that, then every
/// message that a log would have, until `stop` or until the controller has been silent for 2 s.
/// False when it ended before there was one. Throws InputError when the bus cannot be opened.
bool followBus(const std::string& url, const std::function<bool()>& stop,
               const std::function<void(const experiment_t&)>& begin,
               const std::function<void(const LogEvent&)>& take);

}  // namespace ves
