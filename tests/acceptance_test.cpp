// SPDX-License-Identifier: BSD-3-Clause
//
// The acceptance tests of a platform against machines whose play, lag, delay and noise are drawn,
// and the one whose servos are equations.
#include <gtest/gtest.h>

#include <complex>
#include <fstream>
#include <random>

#include "support/programs.hpp"
#include "support/rig.hpp"
#include "support/robots.hpp"
#include "ves/acceptance/acceptance.hpp"
#include "ves/core/coordinates.hpp"
#include "ves/math/dense.hpp"
#include "ves/robot/newton_euler.hpp"

namespace ves {
namespace {

using namespace std::complex_literals;

#ifdef VES_SANITIZE
constexpr int kMachines = 8;
#else
constexpr int kMachines = 50;
#endif

Track sampled(double seconds, double period, const std::function<double(double)>& y) {
  Track out;
  for (int i = 0; i < std::lround(seconds / period); ++i) {
    out.t.push_back(100.0 + i * period);
    out.y.push_back(y(out.t.back()));
  }
  return out;
}

TEST(Measures, FindASineItsHarmonicsAndWhatRemains) {
  constexpr double kDrift = 1e-3;  // a fourth harmonic is a little of a drift too
  const double w = 2.0 * M_PI * 3.0;
  const Track track = sampled(2.0, 0.01, [&](double t) {
    return 0.4 + 0.02 * (t - 100.0) + 1.5 * std::cos(w * t + 0.7) +
           0.2 * std::cos(2 * w * t - 1.0) + 0.1 * std::cos(3 * w * t) + 0.05 * std::cos(4 * w * t);
  });
  const Sinusoid s = sinusoid(track, 3.0);
  EXPECT_NEAR(std::abs(s.of[0] - 1.5 * std::exp(0.7i)), 0.0, kDrift);
  EXPECT_NEAR(std::abs(s.of[1] - 0.2 * std::exp(-1.0i)), 0.0, kDrift);
  EXPECT_NEAR(std::abs(s.of[2] - 0.1), 0.0, kDrift);
  EXPECT_NEAR(s.rest, 0.05 / M_SQRT2, kDrift);
  EXPECT_NEAR(s.peak, 0.35, 0.03);
}

TEST(Measures, IntervalsOfASineHoldItAsOftenAsTheySay) {
  std::mt19937 engine(1);
  std::normal_distribution<double> noise(0.0, 0.1);
  constexpr int kDraws = 400;
  int gains = 0, phases = 0;
  for (int k = 0; k < kDraws; ++k) {
    const double f = 0.5 + 0.02 * k, w = 2.0 * M_PI * f;
    const double span = std::ceil(4.0 * f) / f;
    const Sinusoid in = sinusoid(sampled(span, 0.01, [&](double t) { return std::cos(w * t); }), f),
                   out = sinusoid(sampled(span, 0.01,
                                          [&](double t) {
                                            return 0.8 * std::cos(w * t - 0.5) + noise(engine);
                                          }),
                                  f);
    const Response r = response(in, out);
    if (std::abs(r.gain.value - 0.8) <= r.gain.within) ++gains;
    if (std::abs(r.phase.value + 0.5) <= r.phase.within) ++phases;
  }
  EXPECT_GE(gains, kDraws * 0.93);
  EXPECT_GE(phases, kDraws * 0.93);
  // Noise that remembers: neighbours tell the same, cycles do not.
  gains = 0;
  for (int k = 0; k < kDraws; ++k) {
    double wanders = 0.0;
    const Sinusoid out = sinusoid(sampled(10.0, 0.01,
                                          [&](double t) {
                                            wanders = 0.98 * wanders + noise(engine);
                                            return std::cos(2.0 * M_PI * t) + wanders;
                                          }),
                                  1.0);
    if (std::abs(out.of[0].real() - 1.0) <= out.within) ++gains;
  }
  EXPECT_GE(gains, kDraws * 0.9);
}

TEST(Measures, TakeTheLagOfASteadySpeedOutOfTheWidth) {
  // Down: late by lag * speed above; up: below; apart by `width`.
  const double width = 3e-4, lag = 0.06, offset = 1e-4, speed = 1e-3;
  const auto passes = [&](double v) {
    Passes p;
    for (int k = 0; k < 3; ++k) {
      p.up.push_back({offset - 0.5 * width - lag * v, 1e-6});
      p.down.push_back({offset + 0.5 * width + lag * v, 1e-6});
    }
    return p;
  };
  const Hysteresis h = hysteresis(passes(speed), passes(2.0 * speed), speed);
  EXPECT_NEAR(h.width.value, width, 1e-12);
  EXPECT_NEAR(h.lag.value, lag, 1e-9);
  EXPECT_NEAR(h.offset.value, offset, 1e-12);
  EXPECT_NEAR(h.width.within, std::hypot(2.0, 1.0) * M_SQRT2 * 1e-6, 1e-9);
}

TEST(Measures, WhatIsNotReachedIsNotANumber) {
  const Track never = sampled(0.4, 0.01, [](double) { return 0.0; });
  EXPECT_TRUE(std::isnan(threshold({never, never, never}, 1.0).value));
  EXPECT_TRUE(std::isnan(crossing({1, 2, 3}, {{-0.1, 0}, {-0.2, 0}, {-0.3, 0}}, -1.0).value));
  EXPECT_TRUE(std::isnan(crossing({}, {}, -1.0).value));
}

TEST(Measures, ACrossingIsWhereTheCurveComesToTheLevelFirst) {
  const auto fell = [](double f) { return -0.2 - 0.3 * f - 0.004 * f * f; };
  std::vector<double> f;
  std::vector<Estimate> values;
  for (double at : {1.0, 2.0, 3.0, 4.0, 5.0}) {
    f.push_back(at);
    values.push_back({fell(at), 0.01});
  }
  const double truth = (-0.3 + std::sqrt(0.09 + 4.0 * 0.004 * 0.9)) / 0.008;  // fell(truth) = -1.1
  const Estimate found = crossing(f, values, -1.1);
  EXPECT_NEAR(found.value, truth, 1e-3);
  EXPECT_GT(found.within, 0.01 / 0.33 / 2.0);  // of a value over the slope
  EXPECT_LT(found.within, 0.05);
  // Below the level from the beginning, it comes to it nowhere.
  EXPECT_TRUE(std::isnan(crossing(f, values, -0.1).value));
  EXPECT_NEAR(crossing({1, 2, 3, 4}, {{-1, 0}, {-3, 0}, {-1, 0}, {-3, 0}}, -2.0).value, 1.5, 0.5);
}

TEST(Measures, CyclesThatRepeatEachOtherTellNoMoreThanOne) {
  const auto within = [](double cycles) {
    return sinusoid(sampled(cycles, 0.01,
                            [](double t) {
                              const double w = 2.0 * M_PI * t;
                              return std::cos(w) + 0.1 * std::cos(7.0 * w);
                            }),
                    1.0)
        .within;
  };
  // 1.96 times the rest's deviation on one cycle's hundred samples, of a sine's amplitude.
  EXPECT_NEAR(within(5), 1.96 * 0.1 * std::sqrt(1.0 / 100.0), 0.1 * within(5));
  EXPECT_NEAR(within(40), within(5), 0.1 * within(5));
}

TEST(Measures, ATurnAroundIsWhatStandsOutWhereTheSpeedIsNone) {
  constexpr double kWide = 0.08;  // [-] of a cycle
  const double f = 0.5, w = 2.0 * M_PI * f;
  // About one turn in two as large as about the other, or larger; the largest counts.
  for (const auto& [at_top, below] : {std::pair{0.3, 0.0}, {0.3, 0.2}, {0.2, 0.3}, {-0.3, 0.2}}) {
    const Track track = sampled(20.0, 0.005, [&, top = at_top, bottom = below](double t) {
      const double turns = f * t - std::round(f * t);
      return 1.5 * std::cos(w * t) + (std::abs(turns) < 0.5 * kWide         ? top
                                      : std::abs(turns) > 0.5 - 0.5 * kWide ? bottom
                                                                            : 0.0);
    });
    Sinusoid whole;
    whole.of = {1.5};
    const Estimate e = turnAround(track, whole, 1.5i * w, f);  // no speed at the turns of a cosine
    const double mean = kWide * (at_top + below);
    EXPECT_NEAR(e.value, std::max(std::abs(at_top - mean), std::abs(below - mean)), 0.01);
  }
}

/// A machine that nobody of us has built: delay, play, a lag of the first order, noise.
struct Drawn {
  double play, lag, delay;        // [m | rad], [s], [s]
  double read_noise, felt_noise;  // [m | rad], [m/s^2 | rad/s^2]
};

/// Between ticks as smooth as what was told: a cubic, its slopes central differences.
double smoothAt(const Track& track, double t) {
  const double period = 0.01;
  const auto at = [&](double k) { return valueAt(track, track.t.front() + k * period); };
  const double k = std::floor((t - track.t.front()) / period + 1e-9),
               s = (t - track.t.front()) / period - k;
  const double a = at(k), b = at(k + 1), m = 0.5 * (b - at(k - 1)), n = 0.5 * (at(k + 2) - a);
  return a + s * (m + s * (3 * (b - a) - 2 * m - n + s * (2 * (a - b) + m + n)));
}

/// The run as this machine would have answered it.
Series answered(Series series, int i, const Drawn& machine, std::mt19937& engine) {
  constexpr double kStep = 5e-4;  // [s]
  constexpr double kBias = 0.02;  // [m/s^2 | rad/s^2] that the weight is off
  const ControllerConfig& c = series.experiment.controller;
  const RigidBody load_P =
      combine(RigidBody{}, c.payload.X_PL0(),
              compositeBody(carried(c.payload), series.experiment.plant.task.initial_joints));
  Track told;
  for (const Row& row : series.rows) {
    told.t.push_back(static_cast<double>(row.state.machine_time_ns) * 1e-9);
    told.y.push_back(row.state.x_desired[i]);
  }
  Track y, a;
  // What has play stands at the middle of each step, the lag is exact over it.
  double before = told.y.front(), at = before;
  const double decays = std::exp(-kStep / machine.lag);
  for (double t = told.t.front(); t < told.t.back(); t += kStep) {
    const double u = smoothAt(told, t + 0.5 * kStep - machine.delay),
                 held = std::clamp(before, u - 0.5 * machine.play, u + 0.5 * machine.play),
                 v = (0.5 * (held + before) - at) / machine.lag;
    y.t.push_back(t);
    y.y.push_back(at);
    a.t.push_back(t);
    a.y.push_back(((held - before) / kStep - v) / machine.lag);
    before = held;
    at = held + (at - held) * decays;
  }
  std::normal_distribution<double> noise;
  const double late = M_SQRT2 / c.servo.sensor_cutoff + 0.5 * c.servo.sensor_window;
  for (Row& row : series.rows) {
    if (!row.has_sample) continue;
    const double read_at = static_cast<double>(row.sample.legs_time_ns) * 1e-9,
                 felt_at = static_cast<double>(row.sample.wrench_time_ns) * 1e-9 - late;
    Vec6 x = Vec6::Zero(), felt = Vec6::Zero();
    x(i) = valueAt(y, read_at) + machine.read_noise * noise(engine);
    felt(i) = kBias + valueAt(a, felt_at) + machine.felt_noise * noise(engine);
    Vec6::Map(row.state.x_measured) = x;
    const Transform X = c.geometry.fromHome({x.head<3>(), x.tail<3>()});
    Vec6::Map(row.state.leg_measured) = legLengths(c.geometry, X);
    Vec6::Map(row.state.total) =
        Vec6::Map(row.state.static_wrench) - spatialMass(rotated(X.R, load_P)) * felt;
  }
  return series;
}

const Measurement* find(const CoordinateResult& found, Quantity quantity) {
  const std::string_view of = coordinate(found.coordinate).name;
  for (const Measurement& m : found.all)
    if (m.quantity == quantity && m.of == of) return &m;
  return nullptr;
}

TEST(Acceptance, RecoversWhatMachinesWereDrawnWith) {
  AcceptanceOptions options;
  options.frequencies = {3, 4, 5, 7, 9};
  options.amplitudes = {1.0};
  const Experiment scenario = test::experiment("puma_on_table_4_1");
  std::mt19937 engine(7);
  const auto between = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(engine);
  };
  struct Score {
    int held = 0, of = 0;
    std::vector<double> widths = {};  // [-] interval over what it is to find
    void add(const Measurement* m, double truth) {
      ++of;
      ASSERT_TRUE(m);
      if (std::abs(m->estimate.value - truth) <= m->estimate.within) ++held;
      widths.push_back(m->estimate.within / truth);
    }
  } play, lag, corner, threshold_, read, felt;
  for (const int i : {2, 4}) {
    const AcceptanceTest test = acceptanceTest(scenario, i, options);
    const Series run = recordLockstep(test.experiment).series;
    const double per_way = i < 3 ? 1.0 : 1.0 / test.radius;
    for (int k = 0; k < kMachines / 2; ++k) {
      Drawn m;
      m.play = k % 2 ? between(1e-4, 1e-3) * per_way : 0.0;
      m.lag = between(0.03, 0.09);
      m.delay = between(0.002, 0.02);
      m.read_noise = between(1e-5, 1e-4) * per_way;
      m.felt_noise = between(0.005, 0.03) * per_way;
      const CoordinateResult found = measurementsOf(answered(run, i, m, engine), test);
      read.add(find(found, Quantity::kRestPosition), m.read_noise);
      felt.add(find(found, Quantity::kRestAcceleration), m.felt_noise);
      lag.add(find(found, Quantity::kLag), m.lag + m.delay);
      if (m.play > 0.0) {
        play.add(find(found, Quantity::kHysteresis), m.play);
        continue;
      }
      // Without play: 1 - 1/e after delay and lag; -90 deg where w delay + atan(w lag) is that.
      threshold_.add(find(found, Quantity::kThreshold), m.delay + m.lag);
      double low = 0.1, high = 400.0;
      for (int n = 0; n < 60; ++n) {
        const double w = 0.5 * (low + high);
        (w * m.delay + std::atan(w * m.lag) < M_PI_2 ? low : high) = w;
      }
      const double truth = low / (2.0 * M_PI);
      if (truth > options.frequencies.front() && truth < options.frequencies.back())
        corner.add(find(found, Quantity::kCorner), truth);
    }
  }
  const auto holds = [](Score s, double width, const char* name) {
    ASSERT_GT(s.of, 1) << name;
    EXPECT_GE(s.held, std::min(0.88 * s.of, s.of - 1.0)) << name << " of " << s.of;
    std::nth_element(s.widths.begin(), s.widths.begin() + s.of / 2, s.widths.end());
    EXPECT_LT(s.widths[static_cast<std::size_t>(s.of / 2)], width) << name;
  };
  // A leg goes slower than z, and is as late.
  const AcceptanceTest test = acceptanceTest(scenario, 2, options);
  const Drawn late = {0.0, 0.06, 0.01, 1e-5, 0.01};
  const CoordinateResult of_legs =
      measurementsOf(answered(recordLockstep(test.experiment).series, 2, late, engine), test);
  for (const Measurement& m : of_legs.all)
    if (m.quantity == Quantity::kLag) {
      EXPECT_NEAR(m.estimate.value, 0.07, 0.002) << m.of;
    }
  holds(read, 0.15, "noise of the readings");
  holds(felt, 0.15, "noise of the acceleration");
  holds(lag, 0.1, "lag");
  holds(play, 0.1, "play");
  holds(threshold_, 0.2, "threshold");
  holds(corner, 0.03, "corner");
}

TEST(Acceptance, FeelsTheLoadInThePoseThatTheMachineTells) {
  // The robot stands elsewhere than the scenario says; what is felt then follows what is done.
  const std::vector<std::string> sets = {"sensor.noise=false", "gravity_m_per_s2=0"};
  AcceptanceOptions options;
  options.frequencies = {1};
  options.amplitudes = {1.0};
  options.passes = options.steps = false;
  const AcceptanceTest test =
      acceptanceTest(test::experiment("puma_on_table_4_1", sets), 4, options);
  Experiment elsewhere = test.experiment;
  elsewhere.plant.task.initial_joints(1) += 1.2;
  Series run = recordLockstep(elsewhere).series;
  const auto bump = [&](const Series& series) {
    return find(measurementsOf(series, test), Quantity::kTurnAround)->estimate.value;
  };
  const double as_it_stands = bump(run);
  run.experiment.plant.task.initial_joints = test.experiment.plant.task.initial_joints;
  EXPECT_EQ(bump(run), as_it_stands);  // what the simulation begins with is nobody's to know
}

TEST(Acceptance, FindsTheServoThatItsEquationsSay) {
  // (2.17) behind a LegSlave, alike both ways: K e^-sD / (s (1 + tau s) + K e^-s(D-A)), and half a
  // period of the held command in D.
  const Experiment scenario = test::experiment(
      "puma_on_table_4_1",
      {"legs.gain_extend_in_per_s_per_ma=1", "legs.gain_retract_in_per_s_per_ma=1"});
  AcceptanceOptions options;
  options.frequencies = {0.5, 1, 2, 3, 5, 7};
  options.amplitudes = {1.0};
  options.passes = options.steps = false;
  const AcceptanceTest test = acceptanceTest(scenario, 2, options);
  const CoordinateResult found = measurementsOf(recordLockstep(test.experiment).series, test);
  const double K = 0.0254 * (10.0 / 32768.0) * 4.0 * 8500.0 / 256.0 * 363.6 / 0.0254,  // [1/s]
      tau = 0.0064, update = 0.001023, read = 0.000341, period = 0.01;
  const double feedback = 0.5 * update + 0.5 * read,
               command = 0.5 * period + 0.5 * update + 0.5 * update;
  int looked = 0;
  for (const Measurement& m : found.all) {
    if (m.of != "z" || m.quantity != Quantity::kGain) continue;
    const std::complex<double> s(0.0, 2.0 * M_PI * m.frequency);
    const std::complex<double> H =
        K * std::exp(-s * command) / (s * (1.0 + tau * s) + K * std::exp(-s * feedback));
    EXPECT_NEAR(m.estimate.value, std::abs(H), 0.01 + m.estimate.within) << m.frequency;
    for (const Measurement& phase : found.all)
      if (phase.quantity == Quantity::kPhase && phase.frequency == m.frequency) {
        EXPECT_NEAR(phase.estimate.value, std::arg(H), 0.03 + phase.estimate.within) << m.frequency;
      }
    ++looked;
  }
  EXPECT_EQ(looked, 6);
}

TEST(Acceptance, StaysWithinTheShareOfTheMachineThatItWasGiven) {
  const Experiment scenario = test::experiment("puma_on_table_4_1");
  for (int i = 0; i < 6; ++i) {
    const AcceptanceTest test = acceptanceTest(scenario, i, {});
    const double way = std::min(test.down.distance, test.up.distance);
    for (const AcceptanceTest::Sine& s : test.sines) {
      const double w = 2.0 * M_PI * s.frequency;
      EXPECT_LE(s.amplitude, 0.5 * way * (1 + 1e-9));
      EXPECT_LE(s.amplitude * w, 0.5 * test.fastest * (1 + 1e-9));
      EXPECT_LE(s.amplitude * w * w, 0.5 * test.hardest * (1 + 1e-9));
    }
    EXPECT_TRUE(recordLockstep(test.experiment).result.good()) << i;
    if (i == 2) i = 4;  // half of them are enough to run
  }
}

TEST(Acceptance, SaysWhatARunThatWasCutOffDoesNotTell) {
  AcceptanceOptions options;
  options.frequencies = {3, 7};
  options.amplitudes = {1.0};
  const AcceptanceTest test = acceptanceTest(test::experiment("puma_on_table_4_1"), 2, options);
  const Series whole = recordLockstep(test.experiment).series;
  const auto after = [&](double seconds) {
    Series cut = whole;
    std::erase_if(cut.rows, [&](const Row& row) { return row.t > seconds; });
    return measurementsOf(cut, test);
  };
  EXPECT_TRUE(after(0.0).all.empty());
  EXPECT_GE(after(0.0).missing.size(), 4u);
  const CoordinateResult first = after(14.0);  // in the second sine
  EXPECT_TRUE(find(first, Quantity::kGain));
  EXPECT_FALSE(find(first, Quantity::kHysteresis));
  EXPECT_FALSE(find(first, Quantity::kThreshold));
  EXPECT_TRUE(find(after(1e9), Quantity::kThreshold));
  EXPECT_TRUE(after(1e9).missing.empty());
  Series moved = whole;  // the load did not stay what it was
  moved.rows[moved.rows.size() / 2].sample.q[1] += 0.1;
  EXPECT_FALSE(find(measurementsOf(moved, test), Quantity::kThreshold));
  EXPECT_TRUE(find(measurementsOf(moved, test), Quantity::kGain));
  EXPECT_NE(measurementsOf(moved, test).missing.front().find("the robot moved"), std::string::npos);
  Series deaf = whole;  // no sample came
  for (Row& row : deaf.rows) row.has_sample = false;
  EXPECT_TRUE(measurementsOf(deaf, test).all.empty());
  Series stale = whole;  // or the same one again and again
  for (Row& row : stale.rows) row.sample = whole.rows.front().sample;
  EXPECT_TRUE(measurementsOf(stale, test).all.empty());
}

// A lag without play bends no sine: what is felt beside it is noise, and a slow pass is late by the
// lag's way.
TEST(Acceptance, ShowsNoiseBesideASineAndTheLagInALoop) {
  AcceptanceOptions options;
  options.frequencies = {3};
  options.amplitudes = {1.0};
  options.steps = true;
  const AcceptanceTest test = acceptanceTest(test::experiment("puma_on_table_4_1"), 2, options);
  const Drawn m = {0.0, 0.05, 0.01, 1e-6, 0.02};
  std::mt19937 engine(3);
  Series run = answered(recordLockstep(test.experiment).series, 2, m, engine);
  const CoordinateResult found = measurementsOf(run, test);
  const double w = 2.0 * M_PI * 3.0,
               first = test.sines.front().amplitude * w * w / std::hypot(1.0, w * m.lag);
  const auto value = [&](Quantity quantity) {
    const Measurement* one = find(found, quantity);
    return one ? one->estimate.value : NAN;
  };
  EXPECT_NEAR(value(Quantity::kRoughness), M_SQRT2 * m.felt_noise / first,
              0.2 * M_SQRT2 * m.felt_noise / first);
  EXPECT_GT(value(Quantity::kPeak), 2.0 * m.felt_noise / first);
  EXPECT_LT(value(Quantity::kPeak), 6.0 * m.felt_noise / first);
  EXPECT_LT(value(Quantity::kHarmonics), m.felt_noise / first);
  // What was told and what was done, on the way up and down, where neither turns round.
  const auto middle = [&](const Track& loop) {
    double sum = 0.0;
    int n = 0;
    const auto [low, high] = std::minmax_element(loop.t.begin(), loop.t.end());
    for (std::size_t k = 0; k < loop.t.size(); ++k)
      if (std::abs(2.0 * loop.t[k] - *low - *high) < 0.5 * (*high - *low)) {
        sum += loop.y[k];
        ++n;
      }
    EXPECT_GT(n, 100);
    return sum / n;
  };
  const double late = test.slow * (m.lag + m.delay);
  EXPECT_NEAR(middle(found.loop_up), -late, 0.05 * late);
  EXPECT_NEAR(middle(found.loop_down), late, 0.05 * late);
  // Ticks for which no sample came say nothing of the robot.
  for (std::size_t k = 0; k < run.rows.size(); k += 10) {
    run.rows[k].has_sample = false;
    run.rows[k].sample = {};
  }
  const CoordinateResult with_gaps = measurementsOf(run, test);
  EXPECT_EQ(with_gaps.missing, found.missing);
  EXPECT_TRUE(find(with_gaps, Quantity::kThreshold));
}

TEST(Measurements, AreShownAndLimitedInTheUnitsTheyAreCalledBy) {
  constexpr double kTurn = 180.0 / M_PI;
  const auto is = [](Quantity quantity, bool turns, const char* name, double per_si,
                     const char* key, double key_si) {
    const Unit unit = unitOf(quantity, turns);
    EXPECT_STREQ(unit.name, name);
    EXPECT_DOUBLE_EQ(unit.per_si, per_si) << name;
    EXPECT_STREQ(unit.key, key);
    EXPECT_DOUBLE_EQ(unit.key_si, key_si) << key;
  };
  is(Quantity::kGain, false, "", 1.0, "", 1.0);
  is(Quantity::kPhase, false, "deg", kTurn, "_deg", 1.0 / kTurn);
  is(Quantity::kCorner, true, "Hz", 1.0, "_hz", 1.0);
  is(Quantity::kLag, true, "ms", 1000.0, "_s", 1.0);
  is(Quantity::kHysteresis, false, "mm", 1000.0, "_m", 1.0);
  is(Quantity::kHysteresis, true, "deg", kTurn, "_deg", 1.0 / kTurn);
  is(Quantity::kRestAcceleration, false, "m/s^2", 1.0, "_m_per_s2", 1.0);
  is(Quantity::kRestAcceleration, true, "deg/s^2", kTurn, "_deg_per_s2", 1.0 / kTurn);
}

TEST(Acceptance, VerdictsFollowTheWholeInterval) {
  CoordinateResult z;
  z.coordinate = 2;
  const auto put = [&](double f, double value, double within) {
    Measurement m;
    m.of = "z";
    m.quantity = Quantity::kGain;
    m.frequency = f;
    m.estimate = {value, within};
    z.all.push_back(m);
  };
  put(1.0, 0.95, 0.01);
  put(2.0, 0.80, 0.05);
  const auto is = [&](double least, double up_to, std::vector<std::string> of = {}) {
    AcceptanceLimit limit;
    limit.quantity = Quantity::kGain;
    limit.least = least;
    limit.up_to = up_to;
    limit.of = std::move(of);
    return judge({limit}, {z}).front().is;
  };
  using Is = AcceptanceVerdict::Is;
  EXPECT_EQ(is(0.9, 1.0), Is::kKept);
  EXPECT_EQ(is(0.9, 2.0), Is::kBroken);
  EXPECT_EQ(is(0.78, 2.0), Is::kOpen);
  EXPECT_EQ(is(0.96, 1.0), Is::kOpen);
  EXPECT_EQ(is(0.5, 2.0), Is::kKept);
  EXPECT_EQ(is(0.5, 2.0, {"z", "x"}), Is::kNotMeasured);
  EXPECT_EQ(is(0.9, 2.0, {"z", "x"}), Is::kBroken);
  EXPECT_EQ(is(0.5, 0.5), Is::kNotMeasured);
  AcceptanceLimit above;
  above.quantity = Quantity::kGain;
  above.from = 1.5;
  above.most = 0.9;  // the one below is not meant
  EXPECT_EQ(judge({above}, {z}).front().is, Is::kKept);
  put(1.5, NAN, NAN);
  EXPECT_EQ(is(0.5, 2.0), Is::kOpen);
  z.all.clear();
  EXPECT_EQ(is(0.5, 2.0), Is::kNotMeasured);
}

class Accept : public test::Programs {
 protected:
  std::string limits(const std::string& text) {
    std::ofstream(file("limits.yaml")) << text;
    return " --limits " + file("limits.yaml");
  }
};

TEST_F(Accept, LeavesAPageANumberTableAndAVerdict) {
  const std::string z = app("accept") +
                        "puma_on_table_4_1 --lockstep --coordinates z --tests sines,steps "
                        "--frequencies 1,5,7 --amplitudes 1";
  const test::Output kept =
      test::sh(z + out("a") +
               limits("limits:\n  - {quantity: gain, up_to_hz: 1, least: 0.9, most: 1.1}\n"
                      "  - {quantity: threshold, of: [z], most_s: 0.2}\n"));
  ASSERT_EQ(kept.status, 0) << kept.text;
  EXPECT_NE(kept.text.find("kept"), std::string::npos) << kept.text;
  for (const char* name : {"accept.html", "accept.csv", "z/run.lcmlog"})
    EXPECT_TRUE(std::filesystem::exists(folder_ / "a" / name)) << name;
  std::ifstream csv(file("a/accept.csv"));
  std::string header, line;
  std::getline(csv, header);
  EXPECT_EQ(header, "of,quantity,unit,value,within_95,frequency_hz,amplitude_m_or_rad,note\r");
  int phases = 0;
  while (std::getline(csv, line)) phases += line.starts_with("z,phase,rad,-") ? 1 : 0;
  EXPECT_EQ(phases, 3);

  const test::Output broken =
      test::sh(z + out("b") + limits("limits: [{quantity: gain, least: 0.9}]\n"));
  EXPECT_EQ(broken.status, 1) << broken.text;
  EXPECT_NE(broken.text.find("BROKEN"), std::string::npos) << broken.text;
  EXPECT_NE(test::readText(file("b/accept.html")).find("BROKEN"), std::string::npos);
  EXPECT_EQ(test::sh(z + out("n")).status, 0);  // nothing was asked of it
  EXPECT_EQ(test::readText(file("n/accept.html")).find("What was asked"), std::string::npos);
  const test::Output missing =
      test::sh(z + out("c") + limits("limits: [{quantity: hysteresis, of: [z], most_m: 0.1}]\n"));
  EXPECT_EQ(missing.status, 2) << missing.text;  // before anything moves
  EXPECT_NE(missing.text.find("not measured without passes"), std::string::npos) << missing.text;
}

TEST_F(Accept, RefusesLimitsThatMeanNothing) {
  const std::string z = app("accept") + "puma_on_table_4_1 --lockstep --coordinates z" + out("a");
  const auto refused = [&](const std::string& text, const std::string& says) {
    expectRefusal(z + limits(text), says);
  };
  refused("limits: [{quantity: gian, least: 1}]\n", "limits[0].quantity");
  refused("limits: [{quantity: gain}]\n", "least, most, or both");
  refused("limits: [{quantity: gain, least: 2, most: 1}]\n", "most");
  refused("limits: [{quantity: hysteresis, most_m: 1}]\n", "of");
  refused("limits: [{quantity: hysteresis, of: [x, alpha], most_m: 1}]\n", "of");
  refused("limits: [{quantity: hysteresis, of: [alpha], most_m: 1}]\n", "most_deg");
  refused("limits: [{quantity: gain, of: [w], least: 1}]\n", "of");
  refused("limits: [{quantity: corner_hz, least_hz: 1, up_to_hz: 2}]\n", "up_to_hz");
  refused("limits: [{quantity: gain, least: .nan}]\n", "least");
  refused("limit: []\n", "limits");
  expectRefusal(app("accept") + "z_sine --lockstep --move", "--move");
  // A platform of a fifth the size: what is refused says what is taken.
  const std::string desk = app("accept") + "arm_on_desk --lockstep --quiet --coordinates alpha ";
  const std::string told = sh(desk).text, most = "want a --step of at most ";
  ASSERT_NE(told.find(most), std::string::npos) << told;
  EXPECT_EQ(sh(desk + "--tests steps --step " + told.substr(told.find(most) + most.size(), 5) +
               out("desk"))
                .status,
            0);
  expectRefusal(app("accept") + "z_sine --lockstep --coordinates w", "--coordinates");
  expectRefusal(app("accept") + "z_sine --lockstep --frequencies 2,1", "--frequencies");
  expectRefusal(app("accept") + "z_sine --lockstep --share nan", "--share");
}

}  // namespace
}  // namespace ves
