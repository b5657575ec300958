// SPDX-License-Identifier: BSD-3-Clause
//
// What may be let in: every value finite and in range. NaN never is.
#pragma once

#include "ves/contract/robot_order.hpp"
#include "ves/contract/setup.hpp"
#include "ves/contract/tick_state.hpp"

namespace ves {

bool plausible(const Sample& sample) noexcept;
bool plausible(const LegCommand& command) noexcept;
bool plausible(const Order& order) noexcept;
bool plausible(const RobotOrder& order) noexcept;
/// Lengths, limits and times that a driver can keep.
bool plausible(const MachineSetup& setup) noexcept;

}  // namespace ves
