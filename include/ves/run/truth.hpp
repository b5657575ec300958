// SPDX-License-Identifier: BSD-3-Clause
//
// What a simulated machine says of itself beyond what a controller may know.
#pragma once

#include "ves/bus/messages.hpp"
#include "ves/plant/plant.hpp"

namespace ves {

truth_t toMessage(const plant::Truth& truth, const header_t& header) noexcept;

}  // namespace ves
