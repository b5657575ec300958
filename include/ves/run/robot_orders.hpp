// SPDX-License-Identifier: BSD-3-Clause
//
// Orders from the bus to the simulated robot. A tool path takes milliseconds to plan: a thread of
// its own does it, so that the machine keeps its time.
#pragma once

#include <future>
#include <memory>
#include <optional>
#include <string>

#include "ves/config/experiment.hpp"
#include "ves/contract/robot_order.hpp"
#include "ves/planning/tool_planner.hpp"
#include "ves/plant/plant.hpp"

namespace ves {

class RobotOrders {
 public:
  explicit RobotOrders(const Experiment& experiment);

  /// What can begin at once; nothing for a tool path, which done() gives when it is planned. The
  /// platform is where the plant truly has it. Throws InputError: why an order is refused.
  std::optional<RobotAction> take(const RobotOrder& order, const plant::Truth& truth);

  /// The path that is planned now, and not given yet; `wait`: until one that is begun is. Throws
  /// InputError: why there is none.
  std::optional<RobotAction> done(bool wait);

 private:
  const Experiment& experiment_;
  std::unique_ptr<ToolPlanner> planner_;
  std::future<JointTrajectory> planned_;
};

}  // namespace ves
