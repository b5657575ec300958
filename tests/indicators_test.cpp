// SPDX-License-Identifier: BSD-3-Clause
//
// The indicators of hybrid testing on motions whose lag and amplitude are known.
#include <gtest/gtest.h>

#include <cmath>

#include "ves/evaluation/indicators.hpp"

namespace ves {
namespace {

constexpr double kPeriod = 0.01;

/// Sines of these frequencies [Hz] over 20 s; y is late by tau [s], `times` as large, and
/// elsewhere.
TrackedMotion sines(const std::vector<double>& frequencies, double tau, double times) {
  TrackedMotion out;
  for (int k = 0; k < 2000; ++k) {
    double u = 0.2, y = -0.1;
    for (const double f : frequencies) {
      u += std::sin(2.0 * M_PI * f * k * kPeriod) / f;
      y += times * std::sin(2.0 * M_PI * f * (k * kPeriod - tau)) / f;
    }
    out.u.push_back(u);
    out.y.push_back(y);
  }
  return out;
}

TEST(TrackingIndicators, KnowALateSine) {
  for (const double tau : {-0.03, 0.0, 0.013, 0.072})
    for (const double times : {0.9, 1.0, 1.2}) {
      const double f = 0.5, phase = 2.0 * M_PI * f * tau;
      const TrackedMotion m = sines({f}, tau, times);
      const TrackingIndicators t = trackingIndicators({m}, kPeriod);
      EXPECT_NEAR(t.paei_amplitude, times, 1e-6);
      EXPECT_NEAR(t.paei_phase, phase, 1e-6);
      EXPECT_NEAR(t.fdb_amplitude, times, 1e-6);
      EXPECT_NEAR(t.fdb_phase, phase, 1e-6);
      EXPECT_NEAR(t.fdb_frequency, f, 1e-6);
      EXPECT_NEAR(t.fdb_delay, tau, 1e-6);
      EXPECT_NEAR(t.delay, tau, 2e-4);
      // |times e^(-j phase) - 1|
      EXPECT_NEAR(t.rms, std::hypot(times * std::cos(phase) - 1.0, times * std::sin(phase)), 1e-6);
    }
}

// Of two sines a delay is a delay; phases are weighed by power.
TEST(TrackingIndicators, KnowADelayOfManyFrequencies) {
  const TrackedMotion m = sines({0.25, 1.0}, 0.05, 1.0);
  const TrackingIndicators t = trackingIndicators({m}, kPeriod);
  EXPECT_NEAR(t.delay, 0.05, 2e-5);
  const double share = 1.0 / 16.0, weigh = 1.0 + share;  // powers 16 and 1
  EXPECT_NEAR(t.fdb_frequency, (0.25 + share) / weigh, 1e-6);
  EXPECT_NEAR(t.fdb_phase, 2.0 * M_PI * 0.05 * t.fdb_frequency, 0.005);
  EXPECT_LT(t.fdb_amplitude, 1.0);  // phases that differ cancel a little
  EXPECT_GT(t.fdb_amplitude, 0.99);
}

TEST(TrackingIndicators, SayNothingOfWhatStandsOrIsShort) {
  const TrackingIndicators still =
      trackingIndicators({{std::vector<double>(500, 0.1), std::vector<double>(500, 0.2)}}, kPeriod);
  EXPECT_EQ(still.points, 0u);
  EXPECT_EQ(still.delay, 0.0);
  EXPECT_EQ(still.paei_amplitude, 1.0);
  const TrackedMotion m = sines({0.5}, 0.1, 1.0);
  const TrackedMotion few = {{m.u.begin(), m.u.begin() + 20}, {m.y.begin(), m.y.begin() + 20}};
  EXPECT_EQ(trackingIndicators({few}, kPeriod).points, 0u);
  EXPECT_EQ(trackingIndicators({few}, kPeriod).delay, 0.0);
  EXPECT_EQ(trackingIndicators({}, kPeriod).delay, 0.0);
}

// Two motions about places that are far apart, and a scrap: each is late by as much, and the jump
// between them is no motion.
TEST(TrackingIndicators, OfSeveralMotionsAreThoseOfEach) {
  const double tau = 0.013, f = 0.5;
  const TrackedMotion one = sines({f}, tau, 1.2);
  TrackedMotion elsewhere = one;
  for (double& u : elsewhere.u) u += 40.0;
  for (double& y : elsewhere.y) y -= 7.0;
  elsewhere.u.resize(1000);
  elsewhere.y.resize(1000);
  const TrackedMotion scrap = {{one.u.begin(), one.u.begin() + 20}, std::vector<double>(20, 3.0)};
  const TrackingIndicators t = trackingIndicators({one, elsewhere, scrap}, kPeriod);
  EXPECT_EQ(t.points, 3000u);
  EXPECT_NEAR(t.paei_amplitude, 1.2, 1e-6);
  EXPECT_NEAR(t.paei_phase, 2.0 * M_PI * f * tau, 1e-6);
  EXPECT_NEAR(t.fdb_amplitude, 1.2, 1e-6);
  EXPECT_NEAR(t.fdb_frequency, f, 1e-6);
  EXPECT_NEAR(t.fdb_delay, tau, 1e-6);
  EXPECT_NEAR(t.delay, tau, 2e-4);
}

// The spectra are taken of a length with small factors, here 1944: no whole number of periods, so
// that its lines lie beside the sine.
TEST(TrackingIndicators, DoNotMindAPrimeNumberOfPoints) {
  TrackedMotion m = sines({0.5}, 0.013, 1.0);
  m.u.resize(1999);
  m.y.resize(1999);
  const TrackingIndicators t = trackingIndicators({m}, kPeriod);
  EXPECT_NEAR(t.fdb_frequency, 0.5, 0.02);
  EXPECT_NEAR(t.fdb_delay, 0.013, 1e-3);
}

}  // namespace
}  // namespace ves
