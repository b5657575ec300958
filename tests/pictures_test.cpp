// SPDX-License-Identifier: BSD-3-Clause
//
// What a picture shows is what the table says: gnuplot is given a stand-in that keeps its script.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <regex>
#include <sstream>

#include "support/programs.hpp"
#include "support/rig.hpp"
#include "ves/series/series.hpp"

namespace ves {
namespace {

namespace fs = std::filesystem;

struct Points {
  std::vector<double> t, y;
};
/// Of a picture, by the label of its panel and the name of the curve.
struct Picture {
  double from = NAN, to = NAN;  // of its axis
  std::map<std::string, std::map<std::string, Points>> panels;
};

double numberIn(const std::string& text) {
  char* end = nullptr;
  const double x = std::strtod(text.c_str(), &end);
  return end == text.c_str() ? NAN : x;
}

/// By file name.
std::map<std::string, Picture> picturesIn(const std::string& script) {
  std::map<std::string, Picture> out;
  std::istringstream lines(script);
  Picture* picture = nullptr;
  std::map<std::string, Points> blocks;
  std::string label;
  std::smatch found;
  const std::regex file("set output '(.*)'"), span("set xrange \\[(.*):(.*)\\]"),
      block("(\\$curve\\d+) << EOD"), ylabel("set ylabel '(.*)' offset 1"),
      curve("(\\$curve\\d+) with lines [^,]*?title '([^']*)'");
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_match(line, found, file)) picture = &out[found[1]];
    if (std::regex_search(line, found, span)) {
      picture->from = std::stod(found[1]);
      picture->to = std::stod(found[2]);
    }
    if (std::regex_match(line, found, block)) {
      Points& points = blocks[found[1]] = {};
      for (double t = 0.0; std::getline(lines, line) && line != "EOD";) {
        std::string y;
        std::istringstream(line) >> t >> y;
        points.t.push_back(t);
        points.y.push_back(numberIn(y));
      }
    }
    if (std::regex_match(line, found, ylabel)) label = found[1];
    if (line.rfind("plot ", 0) != 0) continue;
    // dt (9,5) has a comma of its own.
    line = std::regex_replace(line, std::regex("\\(9,5\\)"), "2");
    for (std::sregex_iterator it(line.begin(), line.end(), curve), end; it != end; ++it)
      picture->panels[label][(*it)[2]] = blocks.at((*it)[1]);
  }
  return out;
}

/// A run with its pictures, as text.
struct DrawnRun {
  std::map<std::string, std::vector<double>> table;
  std::map<std::string, Picture> pictures;
};

class Pictures : public test::Programs {
 protected:
  DrawnRun drawn(const std::string& arguments) {
    const fs::path stand_in = fs::path(file("bin")) / "gnuplot";
    fs::create_directories(stand_in.parent_path());
    std::ofstream(stand_in) << "#!/bin/sh\ncat \"$1\" >>'" << file("script") << "'\n";
    fs::permissions(stand_in, fs::perms::owner_all);
    const test::Output ran = test::sh("PATH='" + stand_in.parent_path().string() + "':$PATH " +
                                      app("run") + arguments + " --lockstep" + out("run"));
    EXPECT_EQ(ran.status, 0) << ran.text;
    DrawnRun d{{}, picturesIn(test::readText(file("script")))};
    std::istringstream rows(test::readText(file("run/series.csv")));
    std::string row;
    std::getline(rows, row);
    const std::vector<std::string> names = csvFields(row);
    while (std::getline(rows, row)) {
      const std::vector<std::string> cells = csvFields(row);
      for (std::size_t k = 0; k < names.size(); ++k)
        d.table[names[k]].push_back(numberIn(cells.at(k)));
    }
    return d;
  }

  /// Each curve of the panel, against what the table's rows say it is: every point of it is of a
  /// row, and no row within the picture goes beyond all points.
  static void expectCurve(const DrawnRun& d, const std::string& picture, const std::string& panel,
                          const std::string& curve,
                          const std::function<double(std::size_t row)>& due) {
    SCOPED_TRACE(picture + ", " + panel + ", " + curve);
    ASSERT_EQ(d.pictures.count(picture), 1u);
    const Picture& p = d.pictures.at(picture);
    ASSERT_EQ(p.panels.count(panel), 1u);
    ASSERT_EQ(p.panels.at(panel).count(curve), 1u);
    const Points& points = p.panels.at(panel).at(curve);
    const std::vector<double>& t = d.table.at("t_s");
    double low = HUGE_VAL, high = -HUGE_VAL, most = 0.0;
    std::map<long, std::size_t> at;  // row by hundredths of a second
    for (std::size_t row = 0; row < t.size(); ++row) {
      at[std::lround(100.0 * t[row])] = row;
      const double y = due(row);
      if (t[row] < p.from || t[row] > p.to || !std::isfinite(y)) continue;
      low = std::min(low, y);
      high = std::max(high, y);
      most = std::max(most, std::abs(y));
    }
    double lowest = HUGE_VAL, highest = -HUGE_VAL;
    const double close = 1e-5 * most + 1e-12;
    for (std::size_t k = 0; k < points.t.size(); ++k) {
      const auto row = at.find(std::lround(100.0 * points.t[k]));
      ASSERT_NE(row, at.end()) << points.t[k];
      const double y = due(row->second);
      EXPECT_EQ(std::isfinite(y), std::isfinite(points.y[k])) << points.t[k];
      if (!std::isfinite(y)) continue;
      ASSERT_NEAR(points.y[k], y, close) << points.t[k];
      lowest = std::min(lowest, points.y[k]);
      highest = std::max(highest, points.y[k]);
    }
    EXPECT_NEAR(lowest, low, close);
    EXPECT_NEAR(highest, high, close);
    ASSERT_FALSE(points.t.empty());
    EXPECT_NEAR(points.t.front(), p.from, 0.05);
    EXPECT_NEAR(points.t.back(), p.to, 0.05);
  }
};

std::string filesOf(const std::map<std::string, Picture>& pictures) {
  std::string out;
  for (const auto& [name, picture] : pictures) out += name + " ";
  return out;
}

TEST_F(Pictures, ShowWhatTheTableSays) {
  const DrawnRun d = drawn("contact_board_puma --set controller.passivity.enabled=true");
  EXPECT_EQ(filesOf(d.pictures), "contact.png error.png legs.png pose.png tool.png wrench.png ");
  const auto value = [&](const std::string& name) {
    EXPECT_EQ(d.table.count(name), 1u) << name;
    return d.table.at(name);
  };
  const auto times = [&](const std::string& name, double factor) {
    return [v = value(name), factor](std::size_t row) { return v[row] * factor; };
  };
  const char* const coordinates[] = {"x", "y", "z", "alpha", "beta", "gamma"};
  for (int i = 0; i < 6; ++i) {
    const std::string c = coordinates[i], unit = i < 3 ? "_m" : "_rad";
    const double shown = i < 3 ? 1e3 : 180.0 / M_PI;
    const std::string panel = c + (i < 3 ? " [mm]" : " [deg]");
    expectCurve(d, "pose.png", panel, "actual", times(c + "_actual" + unit, shown));
    expectCurve(d, "pose.png", panel, "commanded", times(c + "_desired" + unit, shown));
    expectCurve(d, "pose.png", panel, "base in free space", times(c + "_base" + unit, shown));
    expectCurve(d, "error.png", i < 3 ? "position error [mm]" : "orientation error [deg]", c,
                [&, to = value(c + "_desired" + unit), from = value(c + "_actual" + unit)](
                    std::size_t row) { return shown * (to[row] - from[row]); });
    const std::string axis = std::string(i < 3 ? "f" : "m") + "xyz"[i % 3];
    expectCurve(d, "wrench.png", i < 3 ? "force [N]" : "moment [N m]", axis,
                times(axis + "_dynamic" + (i < 3 ? "_n" : "_nm"), 1.0));
    const std::string leg = fmt::format("leg{}", i + 1);
    expectCurve(d, "legs.png", fmt::format("leg {} [mm]", i + 1), "measured",
                times(leg + "_measured_m", 1e3));
    expectCurve(d, "legs.png", fmt::format("leg {} [mm]", i + 1), "commanded",
                times(leg + "_commanded_m", 1e3));
    if (i >= 3) continue;
    expectCurve(d, "tool.png", "actual minus on the base [mm]", c,
                [on = value("tool_" + c + "_base_m"), is = value("tool_" + c + "_actual_m")](
                    std::size_t row) { return 1e3 * (is[row] - on[row]); });
  }
  const auto fx = value("fx_contact_n"), fy = value("fy_contact_n"), fz = value("fz_contact_n");
  expectCurve(d, "contact.png", "force [N]", "on the tool",
              [&](std::size_t row) { return std::hypot(fx[row], fy[row], fz[row]); });
  expectCurve(d, "contact.png", "energy [mJ]", "put in", times("energy_put_in_j", 1e3));
  expectCurve(d, "contact.png", "energy [mJ]", "damped away", times("energy_paid_j", 1e3));
  // Each begins where there is something to be seen: the program, and wrenches without the bias.
  EXPECT_LT(d.pictures.at("pose.png").from, 0.2);
  EXPECT_EQ(d.pictures.at("pose.png").to, d.pictures.at("wrench.png").to);
  EXPECT_NEAR(d.pictures.at("wrench.png").from, 2.12,
              0.02);  // armed, a move and a calibration of 1 s
}

TEST_F(Pictures, ShowWhatIsLearntBesideTheBelief) {
  const DrawnRun d = drawn(
      "puma_on_table_4_1 --set controller.compensation.feed_forward=true --set "
      "controller.compensation.observer=true --set controller.compensation.inertia=true --set "
      "controller.compensation.adaptation=true --set sensor.readings_per_tick=4 --set "
      "controller.compensation.wrench=aided --set "
      "controller.compensation.learns_masses=true");
  const ServoModel believed = test::experiment("puma_on_table_4_1").controller.servo;
  for (int i = 0; i < kLegs; ++i) {
    const std::string leg = fmt::format("leg{}", i + 1), name = fmt::format("leg {}", i + 1);
    const auto beyond = [&](const std::string& what, double scale, double belief) {
      return [&v = d.table.at(leg + what), scale, belief](std::size_t row) {
        return scale * (v[row] - belief);
      };
    };
    expectCurve(d, "servos.png", "gain, extending, beyond belief [1/s]", name,
                beyond("_gain_extend_per_s", 1.0, believed.extend(i)));
    expectCurve(d, "servos.png", "gain, retracting, beyond belief [1/s]", name,
                beyond("_gain_retract_per_s", 1.0, believed.retract(i)));
    expectCurve(d, "servos.png", "delay, beyond belief [ms]", name,
                beyond("_servo_delay_s", 1e3, believed.delay(i)));
  }
  ASSERT_EQ(d.pictures.count("masses.png"), 1u);
  const auto& masses = d.pictures.at("masses.png").panels;
  for (const auto& [link, points] : masses.at("masses of links beyond belief [kg]")) {
    SCOPED_TRACE(link);
    const auto of = std::find_if(d.table.begin(), d.table.end(), [&, link = link](const auto& c) {
      return c.first.find(link + "_learnt_mass_kg") != std::string::npos;
    });
    ASSERT_NE(of, d.table.end());
    // Less the same belief all along.
    double belief = NAN;
    for (std::size_t k = 0, row = 0; k < points.t.size(); ++k) {
      while (d.table.at("t_s")[row] < points.t[k] - 1e-3) ++row;
      if (!std::isfinite(points.y[k])) continue;
      const double off = of->second[row] - points.y[k];
      if (std::isnan(belief)) belief = off;
      EXPECT_NEAR(off, belief, 1e-4 * belief);
    }
    EXPECT_GT(belief, 0.0);
  }
}

}  // namespace
}  // namespace ves
