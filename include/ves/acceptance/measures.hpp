// SPDX-License-Identifier: BSD-3-Clause
//
// What AGARD-AR-144 measures of a motion system, from records of single tests. Each number comes
// with the half width of its 95 % interval.
#pragma once

#include <complex>
#include <vector>

namespace ves {

/// value +- within, 95 %.
struct Estimate {
  double value = 0.0;
  double within = 0.0;
};

/// Mean and interval of independent values, two or more (Student).
Estimate meanOf(const std::vector<double>& values);

/// Values at times of their own.
struct Track {
  std::vector<double> t;  // [s]
  std::vector<double> y;  // [any]
};

/// [any] At t [s], between its neighbours; the ends go on as they are.
double valueAt(const Track& track, double t);

/// What of a track is a sine of this frequency, on an offset and a drift.
struct Sinusoid {
  std::vector<std::complex<double>> of;  // of e^{jkwt}, k = 1, 2, 3
  double within = 0.0;                   // of each real and imaginary part of the first
  double rest = 0.0;                     // rms of what none of them is
  double peak = 0.0;                     // largest of what the first is not
};
/// Least squares. The interval is the wider of that of the residual and of the scatter from cycle
/// to cycle; where cycles repeat each other, as where counts are rounded, one cycle counts.
Sinusoid sinusoid(const Track& track, double frequency);

/// Output over input at a frequency: a describing function's value.
struct Response {
  Estimate gain;   // [any/any]
  Estimate phase;  // [rad] negative: the output is late
};
Response response(const Sinusoid& in, const Sinusoid& out);

/// Width and lag from triangles at two speeds, the second twice the first: what the output is off
/// its input, coming down less going up, is width + lag * 2 * speed.
struct Hysteresis {
  Estimate width;   // [any]
  Estimate lag;     // [s] mean of both ways
  Estimate offset;  // [any] half way between both
};
/// One pass each: mean of output less input, going up and coming down. `speed` [any/s] of the
/// first. An interval is the wider of that of one pass and of the scatter between passes.
struct Passes {
  std::vector<Estimate> up, down;  // [any]
};
Hysteresis hysteresis(const Passes& slow, const Passes& fast, double speed);

/// [s] after an input's step at t = 0 until its mean response has gone 1 - 1/e of `size`; NaN where
/// it does not. Each track is a repetition, 0 before.
Estimate threshold(const std::vector<Track>& repetitions, double size);

/// [any] Standard deviation about the mean; its interval by the scatter of ten parts.
Estimate scatter(const Track& track);

/// Where a quantity that falls with frequency comes to `level` first, on a parabola through the
/// nearest three; half of what that differs from a straight line is in the interval. NaN where it
/// does not.
Estimate crossing(const std::vector<double>& frequencies, const std::vector<Estimate>& values,
                  double level);

/// [any] Largest of what a track has about its sinusoid's turns in the mean over all cycles: within
/// a tenth of a period of where `speed` is 0.
Estimate turnAround(const Track& track, const Sinusoid& whole, const std::complex<double>& speed,
                    double frequency);

}  // namespace ves
