// SPDX-License-Identifier: BSD-3-Clause
#include "ves/pictures/plots.hpp"

#include <fmt/compile.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <utility>
#include <vector>

#include "thinning.hpp"
#include "ves/core/coordinates.hpp"
#include "ves/evaluation/drift_samples.hpp"
#include "ves/pictures/gnuplot.hpp"
#include "ves/pictures/marks.hpp"

namespace ves {
namespace {

constexpr double kShownLength = 1e3;  // [mm/m]

struct Span {
  double from, to;
};

struct Curve {
  std::function<double(const Row&)> value;
  std::string title;
  std::string colour;
  bool dashed = false;
};

/// A picture of panels, as a gnuplot script. Every curve brings its own points: gnuplot would read
/// series.csv once for each.
class Page {
 public:
  Page(const Series& series, const std::vector<Mark>& marks, const std::string& file,
       const std::string& title, Span span, int rows, int cols)
      : series_(series), span_(span), panels_(rows * cols), cols_(cols) {
    script_ = fmt::format(
        "reset\nset terminal pngcairo noenhanced size 1500,{} font 'DejaVu Sans,12' background "
        "'#ffffff'\n"
        "set output {}\n"
        "set multiplot layout {},{} title {} font 'DejaVu Sans,13' margins 0.06,0.985,{},0.90 "
        "spacing 0.06,0.09\n"
        "set grid lc rgb '#cccccc' lw 1 dt 1\nset border 3 lc rgb '#555555'\nset tics nomirror\n"
        "set key at graph 1.0,1.02 right bottom horizontal maxrows 1 samplen 2 width 1 font "
        "'DejaVu Sans,10'\nset xrange [{}:{}]\nset offsets graph 0,0,0.05,0.05\n",
        rows == 1 ? 480 : 800, quoted(file), rows, cols, quoted(title), rows == 1 ? 0.14 : 0.085,
        span.from, span.to);
    script_ += markLines(marks, span.from, span.to);
  }

  /// [units of the panel] the least and the largest value.
  Span range(const std::vector<Curve>& curves) const {
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (const Row& row : series_.rows) {
      if (row.t < span_.from || row.t > span_.to) continue;
      for (const Curve& curve : curves) {
        const double y = curve.value(row);
        if (!std::isfinite(y)) continue;
        low = std::min(low, y);
        high = std::max(high, y);
      }
    }
    return low <= high ? Span{low, high} : Span{0.0, 0.0};
  }

  /// `least`: so far its axis goes at least, so that what rests is seen to rest.
  void panel(const std::string& ylabel, const std::vector<Curve>& curves, double least = 0.0) {
    const Span values = range(curves);
    const double middle = 0.5 * (values.from + values.to);
    // gnuplot warns of what is no range.
    if (!(values.to - values.from > 1e-6 * std::abs(middle))) least = std::max(least, 1.0);
    script_ += values.to - values.from < least
                   ? fmt::format("set yrange [{}:{}]\n", middle - 0.5 * least, middle + 0.5 * least)
                   : "set autoscale y\n";
    const bool bottom = ++drawn_ > panels_ - cols_;
    constexpr std::size_t kMostDrawn = 1400;  // [-] two for a pixel of the widest panel
    for (std::size_t i = 0; i < curves.size(); ++i) {
      std::vector<double> t, y;
      for (const Row& row : series_.rows) {
        if (row.t < span_.from || row.t > span_.to) continue;
        t.push_back(row.t);
        y.push_back(curves[i].value(row));
      }
      fmt::format_to(std::back_inserter(script_), "$curve{} << EOD\n", i);
      for (const std::size_t k : thinned(y, kMostDrawn))
        fmt::format_to(std::back_inserter(script_), FMT_COMPILE("{:.6g} {:.6g}\n"), t[k], y[k]);
      script_ += "EOD\n";
    }
    script_ += fmt::format("set ylabel {} offset 1\nset xlabel {}\nplot ", quoted(ylabel),
                           quoted(bottom ? "time since the first tick [s]" : ""));
    for (std::size_t i = 0; i < curves.size(); ++i)
      script_ +=
          fmt::format("{}$curve{} with lines lw {} dt {} lc rgb '{}' title {}", i ? ", " : "", i,
                      curves[i].dashed ? 1.5 : 2.0, curves[i].dashed ? "(9,5)" : "1",
                      curves[i].colour, quoted(curves[i].title));
    script_ += "\n";
  }

  std::string script() const { return script_ + "unset multiplot\nunset output\n"; }

 private:
  const Series& series_;
  Span span_;
  std::string script_;
  int panels_, cols_, drawn_ = 0;
};

bool in(const Row& row, Phase phase) { return row.state.phase == static_cast<int>(phase); }

/// What the sensor reads over hours (figures 4.2 and 4.3).
std::string driftPage(const std::vector<DriftSample>& samples, const std::string& title) {
  std::string data = "$samples << EOD\n";
  for (const DriftSample& sample : samples) {
    data += fmt::format("{} {}", sample.t / 3600.0, sample.temperature);
    for (double w : sample.wrench) data += fmt::format(" {}", w);
    data += "\n";
  }
  std::string script =
      "reset\n" + data + "EOD\n" +
      fmt::format(
          "set terminal pngcairo noenhanced size 1500,900 font 'DejaVu Sans,12' background "
          "'#ffffff'\nset output 'drift.png'\n"
          "set multiplot layout 3,1 title {} font 'DejaVu Sans,13' margins 0.06,0.985,0.07,0.93 "
          "spacing 0.06,0.06\n"
          "set grid lc rgb '#cccccc' lw 1 dt 1\nset border 3 lc rgb '#555555'\nset tics nomirror\n"
          "set key top right horizontal samplen 2 width 3 font 'DejaVu Sans,11'\n"
          "set xtics 12\nset offsets graph 0,0,0.25,0.05\n",
          quoted(title));
  const auto panel = [&](const char* ylabel, const char* xlabel, int first, int count, bool names) {
    script +=
        fmt::format("set ylabel {} offset 1\nset xlabel {}\nplot ", quoted(ylabel), quoted(xlabel));
    for (int i = 0; i < count; ++i)
      script +=
          fmt::format("{}$samples using 1:{} with linespoints pt 7 ps 0.5 lw 1.5 lc rgb '{}' {}",
                      i ? ", " : "", first + i, kColour[i],
                      names ? "title " + quoted(std::string(wrenchComponent(first - 3 + i).name))
                            : std::string("notitle"));
    script += "\n";
  };
  panel("force [N]", "", 3, 3, true);
  panel("moment [N m]", "", 6, 3, true);
  panel("temperature [C]", "time [h]", 2, 1, false);
  return script + "unset multiplot\nunset output\n";
}

/// Of every segment that ran.
std::vector<Mark> robotStarts(const Series& series) {
  std::vector<Mark> out;
  int segment = -1;
  for (const Row& row : series.rows) {
    if (!in(row, Phase::kRunning) || row.state.segment == std::exchange(segment, row.state.segment))
      continue;
    for (const Mark& mark : robotMarks(series.experiment, segment))
      out.push_back({row.t + mark.x, mark.name});
  }
  return out;
}

/// The pictures that gnuplot has drawn.
std::vector<std::filesystem::path> draw(const std::string& script,
                                        const std::vector<std::string>& files,
                                        const std::filesystem::path& folder) {
  gnuplot(script, folder);
  std::vector<std::filesystem::path> drawn;
  for (const std::string& file : files) {
    std::error_code none;
    if (std::filesystem::exists(folder / file, none)) drawn.push_back(folder / file);
  }
  return drawn;
}

}  // namespace

std::vector<std::filesystem::path> drawPlots(const Series& series,
                                             const std::optional<Emulation>& emulation,
                                             const std::optional<ToolMotion>& tool,
                                             const std::filesystem::path& folder) {
  if (series.rows.empty()) return {};
  const Experiment& experiment = series.experiment;
  if (const auto drift = driftSamples(series); drift.size() > 2)
    return draw(driftPage(drift, experiment.name + ": the sensor's mean over each sample"),
                {"drift.png"}, folder);
  // The program, not the wait before it; wrenches only once the sensor's bias is known.
  Span program{0.0, series.rows.back().t}, calibrated{-1.0, program.to};
  bool waiting = true;
  for (const Row& row : series.rows) {
    if (waiting && !in(row, Phase::kDisarmed)) {
      program.from = row.t;
      waiting = false;
    }
    if (row.state.kind == static_cast<int>(SegmentKind::kCalibration))
      calibrated.from = row.t + 2.0 * static_cast<double>(experiment.controller.period) *
                                    kSecondPerNanosecond;  // the bias counts from the next tick
  }

  const std::vector<Column> all = columns(experiment);
  const auto column = [&](const std::string& name) {
    return std::find_if(all.begin(), all.end(), [&](const Column& c) { return c.name == name; })
        ->value;
  };
  const auto scaled = [&](const std::string& name, double factor) {
    return [value = column(name), factor](const Row& row) { return value(row) * factor; };
  };
  const auto name = [](int i, const char* what) {
    return fmt::format("{}_{}_{}", coordinate(i).name, what, coordinate(i).unit);
  };
  std::vector<Mark> marks = segmentMarks(series);
  const std::vector<Mark> robot = robotStarts(series);
  marks.insert(marks.end(), robot.begin(), robot.end());
  marks = merged(marks);
  std::string script;
  std::vector<std::string> files;
  const auto finish = [&](const std::string& file, const Page& page) {
    files.push_back(file);
    script += page.script();
  };

  Page pose(series, marks, "pose.png", experiment.name + ": pose of the platform, from home",
            program, 2, 3);
  const std::vector<Column> free =
      emulation ? columnsOf(series, *emulation) : std::vector<Column>();
  constexpr double kLeast = 0.1;  // [-] of the panel beside it that goes farthest
  constexpr double kSeen = 0.1;   // [mm, deg]
  for (int half = 0; half < 2; ++half) {
    std::vector<std::vector<Curve>> panels;
    double most = 0.0;
    for (int i = 3 * half; i < 3 * half + 3; ++i) {
      const double scale = coordinate(i).shown;
      panels.push_back({{scaled(name(i, "actual"), scale), "actual", kColour[0], false},
                        {scaled(name(i, "desired"), scale), "commanded", kColour[1], true}});
      if (emulation)
        panels.back().push_back({[value = free[static_cast<std::size_t>(i)].value,
                                  scale](const Row& row) { return value(row) * scale; },
                                 "base in free space", kColour[2], true});
      const Span y = pose.range(panels.back());
      most = std::max(most, y.to - y.from);
    }
    for (int i = 3 * half; i < 3 * half + 3; ++i)
      pose.panel(fmt::format("{} [{}]", coordinate(i).name, coordinate(i).shown_unit),
                 panels[static_cast<std::size_t>(i - 3 * half)], std::max(kLeast * most, kSeen));
  }
  finish("pose.png", pose);

  Page error(series, marks, "error.png", experiment.name + ": commanded minus actual pose", program,
             1, 2);
  for (int half = 0; half < 2; ++half) {
    std::vector<Curve> curves;
    for (int i = 3 * half; i < 3 * half + 3; ++i)
      curves.push_back(
          {[to = column(name(i, "desired")), from = column(name(i, "actual")),
            scale = coordinate(i).shown](const Row& row) { return (to(row) - from(row)) * scale; },
           std::string(coordinate(i).name), kColour[i % 3], false});
    error.panel(half ? "orientation error [deg]" : "position error [mm]", curves);
  }
  finish("error.png", error);

  if (calibrated.from >= 0.0) {
    Page wrench(series, marks, "wrench.png",
                experiment.name + ": wrench on the platform, gravity compensated, about {P} in {I}",
                calibrated, 1, 2);
    for (int half = 0; half < 2; ++half) {
      std::vector<Curve> curves;
      for (int i = 3 * half; i < 3 * half + 3; ++i)
        curves.push_back(
            {column(fmt::format("{}_dynamic_{}", wrenchComponent(i).name, wrenchComponent(i).unit)),
             std::string(wrenchComponent(i).name), kColour[i % 3], false});
      wrench.panel(half ? "moment [N m]" : "force [N]", curves);
    }
    finish("wrench.png", wrench);
  }

  Page legs(series, marks, "legs.png", experiment.name + ": leg lengths", program, 2, 3);
  for (int i = 1; i <= kLegs; ++i)
    legs.panel(
        fmt::format("leg {} [mm]", i),
        {{scaled(fmt::format("leg{}_measured_m", i), kShownLength), "measured", kColour[0], false},
         {scaled(fmt::format("leg{}_commanded_m", i), kShownLength), "commanded", kColour[1],
          true}});
  finish("legs.png", legs);

  if (experiment.controller.compensation.adaptation) {
    const ServoModel& believed = experiment.controller.servo;
    Page page(series, marks, "servos.png", experiment.name + ": what is learnt of the servos",
              program, 1, 3);
    const auto panel = [&](const std::string& ylabel, const char* what, double scale,
                           const Vec6& belief) {
      std::vector<Curve> curves;
      for (int i = 0; i < kLegs; ++i)
        curves.push_back({[value = column(fmt::format("leg{}_{}", i + 1, what)), scale,
                           off = belief(i)](const Row& row) { return scale * (value(row) - off); },
                          fmt::format("leg {}", i + 1), kColour[i % 3], i >= 3});
      page.panel(ylabel, curves);
    };
    panel("gain, extending, beyond belief [1/s]", "gain_extend_per_s", 1.0, believed.extend);
    panel("gain, retracting, beyond belief [1/s]", "gain_retract_per_s", 1.0, believed.retract);
    panel("delay, beyond belief [ms]", "servo_delay_s", 1e3, believed.delay);
    finish("servos.png", page);
  }

  if (experiment.controller.compensation.learns_masses) {
    const std::vector<LearntBody> bodies = learntBodies(experiment);
    Page page(series, marks, "masses.png", experiment.name + ": what is learnt of the masses",
              program, 1, 2);
    std::vector<Curve> links, hand;
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      const auto& [body, believed] = bodies[k];
      const auto mass = column(body + "_learnt_mass_kg"),
                 deviation = column(body + "_learnt_mass_deviation_kg");
      if (body == "hand") {
        hand = {{mass, "in hand", kColour[0], false}};
        for (const double sign : {-1.0, 1.0})
          hand.push_back({[=](const Row& row) { return mass(row) + sign * deviation(row); },
                          sign < 0.0 ? "a deviation off" : "", kColour[1], true});
      } else {
        links.push_back({[mass, off = believed](const Row& row) {
                           return mass(row) > 0.0 ? mass(row) - off : NAN;  // learnt yet
                         },
                         body.substr(body.find('_') + 1), kColour[k % 3], k >= 3});
      }
    }
    page.panel("masses of links beyond belief [kg]", links);
    if (!hand.empty()) page.panel("mass in hand [kg]", hand);
    finish("masses.png", page);
  }

  if (tool && !tool->tick.empty()) {
    Page page(series, marks, "tool.png", experiment.name + ": the tool, carried by the base",
              program, 1, 2);
    const auto between = [&](const std::vector<Transform>& a, const std::vector<Transform>& b) {
      std::map<std::int64_t, Vec3> off;  // [m] by tick
      for (std::size_t k = 0; k < tool->tick.size(); ++k) off[tool->tick[k]] = a[k].p - b[k].p;
      return [off](int i) {
        return [off, i](const Row& row) {
          const auto at = off.find(row.state.header.sequence);
          return at == off.end() ? NAN : at->second(i) * kShownLength;
        };
      };
    };
    const auto carried = between(tool->actual, tool->at_rest),
               due = between(tool->on_base, tool->at_rest),
               missed = between(tool->actual, tool->on_base);
    std::vector<Curve> motions, errors;
    for (int i = 0; i < 3; ++i) {
      const std::string axis(coordinate(i).name);
      motions.push_back({carried(i), axis, kColour[i], false});
      motions.push_back({due(i), axis + ", on the base", kColour[i], true});
      errors.push_back({missed(i), axis, kColour[i], false});
    }
    page.panel("carried off by [mm]", motions);
    page.panel("actual minus on the base [mm]", errors);
    finish("tool.png", page);
  }

  if (experiment.plant.task.world) {
    Page page(series, marks, "contact.png",
              experiment.name + ": what the tool touches, and the energy that the emulation put in",
              program, 1, 2);
    std::vector<Curve> force = {
        {[](const Row& r) { return r.has_truth ? Vec3::Map(r.truth.contact).norm() : NAN; },
         "on the tool", kColour[0], false}};
    if (emulation) {
      std::map<std::int64_t, double> due;  // [N] by tick
      std::optional<std::int64_t> first;
      eachTick(series, [&](const Row& row, double) {
        const std::int64_t tick = row.state.header.sequence;
        if (!first) first = tick;
        const auto at = static_cast<std::size_t>(tick - *first);
        if (at < emulation->base.on_tool.size()) due[tick] = emulation->base.on_tool[at];
      });
      force.push_back({[due](const Row& row) {
                         const auto at = due.find(row.state.header.sequence);
                         return at == due.end() ? NAN : at->second;
                       },
                       "on the base in free space", kColour[1], true});
    }
    page.panel("force [N]", force);
    constexpr double kShownEnergy = 1e3;  // [mJ/J]
    std::vector<Curve> energy = {{[](const Row& r) { return kShownEnergy * r.state.energy_put_in; },
                                  "put in", kColour[0], false}};
    if (experiment.controller.passivity.enabled)
      energy.push_back({[](const Row& r) { return kShownEnergy * r.state.energy_paid; },
                        "damped away", kColour[2], false});
    page.panel("energy [mJ]", energy);
    finish("contact.png", page);
  }

  return draw(script, files, folder);
}

}  // namespace ves
