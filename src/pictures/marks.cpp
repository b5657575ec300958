// SPDX-License-Identifier: BSD-3-Clause
#include "ves/pictures/marks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "ves/pictures/gnuplot.hpp"

namespace ves {
namespace {

struct NameOf {
  const Experiment& experiment;

  std::string operator()(const RobotMove& move) const {
    return experiment.robot.joint_names[static_cast<std::size_t>(move.joint)];
  }
  std::string operator()(const ToolMove&) const { return "tool"; }
  std::string operator()(const Grasp&) const { return "grasp"; }
  std::string operator()(const GraspTarget&) const { return "grasp"; }
  std::string operator()(const Release&) const { return "release"; }
  std::string operator()(const Push&) const { return "push"; }
};

}  // namespace

std::vector<Mark> segmentMarks(const Series& series) {
  std::vector<Mark> out;
  const state_t* before = nullptr;
  for (const Row& row : series.rows) {
    const state_t& s = row.state;
    const bool same = before && before->phase == s.phase && before->segment == s.segment;
    before = &row.state;
    if (same) continue;
    const bool runs = s.phase == static_cast<int>(Phase::kRunning);
    out.push_back({row.t, std::string(runs ? name(static_cast<SegmentKind>(s.kind))
                                           : name(static_cast<Phase>(s.phase)))});
  }
  return out;
}

std::vector<Mark> robotMarks(const Experiment& experiment, int segment) {
  std::vector<Mark> out;
  double rests = -HUGE_VAL;                                             // from then on
  for (const RobotEvent& event : experiment.plant.task.robot_events) {  // by time
    if (event.cue.segment != segment) continue;
    const double start = static_cast<double>(event.cue.after) * kSecondPerNanosecond;
    if (rests < start && std::isfinite(rests)) out.push_back({rests, "at rest"});
    out.push_back({start, std::visit(NameOf{experiment}, event.action)});
    rests = std::max(rests, start + durationOf(event.action));
  }
  if (std::isfinite(rests)) out.push_back({rests, "at rest"});
  return merged(out);
}

std::vector<Mark> merged(std::vector<Mark> marks) {
  std::stable_sort(marks.begin(), marks.end(),
                   [](const Mark& a, const Mark& b) { return a.x < b.x; });
  std::vector<Mark> out;
  for (const Mark& mark : marks)
    if (!out.empty() && mark.x == out.back().x)
      out.back().name += ", " + mark.name;
    else
      out.push_back(mark);
  return out;
}

std::string markLines(const std::vector<Mark>& marks, double from, double to) {
  constexpr double kRoom = 0.025;  // [-] of the axis, for a name on its side
  std::string out = "unset arrow\nunset label\n";
  double named = -HUGE_VAL;
  for (const Mark& mark : marks) {
    if (!(mark.x >= from && mark.x <= to)) continue;  // gnuplot would draw it beside the picture
    out += fmt::format(
        "set arrow from {0},graph 0 to {0},graph 1 nohead back lw 0.8 dt 3 lc rgb '#707070'\n",
        mark.x);
    if (mark.x - named < kRoom * (to - from)) continue;
    named = mark.x;
    out += fmt::format(
        "set label {} at {},graph 0.02 left rotate by 90 offset 0.7,0 font ',9' tc rgb '#707070'\n",
        quoted(mark.name), mark.x);
  }
  return out;
}

}  // namespace ves
