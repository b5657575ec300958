// SPDX-License-Identifier: BSD-3-Clause
//
// "robot" of a program's segments: motions of joints and of the tool, and what the robot takes in
// hand. Read in the order in which they happen, so that each is checked against what was before it.
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "ves/config/experiment.hpp"
#include "ves/planning/joint_paths.hpp"
#include "ves/planning/tool_planner.hpp"

namespace ves {

class RobotEvents {
 public:
  /// Takes machine and robot from `out`, and adds events and told loads to it.
  explicit RobotEvents(Experiment& out);

  /// An event; "at_s" has been read.
  void read(Section& s, const Cue& cue);
  /// After a segment's events.
  void pass(const Segment& segment);

 private:
  void readJoint(Section& s, const Cue& cue);
  void readTool(Section& s, const Cue& cue);
  void readGrasp(Section& s, const Cue& cue);
  void readGripper(Section& s, const Cue& cue);
  void readPush(Section& s, const Cue& cue);
  void readRelease(Section& s, const Cue& cue);
  void tell(Section& s, const Cue& cue, std::optional<double> delay, ToldLoad load);
  const NamedFrame& tool(const Section& s, std::string_view key) const;
  ToolPlanner& planner(const Section& s);
  Transform frameOf(Section& s, const Cue& cue, ToolOrder::Frame frame);
  const Segment& segmentOf(const Cue& cue) const {
    return out_.controller.program.segments[static_cast<std::size_t>(cue.segment)];
  }
  std::int64_t sinceStart(const Cue& cue) const { return began_ + cue.after; }
  void moved(const Cue& cue, const RobotAction& action, std::int64_t until);

  const UrdfRobot& robot_;
  Experiment& out_;
  std::unique_ptr<ToolPlanner> planner_;
  JointPaths paths_;  // of joints that move one by one; tool paths are in it once they have ended
  JointVector q_;                                 // where the last motion of each joint ends
  std::array<std::int64_t, kMaxJoints> until_{};  // [ns] and when, since the program's start
  std::int64_t began_ = 0;                        // [ns] at least, the segment since then
  std::int64_t path_until_ = 0;                   // [ns] when the last tool path ends
  bool holds_ = false;
  std::optional<Pose> stands_;  // the platform, where that is known
};

}  // namespace ves
