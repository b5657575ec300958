// SPDX-License-Identifier: BSD-3-Clause
#include "ves/acceptance/measures.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

#include "ves/math/dense.hpp"

namespace ves {
namespace {

constexpr double kNormal = 1.96;  // [-] 95 % of a normal distribution
constexpr int kHarmonics = 3;

double student(std::size_t values) {
  // In double: valgrind has no long double, and would end the program where Boost prepares its own.
  using Double = boost::math::policies::policy<boost::math::policies::promote_double<false>>;
  using Distribution = boost::math::students_t_distribution<double, Double>;
  return quantile(Distribution(static_cast<double>(values - 1)), 0.975);
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double one : values) sum += one;
  return sum / static_cast<double>(values.size());
}

/// Sum of squares about the mean.
double squares(const std::vector<double>& values) {
  const double about = mean(values);
  double sum = 0.0;
  for (const double one : values) sum += (one - about) * (one - about);
  return sum;
}

/// Columns 1, t, and cos and -sin of each harmonic, over [from, to).
Eigen::MatrixXd waves(const Track& track, double w, int harmonics, std::size_t from,
                      std::size_t to) {
  Eigen::MatrixXd A(to - from, 2 + 2 * harmonics);
  for (std::size_t i = from; i < to; ++i) {
    const auto row = static_cast<Eigen::Index>(i - from);
    A(row, 0) = 1.0;
    A(row, 1) = track.t[i] - track.t[from];
    for (int k = 1; k <= harmonics; ++k) {
      A(row, 2 * k) = std::cos(k * w * track.t[i]);
      A(row, 2 * k + 1) = -std::sin(k * w * track.t[i]);
    }
  }
  return A;
}

Eigen::VectorXd values(const Track& track, std::size_t from, std::size_t to) {
  return Eigen::VectorXd::Map(track.y.data() + from, static_cast<Eigen::Index>(to - from));
}

}  // namespace

Estimate meanOf(const std::vector<double>& all) {
  const auto n = static_cast<double>(all.size());
  if (all.size() < 2) return {all.empty() ? NAN : all.front(), NAN};
  return {mean(all), student(all.size()) * std::sqrt(squares(all) / (n - 1.0) / n)};
}

double valueAt(const Track& track, double t) {
  const auto after = std::upper_bound(track.t.begin(), track.t.end(), t);
  if (after == track.t.begin()) return track.y.front();
  if (after == track.t.end()) return track.y.back();
  const auto i = static_cast<std::size_t>(after - track.t.begin());
  const double share = (t - track.t[i - 1]) / (track.t[i] - track.t[i - 1]);
  return track.y[i - 1] + share * (track.y[i] - track.y[i - 1]);
}

Sinusoid sinusoid(const Track& track, double frequency) {
  constexpr double kLeastPart = 20.0;  // [-] samples of a part that is looked at alone
  const double w = 2.0 * M_PI * frequency;
  const std::size_t size = track.t.size();
  const Eigen::MatrixXd A = waves(track, w, kHarmonics, 0, size);
  const Eigen::VectorXd y = values(track, 0, size), found = leastSquares(A, y),
                        rest = y - A * found;
  Sinusoid out;
  for (int k = 1; k <= kHarmonics; ++k) out.of.emplace_back(found(2 * k), found(2 * k + 1));
  const auto n = static_cast<double>(size);
  out.rest = std::sqrt(rest.squaredNorm() / n);
  out.peak = (y - A.leftCols(4) * found.head(4)).cwiseAbs().maxCoeff();

  const double span = track.t.back() - track.t.front() + (track.t[1] - track.t[0]),
               cycles = span * frequency,
               each = std::ceil(kLeastPart / (n / cycles));  // [-] cycles of a part
  const auto parts = static_cast<std::size_t>(cycles / each + 1e-6);
  std::vector<double> re, im;
  for (std::size_t k = 0; k < parts && parts >= 2; ++k) {
    const std::size_t from = k * size / parts, to = (k + 1) * size / parts;
    const Eigen::VectorXd one = leastSquares(waves(track, w, 1, from, to), values(track, from, to));
    re.push_back(one(2));
    im.push_back(one(3));
  }
  const double noise = 2.0 * out.rest * out.rest;  // of one cycle's part, times its samples
  double within = kNormal * std::sqrt(noise / n);
  if (parts >= 2) {
    const auto m = static_cast<double>(parts);
    const double spread = 0.5 * (squares(re) + squares(im)) / (m - 1.0), expected = noise * m / n;
    within = spread < 0.5 * expected
                 ? kNormal * std::sqrt(noise * cycles / n)
                 : std::max(within, student(2 * parts - 1) * std::sqrt(spread / m));
  }
  out.within = within;
  return out;
}

Response response(const Sinusoid& in, const Sinusoid& out) {
  const double told = std::abs(in.of.front()), did = std::abs(out.of.front());
  Response r;
  r.gain = {did / told, std::hypot(out.within, did / told * in.within) / told};
  r.phase = {std::arg(out.of.front() / in.of.front()),
             std::hypot(out.within / did, in.within / told)};
  return r;
}

Hysteresis hysteresis(const Passes& slow, const Passes& fast, double speed) {
  // Of down + sign * up.
  const auto both = [](const Passes& p, double sign) {
    std::vector<double> values;
    double within = 0.0;
    for (std::size_t i = 0; i < std::min(p.up.size(), p.down.size()); ++i) {
      values.push_back(p.down[i].value + sign * p.up[i].value);
      within = std::max(within, std::hypot(p.down[i].within, p.up[i].within));
    }
    Estimate mean = meanOf(values);
    mean.within = std::max(mean.within, within);
    return mean;
  };
  const Estimate one = both(slow, -1.0), two = both(fast, -1.0), sum = both(slow, 1.0);
  Hysteresis out;
  out.width = {2.0 * one.value - two.value, std::hypot(2.0 * one.within, two.within)};
  out.lag = {(two.value - one.value) / (2.0 * speed),
             std::hypot(one.within, two.within) / (2.0 * speed)};
  out.offset = {0.5 * sum.value, 0.5 * sum.within};
  return out;
}

Estimate threshold(const std::vector<Track>& repetitions, double size) {
  constexpr int kHalf = 5;                                 // [-] steps either side
  constexpr double kGrid = 0.005, kAbout = kHalf * kGrid;  // [s]
  const double level = (1.0 - std::exp(-1.0)) * size;
  double from = -HUGE_VAL, end = HUGE_VAL;
  for (const Track& one : repetitions) {
    from = std::max(from, one.t.front());
    end = std::min(end, one.t.back());
  }
  // Where the mean, smoothed by a parabola about each time, first comes to the level.
  const auto crosses = [&](std::size_t without) {
    const auto smooth = [&](double at) {
      Eigen::MatrixXd A(2 * kHalf + 1, 3), y = Eigen::MatrixXd::Zero(2 * kHalf + 1, 1);
      for (int k = -kHalf; k <= kHalf; ++k) {
        const double d = k * kGrid;
        A.row(k + kHalf) << 1.0, d / kAbout, d * d / (kAbout * kAbout);
        for (std::size_t i = 0; i < repetitions.size(); ++i)
          if (i != without) y(k + kHalf) += valueAt(repetitions[i], at + d);
      }
      const double count = static_cast<double>(repetitions.size()) - (without < repetitions.size());
      return leastSquares(A, y)(0) / count;
    };
    double last = 0.0;
    for (double t = std::max(0.0, from + kAbout); t <= end - kAbout; t += kGrid) {
      const double now = smooth(t);
      if (now >= level) return t > 0.0 ? t - kGrid * (now - level) / (now - last) : t;
      last = now;
    }
    return static_cast<double>(NAN);
  };
  // Leaving one out at a time (jackknife) tells how far that is known.
  const std::size_t n = repetitions.size();
  std::vector<double> without;
  for (std::size_t i = 0; i < n; ++i) without.push_back(crosses(i));
  return {crosses(n), student(n) * std::sqrt((static_cast<double>(n) - 1.0) /
                                             static_cast<double>(n) * squares(without))};
}

Estimate scatter(const Track& track) {
  constexpr std::size_t kParts = 10;
  const std::size_t size = track.y.size();
  const double about = mean(track.y);
  std::vector<double> variances;
  for (std::size_t k = 0; k < kParts; ++k) {
    double sum = 0.0;
    const std::size_t from = k * size / kParts, to = (k + 1) * size / kParts;
    for (std::size_t i = from; i < to; ++i) sum += (track.y[i] - about) * (track.y[i] - about);
    variances.push_back(sum / static_cast<double>(to - from));
  }
  const Estimate variance = meanOf(variances);
  const double deviation = std::sqrt(variance.value);
  return {deviation, deviation > 0.0 ? 0.5 * variance.within / deviation : 0.0};
}

Estimate crossing(const std::vector<double>& frequencies, const std::vector<Estimate>& values,
                  double level) {
  for (std::size_t i = 1; i < values.size(); ++i) {
    const Estimate &a = values[i - 1], &b = values[i];
    if (!(a.value > level && b.value <= level)) continue;
    const double fall = a.value - b.value, share = (a.value - level) / fall, f = frequencies[i - 1],
                 step = frequencies[i] - f, straight = f + share * step;
    // By how much a parabola through a third one is off the straight line there.
    const std::size_t third = i >= 2 ? i - 2 : i + 1;
    double bend = 0.0;
    if (third < values.size()) {
      const double g = frequencies[third],
                   curvature = ((values[third].value - a.value) / (g - f) + fall / step) /
                               (g - frequencies[i]);
      bend = curvature * (straight - f) * (straight - frequencies[i]) * step / fall;
    }
    const double measured = std::hypot((1.0 - share) * a.within, share * b.within) * step / fall;
    return {straight + bend, std::hypot(measured, third < values.size() ? 0.5 * bend : step)};
  }
  return {NAN, NAN};
}

Estimate turnAround(const Track& track, const Sinusoid& whole, const std::complex<double>& speed,
                    double frequency) {
  constexpr int kBins = 40;       // [-] of a cycle
  constexpr double kAbout = 0.1;  // [-] of a cycle
  const double w = 2.0 * M_PI * frequency;
  const double offset = mean(track.y);
  std::vector<std::vector<double>> bins(kBins);
  for (std::size_t i = 0; i < track.t.size(); ++i) {
    // From where the speed is 0, in half cycles.
    const double angle = w * track.t[i] + std::arg(speed) - M_PI_2,
                 half = angle / M_PI - std::round(angle / M_PI);
    if (std::abs(0.5 * half) > kAbout) continue;
    const double turns = angle / (2.0 * M_PI), cycle = turns - std::floor(turns);
    const std::complex<double> wave = std::polar(1.0, w * track.t[i]);
    bins[static_cast<std::size_t>(cycle * kBins) % kBins].push_back(
        track.y[i] - offset - (whole.of.front() * wave).real());
  }
  Estimate out;
  for (const std::vector<double>& bin : bins) {
    if (bin.size() < 2) continue;
    const Estimate one = meanOf(bin);
    if (std::abs(one.value) > out.value) out = {std::abs(one.value), one.within};
  }
  return out;
}

}  // namespace ves
