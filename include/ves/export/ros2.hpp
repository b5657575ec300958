// SPDX-License-Identifier: BSD-3-Clause
//
// A run for the viewers of ROS 2: an MCAP file of that profile, messages as CDR with their schemas
// inside. ROS 2 itself is not needed, here or there.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "ves/series/series.hpp"

namespace ves {

/// /tf and /tf_static (platform, every frame of the robot, the same under ghost/ on the base in
/// free space), /robot_description, /joint_states, /wrench, /legs, /log, and every message as its
/// .lcm file defines it under /ves/; the configuration is attached. The same bytes for the same
/// events.
class McapExport {
 public:
  /// [m, rad] from home: where the base in free space is shown beside a row. Nothing: not known.
  using BaseOf = std::function<std::optional<Vec6>(const Row&)>;

  /// Throws InputError when the file cannot be written; so do add() and finish().
  McapExport(const Experiment& experiment, const std::string& version, const std::string& file,
             BaseOf base);
  ~McapExport();

  /// What a log or a bus says next. Ticks of the first controller only.
  void add(const LogEvent& event);
  /// Index and attachments; without it readers call the file truncated.
  void finish();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ves
