// SPDX-License-Identifier: BSD-3-Clause
//
// Figures of a page, as SVG.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "ves/pictures/marks.hpp"

namespace ves {

struct Line {
  std::string name;  // in the key; empty: not there
  std::vector<double> x, y;
  int colour = 0;  // [-] 0 to 2
  bool dashed = false;
};

/// A value over time where it is a number; the k-th line of a panel.
Line lineOf(const std::string& name, const Series& series, int k,
            const std::function<double(const Row&)>& value);

struct Panel {
  std::string x_label, y_label;
  std::vector<Line> lines;
  bool log_x = false;
  std::vector<Mark> marks = {};  // lines from below to above
};

/// One figure as SVG to stand in a page, panels side by side, two a row. Drawn by gnuplot; a
/// sentence in its place when that fails. Its inks are classes (`ink`, `c0`..`c2`, `grid`) that the
/// page colours, so that it is read on light and dark.
std::string svg(const std::vector<Panel>& panels);

/// The same as a file that needs no page around it. Throws InputError when nothing is drawn.
std::string svgFile(const std::vector<Panel>& panels);

}  // namespace ves
