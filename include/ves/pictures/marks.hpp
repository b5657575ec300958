// SPDX-License-Identifier: BSD-3-Clause
//
// What begins on a time axis.
#pragma once

#include <string>
#include <vector>

#include "ves/series/series.hpp"

namespace ves {

struct Mark {
  double x = 0.0;  // [s]
  std::string name;
};

/// Where phases and segments begin, since the first tick.
std::vector<Mark> segmentMarks(const Series& series);

/// Where the program has the robot move a joint or its tool, grasp or let go, and where it rests
/// again, since the segment's start.
std::vector<Mark> robotMarks(const Experiment& experiment, int segment);

/// By time; what begins at once has one name.
std::vector<Mark> merged(std::vector<Mark> marks);

/// gnuplot's lines for those on an axis from here to there, in place of those before; names where
/// there is room.
std::string markLines(const std::vector<Mark>& marks, double from, double to);

}  // namespace ves
