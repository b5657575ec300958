// SPDX-License-Identifier: BSD-3-Clause
#include "ves/evaluation/indicators.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <unsupported/Eigen/FFT>

namespace ves {
namespace {

void removeMean(std::vector<double>& x) {
  const double mean = std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(x.size());
  for (double& one : x) one -= mean;
}

/// Mean square of y - u moved by `late` points.
double apart(const std::vector<TrackedMotion>& motions, std::ptrdiff_t late) {
  double sum = 0.0, count = 0.0;
  for (const TrackedMotion& m : motions) {
    const auto n = std::ssize(m.u);
    const std::ptrdiff_t from = std::max<std::ptrdiff_t>(0, late),
                         to = std::min(n, n + std::min<std::ptrdiff_t>(0, late));
    for (std::ptrdiff_t i = from; i < to; ++i) {
      const double e = m.y[static_cast<std::size_t>(i)] - m.u[static_cast<std::size_t>(i - late)];
      sum += e * e;
    }
    count += static_cast<double>(to - from);
  }
  return sum / count;
}

/// At most n, with prime factors of which GSL makes fast transforms.
std::size_t fastLength(std::size_t n) {
  const auto fast = [](std::size_t k) {
    for (const std::size_t factor : {2u, 3u, 5u})
      while (k % factor == 0) k /= factor;
    return k == 1;
  };
  while (!fast(n)) --n;
  return n;
}

/// The first `size` points' discrete Fourier transform, the frequencies 0 to half of them.
std::vector<std::complex<double>> spectrum(std::vector<double> x, std::size_t size) {
  x.resize(size);
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  std::vector<std::complex<double>> out;
  fft.fwd(out, x);
  return out;
}

}  // namespace

TrackingIndicators trackingIndicators(std::vector<TrackedMotion> motions, double period) {
  constexpr double kMostDelay = 0.5;       // [s]
  constexpr double kMostFrequency = 10.0;  // [Hz] above which a platform does nothing
  TrackingIndicators out;
  const auto most = static_cast<std::ptrdiff_t>(kMostDelay / period);
  std::erase_if(motions, [&](const TrackedMotion& m) { return std::ssize(m.u) < 4 * most; });
  std::size_t points = 0;
  double uu = 0.0, yy = 0.0, uy = 0.0, turn = 0.0;
  for (TrackedMotion& m : motions) {
    removeMean(m.u);
    removeMean(m.y);
    points += m.u.size();
    for (std::size_t i = 0; i < m.u.size(); ++i) {
      uu += m.u[i] * m.u[i];
      yy += m.y[i] * m.y[i];
      uy += m.u[i] * m.y[i];
      if (i > 0) turn += m.u[i - 1] * m.y[i] - m.u[i] * m.y[i - 1];
    }
  }
  constexpr double kStill = 1e-12;  // [m], [rad]
  const double n = static_cast<double>(points), still = n * kStill * kStill;
  if (!(uu > still && yy > still)) return out;
  out.points = points;
  out.rms = std::sqrt(apart(motions, 0) * n / uu);
  out.paei_amplitude = std::sqrt(yy / uu);
  out.paei_phase = std::copysign(std::acos(std::clamp(uy / std::sqrt(uu * yy), -1.0, 1.0)), turn);

  std::ptrdiff_t best = 0;
  double least = HUGE_VAL;
  for (std::ptrdiff_t late = -most; late <= most; ++late)
    if (const double a = apart(motions, late); a < least) {
      least = a;
      best = late;
    }
  // Between two points by a parabola.
  const double before = apart(motions, best - 1), after = apart(motions, best + 1),
               bend = before - 2.0 * least + after;
  const double between = bend > 0.0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0.0;
  out.delay = (static_cast<double>(best) + between) * period;

  std::complex<double> index = 0.0;
  double weights = 0.0, frequencies = 0.0;
  for (const TrackedMotion& m : motions) {
    const std::size_t size = fastLength(m.u.size());
    const std::vector<std::complex<double>> U = spectrum(m.u, size), Y = spectrum(m.y, size);
    const double step = 1.0 / (static_cast<double>(size) * period);
    for (std::size_t k = 1; k < U.size(); ++k) {
      const double f = static_cast<double>(k) * step;
      if (f > kMostFrequency) break;
      // Energy density: a long motion's lines stand closer together.
      const double weight = step * std::norm(U[k]);
      index += step * Y[k] * std::conj(U[k]);
      weights += weight;
      frequencies += weight * f;
    }
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
