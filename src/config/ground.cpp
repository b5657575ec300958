// SPDX-License-Identifier: BSD-3-Clause
//
// base.ground: what a vehicle stands on, recorded or as waves make a ship move.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <complex>
#include <random>
#include <sstream>

#include "readers.hpp"
#include "ves/core/coordinates.hpp"

namespace ves {
namespace {

constexpr double kStep = 0.01;  // [s] between rows of what was recorded

/// One column of a recording, in SI.
struct RecordedColumn {
  int coordinate;  // [-] -1: time
  double unit;
};

/// "t_s", "x_m", "alpha_deg", "alpha_rad".
std::optional<RecordedColumn> columnOf(const std::string& name) {
  if (name == "t_s") return RecordedColumn{-1, 1.0};
  for (int i = 0; i < 6; ++i) {
    const Coordinate& c = coordinate(i);
    if (name == fmt::format("{}_{}", c.name, c.yaml_unit)) return RecordedColumn{i, c.yaml};
    if (name == fmt::format("{}_{}", c.name, c.unit)) return RecordedColumn{i, 1.0};
  }
  return {};
}

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> out;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) {
    const auto first = cell.find_first_not_of(" \t\r"), last = cell.find_last_not_of(" \t\r");
    out.push_back(first == std::string::npos ? "" : cell.substr(first, last - first + 1));
  }
  return out;
}

/// [s], and [m, rad] a row.
struct Recording {
  std::vector<double> t;
  std::array<std::vector<double>, 6> x;
};

/// Throws InputError.
Recording readRecording(const std::string& text, const std::string& file) {
  constexpr double kMostGap = 0.5;               // [s] between rows
  constexpr double kMostSpeed[] = {5.0, M_PI};   // [m/s], [rad/s] from row to row
  constexpr double kMostAngle = 85.0 * kDegree;  // that fixed angles can have
  int line_number = 0;
  const auto fail = [&](const std::string& why) {
    throw InputError(fmt::format("{}:{}: {}", file, line_number, why));
  };
  std::istringstream in(text);
  std::string line;
  std::vector<RecordedColumn> columns;
  Recording out;
  while (std::getline(in, line)) {
    ++line_number;
    const std::vector<std::string> row = cells(line);
    if (row.empty() || row[0].empty() || row[0][0] == '#') continue;
    if (columns.empty()) {
      for (const std::string& name : row) {
        const auto column = columnOf(name);
        if (!column)
          fail(
              fmt::format("column '{}', want t_s and of x_m y_m z_m alpha_deg beta_deg gamma_deg "
                          "(or _rad) those that move",
                          name));
        for (const RecordedColumn& other : columns)
          if (other.coordinate == column->coordinate)
            fail(fmt::format("column '{}' is there twice", name));
        columns.push_back(*column);
      }
      if (columns[0].coordinate != -1) fail("the first column is not t_s, the time");
      continue;
    }
    if (row.size() != columns.size())
      fail(fmt::format("{} columns, want {} as above", row.size(), columns.size()));
    std::array<double, 6> x{};
    double t = 0.0;
    for (std::size_t i = 0; i < row.size(); ++i) {
      double value = 0.0;
      const auto [end, error] =
          std::from_chars(row[i].data(), row[i].data() + row[i].size(), value);
      if (error != std::errc() || end != row[i].data() + row[i].size() || !std::isfinite(value))
        fail(fmt::format("'{}', want a number", row[i]));
      value *= columns[i].unit;
      if (columns[i].coordinate < 0) {
        t = value;
        continue;
      }
      x[static_cast<std::size_t>(columns[i].coordinate)] = value;
      if (columns[i].coordinate >= 3 && !(std::abs(value) <= kMostAngle))
        fail(
            fmt::format("an angle of {:.4g} rad, want at most {:.3g}; of degrees the column is "
                        "called {}_deg",
                        value, kMostAngle, coordinate(columns[i].coordinate).name));
    }
    if (!out.t.empty()) {
      const double since = t - out.t.back();
      if (!(since > 0.0))
        fail(fmt::format("the time {:g} s is not after that of the row before", t));
      if (!(since <= kMostGap))
        fail(fmt::format("a gap of {:.4g} s, want at most {} s between rows", since, kMostGap));
      for (std::size_t i = 0; i < 6; ++i)
        if (const double speed = std::abs(x[i] - out.x[i].back()) / since, most = kMostSpeed[i / 3];
            !(speed <= most))
          fail(fmt::format("a step of {}: {:.4g} {}/s since the row before, want at most {:.3g}",
                           coordinate(static_cast<int>(i)).name, speed,
                           coordinate(static_cast<int>(i)).unit, most));
    }
    out.t.push_back(t);
    for (std::size_t i = 0; i < 6; ++i) out.x[i].push_back(x[i]);
  }
  if (out.t.size() < 4) fail(fmt::format("{} rows of motion, want at least 4", out.t.size()));
  return out;
}

/// Second derivatives at the knots of the natural cubic spline: a tridiagonal system, eliminated
/// downwards.
std::vector<double> curvatures(const std::vector<double>& t, const std::vector<double>& x) {
  const std::size_t n = t.size();
  std::vector<double> curve(n, 0.0), above(n, 0.0);
  for (std::size_t k = 1; k + 1 < n; ++k) {
    const double before = t[k] - t[k - 1], after = t[k + 1] - t[k];
    const double slopes = (x[k + 1] - x[k]) / after - (x[k] - x[k - 1]) / before;
    const double pivot = 2.0 * (before + after) - before * above[k - 1];
    above[k] = after / pivot;
    curve[k] = (6.0 * slopes - before * curve[k - 1]) / pivot;
  }
  for (std::size_t k = n - 1; k-- > 1;) curve[k] -= above[k] * curve[k + 1];
  return curve;
}

/// Natural cubic splines through the rows.
GroundMotion resampled(const Recording& recording) {
  const std::vector<double>& knots = recording.t;
  const double begin = knots.front(), lasts = knots.back() - begin;
  const auto n = static_cast<Eigen::Index>(std::floor(lasts / kStep)) + 1;
  GroundMotion out;
  out.step = kStep;
  out.rows.setZero(18, n);
  for (std::size_t c = 0; c < 6; ++c) {
    const std::vector<double>& x = recording.x[c];
    const std::vector<double> curve = curvatures(knots, x);
    const auto row = static_cast<Eigen::Index>(c);
    std::size_t k = 1;  // the knot after
    for (Eigen::Index i = 0; i < n; ++i) {
      const double t = std::min(begin + kStep * static_cast<double>(i), knots.back());
      while (k + 1 < knots.size() && knots[k] < t) ++k;
      const double h = knots[k] - knots[k - 1], from = t - knots[k - 1], to = knots[k] - t,
                   c_0 = curve[k - 1] / (6.0 * h), c_1 = curve[k] / (6.0 * h),
                   x_0 = x[k - 1] / h - c_0 * h * h, x_1 = x[k] / h - c_1 * h * h;
      out.rows(row, i) = x_0 * to + x_1 * from + c_0 * to * to * to + c_1 * from * from * from;
      out.rows(6 + row, i) = x_1 - x_0 - 3.0 * c_0 * to * to + 3.0 * c_1 * from * from;
      out.rows(12 + row, i) = 6.0 * (c_0 * to + c_1 * from);
    }
  }
  return out;
}

using Complex6 = std::array<std::complex<double>, 6>;

/// How a ship answers waves of one metre from one side: by frequency, six coordinates.
struct Response {
  double heading;                 // [rad]
  std::vector<double> frequency;  // [Hz]
  std::vector<Complex6> of;       // [m/m, rad/m]

  /// By lines between its frequencies; none beyond them.
  Complex6 at(double f) const {
    Complex6 out{};
    const auto after = std::upper_bound(frequency.begin(), frequency.end(), f);
    if (after == frequency.begin() || after == frequency.end()) return out;
    const auto i = static_cast<std::size_t>(after - frequency.begin());
    const double share = (f - frequency[i - 1]) / (frequency[i] - frequency[i - 1]);
    for (std::size_t c = 0; c < 6; ++c) out[c] = (1.0 - share) * of[i - 1][c] + share * of[i][c];
    return out;
  }
};

Response readResponse(Section s) {
  Response out;
  out.heading = s.number("heading_deg", -360.0, 360.0) * kDegree;
  const Eigen::MatrixXd rows = s.matrix("rows", -1, 13, -1e3, 1e3);
  if (rows.rows() < 2) s.fail("rows", "want two frequencies at least");
  for (Eigen::Index r = 0; r < rows.rows(); ++r) {
    if (!(rows(r, 0) > (r > 0 ? rows(r - 1, 0) : 0.0)))
      s.fail("rows", fmt::format("frequency {:g} Hz in row {}, want them above 0 and rising",
                                 rows(r, 0), r + 1));
    out.frequency.push_back(rows(r, 0));
    Complex6 of;
    for (Eigen::Index c = 0; c < 6; ++c)
      of[static_cast<std::size_t>(c)] =
          std::polar(std::abs(rows(r, 1 + 2 * c)) * coordinate(static_cast<int>(c)).yaml,
                     rows(r, 2 + 2 * c) * kDegree);
    out.of.push_back(of);
  }
  s.finish();
  return out;
}

/// [m^2/Hz] of JONSWAP's shape with the peak f_p [Hz], not scaled; of a peakedness of 1 Pierson's
/// and Moskowitz's.
double shapeOf(double f, double f_p, double peakedness) {
  const double width = f <= f_p ? 0.07 : 0.09, off = (f - f_p) / (width * f_p);
  return std::pow(f, -5.0) * std::exp(-1.25 * std::pow(f_p / f, 4.0)) *
         std::pow(peakedness, std::exp(-0.5 * off * off));
}

GroundMotion readSea(Section s) {
  const double height = s.number("significant_height_m", 0.0, 30.0),
               f_p = 1.0 / s.number("peak_period_s", 0.5, 60.0),
               peakedness = s.number("peakedness", 1.0, 10.0),
               heading = s.number("heading_deg", -360.0, 360.0) * kDegree;
  const auto n = static_cast<Eigen::Index>(s.integer("waves", 8, 200));
  std::mt19937_64 draw(static_cast<std::uint64_t>(s.integer("seed", 0, 1'000'000'000)));
  const auto uniform = [&] { return static_cast<double>(draw() >> 11) * 0x1p-53; };
  std::vector<Response> responses;
  for (Section one : s.list("responses")) responses.push_back(readResponse(one));
  if (responses.empty()) s.fail("responses", "no heading, want one at least");
  std::sort(responses.begin(), responses.end(),
            [](const Response& a, const Response& b) { return a.heading < b.heading; });
  const auto after = std::find_if(responses.begin(), responses.end(),
                                  [&](const Response& r) { return r.heading >= heading - 1e-9; });
  if (after == responses.end() ||
      (after == responses.begin() && !(responses.front().heading <= heading + 1e-9)))
    s.fail("heading_deg",
           fmt::format("{:g}, and the responses are for {:g} to {:g}", heading / kDegree,
                       responses.front().heading / kDegree, responses.back().heading / kDegree));
  const Response &right = *after, &left = after == responses.begin() ? right : *(after - 1);
  const double share =
      &left == &right ? 1.0 : (heading - left.heading) / (right.heading - left.heading);

  // From where there is no wave to where there is hardly any; a wave in each part.
  constexpr double kFirst = 0.5, kLast = 4.0;  // [-] of the peak's frequency
  constexpr int kParts = 20;                   // [-] of a part, for its energy
  const double part = (kLast - kFirst) * f_p / static_cast<double>(n);
  Eigen::VectorXd energy = Eigen::VectorXd::Zero(n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (int k = 0; k < kParts; ++k)
      energy(i) += shapeOf(kFirst * f_p + (static_cast<double>(i) + (k + 0.5) / kParts) * part, f_p,
                           peakedness);
  energy *= height * height / 16.0 / energy.sum();  // Hs = 4 sqrt(m0)
  GroundMotion out;
  out.waves.setZero(13, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double f = kFirst * f_p + (static_cast<double>(i) + uniform()) * part,
                 amplitude = std::sqrt(2.0 * energy(i)), phase = 2.0 * M_PI * uniform();
    const Complex6 a = left.at(f), b = right.at(f);
    out.waves(0, i) = 2.0 * M_PI * f;
    for (Eigen::Index c = 0; c < 6; ++c) {
      const auto k = static_cast<std::size_t>(c);
      const std::complex<double> of =
          std::polar(amplitude, phase) * ((1.0 - share) * a[k] + share * b[k]);
      out.waves(1 + c, i) = of.real();
      out.waves(7 + c, i) = -of.imag();
    }
  }
  s.finish();
  return out;
}

}  // namespace

GroundMotion readGround(Section s) {
  GroundMotion out;
  const double fade = s.number("fade_s", 0.5, 600.0);
  if (s.has("sea") && s.has("recording_text"))
    s.fail("sea", "there is a recording too, want one of them");
  if (s.has("sea"))
    out = readSea(s.section("sea"));
  else if (s.has("recording_text"))
    out = resampled(readRecording(s.text("recording_text"), s.fileOf("recording_text")));
  else
    s.fail("sea", "missing, want it or a recording");
  out.fade = fade;
  s.finish();
  return out;
}

}  // namespace ves
