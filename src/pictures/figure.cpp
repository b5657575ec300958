// SPDX-License-Identifier: BSD-3-Clause
#include "ves/pictures/figure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <regex>
#include <sstream>
#include <utility>

#include "thinning.hpp"
#include "ves/core/errors.hpp"
#include "ves/pictures/gnuplot.hpp"

namespace ves {
namespace {

constexpr const char* kNoFigure = "<p>(gnuplot could not draw this figure)</p>";
constexpr std::size_t kMostPoints = 700;  // [-] of a line: more than it has pixels

std::string data(const Line& line) {
  std::string out;
  for (const std::size_t k : thinned(line.y, kMostPoints))
    out += fmt::format("{:.6g} {:.6g}\n", line.x[k], line.y[k]);
  return out;
}

/// Of x or y over all lines.
std::pair<double, double> range(const Panel& panel, std::vector<double> Line::*values) {
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const Line& line : panel.lines)
    for (const double value : line.*values) {
      low = std::min(low, value);
      high = std::max(high, value);
    }
  return low <= high ? std::pair(low, high) : std::pair(0.0, 0.0);
}

void replaceAll(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
}

}  // namespace

Line lineOf(const std::string& name, const Series& series, int k,
            const std::function<double(const Row&)>& value) {
  Line line{name, {}, {}, k % 3, k >= 3};
  for (const Row& row : series.rows) {
    const double y = value(row);
    if (!std::isfinite(y)) continue;
    line.x.push_back(row.t);
    line.y.push_back(y);
  }
  return line;
}

std::string svg(const std::vector<Panel>& panels) {
  const std::size_t columns = std::min<std::size_t>(2, panels.size());
  const std::size_t rows = (panels.size() + columns - 1) / columns;
  const double height = 250.0 * static_cast<double>(rows);
  std::string script = fmt::format(
      "set terminal svg noenhanced size {},{} font 'sans-serif,12'\nset output 'figure.svg'\n"
      "set multiplot layout {},{} margins {},0.99,{},{} spacing {},{}\n"
      "set grid lc rgb '#808080' lw 0.4 dt 1\nset border 3\nset tics nomirror\n"
      "set key top right horizontal samplen 2 width 1\n",
      columns == 1 ? 520 : 960, height, rows, columns, columns == 1 ? 0.13 : 0.075, 52.0 / height,
      1.0 - 12.0 / height, 0.1, 62.0 / height);
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const Panel& panel = panels[p];
    script += fmt::format("{}\nset xlabel {}\nset ylabel {}\n",
                          panel.log_x ? "set logscale x\nset autoscale xfix" : "unset logscale x",
                          quoted(panel.x_label), quoted(panel.y_label));
    const auto [low, high] = range(panel, &Line::y);
    const double span = high > low ? high - low : 1.0;  // room for the key above
    script += fmt::format("set yrange [{}:{}]\n", low - 0.05 * span, high + 0.16 * span);
    const auto [from, to] = range(panel, &Line::x);
    script += markLines(panel.marks, from, to);
    std::string plot;
    for (std::size_t i = 0; i < panel.lines.size(); ++i) {
      const Line& line = panel.lines[i];
      const std::string block = fmt::format("$p{}_{}", p, i);
      script += fmt::format("{} << EOD\n{}EOD\n", block, data(line));
      plot += fmt::format("{}{} using 1:2 with lines lw {} dt {} lc rgb '{}' {}",
                          plot.empty() ? "plot " : ", ", block, line.dashed ? 1.6 : 1.8,
                          line.dashed ? "(9,5)" : "1", kColour[line.colour],
                          line.name.empty() ? "notitle" : "title " + quoted(line.name));
    }
    script += plot + "\n";
  }
  script += "unset multiplot\nunset output\n";

  std::string name = (std::filesystem::temp_directory_path() / "ves-figure-XXXXXX").string();
  if (!mkdtemp(name.data())) return kNoFigure;
  const std::filesystem::path folder = name;
  gnuplot(script, folder);
  std::ostringstream text;
  text << std::ifstream(folder / "figure.svg").rdbuf();
  std::filesystem::remove_all(folder);
  std::string out = text.str();
  if (out.find("</svg>") == std::string::npos) return kNoFigure;

  out.erase(0, out.find("<svg"));
  // One panel is no wider than one of two, so that letters are of one size.
  out.insert(4, fmt::format(" style=\"max-width: {}px\"", columns == 1 ? 520 : 960));
  out = std::regex_replace(out, std::regex("<title>[^<]*</title>\\s*|<desc>[^<]*</desc>\\s*"), "");
  out.erase(out.find("<defs>"), out.find("</defs>") + 7 - out.find("<defs>"));
  out = std::regex_replace(
      out, std::regex(" id=\"[^\"]*\"| (width|height)=\"\\d+\"(?=[^>]*viewBox)"), "");
  out = std::regex_replace(out, std::regex("<g [^>]*>\\s*</g>\\s*"), "");
  const char* const ink[][2] = {{"stroke='black'", "class=\"ink\""},
                                {"fill=\"black\"", "class=\"ink-text\""},
                                {"stroke='rgb(  0, 114, 178)'", "class=\"c0\""},
                                {"stroke='rgb(213,  94,   0)'", "class=\"c1\""},
                                {"stroke='rgb(  0, 158, 115)'", "class=\"c2\""},
                                {"stroke='rgb(112, 112, 112)'", "class=\"mark\""},
                                {"fill=\"rgb(112,112,112)\"", "class=\"mark-text\""},
                                {"stroke='rgb(128, 128, 128)'", ""}};
  for (const auto& [from, to] : ink) replaceAll(out, from, to);
  return out;
}

std::string svgFile(const std::vector<Panel>& panels) {
  std::string out = svg(panels);
  if (out.rfind("<svg", 0) != 0) throw InputError("gnuplot has drawn nothing; is it installed?");
  out.insert(out.find('>') + 1,
             "\n<style>.ink { stroke: #1b1f24; } .ink-text { fill: #1b1f24; } .mark { stroke: "
             "#57606a; } .mark-text { fill: #57606a; } .gridline { stroke: "
             "#d0d7de; } .c0 { stroke: #0067a8; } .c1 { stroke: #c14e00; } .c2 { stroke: #00805e; "
             "}</style>\n<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>");
  return out;
}

}  // namespace ves
