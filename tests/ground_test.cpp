// SPDX-License-Identifier: BSD-3-Clause
//
// A vehicle on a ground that moves by itself, against closed forms.
#include <gtest/gtest.h>

#include <complex>

#include "support/momentum.hpp"
#include "support/programs.hpp"
#include "support/refusal.hpp"
#include "support/rig.hpp"
#include "ves/math/dense.hpp"
#include "ves/srms/interaction.hpp"

namespace ves {
namespace {

using Complex = std::complex<double>;

constexpr double kPeriod = 0.01;  // [s]

/// A cos wt + B sin wt in each coordinate.
GroundMotion wave(double w, const Vec6& cosines, const Vec6& sines, double fade = 0.0) {
  GroundMotion out;
  out.waves.resize(13, 1);
  out.waves << w, cosines, sines;
  out.fade = fade;
  return out;
}

/// Of rows between which it goes.
GroundMotion sampled(const GroundMotion& of, double step, int n) {
  GroundMotion out;
  out.step = step;
  out.rows.resize(18, n);
  for (int i = 0; i < n; ++i) {
    const PathPoint<6> p = of.at(i * step);
    out.rows.col(i) << p.x, p.x_dot, p.x_ddot;
  }
  return out;
}

/// Six oscillators of different frequencies, x'' + 2 zeta w_i x' + w_i^2 x = F.
ModalModel oscillators(double zeta) {
  ModalModel out;
  out.Phi = Mat6::Identity();
  out.stiffness = (2.0 * M_PI * Vec6(0.3, 0.5, 0.8, 1.1, 1.5, 2.0)).cwiseAbs2();
  out.damping = Eigen::MatrixXd((2.0 * zeta * out.stiffness.cwiseSqrt()).asDiagonal());
  return out;
}

/// x of x'' + c (x' - g') + k (x - g) = 0 from rest at x = 0, where g = Re((a - i b) e^(i w t)).
double shaken(double k, double c, double w, double a, double b, double t) {
  const Complex i(0.0, 1.0), g(a, -b), H = (k + i * w * c) / (k - w * w + i * w * c);
  const double decay = 0.5 * c, turn = std::sqrt(k - decay * decay);
  const auto steady = [&](double at) { return (H * g * std::exp(i * w * at)).real(); };
  const double x_0 = -steady(0.0), v_0 = -(i * w * H * g).real();
  return steady(t) + std::exp(-decay * t) * (x_0 * std::cos(turn * t) +
                                             (v_0 + decay * x_0) / turn * std::sin(turn * t));
}

TEST(Ground, RatesAreThoseOfItsMotion) {
  GroundMotion both = wave(3.0, Vec6::LinSpaced(0.1, 0.3), Vec6::LinSpaced(-0.2, 0.1), 2.0);
  GroundMotion more = sampled(wave(1.7, Vec6::LinSpaced(0.3, 0.1), Vec6::Constant(0.2)), 0.01, 500);
  both.rows = more.rows;
  both.step = more.step;
  const auto x = [&](double t) -> Vec6 { return both.at(t).x; };
  const auto x_dot = [&](double t) -> Vec6 { return both.at(t).x_dot; };
  for (const double t : {0.3, 1.1, 1.9, 2.5, 4.4}) {  // while it comes in, and afterwards
    EXPECT_LT((test::derivative(x, t, 1e-2) - both.at(t).x_dot).norm(), 1e-7) << t;
    EXPECT_LT((test::derivative(x_dot, t, 1e-2) - both.at(t).x_ddot).norm(), 1e-5) << t;
  }
  EXPECT_EQ(both.at(-1.0).x, Vec6::Zero());
  EXPECT_DOUBLE_EQ(both.lasts(), 4.99);
  EXPECT_EQ(wave(1.0, Vec6::Ones(), Vec6::Ones()).lasts(), HUGE_VAL);
}

TEST(Ground, RowsAreTheMotionTheyAreOf) {
  const GroundMotion of = wave(2.0 * M_PI * 0.7, Vec6::Constant(0.1), Vec6::Constant(-0.05));
  const GroundMotion rows = sampled(of, 0.01, 1000);
  for (double t = 0.003; t < 9.9; t += 0.071) {
    EXPECT_LT((rows.at(t).x - of.at(t).x).norm(), 1e-11) << t;
    EXPECT_LT((rows.at(t).x_ddot - of.at(t).x_ddot).norm(), 1e-5) << t;
  }
  // Where they end, it stands.
  for (const double t : {9.99, 9.995, 12.0, 1e6}) {
    EXPECT_EQ(rows.at(t).x, Vec6(rows.rows.col(999).head<6>())) << t;
    EXPECT_EQ(rows.at(t).x_dot, Vec6(Vec6::Zero())) << t;
    EXPECT_EQ(rows.at(t).x_ddot, Vec6(Vec6::Zero())) << t;
  }
}

TEST(Ground, FreeSpaceIsTheClosedFormOfAShakenOscillator) {
  const ModalModel modes = oscillators(0.05);
  const double w = 2.0 * M_PI * 0.4;
  Vec6 a, b;
  a << 0.01, -0.02, 0.03, 0.001, 0.002, -0.001;
  b << -0.02, 0.01, 0.01, 0.002, -0.001, 0.001;
  Interaction i;
  i.vehicle = modes;
  i.vehicle.ground = wave(w, a, b);
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.tolerance = 1e-12;
  options.duration = 20'000'000'000;
  for (const InteractionPoint& p : simulate(i, options))
    for (int k = 0; k < 6; ++k)
      ASSERT_NEAR(p.x(k), shaken(modes.stiffness(k), modes.damping(k, k), w, a(k), b(k), p.t), 1e-9)
          << k << " at " << p.t;
}

// What the wrench was felt at, and what goes on unpushed, is the motion itself without
// accelerations.
TEST(Ground, OfItsMotionOnlyAccelerationsAreLeftOut) {
  VehicleModel vehicle = oscillators(0.05);
  vehicle.ground = wave(2.0 * M_PI * 0.4, Vec6::Constant(0.02), Vec6::Constant(-0.01));
  AdmittanceModel model(vehicle, kPeriod);
  model.reset(Vec6::Zero());
  double fastest = 0.0;
  for (int n = 0; n < 100; ++n) {
    model.step(Wrench{{3.0, 2.0, 1.0}, {0.1, 0.2, 0.3}});
    const BodyMotion moves = model.bodyMotion();
    fastest = std::max(fastest, moves.a.norm());
    for (const BodyMotion& one : {model.atWrench(), model.coasting()}) {
      EXPECT_LT((one.X.p - moves.X.p).norm() + (one.X.R - moves.X.R).norm(), 1e-15);
      EXPECT_LT((one.v - moves.v).norm() + (one.w - moves.w).norm(), 1e-15);
      EXPECT_EQ(one.a, Vec3(Vec3::Zero()));
      EXPECT_EQ(one.alpha, Vec3(Vec3::Zero()));
    }
  }
  EXPECT_GT(fastest, 0.01);
}

TEST(Ground, TheModelIsItsClosedFormToTheOrderOfItsStep) {
  const ModalModel modes = oscillators(0.05);
  const double w = 2.0 * M_PI * 0.4;
  const Vec6 a = Vec6::Constant(0.02), b = Vec6::Constant(-0.01);
  const auto error = [&](double period, bool with_body) {
    VehicleModel vehicle = modes;
    vehicle.ground = wave(w, a, b);
    AdmittanceModel model(vehicle, period);
    model.reset(Vec6::Zero());
    double most = 0.0;
    for (int n = 1; n * period <= 10.0; ++n) {
      if (with_body)
        model.step(Wrench{}, CarriedBody(Mat6::Zero()), period, 0.0);
      else
        model.step(Wrench{});
      for (int k = 0; k < 6; ++k)
        most = std::max(
            most, std::abs(model.motion().x(k) - shaken(modes.stiffness(k), modes.damping(k, k), w,
                                                        a(k), b(k), n * period)));
    }
    return most;
  };
  for (const bool with_body : {false, true}) {
    const double whole = error(kPeriod, with_body), half = error(0.5 * kPeriod, with_body);
    EXPECT_LT(whole, 1e-5) << with_body;
    EXPECT_NEAR(whole / half, 4.0, 0.3) << with_body;
  }
}

TEST(Ground, WhatStandsOnTheVehicleIsShakenWithIt) {
  // A mass at the platform's origin, moved along: the same closed form of a heavier oscillator.
  constexpr double kMass = 0.8;  // [kg] on one of 1 kg
  const ModalModel modes = oscillators(0.05);
  const double w = 2.0 * M_PI * 0.4;
  Vec6 a = Vec6::Zero(), b = Vec6::Zero();
  a.head<3>() << 0.02, -0.01, 0.03;
  b.head<3>() << -0.01, 0.02, 0.01;
  Interaction i;
  i.vehicle = modes;
  i.vehicle.ground = wave(w, a, b);
  i.payload.robot.base = {kMass, Vec3::Zero(), 0.1 * Mat3::Identity()};
  InteractionOptions options;
  options.model = InteractionModel::kWhole;
  options.tolerance = 1e-12;
  options.duration = 10'000'000'000;
  AdmittanceModel model(i.vehicle, kPeriod);
  model.reset(Vec6::Zero());
  const Mat6 M_1 = spatialMass(i.payload.robot.base);
  for (const InteractionPoint& p : simulate(i, options)) {
    if (p.t > 0.0) model.step(Wrench{}, M_1, kPeriod, 0.0);
    for (int k = 0; k < 3; ++k) {
      const double should = shaken(modes.stiffness(k) / (1.0 + kMass),
                                   modes.damping(k, k) / (1.0 + kMass), w, a(k), b(k), p.t);
      ASSERT_NEAR(p.x(k), should, 1e-9) << k << " at " << p.t;
      ASSERT_NEAR(model.motion().x(k), should, 1e-5) << k << " at " << p.t;
    }
  }
}

TEST(Ground, ForetellsAndTellsRates) {
  VehicleModel vehicle = oscillators(0.05);
  vehicle.ground = wave(2.0 * M_PI * 0.4, Vec6::Constant(0.02), Vec6::Constant(-0.01), 1.0);
  const Mat6 M_1 = spatialMass({0.5, {0.1, 0.0, 0.3}, Vec3(0.08, 0.08, 0.02).asDiagonal()});
  AdmittanceModel ahead(vehicle, kPeriod), now(vehicle, kPeriod);
  std::vector<PathPoint<6>> of_ahead, of_now;
  for (AdmittanceModel* model : {&ahead, &now}) model->reset(Vec6::Zero());
  for (int n = 0; n < 300; ++n) {
    ahead.step(Wrench{}, M_1, kPeriod, kPeriod);
    now.step(Wrench{}, M_1, kPeriod, 0.0);
    of_ahead.push_back(ahead.motion());
    of_now.push_back(now.motion());
  }
  for (std::size_t n = 0; n + 1 < of_now.size(); ++n)
    EXPECT_LT((of_ahead[n].x - of_now[n + 1].x).norm(), 1e-5) << n;
  const auto x = [&](double t) -> Vec6 {
    return of_now[static_cast<std::size_t>(std::lround(t / kPeriod))].x;
  };
  const auto x_dot = [&](double t) -> Vec6 {
    return of_now[static_cast<std::size_t>(std::lround(t / kPeriod))].x_dot;
  };
  for (const std::size_t n : {40u, 120u, 200u}) {
    const double t = static_cast<double>(n) * kPeriod;
    EXPECT_LT((test::derivative(x, t, kPeriod) - of_now[n].x_dot).norm(), 1e-3);
    EXPECT_LT((test::derivative(x_dot, t, kPeriod) - of_now[n].x_ddot).norm(), 2e-2);
  }
}

TEST(Ground, WithoutModesTheVehicleGoesAsTheGround) {
  ModalModel none;
  none.Phi.resize(6, 0);
  VehicleModel vehicle = none;
  vehicle.ground = wave(1.3, Vec6::LinSpaced(-0.1, 0.2), Vec6::Constant(0.05), 3.0);
  AdmittanceModel model(vehicle, kPeriod);
  model.reset(Vec6::Constant(0.01));
  Interaction i;
  i.vehicle = vehicle;
  i.start.setConstant(0.01);
  InteractionOptions options;
  options.duration = 5'000'000'000;
  const std::vector<InteractionPoint> truth = simulate(i, options);
  const Mat6 M_1 = spatialMass({50.0, {0.1, 0.0, 0.6}, Vec3(8.0, 8.0, 2.0).asDiagonal()});
  for (std::size_t n = 1; n < truth.size(); ++n) {
    model.step(Wrench{{10.0, 20.0, 30.0}, {}}, M_1, kPeriod, 0.0);
    const Vec6 should =
        Vec6::Constant(0.01) + vehicle.ground.at(static_cast<double>(n) * kPeriod).x;
    ASSERT_LT((model.motion().x - should).norm(), 1e-12);
    ASSERT_LT((truth[n].x - should).norm(), 1e-12);
  }
}

TEST(Ground, ItsWorkIsInTheBooks) {
  // Undamped, and shaken: all that is in the motion beside the ground came from it.
  ModalModel modes = oscillators(0.0);
  VehicleModel vehicle = modes;
  vehicle.ground = wave(2.0 * M_PI * 0.45, Vec6::Constant(0.05), Vec6::Constant(0.02), 1.0);
  AdmittanceModel model(vehicle, kPeriod);
  model.reset(Vec6::Zero());
  double given = 0.0, most = 0.0;
  for (int n = 0; n < 1000; ++n) {
    model.step(Wrench{});
    given += model.shaken();
    most = std::max(most, model.energy());
    EXPECT_NEAR(model.energy(), given, 1e-9 + 1e-9 * most) << n;
  }
  EXPECT_GT(most, 0.01);
}

TEST(Ground, AWrenchWorksAlongAllOfTheWay) {
  // Of the ground and of the vehicle on it; a ground alone has no other.
  for (const bool stands : {false, true}) {
    VehicleModel vehicle = oscillators(0.1);
    if (stands) vehicle = ModalModel{Eigen::MatrixXd(6, 0), {}, {}};
    vehicle.ground = wave(2.0 * M_PI * 0.45, (Vec6() << 0.05, 0.03, -0.04, 0, 0, 0).finished(),
                          Vec6::Constant(0.02), 1.0);
    AdmittanceModel model(vehicle, kPeriod);
    model.reset(Vec6::Zero());
    const Wrench F{{20.0, -10.0, 5.0}, Vec3::Zero()};
    double most = 0.0;
    for (int n = 0; n < 300; ++n) {
      const Vec3 from = model.motion().x.head<3>();
      model.step(F);
      const double due = F.f.dot(model.motion().x.head<3>() - from);
      EXPECT_NEAR(model.taken(F), due, 1e-12) << n;
      most = std::max(most, std::abs(due));
    }
    EXPECT_GT(most, 1e-3);
  }
}

// --- From files ----------------------------------------------------------------------------------

TEST(Sea, HasItsHeightAndItsSpectrum) {
  // A ship that heaves as the water does, everywhere.
  const double height = 0.3, peak = 1.0 / 5.0;
  for (const int seed : {1, 2, 3}) {
    const Experiment e = test::experiment(
        "ship_arm",
        {fmt::format("base=!replace {{ground: {{fade_s: 0.5, sea: {{significant_height_m: "
                     "{}, peak_period_s: {}, peakedness: 1, heading_deg: 0, waves: 200, "
                     "seed: {}, responses: [{{heading_deg: 0, rows: [[0.01, 0,0, 0,0, "
                     "1,0, 0,0, 0,0, 0,0], [9, 0,0, 0,0, 1,0, 0,0, 0,0, 0,0]]}}]}}}}}}",
                     height, 1.0 / peak, seed)});
    const GroundMotion& sea = e.controller.vehicle.ground;
    // Over so long that no two of its waves look alike.
    double m0 = 0.0, m2 = 0.0;
    int n = 0;
    for (double t = 1.0; t < 4000.0; t += 0.2, ++n) {
      const PathPoint<6> p = sea.at(t);
      m0 += p.x(2) * p.x(2);
      m2 += p.x_dot(2) * p.x_dot(2);
      ASSERT_EQ(p.x(0), 0.0);
    }
    m0 /= n;
    m2 /= n;
    // Pierson and Moskowitz (ITTC 1978), from half the peak's frequency to four times that.
    double s0 = 0.0, s2 = 0.0;
    const double df = 1e-4;
    for (double f = 0.5 * peak; f < 4.0 * peak; f += df) {
      const double S = 5.0 / 16.0 * height * height * std::pow(peak, 4.0) * std::pow(f, -5.0) *
                       std::exp(-1.25 * std::pow(peak / f, 4.0));
      s0 += S * df;
      s2 += 4.0 * M_PI * M_PI * f * f * S * df;
    }
    EXPECT_NEAR(4.0 * std::sqrt(m0), height, 0.02 * height) << seed;
    EXPECT_NEAR(4.0 * std::sqrt(s0), height, 0.01 * height) << seed;  // what the band leaves out
    EXPECT_NEAR(std::sqrt(m0 / m2), std::sqrt(s0 / s2), 0.02 * std::sqrt(s0 / s2)) << seed;
  }
}

TEST(Sea, AShipAnswersByFrequencyHeadingAndPhase) {
  // Of one wave (all others are next to nothing beside a peak so sharp) by hand.
  const Experiment e = test::experiment(
      "ship_arm",
      {"base=!replace {ground: {fade_s: 0.5, sea: {significant_height_m: 0.2, peak_period_s: 5, "
       "peakedness: 3, heading_deg: 30, waves: 8, seed: 4, responses: ["
       "{heading_deg: 60, rows: [[0.01, 0,0, 0,0, 0,0, 4,90, 0,0, 0,0], [9, 0,0, 0,0, 0,0, 4,90, "
       "0,0, 0,0]]}, "
       "{heading_deg: 0, rows: [[0.01, 0,0, 0,0, 1,0, 0,0, 0,0, 0,0], [9, 0,0, 0,0, 1,0, 0,0, 0,0, "
       "0,0]]}]}}}"});
  const auto& waves = e.controller.vehicle.ground.waves;
  ASSERT_EQ(waves.cols(), 8);
  for (Eigen::Index i = 0; i < 8; ++i) {
    // Half of each: heave follows the water, a cos(wt + p); roll leads it by a quarter turn.
    const Complex z(waves(3, i), -waves(9, i)), roll(waves(4, i), -waves(10, i));
    EXPECT_LT(std::abs(roll - Complex(0.0, 4.0 * kDegree) * z), 1e-12);
    EXPECT_GT(std::abs(z), 0.0);
  }
}

TEST(Sea, AResponseIsByLinesBetweenItsFrequenciesAndThePeakIsNarrowerBelow) {
  // Of 196 waves, from half the peak's frequency to four times that, 28 are below it.
  // Two ships: one heaves as the water does, the other by f itself, told at uneven frequencies.
  const auto waves = [](const std::string& rows) {
    return test::experiment(
               "ship_arm",
               {"base=!replace {ground: {fade_s: 0.5, sea: {significant_height_m: 0.2, "
                "peak_period_s: 5, peakedness: 4, heading_deg: 0, waves: 196, seed: 4, responses: "
                "[{heading_deg: 0, rows: [" +
                rows + "]}]}}}"})
        .controller.vehicle.ground.waves;
  };
  const auto row = [](double f, double heave) {
    return fmt::format("[{}, 0,0, 0,0, {},0, 0,0, 0,0, 0,0]", f, heave);
  };
  const auto water = waves(row(0.01, 1) + "," + row(9, 1)),
             ship = waves(row(0.01, 0.01) + "," + row(0.13, 0.13) + "," + row(0.3, 0.3) + "," +
                          row(9, 9));
  ASSERT_EQ(water.cols(), ship.cols());
  double below = 0.0, all = 0.0;
  for (Eigen::Index i = 0; i < water.cols(); ++i) {
    const double f = water(0, i) / (2.0 * M_PI), a = std::hypot(water(3, i), water(9, i));
    EXPECT_EQ(water(0, i), ship(0, i));
    EXPECT_NEAR(std::hypot(ship(3, i), ship(9, i)), f * a, 1e-12);
    (f < 0.2 ? below : all) += a * a;
  }
  all += below;
  // Hasselmann and others (JONSWAP, 1973): 0.07 below the peak, 0.09 above.
  double s_below = 0.0, s_all = 0.0;
  for (double f = 0.1; f < 0.8; f += 1e-5) {
    const double width = f < 0.2 ? 0.07 : 0.09,
                 S = std::pow(f, -5.0) * std::exp(-1.25 * std::pow(0.2 / f, 4.0)) *
                     std::pow(4.0, std::exp(-0.5 * std::pow((f - 0.2) / (width * 0.2), 2.0)));
    s_all += S;
    if (f < 0.2) s_below += S;
  }
  EXPECT_NEAR(below / all, s_below / s_all, 0.005);  // with the widths exchanged 0.03 more
}

class GroundFile : public test::Programs {
 protected:
  /// One line of refusal of a recording.
  std::string refusal(const std::string& text) {
    std::ofstream(file("motion.csv")) << text;
    std::ofstream(file("deck.yaml")) << "from: " << VES_TEST_CONFIG_DIR
                                     << "/scenarios/deck_puma.yaml\nname: deck\nbase: !replace\n  "
                                        "ground: {fade_s: 1, recording: "
                                        "motion.csv}\n";
    return test::refusal([&] { loadExperiment(file("deck.yaml"), {}); });
  }
};

TEST_F(GroundFile, IsResampledByItsUnits) {
  std::string text = "# by hand\nt_s, beta_rad ,x_m\n";
  const auto x = [](double t) { return 0.04 * std::sin(1.1 * t); };
  for (int k = 0; k <= 400; ++k)
    text += fmt::format("{},{},{}\n", 7.0 + 0.05 * k, -0.5 * x(0.05 * k), x(0.05 * k));
  ASSERT_EQ(refusal(text), "");
  const GroundMotion ground = loadExperiment(file("deck.yaml"), {}).controller.vehicle.ground;
  EXPECT_NEAR(ground.lasts(), 20.0, 0.011);
  for (double t = 2.0; t < 18.0; t += 0.37) {
    EXPECT_NEAR(ground.at(t).x(0), x(t), 1e-6) << t;
    EXPECT_NEAR(ground.at(t).x(4), -0.5 * x(t), 1e-6) << t;
    EXPECT_NEAR(ground.at(t).x_dot(0), 0.044 * std::cos(1.1 * t), 1e-5) << t;
    EXPECT_EQ(ground.at(t).x(2), 0.0);
  }
}

TEST_F(GroundFile, ThatCannotBeIsOneLine) {
  std::string good = "t_s,z_m\n";
  for (int k = 0; k <= 200; ++k) good += fmt::format("{:.1f},0\n", 0.1 * k);
  ASSERT_EQ(refusal(good), "");
  const auto expect = [&](const std::string& text, const std::string& in) {
    const std::string said = refusal(text);
    EXPECT_NE(said.find(in), std::string::npos) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  };
  expect("", "motion.csv:0: 0 rows of motion, want at least 4");
  expect("t_s,heave\n", "motion.csv:1: column 'heave', want t_s and of x_m y_m");
  expect("z_m,t_s\n", "motion.csv:1: the first column is not t_s");
  expect("t_s,z_m,z_m\n", "motion.csv:1: column 'z_m' is there twice");
  expect("t_s,z_m\n0,0\n0.1\n", "motion.csv:3: 1 columns, want 2");
  expect("t_s,z_m\n0,0\n0.1,nan\n", "motion.csv:3: 'nan', want a number");
  expect("t_s,z_m\n0,0\n0.1,0.1m\n", "motion.csv:3: '0.1m', want a number");
  expect("t_s,z_m\n0,0\n0,0\n", "motion.csv:3: the time 0 s is not after");
  expect("t_s,z_m\n0,0\n0.1,0\n5,0\n", "motion.csv:4: a gap of 4.9 s");
  expect("t_s,z_m\n0,0\n0.1,0.9\n", "motion.csv:3: a step of z: 9 m/s");
  expect("t_s,alpha_rad\n0,5\n", "of degrees the column is called alpha_deg");
  expect("t_s,z_m\n0,0\n0.1,0\n0.2,0\n0.3,0\n", "its recording lasts 0.3 s");
  std::string far = "t_s,z_m\n";
  for (int k = 0; k <= 200; ++k) far += fmt::format("{:.1f},{}\n", 0.1 * k, 0.01 * k);
  expect(far, "check would stop the run");
}

TEST(Ground, OfSettingsThatCannotBeIsRefused) {
  const auto refused = [](const std::string& set) {
    return test::refusal([&] { test::experiment("ship_arm", {set}); });
  };
  const auto expect = [&](const std::string& set, const std::string& in) {
    EXPECT_NE(refused(set).find(in), std::string::npos) << refused(set);
  };
  expect("base.ground.sea.heading_deg=45", "45, and the responses are for 90 to 90");
  expect("base.ground.sea.responses=[]", "no heading, want one at least");
  expect(
      "base.ground.sea.responses=[{heading_deg: 90, rows: [[0.2, 0,0,0,0,0,0,0,0,0,0,0,0], [0.1, "
      "0,0,0,0,0,0,0,0,0,0,0,0]]}]",
      "frequency 0.1 Hz in row 2, want them above 0 and rising");
  expect("base.ground.sea.waves=500", "base.ground.sea.waves");
  expect("base=!replace {ground: {fade_s: 1}}", "base.ground.sea: missing, want it or a recording");
  expect("base.ground.sea.significant_height_m=2", "check would stop the run");
  expect(
      "base=!replace {free: {mass_kg: 5, inertia_kg_m2: [1, 1, 1, 0, 0, 0]}, ground: {fade_s: 1}}",
      "base.ground: the vehicle floats");
}

}  // namespace
}  // namespace ves
