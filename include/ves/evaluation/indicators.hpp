// SPDX-License-Identifier: BSD-3-Clause
//
// How well a motion was tracked, in the indicators that hybrid testing publishes.
#pragma once

#include <vector>

namespace ves {

/// A motion without a gap, a point every period: what is due, and what came.
struct TrackedMotion {
  std::vector<double> u, y;  // equally many
};

/// Of y beside u, what it should be; without their means.
struct TrackingIndicators {
  std::size_t points = 0;  // [-] of what was compared; 0: too short or nothing moved, all as below
  double delay = 0.0;  // [s] by which u has to be moved to lie closest to y, at most half a second
  double rms = 0.0;    // [-] of y - u, by the rms of u
  // Phase and amplitude error indices (Mirza Hessabi and Mercan 2012, Earthquake Engng. Struct.
  // Dyn. 41(10), 1347): of the ellipse that y over u is, here by its second moments. Phase positive
  // where y is late.
  double paei_amplitude = 1.0, paei_phase = 0.0;  // [-], [rad]
  // The same from the spectra, each frequency weighed by |U|^2 (frequency domain based, FDB; in the
  // form of Guo, Chen, Xu and Sanchez 2014, Smart Mater. Struct. 23, 045042), and the delay that
  // the phase is at the mean frequency.
  double fdb_amplitude = 1.0, fdb_phase = 0.0;  // [-], [rad]
  double fdb_frequency = 0.0, fdb_delay = 0.0;  // [Hz], [s]
};

/// Of several motions together, each without its own mean and moved in time within itself: a jump
/// from the end of one to the start of the next is nobody's motion. Those shorter than four times
/// the longest delay do not count. `period` [s] between points.
TrackingIndicators trackingIndicators(std::vector<TrackedMotion> motions, double period);

}  // namespace ves
