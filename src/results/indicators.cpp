// SPDX-License-Identifier: BSD-3-Clause
#include "ves/results/indicators.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

namespace ves {
namespace {

void removeMean(std::vector<double>& x) {
  const double mean = std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(x.size());
  for (double& one : x) one -= mean;
}

/// Mean square of y - u moved by `late` points.
double apart(const std::vector<double>& u, const std::vector<double>& y, std::ptrdiff_t late) {
  const auto n = std::ssize(u);
  double sum = 0.0;
  const std::ptrdiff_t from = std::max<std::ptrdiff_t>(0, late),
                       to = std::min(n, n + std::min<std::ptrdiff_t>(0, late));
  for (std::ptrdiff_t i = from; i < to; ++i) {
    const double e = y[static_cast<std::size_t>(i)] - u[static_cast<std::size_t>(i - late)];
    sum += e * e;
  }
  return sum / static_cast<double>(to - from);
}

}  // namespace

TrackingIndicators trackingIndicators(std::vector<double> u, std::vector<double> y, double period) {
  constexpr double kMostDelay = 0.5;       // [s]
  constexpr double kMostFrequency = 10.0;  // [Hz] above which a platform does nothing
  TrackingIndicators out;
  const std::size_t n = std::min(u.size(), y.size());
  u.resize(n);
  y.resize(n);
  const auto most = static_cast<std::ptrdiff_t>(kMostDelay / period);
  if (std::ssize(u) < 4 * most) return out;
  removeMean(u);
  removeMean(y);
  double uu = 0.0, yy = 0.0, uy = 0.0, turn = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    uu += u[i] * u[i];
    yy += y[i] * y[i];
    uy += u[i] * y[i];
    if (i > 0) turn += u[i - 1] * y[i] - u[i] * y[i - 1];
  }
  constexpr double kStill = 1e-12;  // [m], [rad]
  const double still = static_cast<double>(n) * kStill * kStill;
  if (!(uu > still && yy > still)) return out;
  out.rms = std::sqrt(apart(u, y, 0) * static_cast<double>(n) / uu);
  out.paei_amplitude = std::sqrt(yy / uu);
  out.paei_phase = std::copysign(std::acos(std::clamp(uy / std::sqrt(uu * yy), -1.0, 1.0)), turn);

  std::ptrdiff_t best = 0;
  double least = HUGE_VAL;
  for (std::ptrdiff_t late = -most; late <= most; ++late)
    if (const double a = apart(u, y, late); a < least) {
      least = a;
      best = late;
    }
  // Between two points by a parabola.
  const double before = apart(u, y, best - 1), after = apart(u, y, best + 1),
               bend = before - 2.0 * least + after;
  const double between = bend > 0.0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0.0;
  out.delay = (static_cast<double>(best) + between) * period;

  std::complex<double> index = 0.0;
  double weights = 0.0, frequencies = 0.0;
  const double step = 1.0 / (static_cast<double>(n) * period);
  for (double f = step; f <= std::min(kMostFrequency, 0.5 / period); f += step) {
    const std::complex<double> once = std::polar(1.0, -2.0 * M_PI * f * period);
    std::complex<double> z = 1.0, U = 0.0, Y = 0.0;
    for (std::size_t i = 0; i < n; ++i, z *= once) {
      U += u[i] * z;
      Y += y[i] * z;
    }
    const double weight = std::norm(U);
    index += Y * std::conj(U);
    weights += weight;
    frequencies += weight * f;
  }
  if (!(weights > 0.0)) return out;
  index /= weights;
  out.fdb_amplitude = std::abs(index);
  out.fdb_phase = -std::arg(index);
  out.fdb_frequency = frequencies / weights;
  out.fdb_delay = out.fdb_phase / (2.0 * M_PI * out.fdb_frequency);
  return out;
}

}  // namespace ves
