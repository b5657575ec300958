// SPDX-License-Identifier: BSD-3-Clause
//
// One direction of the loop: servo, leg and sensor, lifted over a controller period.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "ves/analysis/loop.hpp"

namespace ves {

/// One direction over a controller period: z <- step z + from_command u. `felt` z is the
/// acceleration as the wrench shows it at the tick, `pressed` z the same of the force that it leans
/// with.
struct Channel {
  Eigen::MatrixXd step;
  Eigen::VectorXd from_command;
  Eigen::RowVectorXd felt, pressed;
};

/// States of the machine's channel that the loop looks at.
struct ChannelState {
  static constexpr Eigen::Index kLength = 0, kSpeed = 1;  // [m], [m/s]
};

/// The machine's, leaning on something where `contact` is. `places`, where it is asked for, gets
/// the length at equal shares of the period, a row each, from {state, command}.
Channel channelOf(const Loop& loop, const std::optional<Leaning>& contact,
                  Eigen::MatrixXd* places = nullptr);

/// The controller's servo model, which a reading of the length corrects at every tick.
struct Observer : Channel {
  Eigen::VectorXd from_length;
};
Observer observerOf(const Loop& loop);

}  // namespace ves
